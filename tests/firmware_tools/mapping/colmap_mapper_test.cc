// SPDX-License-Identifier: BSD-3-Clause
#include "firmware_tools/mapping/colmap_mapper.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sqlite3.h>

#include <filesystem>
#include <fstream>

#include "firmware_tools/dataset/tool_file.h"
#include "firmware_tools/mapping/colmap_database.h"
#include "firmware_tools/mapping/sfm.h"
#include "tests/firmware_tools/mapping/synthetic_scene.h"
#include "tests/testing/temp_folder.h"

namespace viewfix {
namespace {

namespace fs = std::filesystem;
using ::testing::AllOf;
using ::testing::HasSubstr;

std::vector<FramePair> PairsInOrder(int num_frames, int window) {
  std::vector<FramePair> pairs;
  for (int a = 0; a < num_frames; ++a) {
    for (int b = a + 1; b < num_frames && b <= a + window; ++b) pairs.push_back({a, b});
  }
  return pairs;
}

// A scene, a work folder, and a program in COLMAP's place.
class ColmapMapper : public ::testing::Test {
 protected:
  ColmapMapper()
      : scene_({.num_frames = 6, .num_points = 150}),
        input_(scene_.WithoutPoses()),
        pairs_(VerifyPairs(input_, PairsInOrder(6, 3), {}, 1)) {
    options_.work_folder = folder_ / "work";
    options_.max_trials = 1;
  }

  void InPlaceOfColmap(const std::string& script) {
    options_.program = folder_.Write("colmap", std::string("#!/bin/sh\n") + kCreator + script);
    fs::permissions(options_.program, fs::perms::owner_all);
  }

  std::string Failure() {
    try {
      static_cast<void>(RunColmapMapper(input_, pairs_, options_, 1));
    } catch (const ToolError& error) {
      return error.what();
    }
    return "none";
  }

  // Tables as `colmap database_creator` makes them.
  static constexpr const char* kCreator =
      "if [ $1 = database_creator ]; then cp \"$(dirname $0)/empty.db\" $3; exit; fi\n";

  void MakeEmptyDatabase() {
    sqlite3* db = nullptr;
    ASSERT_EQ(sqlite3_open((folder_ / "empty.db").c_str(), &db), SQLITE_OK);
    const char* sql =
        "CREATE TABLE cameras (camera_id INTEGER PRIMARY KEY, model, width, height, params BLOB,"
        " prior_focal_length);"
        "CREATE TABLE images (image_id INTEGER PRIMARY KEY, name TEXT, camera_id);"
        "CREATE TABLE keypoints (image_id INTEGER PRIMARY KEY, rows, cols, data BLOB);"
        "CREATE TABLE two_view_geometries (pair_id INTEGER PRIMARY KEY, rows, cols, data BLOB,"
        " config, F BLOB, E BLOB, H BLOB, qvec BLOB, tvec BLOB);";
    ASSERT_EQ(sqlite3_exec(db, sql, nullptr, nullptr, nullptr), SQLITE_OK);
    sqlite3_close(db);
  }

