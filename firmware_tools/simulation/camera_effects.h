// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <opencv2/core.hpp>

#include "firmware_tools/simulation/random.h"
#include "firmware_tools/simulation/renderer.h"

namespace viewfix::simulation {

// What one exposure does to the light that reaches the lens.
struct Exposure {
  Illumination illumination;
  float gain = 1;
  cv::Vec3f white_balance{1, 1, 1};  // BGR factors
  float vignetting = 0.2f;           // light lost in the corners, share
  float noise = 2;                   // grey levels, standard deviation in the mid tones
  float blur_length = 0;             // pixels of motion during the exposure
  float blur_angle = 0;              // radians
  int jpeg_quality = 86;
};

// Draws an exposure. Test images are taken in other light than training images.
Exposure DrawExposure(Random& random, bool is_test);

// Linear light to the bytes of a JPEG.
std::vector<std::uint8_t> Develop(const cv::Mat& linear, const Exposure& exposure, Random& random);

}  // namespace viewfix::simulation
