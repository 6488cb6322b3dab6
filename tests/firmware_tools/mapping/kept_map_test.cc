// SPDX-License-Identifier: BSD-3-Clause
#include "firmware_tools/mapping/kept_map.h"

#include <gtest/gtest.h>

#include <functional>

#include "firmware_tools/mapping/triangulate.h"
#include "tests/firmware_tools/mapping/synthetic_scene.h"

namespace viewfix {
namespace {

class KeptMapTest : public ::testing::Test {
 protected:
  KeptMapTest() {
    for (int a = 0; a < 5; ++a) {
      for (int b = a + 1; b < 5; ++b) candidates_.push_back({a, b});
    }
    input_ = scene_.WithoutPoses();
    pairs_ = VerifyPairs(input_, candidates_, {}, 1);
    map_ = TriangulateWithPoses(scene_.input, pairs_, {}, 1);
    map_.images[1].motion.turn = {0.25, 0.5, 1};
    map_.images[1].readout = 0.125;
  }

  Hash256 Key() const { return MapKey(input_, candidates_, pairs_, options_); }

  std::vector<std::uint8_t> Bytes(const Reconstruction& map) const {
    ByteWriter writer;
    MapCodec().Save(map, writer);
    return writer.bytes();
  }

  // Whether bytes are taken for a map.
  static bool Loads(std::span<const std::uint8_t> bytes) {
    ByteReader reader(bytes);
    Reconstruction map;
    return MapCodec().Load(reader, map) && reader.AtEnd();
  }

  SyntheticScene scene_{{.num_frames = 5}};
  std::vector<FramePair> candidates_;
  MapInput input_;
  std::vector<VerifiedPair> pairs_;
  ColmapOptions options_;
  Reconstruction map_;
};

TEST_F(KeptMapTest, IsTheMapThatWasKept) {
  const auto bytes = Bytes(map_);
  ByteReader reader(bytes);
  Reconstruction kept;
  ASSERT_TRUE(MapCodec().Load(reader, kept));
  EXPECT_TRUE(reader.AtEnd());
  EXPECT_EQ(Bytes(kept), bytes);
  EXPECT_EQ(kept.cameras, map_.cameras);
  ASSERT_EQ(kept.images.size(), 5U);
  EXPECT_EQ(kept.images[3].name, map_.images[3].name);
  EXPECT_EQ(kept.images[1].motion.turn, map_.images[1].motion.turn);
  EXPECT_EQ(kept.images[1].readout, 0.125);
  EXPECT_EQ(kept.images[2].keypoints, map_.images[2].keypoints);
  EXPECT_EQ(kept.points.back().track, map_.points.back().track);
}

TEST_F(KeptMapTest, CutBytesAreNone) {
  const auto bytes = Bytes(map_);
  ASSERT_TRUE(Loads(bytes));
  for (std::size_t size = 0; size < bytes.size(); size += 97) {
    EXPECT_FALSE(Loads(std::span(bytes).first(size))) << size;
  }
}

TEST_F(KeptMapTest, IndicesOutOfRangeAreRefused) {
  const std::vector<std::function<void(Reconstruction&)>> faults = {
      [](Reconstruction& m) { m.images[0].camera_idx = 1; },
      [](Reconstruction& m) { m.images[0].camera_idx = -1; },
      [](Reconstruction& m) { m.images[0].point_idx[0] = static_cast<int>(m.points.size()); },
      [](Reconstruction& m) { m.images[0].point_idx[0] = -2; },
      [](Reconstruction& m) { m.points[0].track[0].image_idx = 5; },
      [](Reconstruction& m) { m.points[0].track[0].feature_idx = 1 << 20; },
  };
  for (std::size_t f = 0; f < faults.size(); ++f) {
    Reconstruction map = map_;
    faults[f](map);
    EXPECT_FALSE(Loads(Bytes(map))) << f;
  }
}

TEST_F(KeptMapTest, WhateverDecidesAMapIsInItsKey) {
  const Hash256 key = Key();
  EXPECT_EQ(Key(), key);
  const std::vector<std::function<void()>> changes = {
      [&] { input_.frames[4].name = "another.jpg"; },
      [&] { input_.frames[4].capture = "another walk"; },
      [&] { input_.frames[4].time += 1; },
      [&] { input_.frames[4].readout += 1; },
      [&] { input_.cameras[0].fx += 1; },
      [&] { input_.cameras[0].distortion[1] += 1; },
      [&] { scene_.features[2]->keypoints[5].x += 1; },
      [&] { scene_.features[2]->descriptors[5] ^= 1; },
      [&] { candidates_.pop_back(); },
      [&] { pairs_[0].matches.pop_back(); },
      [&] { ++pairs_[0].matches[0].second_idx; },
      [&] { ++pairs_[0].matches[0].distance2; },
      [&] { pairs_[0].median_angle_deg += 1; },
      [&] { pairs_[0].second_from_first.translation.x() += 1; },
      [&] { pairs_.pop_back(); },
      [&] { options_.seed = 2; },
      [&] { options_.refine_focal = true; },
      [&] { options_.program = "another"; },
      [&] { options_.max_trials = 9; },
  };
  Hash256 before = key;
  for (std::size_t c = 0; c < changes.size(); ++c) {
    changes[c]();
    EXPECT_NE(Key(), before) << c;
    before = Key();
  }
}

// What loops are depends on how far apart frames stand in their walk, whatever stands between them.
TEST_F(KeptMapTest, AFrameThatIsAddedToTheWalkIsInItsKey) {
  const Hash256 key = Key();
  const ImageFeatures none;
  MapFrame other = input_.frames[0];
  other.features = &none;
  input_.frames.insert(input_.frames.begin() + 2, other);
  const auto moved = [](FramePair pair) {
    return FramePair{pair.first_idx + (pair.first_idx >= 2 ? 1 : 0),
                     pair.second_idx + (pair.second_idx >= 2 ? 1 : 0)};
  };
  for (FramePair& pair : candidates_) pair = moved(pair);
  for (VerifiedPair& pair : pairs_) pair.frames = moved(pair.frames);
  EXPECT_NE(Key(), key);
}

// Poses that are known, where the map stands among others, and the folder say nothing.
TEST_F(KeptMapTest, WhatDoesNotDecideItIsNotInItsKey) {
  const Hash256 key = Key();
  options_.work_folder = "elsewhere";
  input_.frames[0].cam_from_world = Rigid3();
  EXPECT_EQ(Key(), key);
  const ImageFeatures none;
  MapFrame other = input_.frames[0];
  other.features = &none;
  other.capture = "another walk";
  input_.frames.insert(input_.frames.begin(), other);
  for (FramePair& pair : candidates_) pair = {pair.first_idx + 1, pair.second_idx + 1};
  for (VerifiedPair& pair : pairs_) {
    pair.frames = {pair.frames.first_idx + 1, pair.frames.second_idx + 1};
  }
  EXPECT_EQ(Key(), key);
}

}  // namespace
}  // namespace viewfix
