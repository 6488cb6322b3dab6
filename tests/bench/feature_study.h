// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <memory>
#include <opencv2/core.hpp>
#include <string>
#include <vector>

#include "engine/features/feature_extractor.h"

namespace viewfix {

// Key points and descriptors of one image by any method, in one form.
struct StudyFeatures {
  std::vector<Keypoint> keypoints;
  cv::Mat descriptors;  // CV_32F, one row a key point
};

class StudyMethod {
 public:
  virtual ~StudyMethod() = default;
  virtual std::string name() const = 0;
  // The `count` features that the method would keep of a grey image, of at most
  // kStudyMaxSide pixels a side.
  virtual StudyFeatures Extract(const cv::Mat& grey, int count) const = 0;
};
inline constexpr int kStudyMaxSide = 1024;

std::unique_ptr<StudyMethod> MakeViewfixSurf(bool upright);
// dlib's, on the image mirrored at its edges (it finds nothing near them), the
// first octave sampled at every `first_step`-th pixel; its own default is 2.
std::unique_ptr<StudyMethod> MakeDlibSurf(int first_step);
std::unique_ptr<StudyMethod> MakeOpenCvSift();

// One change of an image, with the place each of its points goes to.
struct StudyChange {
  std::string category;  // "rotation", "scale", "blur", "light", "jpeg"
  std::string name;      // "30 deg"
  cv::Mat before;
  cv::Mat after;
  cv::Matx33d after_from_before;  // homography, pixel centres at integers
};

// All changes of a grey image with sides of 240 pixels or more. Rotations show real
// content up to the corners: `before` is a window of the image whose diagonal is
// the image's shorter side.
std::vector<StudyChange> MakeChanges(const cv::Mat& grey);

// A grey image of overlapping discs, bars and letters-like strokes at many scales.
cv::Mat RenderStudyImage(int width, int height, unsigned seed);

// Of `count` features kept of either image, those count that lie where both images
// show the same.
struct StudyScore {
  double repeated = 0;  // share found again: within 2 pixels, scale within 1.4
  double matched = 0;   // share whose nearest descriptor lies within 4 pixels of the truth
  double count = 0;     // features on the side with fewer
};

StudyScore Score(const StudyMethod& method, const StudyChange& change, int count);

}  // namespace viewfix
