// SPDX-License-Identifier: BSD-3-Clause
#include "platform/daemon/run_loop.h"

#include <algorithm>
#include <cstdio>
#include <string>
#include <utility>

#include "engine/pose/motion_model.h"
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
  return AboutFile(frame.name, {status.code(), status.text(), where});
}

FrameTimes TimesOf(const Frame& frame) {
  const std::int64_t age_ns = MonotonicNs() - frame.capture_time_ns;
  return {frame.sequence, frame.capture_time_ns, WallClockNs() - age_ns, age_ns};
}

}  // namespace

void PrintFault(const Status& status) {
  std::string line = "viewfixd: ";
  line.append(status.text());
  if (!status.detail().empty()) line.append(": ").append(status.detail());
  // A file name may hold line ends and worse.
  std::replace_if(
      line.begin(), line.end(), [](unsigned char c) { return c < 0x20; }, '?');
  std::fprintf(stderr, "%s\n", line.c_str());
}

Status RunLoop(FrameSource& source, int rotate_deg, const Camera* camera, Localizer& localizer,
               FixFilter* filter, FixWriter& writer, Publisher& publisher,
               const volatile std::sig_atomic_t& stop, RunReport& report) {
  MotionModel motion;
  Frame frame;
  GreyImage turned;
  const auto pass_over = [&](const Status& fault) {
    PrintFault(fault);
    ++report.failed;
  };
  while (stop == 0) {
    const Status read = source.Next(frame);
    if (read.code() == StatusCode::kNotFound) break;
    if (!read.ok()) {
      pass_over(read);
      continue;
    }
    if (rotate_deg != 0) {
      Orient(frame.image, OrientationOf(rotate_deg), turned);
      std::swap(frame.image, turned);
    }
    const auto prediction = motion.Predict(frame.sequence);
    Prior prior;
    prior.camera = camera;
    prior.sequence = frame.sequence;
    if (prediction) {
      prior.cam_from_world = &prediction->cam_from_world;
      prior.map_idx = prediction->map_idx;
    }
    Result<Fix> fix = localizer.Localize(frame.image.view(), prior);
    if (!fix.ok()) {
      pass_over(AboutFrame(frame, camera, fix.status()));
      continue;
    }
    // What this frame says alone is where the next is looked for, believed or not.
    if (fix->has_pose) {
      motion.Update(frame.sequence, fix->map_idx, fix->world_from_cam);
    } else {
      motion.Lose();
    }
    if (filter != nullptr) filter->Apply(frame.sequence, *fix);
    ++report.frames;
    if (fix->localized) ++report.localized;
    const Status published = publisher.Publish(writer.Write(TimesOf(frame), *fix));
    if (!published.ok()) return published;
  }
  return {};
}

}  // namespace viewfix
