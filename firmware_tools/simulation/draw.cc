// SPDX-License-Identifier: BSD-3-Clause
#include "firmware_tools/simulation/draw.h"

#include <algorithm>
#include <array>
#include <opencv2/imgproc.hpp>
#include <vector>

namespace viewfix::simulation {

cv::Scalar RandomColour(Random& random, int saturation_low, int saturation_high, int value_low,
                        int value_high) {
  cv::Mat3b pixel(1, 1);
  pixel(0, 0) = {static_cast<std::uint8_t>(random.Below(180)),
                 static_cast<std::uint8_t>(random.Uniform(saturation_low, saturation_high)),
                 static_cast<std::uint8_t>(random.Uniform(value_low, value_high))};
  cv::cvtColor(pixel, pixel, cv::COLOR_HSV2BGR);
  return {static_cast<double>(pixel(0, 0)[0]), static_cast<double>(pixel(0, 0)[1]),
          static_cast<double>(pixel(0, 0)[2]), 255};
}

cv::Scalar Shade(const cv::Scalar& colour, double factor) {
  return {std::min(255.0, colour[0] * factor), std::min(255.0, colour[1] * factor),
          std::min(255.0, colour[2] * factor), 255};
}

cv::Mat Noise(Random& random, cv::Size size, int cell, int octaves, double falloff, int stretch) {
  cv::Mat sum = cv::Mat::zeros(size, CV_32F);
  double weight = 1;
  for (int octave = 0; octave < octaves && cell >= 1; ++octave, cell /= 2, weight *= falloff) {
    const int columns = std::max(1, size.width / cell);
    const int rows = std::max(1, size.height / (cell * stretch));
    cv::Mat1f cells(rows, columns);
    for (float& value : cells) value = static_cast<float>(random.Uniform(-weight, weight));
    // Two cells of wrap-around on each side make the enlarged noise repeat.
    cv::Mat wrapped, enlarged;
    cv::copyMakeBorder(cells, wrapped, 2, 2, 2, 2, cv::BORDER_WRAP);
    const double sx = static_cast<double>(size.width) / columns;
    const double sy = static_cast<double>(size.height) / rows;
    cv::resize(wrapped, enlarged, {cvRound(sx * (columns + 4)), cvRound(sy * (rows + 4))}, 0, 0,
               cv::INTER_CUBIC);
    sum += enlarged(cv::Rect(cvRound(2 * sx), cvRound(2 * sy), size.width, size.height));
  }
  return sum;
}

void AddNoise(cv::Mat& image, const cv::Mat& noise, double amount) {
  std::vector<cv::Mat> planes(static_cast<std::size_t>(image.channels()), noise);
  cv::Mat merged, wide;
  cv::merge(planes, merged);
  image.convertTo(wide, CV_32F);
  wide += merged * amount;
  wide.convertTo(image, CV_8U);
}

void VerticalGradient(cv::Mat& image, cv::Rect area, cv::Scalar top, cv::Scalar bottom) {
  area &= cv::Rect({}, image.size());
  for (int y = 0; y < area.height; ++y) {
    const double part = static_cast<double>(y) / area.height;
    image(cv::Rect(area.x, area.y + y, area.width, 1)) = top * (1 - part) + bottom * part;
  }
}

void Write(cv::Mat& image, const std::string& text, cv::Point origin, double height,
           cv::Scalar colour, int max_width, bool bold) {
  const int font = bold ? cv::FONT_HERSHEY_DUPLEX : cv::FONT_HERSHEY_SIMPLEX;
  double scale = height / 21.0;  // the Hershey capitals are 21 units high
  int baseline = 0;
  const int width = cv::getTextSize(text, font, scale, 1, &baseline).width;
  if (width > max_width) scale *= static_cast<double>(max_width) / width;
  const int thickness = std::max(1, cvRound(scale * (bold ? 3.0 : 1.6)));
  cv::putText(image, text, origin, font, scale, colour, thickness, cv::LINE_AA);
}

std::string RandomWord(Random& random) {
  static constexpr std::array kSyllables{"ka",  "lo",  "mi",  "ser", "tan", "vo",
                                         "ri",  "pel", "dun", "ge",  "zor", "hal",
                                         "qui", "bea", "fu",  "nix", "war", "sty"};
  std::string word;
  for (int i = 1 + random.Below(3); i >= 0; --i) {
    word += kSyllables[random.Below(static_cast<int>(kSyllables.size()))];
  }
  return word;
}

std::string RandomPhrase(Random& random, int words) {
  std::string phrase = RandomWord(random);
  for (int i = 1; i < words; ++i) phrase.append(" ").append(RandomWord(random));
  return phrase;
}

void WriteParagraph(cv::Mat& image, Random& random, cv::Rect area, double height,
                    cv::Scalar colour) {
  const int step = cvRound(height * 1.9);
  for (int y = area.y + step; y < area.br().y; y += step) {
    const bool last = random.Chance(0.15);
    const int width = last ? area.width / 2 : area.width;
    const int words = std::max(1, cvRound(width / (height * 4.6)));
    Write(image, RandomPhrase(random, words), {area.x, y}, height, colour, width);
    if (last) y += step / 2;
  }
}

void PaintScenery(cv::Mat& image, Random& random, cv::Rect area) {
  cv::Mat canvas = image(area);
  VerticalGradient(canvas, {{}, canvas.size()}, RandomColour(random, 40, 200, 120, 250),
                   RandomColour(random, 40, 160, 160, 255));
  const int side = std::min(area.width, area.height);
  for (int i = 2 + random.Below(4); i > 0; --i) {
    const cv::Point at(random.Below(area.width), random.Below(area.height));
    cv::circle(canvas, at, cvRound(side * random.Uniform(0.05, 0.25)),
               RandomColour(random, 80, 255, 80, 255),
               random.Chance(0.3) ? side / 30 + 1 : cv::FILLED, cv::LINE_AA);
  }
  for (int hill = 2 + random.Below(3); hill > 0; --hill) {
    std::vector<cv::Point> outline{{0, area.height}};
    const double base = random.Uniform(0.45, 0.85);
    for (int i = 0; i <= 12; ++i) {
      outline.emplace_back(area.width * i / 12,
                           cvRound(area.height * (base + random.Uniform(-0.12, 0.12))));
    }
    outline.emplace_back(area.width, area.height);
    cv::fillPoly(canvas, std::vector{outline}, RandomColour(random, 60, 220, 40, 200), cv::LINE_AA);
  }
  for (int i = 15 + random.Below(50); i > 0; --i) {
    const cv::Point at(random.Below(area.width), random.Below(area.height));
    cv::ellipse(
        canvas, at,
        {cvRound(side * random.Uniform(0.01, 0.08)), cvRound(side * random.Uniform(0.005, 0.02))},
        random.Uniform(0, 180), 0, 360, RandomColour(random, 50, 255, 30, 255), cv::FILLED,
        cv::LINE_AA);
  }
  AddNoise(canvas, Noise(random, canvas.size(), std::max(2, side / 12), 4, 0.7), 18);
}

}  // namespace viewfix::simulation
