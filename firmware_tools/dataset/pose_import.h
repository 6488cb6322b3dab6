// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "firmware_tools/dataset/image_set.h"

namespace viewfix {

// An image, or an instant, whose pose another program found.
struct ImportedPose {
  std::string name;  // path of the image as that program wrote it; TUM: the timestamp's text
  std::optional<double> time_s;  // TUM, where the timestamp is a number
  Pose pose;
  int camera_idx = -1;  // into ImportedPoses::cameras; -1: the file says nothing of it
  bool is_test = false;
};

struct ImportedPoses {
  std::filesystem::path source;
  std::vector<ImportedPose> images;
  std::vector<Calibration> cameras;  // pixel centres at integers
};

// A TUM trajectory: lines `timestamp tx ty tz qx qy qz qw`, world_from_cam, # begins a comment.
// What stands for the timestamp may also be an image's name without extension.
ImportedPoses ReadTumTrajectory(const std::filesystem::path& file);

// nerfstudio's transforms.json: camera-to-world matrices with OpenGL's axes (y up, z back) and
// pixel centres at +0.5; intrinsics for all frames or for each (fl_x, fl_y, cx, cy, w, h, k1...,
// camera_model, or camera_angle_x). applied_transform and applied_scale are undone. Frames in
// test_filenames and val_filenames are test images.
ImportedPoses ReadTransformsJson(const std::filesystem::path& file);

// A COLMAP model's images and cameras (see mapping/colmap_model.h); the points are not used.
ImportedPoses ReadColmapPoses(const std::filesystem::path& folder);

// Any of these: a .json file, another file (TUM), or a folder that holds a COLMAP model,
// sparse/0, sparse, or transforms.json. All throw ToolError naming the file, the place and the
// cause: not this format, a number that is not finite, a quaternion or matrix that is no
// rotation, a camera model that Viewfix does not have.
ImportedPoses ReadPoses(const std::filesystem::path& path);

struct PoseMatches {
  int matched = 0;    // images of the set that got a pose
  int unmatched = 0;  // images of the set that did not
  int unused = 0;     // poses for no image of the set; not counted for TUM, which has many
};

// Gives the set's images the poses of the same path; failing that, of the same file name, or of
// the same name without folder and extension, where only one pose has it. A TUM pose goes to the
// image whose name is a number of the same time (seconds; nanoseconds if 19 digits), interpolated
// between neighbours at most 0.2 s apart. Cameras come along where the image has none. Images
// without a match keep what they had. Throws ToolError if no image matches.
PoseMatches ApplyPoses(const ImportedPoses& poses, ImageSet& set);

// The images of a folder described by nothing but poses: transforms.json in it, or a COLMAP
// model in it, in sparse/0 or in sparse (images then stand beside it, in images/, or in these
// places of a folder or two above). Not labelled. Nothing: it has no such files.
std::optional<ImageSet> LoadPosedImageSet(const std::filesystem::path& folder);

}  // namespace viewfix
