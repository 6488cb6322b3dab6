// SPDX-License-Identifier: BSD-3-Clause
#include "firmware_tools/cli/set_flags.h"

#include <cstdio>

#include "firmware_tools/dataset/pose_import.h"

namespace viewfix {

void AddPosesFlag(CLI::App& command, std::string& poses) {
  command.add_option("--poses", poses,
                     "poses of the set's images by name: a TUM trajectory, nerfstudio's "
                     "transforms.json, or the folder of a COLMAP model");
}

ImageSet LoadImageSetWithPoses(const std::string& path, const std::string& poses) {
  ImageSet set = LoadImageSet(path);
  if (poses.empty()) return set;
  const PoseMatches matches = ApplyPoses(ReadPoses(poses), set);
  std::fprintf(stderr, "%s: poses for %d of %d images", poses.c_str(), matches.matched,
               matches.matched + matches.unmatched);
  if (matches.unused > 0) std::fprintf(stderr, "; %d are of no image of the set", matches.unused);
  std::fputc('\n', stderr);
  return set;
}

}  // namespace viewfix
