// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "engine/base/status.h"
#include "engine/image/image_view.h"

namespace viewfix {

// Owned pixels, rows without padding: grey, and chroma as ChromaView says, of half the size,
// rounded up, or none. Keeps its memory between frames.
struct YuvImage {
  int width = 0;
  int height = 0;
  std::vector<std::uint8_t> pixels;
  std::vector<std::uint8_t> cb = {};
  std::vector<std::uint8_t> cr = {};
  // Asks whoever fills the image to leave chroma out, which most of a JPEG's decoding goes into.
  bool luma_only = false;

  int ChromaWidth() const { return (width + 1) / 2; }
  int ChromaHeight() const { return (height + 1) / 2; }
  void ResizeChroma() {
    cb.resize(std::size_t(ChromaWidth()) * ChromaHeight());
    cr.resize(cb.size());
  }
  void ClearChroma() {
    cb.clear();
    cr.clear();
  }
  ImageView view() const {
    ImageView view = {pixels.data(), width, height, width};
    if (!cb.empty()) {
      view.chroma = {cb.data(), cr.data(), ChromaWidth(), ChromaHeight(), ChromaWidth()};
    }
    return view;
  }
};

// What the EXIF block says of the lens, where it says it.
struct ExifInfo {
  int orientation = 1;                      // EXIF 1..8; already applied to the pixels
  std::optional<double> focal_length_35mm;  // millimetres on a 36 x 24 mm frame
};

// Luma of a JPEG, and chroma if it is YCbCr and wanted (luma_only), with its EXIF orientation
// applied. Laptop and board decode with this one function, so that they see the same pixels. A
// truncated or damaged stream is an error (kCorrupt), never a half-grey picture; sizes above
// kMaxImageSide / kMaxImagePixels are kUnsupported.
Status DecodeJpeg(std::span<const std::uint8_t> bytes, YuvImage& image, ExifInfo* exif = nullptr);

// The same of a camera's frame: no EXIF, and shrunk by libjpeg to 1/2, 1/4 or 1/8 as long as its
// longer side stays at least `enough_side` pixels, which saves most of the decoding.
Status DecodeJpegReduced(std::span<const std::uint8_t> bytes, int enough_side, YuvImage& image);

}  // namespace viewfix
