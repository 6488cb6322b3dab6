// SPDX-License-Identifier: BSD-3-Clause
#include "firmware_tools/mapping/missing_tracks.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <functional>
#include <random>
#include <string>

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

bool OneShelf(int column, int) { return column < 8; }

// One patch of the image, of 192, of which a shelf has 48, is missing.
bool EverywhereButAPatch(int column, int row) { return !(column / 2 == 1 && row / 2 == 5); }

bool OneShelfButAPatch(int column, int row) {
  return OneShelf(column, row) && EverywhereButAPatch(column, row);
}

bool APoster(int column, int row) { return column < 6 && row < 5; }

// Walks of 12 frames, each of which sees one grid of key points all along. What matches between
// the walks is up to the test.
class Walks {
 public:
  explicit Walks(int count = 2) {
    for (int row = 0; row < kDown; ++row) {
      for (int column = 0; column < kAcross; ++column) {
        features_.keypoints.push_back({.x = 10.0F + 20.0F * static_cast<float>(column),
                                       .y = 10.0F + 20.0F * static_cast<float>(row),
                                       .sigma = 4});
      }
    }
    input.cameras.push_back(
        {.width = 640, .height = 480, .fx = 500, .fy = 500, .cx = 319.5, .cy = 239.5});
    for (int f = 0; f < count * kFrames; ++f) {
      MapFrame& frame = input.frames.emplace_back();
      frame.capture = "walk " + std::to_string(1 + f / kFrames);
      frame.features = &features_;
      for (int before = std::max(f - 3, f / kFrames * kFrames); before < f; ++before) {
        AddPair(before, f, Everywhere);
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

  // Between the first frames of two walks, `count` of them each.
  void Link(int count, const Matches& matches, int first = 0, int second = 1) {
    for (int a = 0; a < count; ++a) {
      for (int b = 0; b < count; ++b) AddPair(first * kFrames + a, second * kFrames + b, matches);
    }
  }

  // Of four walks 0 and 3 show one place, 1 and 2 its look-alike.
  void ShowTwoPlaces() {
    Link(5, EverywhereButAPatch, 0, 3);
    Link(5, EverywhereButAPatch, 1, 2);
    Link(5, EachOtherShelf, 1, 3);
    Link(5, EachOtherShelf, 2, 3);
  }

  std::size_t Kept() const { return DropPairsMissingTracks(input, pairs).size(); }
  std::size_t KeptBetween(int first, int second) const {
    const auto kept = DropPairsMissingTracks(input, pairs);
    return std::count_if(kept.begin(), kept.end(), [&](const VerifiedPair& pair) {
      return pair.frames.first_idx / kFrames == first && pair.frames.second_idx / kFrames == second;
    });
  }

  MapInput input;
  std::vector<VerifiedPair> pairs;
  std::size_t in_order = 0;

 private:
  ImageFeatures features_;
};

TEST(DropPairsMissingTracks, APlaceSeenAgainMissesATrackHereAndThere) {
  Walks walks;
  std::mt19937 random(1);
  walks.Link(5, [&](int, int) { return random() % 3 > 0; });
  EXPECT_EQ(walks.Kept(), walks.pairs.size());
}

TEST(DropPairsMissingTracks, LookAlikesShareShelvesButNotAll) {
  Walks walks;
  walks.Link(5, EachOtherShelf);
  EXPECT_EQ(walks.Kept(), walks.in_order);
}

// All that walk 0 sees of the other place is a shelf that both have, with hardly a hole: what the
// others of its place say counts for it, too.
TEST(DropPairsMissingTracks, AWalkThatSeesWhatIsSharedGoesWithItsPlace) {
  Walks walks(4);
  walks.Link(5, OneShelfButAPatch, 0, 1);
  EXPECT_EQ(walks.Kept(), walks.pairs.size()) << "by itself it cannot be told";
  walks.ShowTwoPlaces();
  EXPECT_EQ(walks.KeptBetween(0, 1), 0U);
  EXPECT_EQ(walks.Kept(), walks.in_order + 50) << "those of each place";
}

// A few frames of two places share something without a hole: that puts no walks together.
TEST(DropPairsMissingTracks, AFewPairsPutNoWalksTogether) {
  Walks walks(4);
  walks.Link(3, OneShelf, 0, 1);
  walks.ShowTwoPlaces();
  EXPECT_EQ(walks.Kept(), walks.in_order + 50);
}

// What walks 0 and 1 show of look-alikes is not made good by a third that shares much with both.
TEST(DropPairsMissingTracks, TwoWalksThatAreToldApartStayApart) {
  Walks walks(3);
  walks.Link(4, EachOtherShelf, 0, 1);
  for (int a = 8; a < kFrames; ++a) {  // by itself this stretch cannot be told
    for (int b = 8; b < kFrames; ++b) walks.AddPair(a, kFrames + b, OneShelf);
  }
  walks.Link(9, Everywhere, 0, 2);
  walks.Link(9, Everywhere, 1, 2);
  EXPECT_EQ(walks.KeptBetween(0, 1), 0U);
}

// Many pairs of two long walks are told apart by little that they share: few holes in all of it say
// that the rest shows one place.
TEST(DropPairsMissingTracks, WhatWalksShareIsJudgedAsAWhole) {
  Walks walks(4);
  for (int f = 0; f < 4 * kFrames; ++f) {
    walks.input.frames[f].capture = f < 2 * kFrames ? "walk 1" : "walk 2";
  }
  walks.Link(
      6, [](int column, int row) { return row < 4 && EachOtherShelf(column, row); }, 0, 2);
  EXPECT_EQ(walks.Kept(), walks.in_order) << "by itself";
  walks.Link(8, Everywhere, 1, 3);
  EXPECT_EQ(walks.KeptBetween(0, 2), 0U) << "36 of 100 pairs";
  EXPECT_EQ(walks.KeptBetween(1, 3), 64U);
}

TEST(DropPairsMissingTracks, WhatIsTooSmallToBeFoundThereIsNotMissed) {
  Walks walks;
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
  Walks walks;
  walks.Link(2, APoster);
  EXPECT_EQ(walks.Kept(), walks.in_order);
}

TEST(DropPairsMissingTracks, ManyPairsOfLittleJoin) {
  Walks walks;
  walks.Link(2, APoster);
  for (int a = 4; a < kFrames; ++a) walks.AddPair(a, a + kFrames, APoster);
  EXPECT_EQ(walks.Kept(), walks.pairs.size());
}

TEST(DropPairsMissingTracks, PhotographsWithoutOrderStay) {
  Walks walks;
  for (MapFrame& frame : walks.input.frames) {
    frame.capture = std::to_string(&frame - walks.input.frames.data());
  }
  walks.Link(3, EachOtherShelf);
  EXPECT_EQ(walks.Kept(), walks.pairs.size()) << "nothing is known of what should be seen";
}

}  // namespace
}  // namespace viewfix
