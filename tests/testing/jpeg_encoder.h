// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <span>
#include <vector>

namespace viewfix {

struct JpegEncoding {
  int quality = 90;
  bool progressive = false;
  bool one_scan_per_coefficient = false;  // grey only: 128 scans
  int restart_rows = 0;                   // rows of blocks between restart marks, 0: none
  std::vector<std::uint8_t> app1 = {};    // contents of an APP1 segment, empty: none
};

// `pixels`: [height, width, components], components 1 grey, 3 RGB, 4 CMYK.
std::vector<std::uint8_t> EncodeJpeg(std::span<const std::uint8_t> pixels, int width, int height,
                                     int components, const JpegEncoding& encoding = {});

// The contents of an EXIF segment: these two tags (0: left out) and nothing else.
std::vector<std::uint8_t> MakeExif(int orientation, int focal_length_35mm, bool big_endian);

// A texture that SURF finds features in: dark and light discs on a slope; another one for
// each seed. [height, width]
std::vector<std::uint8_t> MakeTexture(int width, int height, std::uint32_t seed);

}  // namespace viewfix
