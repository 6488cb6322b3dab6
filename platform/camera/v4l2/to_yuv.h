// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>

#include "engine/base/status.h"
#include "platform/camera/jpeg_decoder.h"
#include "platform/camera/raw_image.h"

namespace viewfix {

// Whether ToYuv() knows the format.
bool KnowsPixelFormat(std::uint32_t fourcc);

// Bytes of a row without padding; 0: compressed or unknown.
std::size_t RowBytes(std::uint32_t fourcc, int width);

// Bytes that ToYuv() needs of an image; 0: compressed or unknown.
std::size_t LumaBytes(const RawImage& raw);

// Grey pixels of `raw`. YUV: luma as it is, or stretched where it is said to be limited; RGB:
// (77 r + 150 g + 29 b) / 256; Bayer: the mean of each pixel and its three neighbours to the right
// and below, which always are one red, two green and one blue; Y10, Y12, Y16: the upper eight bits.
// MJPEG is decoded at 1/2, 1/4 or 1/8 as long as its longer side stays at least `enough_side`.
// Chroma comes with YUV, as far as it lies behind the luma, with RGB and MJPEG; other formats have
// none, and none does where image.luma_only says so.
// kCorrupt: too few bytes, or a JPEG that does not decode; kUnsupported: another format. Equal
// bytes give equal pixels on every processor. Allocates only where `image` is too small (MJPEG:
// what libjpeg needs).
Status ToYuv(const RawImage& raw, int enough_side, YuvImage& image);

}  // namespace viewfix