  TempFolder folder_;
  SyntheticScene scene_;
  MapInput input_;
  std::vector<VerifiedPair> pairs_;
  ColmapOptions options_;
};

TEST_F(ColmapMapper, SaysThatTheProgramIsMissing) {
  options_.program = "no-such-colmap";
  EXPECT_THAT(Failure(), HasSubstr("no-such-colmap: not found"));
}

TEST_F(ColmapMapper, QuotesTheLogOfAFailure) {
  MakeEmptyDatabase();
  InPlaceOfColmap("echo 'the sky is falling' >&2; exit 3\n");
  EXPECT_THAT(Failure(), AllOf(HasSubstr("exit code 3"), HasSubstr("the sky is falling"),
                               HasSubstr("colmap.log")));
}

TEST_F(ColmapMapper, GoesOnAfterBeingKilled) {
  MakeEmptyDatabase();
  InPlaceOfColmap("kill -9 $$\n");
  EXPECT_THAT(Failure(), HasSubstr("signal"));
  EXPECT_TRUE(fs::exists(options_.work_folder / "database.db"));
  // The same folder, now with a program that cannot begin: the database is not made again.
  fs::remove(folder_ / "empty.db");
  InPlaceOfColmap("echo 'ERROR: failed to create sparse model'; exit 1\n");
  EXPECT_FALSE(RunColmapMapper(input_, pairs_, options_, 1).has_value());
}

TEST_F(ColmapMapper, EndsTheProgramWhenInterrupted) {
  MakeEmptyDatabase();
  InPlaceOfColmap(
      "echo $$ > \"$(dirname $0)/pid\"\necho 'Registering image #2 (3)'\nexec sleep 60\n");
  const auto interrupt = [](int done, int /*total*/) {
    if (done == 3) throw ToolError("interrupted");
  };
  EXPECT_THROW(static_cast<void>(RunColmapMapper(input_, pairs_, options_, 1, interrupt)),
               ToolError);
  std::string pid = ReadTextFile(folder_ / "pid");
  pid.pop_back();
  EXPECT_FALSE(fs::exists("/proc/" + pid));
}

TEST_F(ColmapMapper, ReportsRegisteredFrames) {
  MakeEmptyDatabase();
  InPlaceOfColmap(
      "echo 'Registering image #2 (3)'\necho 'ERROR: failed to create sparse model'; exit 1\n");
  std::vector<int> seen;
  EXPECT_FALSE(RunColmapMapper(input_, pairs_, options_, 1, [&](int done, int total) {
                 EXPECT_EQ(total, 6);
                 seen.push_back(done);
               }).has_value());
  EXPECT_THAT(seen, ::testing::Contains(3));
}

TEST_F(ColmapMapper, WritesPixelsWithCentresAtHalves) {
  MakeEmptyDatabase();
  const fs::path file = folder_ / "empty.db";
  WriteColmapDatabase(input_, pairs_, file);
  sqlite3* db = nullptr;
  ASSERT_EQ(sqlite3_open(file.c_str(), &db), SQLITE_OK);
  sqlite3_stmt* row = nullptr;
  const char* sql =
      "SELECT k.data, c.params, (SELECT COUNT(*) FROM two_view_geometries), "
      "(SELECT MIN(pair_id) FROM two_view_geometries) FROM keypoints k, cameras c "
      "WHERE k.image_id = 1";
  ASSERT_EQ(sqlite3_prepare_v2(db, sql, -1, &row, nullptr), SQLITE_OK);
  ASSERT_EQ(sqlite3_step(row), SQLITE_ROW);
  const auto* pixels = static_cast<const float*>(sqlite3_column_blob(row, 0));
  EXPECT_FLOAT_EQ(pixels[0], input_.frames[0].features->keypoints[0].x + 0.5F);
  EXPECT_FLOAT_EQ(pixels[1], input_.frames[0].features->keypoints[0].y + 0.5F);
  const auto* params = static_cast<const double*>(sqlite3_column_blob(row, 1));
  EXPECT_DOUBLE_EQ(params[2], input_.cameras[0].cx + 0.5);
  EXPECT_EQ(sqlite3_column_int(row, 2), static_cast<int>(pairs_.size()));
  EXPECT_EQ(sqlite3_column_int64(row, 3), 1 * 2147483647LL + 2);
  sqlite3_finalize(row);
  sqlite3_close(db);
}

TEST_F(ColmapMapper, BeginsWithManyMatchesAndWideAngles) {
  std::vector<VerifiedPair> pairs(3);
  pairs[0] = {{0, 1}, std::vector<FeatureMatch>(300), {}, 1.0};
  pairs[1] = {{1, 2}, std::vector<FeatureMatch>(100), {}, 10.0};
  pairs[2] = {{3, 4}, std::vector<FeatureMatch>(200), {}, 8.0};
  EXPECT_THAT(ChooseInitialPairs(pairs, 5),
              ::testing::ElementsAre(FramePair{3, 4}, FramePair{1, 2}));
}

TEST_F(ColmapMapper, CountsMatchesOfLoopsThatAMapContradicts) {
  Reconstruction map;
  map.cameras = input_.cameras;
  for (int f = 0; f < 6; ++f) {
    map.images.push_back({.name = input_.frames[f].name,
                          .camera_idx = input_.frames[f].camera_idx,
                          .cam_from_world = scene_.cam_from_world[f],
                          .keypoints = {},
                          .point_idx = {}});
  }
  map.images.back().cam_from_world.translation.y() += 0.5;
  EXPECT_EQ(OpenLoopShare(input_, pairs_, map), 0);  // one walk, no loop
  input_.frames.back().capture = "another walk";
  EXPECT_GT(OpenLoopShare(input_, pairs_, map), 0.8);
  map.images.back().cam_from_world = scene_.cam_from_world[5];
  EXPECT_LT(OpenLoopShare(input_, pairs_, map), 0.01);
  map.images.pop_back();  // what is not in the map says nothing
  EXPECT_EQ(OpenLoopShare(input_, pairs_, map), 0);
}

// The whole way with the real program, where it is installed.
TEST_F(ColmapMapper, MapsASceneFromScratch) {
  if (std::string(COLMAP).empty()) GTEST_SKIP() << "colmap is not installed";
  options_.program = COLMAP;
  SfmOptions options;
  options.colmap = options_;
  options.min_frames = 3;
  StageCache first_run(folder_ / "stages");
  options.cache = &first_run;
  const SfmResult result = MapPhotographs(input_, PairsInOrder(6, 3), pairs_, options, 1);
  ASSERT_EQ(result.maps.size(), 1);
  const Reconstruction& map = result.maps[0];
  ASSERT_EQ(map.images.size(), 6);
  EXPECT_LT(Summarize(map).mean_error_px, 0.6);
  // Up to a similarity: ratios of distances between cameras.
  const auto distance = [](const Rigid3& a, const Rigid3& b) {
    return (Inverse(a).translation - Inverse(b).translation).norm();
  };
  const double scale = distance(map.images[0].cam_from_world, map.images[5].cam_from_world) /
                       distance(scene_.cam_from_world[0], scene_.cam_from_world[5]);
  for (int i = 1; i < 6; ++i) {
    EXPECT_NEAR(distance(map.images[0].cam_from_world, map.images[i].cam_from_world),
                scale * distance(scene_.cam_from_world[0], scene_.cam_from_world[i]), 0.02 * scale);
  }
  // A second run takes what the first kept, and needs no COLMAP.
  StageCache second_run(folder_ / "stages");
  options.cache = &second_run;
  fs::remove_all(options_.work_folder);
  const SfmResult again = MapPhotographs(input_, PairsInOrder(6, 3), pairs_, options, 1);
  EXPECT_EQ(second_run.Report(), std::vector<std::string>{"maps: 1 of 1 kept"});
  ASSERT_EQ(again.maps.size(), 1);
  ASSERT_EQ(again.maps[0].images.size(), 6);
  EXPECT_EQ(again.maps[0].images[5].cam_from_world.translation,
            map.images[5].cam_from_world.translation);
  EXPECT_EQ(again.maps[0].points.size(), map.points.size());
  EXPECT_FALSE(fs::exists(options_.work_folder));
}

}  // namespace
}  // namespace viewfix
