// SPDX-License-Identifier: BSD-3-Clause
#include "tests/testing/jpeg_encoder.h"

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <random>

// clang-format off
#include <jpeglib.h>
// clang-format on

namespace viewfix {
namespace {

std::vector<jpeg_scan_info> ScanPerCoefficient() {
  std::vector<jpeg_scan_info> scans;
  const auto add = [&](int coefficient, int ah, int al) {
    scans.push_back({1, {0, 0, 0, 0}, coefficient, coefficient, ah, al});
  };
  for (int k = 0; k < 64; ++k) add(k, 0, 1);
  for (int k = 0; k < 64; ++k) add(k, 1, 0);
  return scans;
}

J_COLOR_SPACE ColorSpaceOf(int components) {
  return components == 1 ? JCS_GRAYSCALE : components == 3 ? JCS_RGB : JCS_CMYK;
}

// A TIFF block written value by value.
class TiffWriter {
 public:
  explicit TiffWriter(bool big_endian) : big_endian_(big_endian) {}

  void U16(int value) {
    const auto high = static_cast<std::uint8_t>(value >> 8);
    const auto low = static_cast<std::uint8_t>(value);
    bytes.insert(bytes.end(), {big_endian_ ? high : low, big_endian_ ? low : high});
  }
  void U32(int value) {
    U16(big_endian_ ? value >> 16 : value & 0xFFFF);
    U16(big_endian_ ? value & 0xFFFF : value >> 16);
  }
  void ShortEntry(int tag, int value) {
    U16(tag);
    U16(3);
    U32(1);
    U16(value);
    U16(0);
  }

  std::vector<std::uint8_t> bytes;

 private:
  bool big_endian_;
};

}  // namespace

std::vector<std::uint8_t> EncodeJpeg(std::span<const std::uint8_t> pixels, int width, int height,
                                     int components, const JpegEncoding& encoding) {
  jpeg_compress_struct info = {};
  jpeg_error_mgr errors = {};
  info.err = jpeg_std_error(&errors);  // ends the test program on an error
  jpeg_create_compress(&info);
  unsigned char* out = nullptr;
  unsigned long size = 0;
  jpeg_mem_dest(&info, &out, &size);
  info.image_width = static_cast<JDIMENSION>(width);
  info.image_height = static_cast<JDIMENSION>(height);
  info.input_components = components;
  info.in_color_space = ColorSpaceOf(components);
  jpeg_set_defaults(&info);
  jpeg_set_quality(&info, encoding.quality, TRUE);
  if (encoding.progressive) jpeg_simple_progression(&info);
  const std::vector<jpeg_scan_info> scans = ScanPerCoefficient();
  if (encoding.one_scan_per_coefficient) {
    info.scan_info = scans.data();
    info.num_scans = static_cast<int>(scans.size());
  }
  info.restart_in_rows = encoding.restart_rows;
  jpeg_start_compress(&info, TRUE);
  if (!encoding.app1.empty()) {
    jpeg_write_marker(&info, JPEG_APP0 + 1, encoding.app1.data(),
                      static_cast<unsigned>(encoding.app1.size()));
  }
  while (info.next_scanline < info.image_height) {
    const std::size_t row_bytes = std::size_t(width) * components;
    JSAMPROW row = const_cast<JSAMPROW>(pixels.data() + info.next_scanline * row_bytes);
    jpeg_write_scanlines(&info, &row, 1);
  }
  jpeg_finish_compress(&info);
  jpeg_destroy_compress(&info);
  std::vector<std::uint8_t> bytes(out, out + size);
  std::free(out);
  return bytes;
}

std::vector<std::uint8_t> MakeExif(int orientation, int focal_length_35mm, bool big_endian) {
  TiffWriter tiff(big_endian);
  const char order = big_endian ? 'M' : 'I';
  for (const char byte : {'E', 'x', 'i', 'f', '\0', '\0', order, order}) {
    tiff.bytes.push_back(static_cast<std::uint8_t>(byte));
  }
  tiff.U16(42);
  tiff.U32(8);
  const int entries = (orientation > 0 ? 1 : 0) + (focal_length_35mm > 0 ? 1 : 0);
  tiff.U16(entries);
  if (orientation > 0) tiff.ShortEntry(0x0112, orientation);
  if (focal_length_35mm > 0) {
    tiff.U16(0x8769);  // where the EXIF directory stands: right after this one
    tiff.U16(4);
    tiff.U32(1);
    tiff.U32(8 + 2 + 12 * entries + 4);
  }
  tiff.U32(0);
  if (focal_length_35mm > 0) {
    tiff.U16(1);
    tiff.ShortEntry(0xA405, focal_length_35mm);
    tiff.U32(0);
  }
  return tiff.bytes;
}

std::vector<std::uint8_t> MakeTexture(int width, int height, std::uint32_t seed) {
  std::mt19937 random(seed);
  const auto below = [&](int n) { return static_cast<int>(random() % static_cast<unsigned>(n)); };
  std::vector<std::uint8_t> pixels(std::size_t(width) * height);
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      pixels[std::size_t(y) * width + x] =
          static_cast<std::uint8_t>(96 + 32 * x / width + 32 * y / height);
    }
  }
  for (int disc = 0; disc < width * height / 400; ++disc) {
    const int cx = below(width);
    const int cy = below(height);
    const int radius = 2 + below(6);
    const auto grey = static_cast<std::uint8_t>(below(256));
    for (int y = std::max(0, cy - radius); y < std::min(height, cy + radius); ++y) {
      for (int x = std::max(0, cx - radius); x < std::min(width, cx + radius); ++x) {
        const int dx = x - cx;
        const int dy = y - cy;
        if (dx * dx + dy * dy < radius * radius) pixels[std::size_t(y) * width + x] = grey;
      }
    }
  }
  return pixels;
}

}  // namespace viewfix
