// SPDX-License-Identifier: BSD-3-Clause
#include "firmware_tools/training/labels.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <numeric>

namespace viewfix {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

Eigen::MatrixXf GramOf(const Eigen::MatrixXf& rows) { return rows * rows.transpose(); }

std::vector<int> AllOf(const ImageSet& set) {
  std::vector<int> idxs(set.images.size());
  std::iota(idxs.begin(), idxs.end(), 0);
  return idxs;
}

ImageRecord Labelled(const std::string& location, const std::string& view) {
  ImageRecord image;
  image.location = location;
  image.view = view;
  return image;
}

// A camera held upright (y down = world -z) that looks along `heading`.
ImageRecord Posed(double x, double y, double heading) {
  ImageRecord image;
  Eigen::Matrix3d world_from_cam;
  const Eigen::Vector3d forward(std::cos(heading), std::sin(heading), 0);
  const Eigen::Vector3d down(0, 0, -1);
  world_from_cam << down.cross(forward), down, forward;
  image.pose = Pose{Eigen::Quaterniond(world_from_cam), {x, y, 1.6}};
  return image;
}

TEST(CutIntoRuns, FindsTheCuts) {
  Eigen::MatrixXf rows(7, 2);
  rows << 1, 0, 1, 0, 0, 1, 0, 1, 0, 1, -1, 0, -1, 0;
  const std::vector<int> order = {0, 1, 2, 3, 4, 5, 6};
  EXPECT_THAT(CutIntoRuns(GramOf(rows), order, 3), ElementsAre(0, 0, 1, 1, 1, 2, 2));
}

TEST(CutIntoRuns, OneRunAndRunsOfOne) {
  const Eigen::MatrixXf gram = GramOf(Eigen::MatrixXf::Random(4, 3));
  const std::vector<int> order = {3, 1, 2, 0};
  EXPECT_THAT(CutIntoRuns(gram, order, 1), ElementsAre(0, 0, 0, 0));
  EXPECT_THAT(CutIntoRuns(gram, order, 4), ElementsAre(0, 1, 2, 3));
}

// Against every possible pair of cuts.
TEST(CutIntoRuns, IsOptimal) {
  const int n = 9;
  const Eigen::MatrixXf rows = Eigen::MatrixXf::Random(n, 4);
  const auto scatter = [&](const std::vector<int>& run) {
    double sum = 0;
    for (int r = 0; r < 3; ++r) {
      Eigen::RowVectorXf mean = Eigen::RowVectorXf::Zero(4);
      float count = 0;
      for (int i = 0; i < n; ++i) {
        if (run[i] == r) mean += rows.row(i), count += 1;
      }
      mean /= count;
      for (int i = 0; i < n; ++i) {
        if (run[i] == r) sum += double{(rows.row(i) - mean).squaredNorm()};
      }
    }
    return sum;
  };
  double best = 1e300;
  for (int a = 1; a < n - 1; ++a) {
    for (int b = a + 1; b < n; ++b) {
      std::vector<int> run(n);
      for (int i = 0; i < n; ++i) run[i] = i < a ? 0 : i < b ? 1 : 2;
      best = std::min(best, scatter(run));
    }
  }
  std::vector<int> order(n);
  std::iota(order.begin(), order.end(), 0);
  EXPECT_NEAR(scatter(CutIntoRuns(GramOf(rows), order, 3)), best, 1e-4);
}

TEST(MakeLabels, TakesLabelsThatAreGiven) {
  ImageSet set;
  set.images = {Labelled("lobby", "right"), Labelled("cafe", "left"), Labelled("lobby", "left")};
  const Labels labels = MakeLabels(set, AllOf(set), Eigen::MatrixXf::Identity(3, 3), {});
  EXPECT_THAT(labels.locations, ElementsAre("cafe", "lobby"));
  EXPECT_THAT(labels.views, ElementsAre("left", "right"));
  EXPECT_THAT(labels.location, ElementsAre(1, 0, 1));
  EXPECT_THAT(labels.pair_location, ElementsAre(0, 1, 1));
  EXPECT_THAT(labels.pair_view, ElementsAre(0, 0, 1));
  EXPECT_THAT(labels.pair, ElementsAre(2, 0, 1));
  EXPECT_TRUE(labels.global_views);
}

TEST(MakeLabels, ViewsByOrderAreLocalToALocation) {
  ImageSet set;
  for (int i = 0; i < 16; ++i) set.images.push_back(Labelled("a", ""));
  for (int i = 0; i < 8; ++i) set.images.push_back(Labelled("b", ""));
  LabelOptions options;
  options.images_per_view = 8;
  const Labels labels =
      MakeLabels(set, AllOf(set), GramOf(Eigen::MatrixXf::Random(24, 5)), options);
  EXPECT_FALSE(labels.global_views);
  EXPECT_EQ(labels.view_source, "order");
  EXPECT_THAT(labels.pair_location, ElementsAre(0, 0, 1));
}

TEST(MakeLabels, ACountOfViewsIsKept) {
  ImageSet set;
  for (int i = 0; i < 12; ++i) set.images.push_back(Labelled(i < 6 ? "a" : "b", "seen"));
  LabelOptions options;
  options.views = LabelOptions::Views::kCount;
  options.view_count = 3;
  const Labels labels =
      MakeLabels(set, AllOf(set), GramOf(Eigen::MatrixXf::Random(12, 5)), options);
  EXPECT_EQ(labels.num_pairs(), 6);
}

TEST(MakeLabels, HeadingsAndCellsFromPoses) {
  ImageSet set;
  for (int cell = 0; cell < 2; ++cell) {
    for (int sector = 0; sector < 4; ++sector) {
      const double heading = sector * std::numbers::pi / 2 + 0.1;
      set.images.push_back(Posed(10.0 * cell, 0, heading));
      set.images.push_back(Posed(10.0 * cell, 0.1, heading - 0.2));
    }
  }
  const Labels labels = MakeLabels(set, AllOf(set), Eigen::MatrixXf::Identity(16, 16), {});
  EXPECT_EQ(labels.locations.size(), 2U);
  EXPECT_EQ(labels.views.size(), 4U);
  EXPECT_EQ(labels.num_pairs(), 8);
  EXPECT_TRUE(labels.global_views);
  for (int s = 0; s < 16; s += 2) EXPECT_EQ(labels.pair[s], labels.pair[s + 1]) << s;
}

TEST(MakeLabels, NothingToGoByIsAnError) {
  ImageSet set;
  set.source = "walk/images.csv";
  set.images.resize(3);
  EXPECT_FALSE(HasPlace(set, set.images[0]));
  try {
    (void)MakeLabels(set, {}, Eigen::MatrixXf(0, 0), {});
    FAIL();
  } catch (const ToolError& error) {
    EXPECT_THAT(error.what(), HasSubstr("walk/images.csv"));
    EXPECT_THAT(error.what(), HasSubstr("location"));
  }
}

TEST(MakeLabels, ViewsAskedForByLabelMustBeThere) {
  ImageSet set;
  set.images = {Labelled("a", "left"), Labelled("b", "")};
  LabelOptions options;
  options.views = LabelOptions::Views::kLabels;
  EXPECT_THROW((void)MakeLabels(set, AllOf(set), Eigen::MatrixXf::Identity(2, 2), options),
               ToolError);
}

}  // namespace
}  // namespace viewfix
