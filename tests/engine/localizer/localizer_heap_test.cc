// SPDX-License-Identifier: BSD-3-Clause
// Localize() allocates nothing.
#include <gtest/gtest.h>

#include "engine/localizer.h"
#include "tests/testing/allocation_counter.h"
#include "tests/testing/landmark_site.h"
#include "tests/testing/tiny_model.h"

namespace viewfix {
namespace {

TEST(LocalizerHeap, LocalizingAllocatesNothing) {
  const LandmarkSite site = MakeLandmarkSite();
  const auto file = *WriteModel(site.data);
  Localizer localizer = std::move(*Localizer::Create(*ModelView::Open(file), {}));
  const Rigid3 right = Inverse(site.world_from_cam);
  Rigid3 wrong = right;
  wrong.translation.x() += 7;
  const std::vector<std::uint8_t> plain(site.pixels.size(), 100);
  const ImageView whole = {site.pixels.data(), site.width, site.height, site.width};
  const ImageView strip = {site.pixels.data(), site.width, 170, site.width};
  // The first frames may be the largest of all kinds, or not.
  for (int round = 0; round < 2; ++round) {
    const int before = AllocationsSoFar();
    const bool alone = localizer.Localize(whole)->has_pose;
    const bool tracked =
        localizer.Localize(whole, {.camera = &site.camera, .cam_from_world = &right})->has_pose;
    const bool lost = localizer.Localize(whole, {.cam_from_world = &wrong})->has_pose;
    const bool focal = localizer.Localize(strip)->has_pose;
    const bool empty =
        localizer.Localize({plain.data(), site.width, site.height, site.width})->has_pose;
    EXPECT_EQ(AllocationsSoFar(), before) << "round " << round;
    EXPECT_TRUE(alone && tracked && lost && focal);
    EXPECT_FALSE(empty);
  }
}

TEST(LocalizerHeap, DetailsAllocateNothing) {
  const LandmarkSite site = MakeLandmarkSite();
  ModelData data = TinyModelData();
  AddTinyDetails(data);
  const auto file = *WriteModel(data);
  Localizer localizer = std::move(*Localizer::Create(*ModelView::Open(file), {}));
  const ImageView whole = {site.pixels.data(), site.width, site.height, site.width};
  const int before = AllocationsSoFar();
  for (int round = 0; round < 2; ++round) EXPECT_GE(localizer.Localize(whole)->location_idx, 0);
  EXPECT_EQ(AllocationsSoFar(), before);
}

TEST(LocalizerHeap, TheWindowAllocatesNothing) {
  const LandmarkSite site = MakeLandmarkSite();
  const auto file = *WriteModel(site.data);
  LocalizerOptions options;
  options.window = 3;
  Localizer localizer = std::move(*Localizer::Create(*ModelView::Open(file), options));
  const ImageView whole = {site.pixels.data(), site.width, site.height, site.width};
  const int before = AllocationsSoFar();
  bool all_found = true;
  for (const std::uint64_t sequence : {0, 1, 2, 3, 4, 4, 2, 900}) {  // in order and not
    const auto fix = localizer.Localize(whole, {.sequence = sequence});
    all_found = all_found && fix->has_pose &&
                (fix->world_from_cam.translation - site.world_from_cam.translation).norm() < 0.01;
  }
  EXPECT_EQ(AllocationsSoFar(), before);
  EXPECT_TRUE(all_found);
}

}  // namespace
}  // namespace viewfix
