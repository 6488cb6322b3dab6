// SPDX-License-Identifier: BSD-3-Clause
#include "platform/camera/v4l2/to_grey.h"

#include <linux/videodev2.h>

#include <algorithm>
#include <array>

namespace viewfix {
namespace {

enum class Layout { kBytes, kRgb, kBayer, kHigh, kCompressed };

struct Format {
  std::uint32_t fourcc;
  Layout layout;
  int pixel_bytes;  // of the first plane, from one pixel to the next
  int offset;       // of the luma, of red, of the high byte
  int shift;        // kHigh: what 16 bits are shifted by; kRgb: 2 where blue comes first
};

constexpr Format kFormats[] = {
    {V4L2_PIX_FMT_GREY, Layout::kBytes, 1, 0, 0},
    {V4L2_PIX_FMT_YUYV, Layout::kBytes, 2, 0, 0},
    {V4L2_PIX_FMT_YVYU, Layout::kBytes, 2, 0, 0},
    {V4L2_PIX_FMT_UYVY, Layout::kBytes, 2, 1, 0},
    {V4L2_PIX_FMT_VYUY, Layout::kBytes, 2, 1, 0},
    {V4L2_PIX_FMT_NV12, Layout::kBytes, 1, 0, 0},
    {V4L2_PIX_FMT_NV21, Layout::kBytes, 1, 0, 0},
    {V4L2_PIX_FMT_NV16, Layout::kBytes, 1, 0, 0},
    {V4L2_PIX_FMT_NV12M, Layout::kBytes, 1, 0, 0},
    {V4L2_PIX_FMT_NV21M, Layout::kBytes, 1, 0, 0},
    {V4L2_PIX_FMT_YUV420, Layout::kBytes, 1, 0, 0},
    {V4L2_PIX_FMT_YVU420, Layout::kBytes, 1, 0, 0},
    {V4L2_PIX_FMT_YUV420M, Layout::kBytes, 1, 0, 0},
    {V4L2_PIX_FMT_YVU420M, Layout::kBytes, 1, 0, 0},
    {V4L2_PIX_FMT_YUV422P, Layout::kBytes, 1, 0, 0},
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

void Stretch(GreyImage& grey) {
  static constexpr std::array<std::uint8_t, 256> kTable = MakeStretch();
  for (std::uint8_t& pixel : grey.pixels) pixel = kTable[pixel];
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

Status ToGrey(const RawImage& raw, int enough_side, GreyImage& grey) {
  const Format* format = FindFormat(raw.fourcc);
  if (format == nullptr) return {StatusCode::kUnsupported, "unknown pixel format"};
  if (format->layout == Layout::kCompressed) return DecodeJpegReduced(raw.bytes, enough_side, grey);
  const bool fits = raw.width > 0 && raw.height > 0 && raw.width <= kMaxImageSide &&
                    raw.height <= kMaxImageSide &&
                    std::int64_t{raw.width} * raw.height <= kMaxImagePixels;
  if (!fits) return {StatusCode::kUnsupported, "image is too large"};
  if (raw.bytes.size() < LumaBytes(raw)) return {StatusCode::kCorrupt, "frame has too few bytes"};
  grey.width = raw.width;
  grey.height = raw.height;
  grey.pixels.resize(std::size_t(raw.width) * raw.height);
  for (int y = 0; y < raw.height; ++y) {
    GreyRow(*format, raw, y, grey.pixels.data() + std::size_t(y) * raw.width);
  }
  if (raw.limited_range && format->layout == Layout::kBytes) Stretch(grey);
  return {};
}

}  // namespace viewfix
