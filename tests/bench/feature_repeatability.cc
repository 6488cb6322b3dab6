// SPDX-License-Identifier: BSD-3-Clause
// How well features survive changes of the image: this project's SURF beside dlib's
// SURF and OpenCV's SIFT, at an equal number of features.
//
//   feature_repeatability [--count N] [--each] [IMAGE...]
//
// Without images it renders its own. Prints, for each category of change (or, with
// --each, for each change), the share of features found again at the same place
// and scale, and the share whose nearest descriptor is the right one.

#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <map>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <string>
#include <vector>

#include "tests/bench/feature_study.h"

namespace viewfix {
namespace {

struct Arguments {
  int count = 500;
  bool each = false;
  std::vector<cv::Mat> images;
};

Arguments ReadArguments(int argc, char** argv) {
  Arguments arguments;
  for (int i = 1; i < argc; ++i) {
    if (std::strcmp(argv[i], "--each") == 0) {
      arguments.each = true;
    } else if (std::strcmp(argv[i], "--count") == 0 && i + 1 < argc) {
      arguments.count = std::max(16, std::atoi(argv[++i]));
    } else {
      const cv::Mat image = cv::imread(argv[i], cv::IMREAD_GRAYSCALE);
      if (image.empty() || std::min(image.cols, image.rows) < 240) {
        std::fprintf(stderr, "%s: no image of at least 240 pixels a side\n", argv[i]);
        std::exit(1);
      }
      arguments.images.push_back(image);
    }
  }
  if (!arguments.images.empty()) return arguments;
  for (unsigned seed = 1; seed <= 3; ++seed) {
    arguments.images.push_back(RenderStudyImage(960, 720, seed));
  }
  return arguments;
}

void Run(const Arguments& arguments) {
  std::vector<std::unique_ptr<StudyMethod>> methods;
  methods.push_back(MakeViewfixSurf(false));
  methods.push_back(MakeViewfixSurf(true));
  methods.push_back(MakeDlibSurf(2));
  methods.push_back(MakeDlibSurf(1));
  methods.push_back(MakeOpenCvSift());

  std::vector<std::string> rows;  // in order of first appearance
  std::map<std::string, std::vector<StudyScore>> sums;
  std::map<std::string, int> counts;
  for (const cv::Mat& image : arguments.images) {
    for (const StudyChange& change : MakeChanges(image)) {
      const std::string row =
          arguments.each ? change.category + " " + change.name : change.category;
      auto [sum, is_new] = sums.try_emplace(row, methods.size());
      if (is_new) rows.push_back(row);
      ++counts[row];
      for (std::size_t m = 0; m < methods.size(); ++m) {
        const StudyScore score = Score(*methods[m], change, arguments.count);
        sum->second[m].repeated += score.repeated;
        sum->second[m].matched += score.matched;
        sum->second[m].count += score.count;
      }
    }
  }

  std::printf("%zu images, %d features: %% found again / %% matched rightly (count)\n%-22s",
              arguments.images.size(), arguments.count, "");
  for (const auto& method : methods) std::printf(" %22s", method->name().c_str());
  std::printf("\n");
  for (const std::string& row : rows) {
    std::printf("%-22s", row.c_str());
    for (const StudyScore& sum : sums[row]) {
      const double n = counts[row];
      std::printf("    %5.1f / %5.1f (%4.0f)", 100 * sum.repeated / n, 100 * sum.matched / n,
                  sum.count / n);
    }
    std::printf("\n");
  }
}

}  // namespace
}  // namespace viewfix

int main(int argc, char** argv) {
  viewfix::Run(viewfix::ReadArguments(argc, argv));
  return 0;
}
