// SPDX-License-Identifier: BSD-3-Clause
#include "firmware_tools/report/eval_report.h"

#include <algorithm>
#include <map>
#include <nlohmann/json.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "firmware_tools/report/page.h"

namespace viewfix {
namespace {

using Json = nlohmann::ordered_json;

constexpr std::size_t kMaxFailures = 12;
constexpr int kThumbnailSide = 320;  // pixels, the longer side
constexpr int kThumbnailQuality = 75;

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
  return PictureUrl(jpeg);
}

// The thumbnails of the worst failures. A keyframe's photograph is one of the set's, by its path:
// a model cannot name any other file.
class FailurePictures {
 public:
  explicit FailurePictures(const ImageSet& set) : set_(set) {
    for (const ImageRecord& image : set.images) by_path_[image.path] = &image;
  }

  Json Of(const Json& figures) const {
    Json failures = Json::array();
    for (const Json& index : figures["failures"]) {
      if (failures.size() == kMaxFailures) break;
      const Json& frame = figures["frames"][index.get<std::size_t>()];
      failures.push_back({{"frame", index},
                          {"query", Picture(frame["path"])},
                          {"guess", Picture(frame["keyframe"])},
                          {"right", Picture(frame["right_keyframe"])}});
    }
    return failures;
  }

 private:
  Json Picture(const Json& path) const {
    if (!path.is_string()) return nullptr;
    const auto image = by_path_.find(path.get<std::string>());
    return image == by_path_.end() ? Json() : Thumbnail(set_.FullPath(*image->second));
  }

  const ImageSet& set_;
  std::map<std::string, const ImageRecord*> by_path_;
};

// The floor plan lies in site coordinates.
Json FloorPlanUnder(const Json& figures, const ModelView& model) {
  return figures["positions_in"] == "site" ? FloorPlanForPage(model) : Json();
}

}  // namespace

std::string EvalReportHtml(const ReportTitle& title, const ImageSet& set, const ModelView& model,
                           const Json& figures) {
  const auto hash = model.short_hash();
  const Json data = {{"title",
                      {{"set", title.set},
                       {"model", title.model},
                       {"split", title.split},
                       {"map", title.map},
                       {"hash", std::string(hash.begin(), hash.end())}}},
                     {"floor_plan", FloorPlanUnder(figures, model)},
                     {"failures", FailurePictures(set).Of(figures)},
                     {"figures", figures}};
  return PlotPage(EvalReportPage(), data);
}

}  // namespace viewfix
