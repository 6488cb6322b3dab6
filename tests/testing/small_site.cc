// SPDX-License-Identifier: BSD-3-Clause
#include "tests/testing/small_site.h"

#include <vector>

#include "tests/testing/jpeg_encoder.h"

namespace viewfix {
namespace {

constexpr int kWidth = 160;
constexpr int kHeight = 120;

// The part of a wide texture that a camera sees which has moved `shift` pixels.
std::vector<std::uint8_t> Shifted(const std::vector<std::uint8_t>& wide, int wide_width, int shift) {
  std::vector<std::uint8_t> pixels;
  for (int y = 0; y < kHeight; ++y) {
    const auto row = wide.begin() + y * wide_width + shift;
    pixels.insert(pixels.end(), row, row + kWidth);
  }
  return pixels;
}

}  // namespace

std::string WriteSmallSite(const TempFolder& folder, const std::string& name, int per_view) {
  std::string csv = "path,location,view,split\n";
  std::uint32_t seed = 1;
  for (const char* location : {"atrium", "bar", "cellar"}) {
    for (const char* view : {"left", "right"}) {
      const int wide_width = kWidth + 4 * per_view;
      const auto wide = MakeTexture(wide_width, kHeight, seed++);
      for (int i = 0; i < per_view; ++i) {
        const std::string path =
            std::string(location) + "-" + view + "-" + std::to_string(i) + ".jpg";
        folder.Write(name + "/" + path,
                     EncodeJpeg(Shifted(wide, wide_width, 4 * i), kWidth, kHeight, 1));
        csv += path + "," + location + "," + view + "," + (i + 1 < per_view ? "train" : "test") + "\n";
      }
    }
  }
  folder.Write(name + "/images.csv", csv);
  return folder / name;
}

}  // namespace viewfix
