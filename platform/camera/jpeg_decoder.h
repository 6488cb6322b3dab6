// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "engine/base/status.h"
#include "engine/image/image_view.h"

namespace viewfix {

// Owned grey pixels, rows without padding. Keeps its memory between frames.
struct GreyImage {
  int width = 0;
  int height = 0;
  std::vector<std::uint8_t> pixels;

  ImageView view() const { return {pixels.data(), width, height, width}; }
};

// What the EXIF block says of the lens, where it says it.
struct ExifInfo {
  int orientation = 1;                      // EXIF 1..8; already applied to the pixels
  std::optional<double> focal_length_35mm;  // millimetres on a 36 x 24 mm frame
};

// Luma of a JPEG, with its EXIF orientation applied. Laptop and board decode
// with this one function, so that they see the same pixels. A truncated or
// damaged stream is an error (kCorrupt), never a half-grey picture; sizes above
// kMaxImageSide / kMaxImagePixels are kUnsupported.
Status DecodeJpeg(std::span<const std::uint8_t> bytes, GreyImage& image, ExifInfo* exif = nullptr);

// The same of a camera's frame: no EXIF, and shrunk by libjpeg to 1/2, 1/4 or 1/8 as long as its
// longer side stays at least `enough_side` pixels, which saves most of the decoding.
Status DecodeJpegReduced(std::span<const std::uint8_t> bytes, int enough_side, GreyImage& image);

}  // namespace viewfix
