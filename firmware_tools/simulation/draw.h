// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <opencv2/core.hpp>
#include <string>

#include "firmware_tools/simulation/random.h"

// Brushes that the artwork is drawn with.
namespace viewfix::simulation {

// A saturated colour of random hue; value 0..255.
cv::Scalar RandomColour(Random& random, int saturation_low, int saturation_high, int value_low,
                        int value_high);
cv::Scalar Shade(const cv::Scalar& colour, double factor);

// Value noise in -1..1 (CV_32F) that repeats; cells of `cell` pixels and finer, each octave
// weaker by `falloff`. `stretch` > 1 draws it out downwards, as wood grain.
cv::Mat Noise(Random& random, cv::Size size, int cell, int octaves, double falloff,
              int stretch = 1);

// image += amount * noise, clipped.
void AddNoise(cv::Mat& image, const cv::Mat& noise, double amount);

void VerticalGradient(cv::Mat& image, cv::Rect area, cv::Scalar top, cv::Scalar bottom);

// Text whose capitals are `height` pixels high, base line at `origin`; shrunk to `max_width`.
void Write(cv::Mat& image, const std::string& text, cv::Point origin, double height,
           cv::Scalar colour, int max_width, bool bold = false);

std::string RandomWord(Random& random);
std::string RandomPhrase(Random& random, int words);

// Lines of small print filling `area`.
void WriteParagraph(cv::Mat& image, Random& random, cv::Rect area, double height,
                    cv::Scalar colour);

// Abstract picture: sky-like gradient, hills, discs, strokes.
void PaintScenery(cv::Mat& image, Random& random, cv::Rect area);

}  // namespace viewfix::simulation
