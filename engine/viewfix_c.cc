// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <functional>
#include <iterator>
#include <limits>
#include <memory>
#include <new>
#include <set>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "engine/base/location_name.h"
#include "engine/localizer.h"
#include "engine/viewfix.h"
#include "models/model_view.h"

static_assert(std::uint32_t{VIEWFIX_TOO_FEW_FEATURES} == std::uint32_t{viewfix::kTooFewFeatures});
static_assert(std::uint32_t{VIEWFIX_UNKNOWN_PLACE} == std::uint32_t{viewfix::kUnknownPlace});
static_assert(std::uint32_t{VIEWFIX_AMBIGUOUS} == std::uint32_t{viewfix::kAmbiguous});
static_assert(std::uint32_t{VIEWFIX_LOW_INLIERS} == std::uint32_t{viewfix::kLowInliers});
static_assert(std::uint32_t{VIEWFIX_BLURRED} == std::uint32_t{viewfix::kBlurred});
static_assert(std::uint32_t{VIEWFIX_DARK} == std::uint32_t{viewfix::kDark});
static_assert(std::uint32_t{VIEWFIX_OVEREXPOSED} == std::uint32_t{viewfix::kOverexposed});
static_assert(std::size(viewfix_fix{}.rivals) == std::size_t{viewfix::Fix::kMaxRivals} + 1);

struct viewfix_localizer {
  viewfix_localizer(const viewfix::ModelView& view, viewfix::Localizer made)
      : model(view), localizer(std::move(made)) {
    for (int i = 0; i < model.scoring().num_locations; ++i) {
      const std::string_view name = model.location_name(i);
      for (int level = 1; level <= viewfix::LevelsOf(name); ++level) {
        const std::string_view part = viewfix::UpToLevel(name, level);
        if (locations.find(part) == locations.end()) locations.emplace(part);
      }
    }
    for (int i = 0; i < model.scoring().num_views; ++i) views.emplace_back(model.view_name(i));
  }

  viewfix::ModelView model;
  viewfix::Localizer localizer;
  // Up to each of its levels, with an end mark, as C wants them.
  std::set<std::string, std::less<>> locations;
  std::vector<std::string> views;
};

namespace viewfix {
namespace {

// The first version's struct ends here; a caller with less cannot read an answer.
constexpr std::size_t kLeastFixSize = offsetof(viewfix_fix, pose_valid) + sizeof(std::int32_t);

viewfix_status ToC(const Status& status) {
  switch (status.code()) {
    case StatusCode::kOk:
      return VIEWFIX_OK;
    case StatusCode::kInvalidArgument:
      return VIEWFIX_INVALID_ARGUMENT;
    case StatusCode::kCorrupt:
      return VIEWFIX_CORRUPT;
    case StatusCode::kUnsupported:
      return VIEWFIX_UNSUPPORTED;
    case StatusCode::kResourceExhausted:
      return VIEWFIX_RESOURCE_EXHAUSTED;
    default:
      return VIEWFIX_INTERNAL;
  }
}

// Cuts `text` to the room there is; returns how many bytes stand before the end mark.
std::size_t CopyText(std::string_view text, char* out, std::size_t capacity) {
  if (out == nullptr || capacity == 0) return 0;
  const std::size_t size = std::min(text.size(), capacity - 1);
  std::copy_n(text.data(), size, out);
  out[size] = '\0';
  return size;
}

viewfix_status Refuse(const Status& status, char* error, std::size_t error_size) {
  std::size_t used = CopyText(status.text(), error, error_size);
  if (!status.detail().empty()) {
    used += CopyText(": ", error + used, error_size - used);
    CopyText(status.detail(), error + used, error_size - used);
  }
  return ToC(status);
}

Result<std::unique_ptr<viewfix_localizer>> Open(std::span<const std::uint8_t> bytes) {
  const Result<ModelView> model = ModelView::Open(bytes);
  if (!model.ok()) return model.status();
  Result<Localizer> localizer = Localizer::Create(*model, {});
  if (!localizer.ok()) return localizer.status();
  return std::make_unique<viewfix_localizer>(*model, std::move(*localizer));
}

void FillPose(const Fix& fix, viewfix_fix& out) {
  out.pose_valid = 1;
  out.pose_map = fix.map_idx;
  const Eigen::Vector3d& t = fix.world_from_cam.translation;
  const Eigen::Vector4d& q = fix.world_from_cam.rotation.coeffs();  // x y z w
  std::copy(t.begin(), t.end(), out.pose);
  std::copy(q.begin(), q.end(), out.pose + 3);
  float* next = out.covariance;
  for (int row = 0; row < 6; ++row) {
    for (int col = row; col < 6; ++col) *next++ = static_cast<float>(fix.covariance(row, col));
  }
}

const char* NameOf(const viewfix_localizer& from, std::string_view location) {
  return from.locations.find(location)->c_str();
}

void FillRivals(const viewfix_localizer& from, const Fix& fix, viewfix_fix& out) {
  const auto add = [&](int location_idx) {
    out.rivals[out.num_rivals++] = NameOf(from, from.model.location_name(location_idx));
  };
  if (fix.GuessIsRival()) add(fix.location_idx);
  for (int i = 0; i < fix.num_rivals; ++i) add(fix.rivals[i]);
}

void FillAnswer(const viewfix_localizer& from, const Fix& fix, viewfix_fix& out) {
  const ModelKeyframes& keyframes = from.model.keyframes();
  const std::string_view name = from.model.location_name(fix.location_idx);
  out.level = fix.level == 0 ? LevelsOf(name) : fix.level;
  out.location = NameOf(from, UpToLevel(name, out.level));
  if (fix.level != 0) return;
  out.view = from.views[from.model.scoring().pair_view[fix.pair_idx]].c_str();
  if (fix.has_pose) FillPose(fix, out);
  if (fix.keyframe_idx < 0) return;
  out.keyframe_id = fix.keyframe_idx;
  out.keyframe_has_pose = keyframes.has_pose[fix.keyframe_idx];
  const auto pose = keyframes.pose.subspan(std::size_t(fix.keyframe_idx) * 7, 7);
  std::copy(pose.begin(), pose.end(), out.keyframe_pose);
}

viewfix_fix ToC(const viewfix_localizer& from, const Fix& fix) {
  viewfix_fix out = {};
  out.localized = fix.localized ? 1 : 0;
  out.reasons = fix.reasons;
  out.confidence = fix.confidence;
  out.score = fix.score;
  out.margin = fix.margin;
  out.inliers = fix.num_inliers;
  out.keyframe_id = -1;
  FillRivals(from, fix, out);
  if (fix.localized) FillAnswer(from, fix, out);
  return out;
}

}  // namespace
}  // namespace viewfix

