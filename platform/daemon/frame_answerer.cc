// SPDX-License-Identifier: BSD-3-Clause
#include "platform/daemon/frame_answerer.h"

#include <string>
#include <utility>

#include "platform/camera/orient.h"
#include "platform/clock.h"
#include "platform/file.h"

namespace viewfix {
namespace {

// The EXIF orientation that turns a picture clockwise by 0, 90, 180, 270 degrees.
int OrientationOf(int rotate_deg) {
  constexpr int kOrientations[] = {1, 6, 3, 8};
  return kOrientations[rotate_deg / 90];
}

std::string SizeText(int width, int height) {
  return std::to_string(width) + "x" + std::to_string(height);
}

// Of an error that concerns this frame: its name, its size and, where one is given, its camera's.
Status AboutFrame(const Frame& frame, const Camera* camera, const Status& status) {
  std::string where = SizeText(frame.image.width, frame.image.height) + " pixels";
  if (camera != nullptr) {
    where.append(", calibrated at ").append(SizeText(camera->width, camera->height));
  }
  const std::string name =
      frame.name.empty() ? "frame " + std::to_string(frame.sequence) : frame.name;
  return AboutFile(name, {status.code(), status.text(), where});
}

}  // namespace

Result<Fix> FrameAnswerer::Localize(Frame& frame, std::uint64_t number, LoadedModel& model) {
  if (model.rotate_deg != 0) {
    Orient(frame.image, OrientationOf(model.rotate_deg), turned_);
    std::swap(frame.image, turned_);
  }
  const auto prediction = motion_.Predict(number);
  Prior prior;
  prior.camera = model.camera ? &*model.camera : nullptr;
  prior.sequence = number;
  if (prediction) {
    prior.cam_from_world = &prediction->cam_from_world;
    prior.map_idx = prediction->map_idx;
  }
  Result<Fix> fix = model.localizer->Localize(frame.image.view(), prior);
  if (!fix.ok()) return AboutFrame(frame, prior.camera, fix.status());
  // What this frame says alone is where the next is looked for, believed or not.
  if (fix->has_pose) {
    motion_.Update(number, fix->map_idx, fix->world_from_cam);
  } else {
    motion_.Lose();
  }
  if (model.filter) model.filter->Apply(number, *fix);
  return fix;
}

std::string_view WriteFix(const Frame& frame, const Fix& fix, LoadedModel& model) {
  const std::int64_t age_ns = MonotonicNs() - frame.capture_time_ns;
  return model.writer->Write(
      {frame.sequence, frame.capture_time_ns, WallClockNs() - age_ns, age_ns}, fix);
}

}  // namespace viewfix
