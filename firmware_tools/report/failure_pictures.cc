// SPDX-License-Identifier: BSD-3-Clause
#include "firmware_tools/report/failure_pictures.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <nlohmann/json.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <set>

#include "firmware_tools/mapping/map_input.h"
#include "firmware_tools/mapping/two_view.h"
#include "firmware_tools/report/page.h"
#include "firmware_tools/training/feature_store.h"

namespace viewfix {
namespace {

using Json = nlohmann::ordered_json;

constexpr std::size_t kMaxFailures = 12;
constexpr int kThumbnailSide = 320;  // pixels, the longer side
constexpr int kThumbnailQuality = 75;
constexpr std::size_t kMaxMatches = 50;  // more hide the picture
constexpr int kMinMatches = 8;           // fewer agree with a motion by chance

// The image as a small JPEG; null: it cannot be read.
Json Thumbnail(const std::filesystem::path& file) {
  const cv::Mat image = cv::imread(file.string(), cv::IMREAD_COLOR);
  if (image.empty()) return nullptr;
  const double scale = std::min(1.0, double{kThumbnailSide} / std::max(image.cols, image.rows));
  cv::Mat small;
  cv::resize(image, small,
             {std::max(1, cvRound(image.cols * scale)), std::max(1, cvRound(image.rows * scale))},
             0, 0, cv::INTER_AREA);
  std::vector<std::uint8_t> jpeg;
  cv::imencode(".jpg", small, jpeg, {cv::IMWRITE_JPEG_QUALITY, kThumbnailQuality});
  return {{"url", PictureUrl(jpeg)}, {"width", small.cols}, {"height", small.rows}};
}

// A keyframe's photograph is one of the set's, by its path: a model cannot name any other file.
class Photographs {
 public:
  explicit Photographs(const ImageSet& set) {
    for (int i = 0; i < static_cast<int>(set.images.size()); ++i) {
      by_path_[set.images[i].path] = i;
    }
  }

  // -1: none.
  int IndexOf(const Json& path) const {
    if (!path.is_string()) return -1;
    const auto image = by_path_.find(path.get<std::string>());
    return image == by_path_.end() ? -1 : image->second;
  }

 private:
  std::map<std::string, int> by_path_;
};

// Into ImageSet::images; -1: none.
struct Failure {
  Json frame;
  int query = -1;
  int guess = -1;
  int right = -1;
};

std::vector<Failure> WorstFailures(const ImageSet& set, const Json& figures) {
  const Photographs photographs(set);
  std::vector<Failure> failures;
  for (const Json& index : figures["failures"]) {
    if (failures.size() == kMaxFailures) break;
    const Json& frame = figures["frames"][index.get<std::size_t>()];
    failures.push_back({index, photographs.IndexOf(frame["path"]),
                        photographs.IndexOf(frame["keyframe"]),
                        photographs.IndexOf(frame["right_keyframe"])});
  }
  return failures;
}

// Of the photographs of some failures, in which features are looked for once.
class PictureMatcher {
 public:
  PictureMatcher(const ImageSet& set, const FeatureOptions& options,
                 const std::vector<Failure>& failures)
      : features_(ExtractFeatures(set, PhotographsOf(failures), options, 1, {})),
        input_(MakeMapInput(set, features_, PhotographsOf(failures))) {
    for (int f = 0; f < static_cast<int>(input_.frames.size()); ++f) {
      frame_of_[input_.frames[f].name] = f;
      // What the images themselves say: under the true pose a wrong guess would match nowhere.
      input_.frames[f].cam_from_world.reset();
    }
  }

  Json Match(const ImageRecord& query, const ImageRecord& keyframe) const {
    const auto first = frame_of_.find(query.path);
    const auto second = frame_of_.find(keyframe.path);
    Json rows = Json::array();
    if (first == frame_of_.end() || second == frame_of_.end() || first == second) return rows;
    for (const FeatureMatch& match : BestMatches(first->second, second->second)) {
      Json row = Json::array();
      Append(first->second, match.first_idx, row);
      Append(second->second, match.second_idx, row);
      rows.push_back(row);
    }
    return rows;
  }

 private:
  static std::vector<int> PhotographsOf(const std::vector<Failure>& failures) {
    std::set<int> images;
    for (const Failure& f : failures) images.insert({f.query, f.guess, f.right});
    images.erase(-1);
    return {images.begin(), images.end()};
  }

  std::vector<FeatureMatch> BestMatches(int first, int second) const {
    TwoViewOptions options;
    options.min_inliers = kMinMatches;
    const FramePair pair = {first, second};
    const auto verified = VerifyPairs(input_, {&pair, 1}, options, 1);
    if (verified.empty()) return {};
    std::vector<FeatureMatch> matches = verified.front().matches;
    std::stable_sort(
        matches.begin(), matches.end(),
        [](const FeatureMatch& a, const FeatureMatch& b) { return a.distance2 < b.distance2; });
    matches.resize(std::min(matches.size(), kMaxMatches));
    return matches;
  }

  void Append(int frame, int keypoint_idx, Json& row) const {
    const ImageFeatures& image = *input_.frames[frame].features;
    const Keypoint& keypoint = image.keypoints[keypoint_idx];
    const auto share = [](double at, int size) {
      return std::round(1e4 * (at + 0.5) / size) / 1e4;
    };
    row.push_back(share(double{keypoint.x}, image.width));
    row.push_back(share(double{keypoint.y}, image.height));
  }

  FeatureStore features_;
  MapInput input_;
  std::map<std::string, int> frame_of_;  // by path
};

}  // namespace

Json FailurePictures(const ImageSet& set, const FeatureOptions& features, const Json& figures) {
  const std::vector<Failure> failures = WorstFailures(set, figures);
  const PictureMatcher matcher(set, features, failures);
  const auto picture = [&](int image) {
    return image < 0 ? Json() : Thumbnail(set.FullPath(set.images[image]));
  };
  const auto match = [&](int query, int keyframe) {
    return query < 0 || keyframe < 0 ? Json::array()
                                     : matcher.Match(set.images[query], set.images[keyframe]);
  };
  Json pictures = Json::array();
  for (const Failure& failure : failures) {
    pictures.push_back({{"frame", failure.frame},
                        {"query", picture(failure.query)},
                        {"guess", picture(failure.guess)},
                        {"right", picture(failure.right)},
                        {"guess_matches", match(failure.query, failure.guess)},
                        {"right_matches", match(failure.query, failure.right)}});
  }
  return pictures;
}

}  // namespace viewfix