const char* viewfix_version() { return VIEWFIX_VERSION; }

const char* viewfix_status_name(viewfix_status status) {
  switch (status) {
    case VIEWFIX_OK:
      return "ok";
    case VIEWFIX_INVALID_ARGUMENT:
      return "invalid argument";
    case VIEWFIX_CORRUPT:
      return "corrupt";
    case VIEWFIX_UNSUPPORTED:
      return "unsupported";
    case VIEWFIX_RESOURCE_EXHAUSTED:
      return "resource exhausted";
    case VIEWFIX_INTERNAL:
      return "internal error";
  }
  return "unknown";
}

const char* viewfix_reason_name(uint32_t reason) {
  return viewfix::ReasonName(static_cast<viewfix::Reason>(reason));
}

viewfix_status viewfix_open(const void* bytes, size_t size, viewfix_localizer** out, char* error,
                            size_t error_size) {
  using viewfix::Status;
  using viewfix::StatusCode;
  if (out != nullptr) *out = nullptr;
  if (bytes == nullptr || out == nullptr) {
    return viewfix::Refuse({StatusCode::kInvalidArgument, "null pointer"}, error, error_size);
  }
  try {
    auto opened = viewfix::Open({static_cast<const std::uint8_t*>(bytes), size});
    if (!opened.ok()) return viewfix::Refuse(opened.status(), error, error_size);
    *out = opened->release();
    viewfix::CopyText("", error, error_size);
    return VIEWFIX_OK;
  } catch (const std::bad_alloc&) {
    return viewfix::Refuse({StatusCode::kResourceExhausted, "no memory"}, error, error_size);
  }
}

viewfix_status viewfix_localize(viewfix_localizer* localizer, const uint8_t* pixels, int32_t width,
                                int32_t height, size_t row_bytes, viewfix_fix* fix) {
  const viewfix_image image = {sizeof image, pixels,  width, height, row_bytes,
                               nullptr,      nullptr, 0,     0,      0};
  return viewfix_localize_image(localizer, &image, fix);
}

viewfix_status viewfix_localize_image(viewfix_localizer* localizer, const viewfix_image* image,
                                      viewfix_fix* fix) {
  constexpr std::size_t kMaxRowBytes = std::numeric_limits<std::ptrdiff_t>::max();
  if (localizer == nullptr || image == nullptr || fix == nullptr ||
      image->size < sizeof(viewfix_image) || fix->size < viewfix::kLeastFixSize ||
      image->row_bytes > kMaxRowBytes || image->chroma_row_bytes > kMaxRowBytes) {
    return VIEWFIX_INVALID_ARGUMENT;
  }
  const viewfix::ImageView view = {image->y,
                                   image->width,
                                   image->height,
                                   static_cast<std::ptrdiff_t>(image->row_bytes),
                                   {image->cb, image->cr, image->chroma_width, image->chroma_height,
                                    static_cast<std::ptrdiff_t>(image->chroma_row_bytes)}};
  const viewfix::Result<viewfix::Fix> found = localizer->localizer.Localize(view);
  if (!found.ok()) return viewfix::ToC(found.status());
  viewfix_fix answer = viewfix::ToC(*localizer, *found);
  answer.size = fix->size;
  std::memcpy(fix, &answer, std::min(fix->size, sizeof answer));
  return VIEWFIX_OK;
}

void viewfix_free(viewfix_localizer* localizer) { delete localizer; }
