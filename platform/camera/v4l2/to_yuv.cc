// SPDX-License-Identifier: BSD-3-Clause
#include "platform/camera/v4l2/to_yuv.h"

#include <linux/videodev2.h>

#include <algorithm>
#include <array>

namespace viewfix {
namespace {

enum class Layout { kBytes, kRgb, kBayer, kHigh, kCompressed };

// Where a YUV format has its chroma: between the luma of two pixels, or behind all luma in one
// plane of pairs or in two planes.
enum class Chroma { kNone, kBetween, kPairs, kPlanes };

struct Format {
  std::uint32_t fourcc;
  Layout layout;
  int pixel_bytes;  // of the first plane, from one pixel to the next
  int offset;       // of the luma, of red, of the high byte
  int shift;        // kHigh: what 16 bits are shifted by; kRgb: 2 where blue comes first
  Chroma chroma = Chroma::kNone;
  bool cr_first = false;
  bool each_row = true;  // has chroma, else each second one
};

constexpr Format kFormats[] = {
    {V4L2_PIX_FMT_GREY, Layout::kBytes, 1, 0, 0},
    {V4L2_PIX_FMT_YUYV, Layout::kBytes, 2, 0, 0, Chroma::kBetween},
    {V4L2_PIX_FMT_YVYU, Layout::kBytes, 2, 0, 0, Chroma::kBetween, true},
    {V4L2_PIX_FMT_UYVY, Layout::kBytes, 2, 1, 0, Chroma::kBetween},
    {V4L2_PIX_FMT_VYUY, Layout::kBytes, 2, 1, 0, Chroma::kBetween, true},
    {V4L2_PIX_FMT_NV12, Layout::kBytes, 1, 0, 0, Chroma::kPairs, false, false},
    {V4L2_PIX_FMT_NV21, Layout::kBytes, 1, 0, 0, Chroma::kPairs, true, false},
    {V4L2_PIX_FMT_NV16, Layout::kBytes, 1, 0, 0, Chroma::kPairs},
    {V4L2_PIX_FMT_NV12M, Layout::kBytes, 1, 0, 0},
    {V4L2_PIX_FMT_NV21M, Layout::kBytes, 1, 0, 0},
    {V4L2_PIX_FMT_YUV420, Layout::kBytes, 1, 0, 0, Chroma::kPlanes, false, false},
    {V4L2_PIX_FMT_YVU420, Layout::kBytes, 1, 0, 0, Chroma::kPlanes, true, false},
    {V4L2_PIX_FMT_YUV420M, Layout::kBytes, 1, 0, 0},
    {V4L2_PIX_FMT_YVU420M, Layout::kBytes, 1, 0, 0},
    {V4L2_PIX_FMT_YUV422P, Layout::kBytes, 1, 0, 0, Chroma::kPlanes},
    {V4L2_PIX_FMT_RGB24, Layout::kRgb, 3, 0, 0},
    {V4L2_PIX_FMT_BGR24, Layout::kRgb, 3, 0, 2},
    {V4L2_PIX_FMT_SBGGR8, Layout::kBayer, 1, 0, 0},
    {V4L2_PIX_FMT_SGBRG8, Layout::kBayer, 1, 0, 0},
    {V4L2_PIX_FMT_SGRBG8, Layout::kBayer, 1, 0, 0},
    {V4L2_PIX_FMT_SRGGB8, Layout::kBayer, 1, 0, 0},
    {V4L2_PIX_FMT_Y10, Layout::kHigh, 2, 0, 2},
    {V4L2_PIX_FMT_Y12, Layout::kHigh, 2, 0, 4},
    {V4L2_PIX_FMT_Y16, Layout::kHigh, 2, 0, 8},
    {V4L2_PIX_FMT_MJPEG, Layout::kCompressed, 0, 0, 0},
    {V4L2_PIX_FMT_JPEG, Layout::kCompressed, 0, 0, 0},
};

const Format* FindFormat(std::uint32_t fourcc) {
  const auto found = std::find_if(std::begin(kFormats), std::end(kFormats),
                                  [&](const Format& f) { return f.fourcc == fourcc; });
  return found == std::end(kFormats) ? nullptr : found;
}

std::size_t Stride(const Format& format, const RawImage& raw) {
  return std::max(raw.row_bytes, std::size_t(format.pixel_bytes) * raw.width);
}

void GreyOfBytes(const Format& format, const std::uint8_t* row, int width, std::uint8_t* grey) {
  if (format.pixel_bytes == 1) {
    std::copy_n(row, width, grey);
    return;
  }
  row += format.offset;
  for (int x = 0; x < width; ++x) grey[x] = row[2 * x];
}

void GreyOfRgb(const Format& format, const std::uint8_t* row, int width, std::uint8_t* grey) {
  const int red = format.shift, blue = 2 - format.shift;
  for (int x = 0; x < width; ++x, row += 3) {
    grey[x] = static_cast<std::uint8_t>((77 * row[red] + 150 * row[1] + 29 * row[blue]) >> 8);
  }
}

void GreyOfHigh(const Format& format, const std::uint8_t* row, int width, std::uint8_t* grey) {
  for (int x = 0; x < width; ++x) {
    const int value = (row[2 * x] | row[2 * x + 1] << 8) >> format.shift;
    grey[x] = static_cast<std::uint8_t>(std::min(value, 255));
  }
}

// `below`: the next row; the last row and column look back instead.
void GreyOfBayer(const std::uint8_t* row, const std::uint8_t* below, int width,
                 std::uint8_t* grey) {
  for (int x = 0; x < width; ++x) {
    const int beside = x + 1 < width ? x + 1 : std::max(x - 1, 0);
    const int sum = row[x] + row[beside] + below[x] + below[beside];
    grey[x] = static_cast<std::uint8_t>(sum / 4);
  }
}

// 16..235 to 0..255, rounded.
constexpr std::array<std::uint8_t, 256> MakeStretch() {
  std::array<std::uint8_t, 256> table{};
  for (int y = 0; y < 256; ++y) {
    table[y] = static_cast<std::uint8_t>(std::clamp(((y - 16) * 255 + 109) / 219, 0, 255));
  }
  return table;
}

// 16..240 to 0..255 about the neutral 128, rounded.
constexpr std::array<std::uint8_t, 256> MakeChromaStretch() {
  std::array<std::uint8_t, 256> table{};
  for (int c = 0; c < 256; ++c) {
    const int stretched = (c - 128) * 255;
    const int rounded = (stretched + (stretched < 0 ? -112 : 112)) / 224;
    table[c] = static_cast<std::uint8_t>(std::clamp(128 + rounded, 0, 255));
  }
  return table;
}

void Stretch(YuvImage& image) {
  static constexpr std::array<std::uint8_t, 256> kTable = MakeStretch();
  static constexpr std::array<std::uint8_t, 256> kChromaTable = MakeChromaStretch();
  for (std::uint8_t& pixel : image.pixels) pixel = kTable[pixel];
  for (std::uint8_t& pixel : image.cb) pixel = kChromaTable[pixel];
  for (std::uint8_t& pixel : image.cr) pixel = kChromaTable[pixel];
}

// Samples `step` bytes apart.
void CopySamples(const std::uint8_t* from, int step, int count, std::uint8_t* to) {
  for (int i = 0; i < count; ++i) to[i] = from[std::ptrdiff_t{i} * step];
}

// Where row y of a YUV image's chroma begins, counted from the image's first byte.
struct ChromaRow {
  std::size_t first = 0;   // of Cb, or of Cr if it comes first
  std::size_t second = 0;  // of the other
  int step = 1;            // from sample to sample
};

ChromaRow FindChroma(const Format& format, const RawImage& raw, int y) {
  const std::size_t stride = Stride(format, raw), luma = stride * raw.height;
  const std::size_t row = format.each_row ? std::min(2 * y, raw.height - 1) : y;
  switch (format.chroma) {
    case Chroma::kBetween: {
      const std::size_t first = stride * row + 1 - format.offset;
      return {first, first + 2, 4};
    }
    case Chroma::kPairs:
      return {luma + stride * row, luma + stride * row + 1, 2};
    default: {
      const std::size_t rows = format.each_row ? raw.height : (raw.height + 1) / 2;
      const std::size_t begin = luma + stride / 2 * row;
      return {begin, begin + stride / 2 * rows, 1};
    }
  }
}

// Of 4:2:2 each second row. None where the driver keeps it elsewhere, or the width is odd.
void CopyChroma(const Format& format, const RawImage& raw, YuvImage& image) {
  const int width = raw.width / 2, height = image.ChromaHeight();
  const ChromaRow last = FindChroma(format, raw, height - 1);
  const std::size_t end = last.second + std::size_t(width - 1) * last.step + 1;
  if (raw.width % 2 != 0 || raw.bytes.size() < end) return;
  image.ResizeChroma();
  for (int y = 0; y < height; ++y) {
    const ChromaRow row = FindChroma(format, raw, y);
    const std::size_t begin = std::size_t(y) * width;
    const std::uint8_t* const bytes = raw.bytes.data();
    CopySamples(bytes + row.first, row.step, width,
                (format.cr_first ? image.cr : image.cb).data() + begin);
    CopySamples(bytes + row.second, row.step, width,
                (format.cr_first ? image.cb : image.cr).data() + begin);
  }
}

// Of each second pixel of each second row.
void ChromaOfRgb(const Format& format, const RawImage& raw, YuvImage& image) {
  const int red = format.shift, blue = 2 - format.shift;
  image.ResizeChroma();
  for (int y = 0; y < image.ChromaHeight(); ++y) {
    const std::uint8_t* pixel = raw.bytes.data() + Stride(format, raw) * 2 * y;
    const std::size_t begin = std::size_t(y) * image.ChromaWidth();
    for (int x = 0; x < image.ChromaWidth(); ++x, pixel += 6) {
      const int r = pixel[red], g = pixel[1], b = pixel[blue];
      image.cb[begin + x] = static_cast<std::uint8_t>(128 + ((128 * b - 85 * g - 43 * r) >> 8));
      image.cr[begin + x] = static_cast<std::uint8_t>(128 + ((128 * r - 107 * g - 21 * b) >> 8));
    }
  }
}

void GreyRow(const Format& format, const RawImage& raw, int y, std::uint8_t* grey) {
  const std::size_t stride = Stride(format, raw);
  const std::uint8_t* row = raw.bytes.data() + stride * y;
  switch (format.layout) {
    case Layout::kBytes:
      return GreyOfBytes(format, row, raw.width, grey);
    case Layout::kRgb:
      return GreyOfRgb(format, row, raw.width, grey);
    case Layout::kHigh:
      return GreyOfHigh(format, row, raw.width, grey);
    case Layout::kBayer: {
      const std::ptrdiff_t step = y + 1 < raw.height ? 1 : (y > 0 ? -1 : 0);
      return GreyOfBayer(row, row + step * static_cast<std::ptrdiff_t>(stride), raw.width, grey);
    }
    case Layout::kCompressed:
      return;
  }
}

}  // namespace

bool KnowsPixelFormat(std::uint32_t fourcc) { return FindFormat(fourcc) != nullptr; }

std::size_t RowBytes(std::uint32_t fourcc, int width) {
  const Format* format = FindFormat(fourcc);
  return format == nullptr ? 0 : std::size_t(format->pixel_bytes) * width;
}

std::size_t LumaBytes(const RawImage& raw) {
  const Format* format = FindFormat(raw.fourcc);
  if (format == nullptr || format->layout == Layout::kCompressed || raw.height <= 0) return 0;
  return Stride(*format, raw) * (std::size_t(raw.height) - 1) +
         std::size_t(format->pixel_bytes) * raw.width;
}

Status ToYuv(const RawImage& raw, int enough_side, YuvImage& image) {
  const Format* format = FindFormat(raw.fourcc);
  if (format == nullptr) return {StatusCode::kUnsupported, "unknown pixel format"};
  if (format->layout == Layout::kCompressed)
    return DecodeJpegReduced(raw.bytes, enough_side, image);
  const bool fits = raw.width > 0 && raw.height > 0 && raw.width <= kMaxImageSide &&
                    raw.height <= kMaxImageSide &&
                    std::int64_t{raw.width} * raw.height <= kMaxImagePixels;
  if (!fits) return {StatusCode::kUnsupported, "image is too large"};
  if (raw.bytes.size() < LumaBytes(raw)) return {StatusCode::kCorrupt, "frame has too few bytes"};
  image.width = raw.width;
  image.height = raw.height;
  image.pixels.resize(std::size_t(raw.width) * raw.height);
  for (int y = 0; y < raw.height; ++y) {
    GreyRow(*format, raw, y, image.pixels.data() + std::size_t(y) * raw.width);
  }
  image.ClearChroma();
  if (!image.luma_only && format->chroma != Chroma::kNone) CopyChroma(*format, raw, image);
  if (!image.luma_only && format->layout == Layout::kRgb) ChromaOfRgb(*format, raw, image);
  if (raw.limited_range && format->layout == Layout::kBytes) Stretch(image);
  return {};
}

}  // namespace viewfix
