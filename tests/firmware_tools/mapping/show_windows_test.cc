// SPDX-License-Identifier: BSD-3-Clause
// Photographs of two places that look alike make no pair of one map.
#include <gtest/gtest.h>

#include <string>

#include "firmware_tools/mapping/sfm.h"
#include "firmware_tools/simulation/camera_effects.h"
#include "firmware_tools/simulation/renderer.h"
#include "firmware_tools/simulation/room.h"
#include "firmware_tools/simulation/stand.h"
#include "tests/testing/temp_folder.h"

namespace viewfix {
namespace {

using simulation::Stand;

constexpr int kSeed = 5;
constexpr int kFramesALeg = 5;

Stand Between(const Stand& a, const Stand& b, double share) {
  return {(1 - share) * a.position + share * b.position,
          (1 - share) * a.heading + share * b.heading, (1 - share) * a.pitch + share * b.pitch,
          (1 - share) * a.roll + share * b.roll};
}

// Up to the window, to its left side, and back: the walk meets itself again.
std::vector<Stand> WalkThrough(const simulation::Room& room, simulation::Random& random) {
  std::vector<Stand> corners;
  for (const auto& [approach_idx, share] :
       {std::pair{1, 1.0}, {1, 0.4}, {0, 0.6}, {0, 0.3}, {1, 0.5}, {1, 0.9}}) {
    const simulation::Approach& approach = room.approaches[approach_idx];
    const double nearest{approach.nearest}, farthest{approach.farthest};
    corners.push_back(
        simulation::FreeStand(room, approach, nearest + share * (farthest - nearest), random));
    corners.back().roll = 0;
  }
  std::vector<Stand> stands;
  for (std::size_t c = 0; c + 1 < corners.size(); ++c) {
    for (int i = 0; i < kFramesALeg; ++i) {
      stands.push_back(Between(corners[c], corners[c + 1], double(i) / kFramesALeg));
    }
  }
  return stands;
}

// A set of one walk before each of the museum's show windows.
ImageSet PhotographWindows(const TempFolder& folder) {
  const simulation::Building building(kSeed);
  ImageSet set;
  set.folder = set.source = folder.path();
  set.cameras.push_back({640, 480, 520, 519, 318.7, 241.2, {-0.11, 0.035, 0, 0}});
  const simulation::Renderer renderer(set.cameras[0]);
  for (const std::string name : {"show_window_1", "show_window_2"}) {
    const simulation::Room room = simulation::BuildRoom(building, name, kSeed);
    simulation::Random random(kSeed, name);
    for (const Stand& stand : WalkThrough(room, random)) {
      const auto exposure = simulation::DrawExposure(random, false);
      ImageRecord image;
      image.path = name + "_" + std::to_string(100 + set.images.size()) + ".jpg";
      image.capture = name;
      image.camera_idx = 0;
      folder.Write(image.path,
                   simulation::Develop(renderer.Render(room.scene, {}, simulation::PoseOf(stand),
                                                       exposure.illumination),
                                       exposure, random));
      set.images.push_back(image);
    }
  }
  return set;
}

struct PairCounts {
  int of_one_window = 0;  // far apart in its walk
  int of_both = 0;
};

PairCounts Count(const MapInput& input, const std::vector<VerifiedPair>& pairs) {
  const CaptureOrder order(input);
  PairCounts count;
  for (const VerifiedPair& pair : pairs) {
    const auto [a, b] = pair.frames;
    const bool of_both = input.frames[a].capture != input.frames[b].capture;
    count.of_both += of_both ? 1 : 0;
    count.of_one_window += !of_both && order.AreApart(a, b, 8) ? 1 : 0;
  }
  return count;
}

TEST(BelievedPairs, KeepBothShowWindowsOfTheMuseumApart) {
  const TempFolder folder;
  const ImageSet set = PhotographWindows(folder);
  std::vector<int> all;
  std::vector<FramePair> candidates;
  for (int i = 0; i < static_cast<int>(set.images.size()); ++i) {
    for (const int before : all) candidates.push_back({before, i});
    all.push_back(i);
  }
  std::sort(candidates.begin(), candidates.end());
  const FeatureStore features = ExtractFeatures(set, all, {}, 0, {});
  const MapInput input = MakeMapInput(set, features, all);
  const auto verified = VerifyPairs(input, candidates, {}, 0);
  const PairCounts before = Count(input, verified);
  ASSERT_GT(before.of_both, 100) << "they look alike no more: nothing is tested";
  const PairCounts after = Count(input, BelievedPairs(input, verified, {}));
  EXPECT_EQ(after.of_both, 0);
  EXPECT_GT(after.of_one_window, 0.8 * before.of_one_window);
}

}  // namespace
}  // namespace viewfix
