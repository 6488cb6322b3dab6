// SPDX-License-Identifier: BSD-3-Clause
#include "firmware_tools/mapping/look_alikes.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <memory>

namespace viewfix {
namespace {

// A walk of 40 frames. Each has the same 16 x 12 grid of key points, which match between
// neighbours; how frames 0..4 match frames 30..34 is up to the test.
class Walk {
 public:
  Walk() {
    features_.width = 640;
    features_.height = 480;
    for (int i = 0; i < 16 * 12; ++i) {
      features_.keypoints.push_back({.x = 20.0F + 40.0F * static_cast<float>(i % 16),
                                     .y = 20.0F + 40.0F * static_cast<float>(i / 16)});
    }
    input.cameras.push_back(
        {.width = 640, .height = 480, .fx = 500, .fy = 500, .cx = 319.5, .cy = 239.5});
    for (int f = 0; f < 40; ++f) {
      MapFrame& frame = input.frames.emplace_back();
      frame.capture = "walk";
      frame.features = &features_;
    }
    for (int a = 0; a < 40; ++a) {
      for (int b = a + 1; b < 40 && b <= a + 3; ++b) AddPair(a, b, 640, 480);
    }
  }

  // Matches key points of the middle of the image, `width` x `height` pixels of it.
  void AddPair(int a, int b, float width, float height) {
    VerifiedPair pair{{a, b}, {}, {}, 5};
    for (int i = 0; i < 16 * 12; ++i) {
      const Keypoint& keypoint = features_.keypoints[i];
      if (std::abs(keypoint.x - 320) > width / 2 || std::abs(keypoint.y - 240) > height / 2)
        continue;
      pair.matches.push_back({i, i, 0});
    }
    pairs.push_back(std::move(pair));
  }

  void AddFarPairs(float width, float height) {
    for (int a = 0; a < 5; ++a) {
      for (int b = 30; b < 35; ++b) AddPair(a, b, width, height);
    }
  }

  MapInput input;
  std::vector<VerifiedPair> pairs;

 private:
  ImageFeatures features_;
};

TEST(DropLookAlikes, KeepsAPlaceSeenAgain) {
  Walk walk;
  walk.AddFarPairs(500, 400);
  EXPECT_EQ(DropLookAlikes(walk.input, walk.pairs).size(), walk.pairs.size());
}

TEST(DropLookAlikes, DropsEqualWindowsInDifferentWalls) {
  Walk walk;
  const std::size_t in_order = walk.pairs.size();
  walk.AddFarPairs(280, 160);
  EXPECT_EQ(DropLookAlikes(walk.input, walk.pairs).size(), in_order);
}

TEST(DropLookAlikes, FramesThatSeeMoreSpeakForThoseFilledByTheWindow) {
  Walk walk;
  const std::size_t in_order = walk.pairs.size();
  walk.AddFarPairs(280, 160);
  walk.AddPair(5, 35, 640, 480);
  EXPECT_EQ(DropLookAlikes(walk.input, walk.pairs).size(), in_order);
}

}  // namespace
}  // namespace viewfix
