// SPDX-License-Identifier: BSD-3-Clause
#include "firmware_tools/mapping/missing_tracks.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <functional>
#include <random>

namespace viewfix {
namespace {

constexpr int kAcross = 32;
constexpr int kDown = 24;
constexpr int kFrames = 12;

// Which key points match: column and row of a grid.
using Matches = std::function<bool(int column, int row)>;

bool Everywhere(int, int) { return true; }

// Shelves 8 key points wide, of which each other holds something else.
bool EachOtherShelf(int column, int) { return column / 8 % 2 == 0; }

bool APoster(int column, int row) { return column < 6 && row < 5; }

// Two walks of 12 frames, each of which sees one grid of key points all along. What matches
// between the walks is up to the test.
class TwoWalks {
 public:
  TwoWalks() {
    for (int row = 0; row < kDown; ++row) {
      for (int column = 0; column < kAcross; ++column) {
        features_.keypoints.push_back({.x = 10.0F + 20.0F * static_cast<float>(column),
                                       .y = 10.0F + 20.0F * static_cast<float>(row),
                                       .sigma = 4});
      }
    }
    input.cameras.push_back(
        {.width = 640, .height = 480, .fx = 500, .fy = 500, .cx = 319.5, .cy = 239.5});
    for (int f = 0; f < 2 * kFrames; ++f) {
      MapFrame& frame = input.frames.emplace_back();
      frame.capture = f < kFrames ? "walk 1" : "walk 2";
      frame.features = &features_;
    }
    for (int f = 0; f < 2 * kFrames; ++f) {
      for (int next = f + 1; next < f + 4 && next < (f < kFrames ? kFrames : 2 * kFrames); ++next) {
        AddPair(f, next, Everywhere);
      }
    }
    in_order = pairs.size();
  }

  void AddPair(int a, int b, const Matches& matches) {
    VerifiedPair pair{{a, b}, {}, {}, 5};
    for (int i = 0; i < kAcross * kDown; ++i) {
      if (matches(i % kAcross, i / kAcross)) pair.matches.push_back({i, i, 0});
    }
    pairs.push_back(std::move(pair));
  }

  // Between the first frames of the walks, `count` of them each.
  void Link(int count, const Matches& matches) {
    for (int a = 0; a < count; ++a) {
      for (int b = kFrames; b < kFrames + count; ++b) AddPair(a, b, matches);
    }
  }

  std::size_t Kept() const { return DropPairsMissingTracks(input, pairs).size(); }

  MapInput input;
  std::vector<VerifiedPair> pairs;
  std::size_t in_order = 0;

 private:
  ImageFeatures features_;
};

TEST(DropPairsMissingTracks, APlaceSeenAgainMissesATrackHereAndThere) {
  TwoWalks walks;
  std::mt19937 random(1);
  walks.Link(5, [&](int, int) { return random() % 3 > 0; });
  EXPECT_EQ(walks.Kept(), walks.pairs.size());
}

TEST(DropPairsMissingTracks, LookAlikesShareShelvesButNotAll) {
  TwoWalks walks;
  walks.Link(5, EachOtherShelf);
  EXPECT_EQ(walks.Kept(), walks.in_order);
}

TEST(DropPairsMissingTracks, WhatIsTooSmallToBeFoundThereIsNotMissed) {
  TwoWalks walks;
  walks.Link(5, EachOtherShelf);
  ImageFeatures far_off = *walks.input.frames.back().features;
  for (Keypoint& keypoint : far_off.keypoints) keypoint.sigma = 2;
  for (int f = kFrames; f < 2 * kFrames; ++f) walks.input.frames[f].features = &far_off;
  // Seen from afar all is half as large: now only that side's tracks have chances.
  EXPECT_EQ(walks.Kept(), walks.in_order);
  for (MapFrame& frame : walks.input.frames) frame.features = &far_off;
  EXPECT_EQ(walks.Kept(), walks.pairs.size());
}

TEST(DropPairsMissingTracks, APosterJoinsNoWalks) {
  TwoWalks walks;
  walks.Link(2, APoster);
  EXPECT_EQ(walks.Kept(), walks.in_order);
}

TEST(DropPairsMissingTracks, ManyPairsOfLittleJoin) {
  TwoWalks walks;
  walks.Link(2, APoster);
  for (int a = 4; a < kFrames; ++a) walks.AddPair(a, a + kFrames, APoster);
  EXPECT_EQ(walks.Kept(), walks.pairs.size());
}

TEST(DropPairsMissingTracks, PhotographsWithoutOrderStay) {
  TwoWalks walks;
  for (MapFrame& frame : walks.input.frames) {
    frame.capture = std::to_string(&frame - walks.input.frames.data());
  }
  walks.Link(3, EachOtherShelf);
  EXPECT_EQ(walks.Kept(), walks.pairs.size()) << "nothing is known of what should be seen";
}

}  // namespace
}  // namespace viewfix
