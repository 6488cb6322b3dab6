// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <optional>
#include <span>
#include <string>
#include <vector>

#include "engine/geometry/camera.h"
#include "engine/geometry/rigid3.h"
#include "firmware_tools/dataset/image_set.h"
#include "firmware_tools/training/feature_store.h"

namespace viewfix {

// A photograph to be mapped.
struct MapFrame {
  std::string name;     // path relative to the image set's folder
  std::string capture;  // the walk it belongs to
  double time = 0;      // in its walk, in frames: those that are left out count
  int camera_idx = 0;   // into MapInput::cameras
  const ImageFeatures* features = nullptr;
  std::optional<Rigid3> cam_from_world;  // where the pose is known
  double readout = 0;  // of a rolling shutter that the key points were rid of (rolling_shutter.h)
};

// What maps are made of: frames in the order they were taken, and their cameras at the size
// that features were found in, so that key points are pixels of them.
struct MapInput {
  std::vector<Camera> cameras;
  std::vector<MapFrame> frames;
  bool focal_is_guess = false;        // of at least one camera
  std::vector<std::string> warnings;  // which cameras are guesses
};

// Frames first_idx < second_idx of a MapInput.
struct FramePair {
  int first_idx = 0;
  int second_idx = 0;

  friend auto operator<=>(const FramePair&, const FramePair&) = default;
};

// The images `image_idxs` of a set, those without features left out. Refers to `features`,
// which must live longer. Cameras that the set does not know are EXIF's; where that is silent, a
// pinhole with a focal length of 1.2 times the longer side: the middle of what cameras have.
MapInput MakeMapInput(const ImageSet& set, const FeatureStore& features,
                      std::span<const int> image_idxs);

// Which frames were taken one soon after the other. Refers to the input, which must live longer.
class CaptureOrder {
 public:
  explicit CaptureOrder(const MapInput& input);

  // Of different captures, or more than `window` frames apart in one.
  bool AreApart(int a, int b, int window) const;

  // Of a frame in its capture.
  int Position(int frame) const { return position_[frame]; }

 private:
  const MapInput& input_;
  std::vector<int> position_;  // [frames] in their capture
};

// Pixels of an image of 640 pixels a side, in which thresholds are stated, to pixels of this
// camera.
double PixelsPerNominal(const Camera& camera);

// Unit vectors of the key points, [keypoints]; zero where no ray gives the pixel.
std::vector<Eigen::Vector3d> Bearings(const Camera& camera, const ImageFeatures& features);

inline Eigen::Vector2d Pixel(const Keypoint& keypoint) { return {keypoint.x, keypoint.y}; }

}  // namespace viewfix
