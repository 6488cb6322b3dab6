// SPDX-License-Identifier: BSD-3-Clause
#include "firmware_tools/mapping/floor_plan.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Core>
#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>

#include "firmware_tools/dataset/image_set.h"
#include "models/model_view.h"
#include "tests/testing/temp_folder.h"

namespace viewfix {
namespace {

using ::testing::HasSubstr;

class FloorPlanTest : public ::testing::Test {
 protected:
  // Noise, which no format makes small.
  std::string Picture(const std::string& name, int width, int height) {
    cv::Mat picture(height, width, CV_8UC3);
    cv::setRNGSeed(1);
    cv::randu(picture, 0, 256);
    cv::imwrite(folder_ / name, picture);
    return folder_ / name;
  }

  std::string Align(const std::string& rows) {
    return folder_.Write("align.csv", std::string_view("px,py,x,y\n" + rows));
  }

  void ExpectRefused(const std::string& picture, const std::string& align,
                     const std::string& words) {
    try {
      (void)ReadFloorPlan(picture, align);
      ADD_FAILURE() << "not refused: " << words;
    } catch (const ToolError& error) {
      EXPECT_THAT(error.what(), HasSubstr(words));
    }
  }

  TempFolder folder_;
};

Eigen::Vector2d OnSite(const FloorPlan& plan, double px, double py) {
  const auto& [a, b, tx, ty] = plan.site_from_pixel;
  return {a * px + b * py + tx, b * px - a * py + ty};
}

TEST_F(FloorPlanTest, TwoPointsAlignIt) {
  // 0.1 m a pixel; the picture's right is the site's north.
  const FloorPlan plan =
      ReadFloorPlan(Picture("plan.png", 40, 30), Align("10,10,5,7\n30,10,5,9\n"));
  EXPECT_EQ(plan.width, 40);
  EXPECT_LT(plan.rms_metres, 1e-9);
  EXPECT_LT((OnSite(plan, 30, 10) - Eigen::Vector2d(5, 9)).norm(), 1e-9);
  EXPECT_LT((OnSite(plan, 10, 20) - Eigen::Vector2d(6, 7)).norm(), 1e-9) << "down is east";
}

TEST_F(FloorPlanTest, MorePointsAreAveraged) {
  const FloorPlan plan = ReadFloorPlan(Picture("plan.jpg", 40, 30),
                                       Align("0,0,0,0\n10,0,10.1,0\n0,10,0,-9.9\n10,10,10,-10\n"));
  EXPECT_GT(plan.rms_metres, 0.01);
  EXPECT_LT(plan.rms_metres, 0.1);
}

TEST_F(FloorPlanTest, LargePicturesAreShrunkAndStayInPlace) {
  const std::string align = Align("0,0,0,0\n1999,0,199.9,0\n");
  const FloorPlan plan = ReadFloorPlan(Picture("plan.png", 2000, 1500), align);
  EXPECT_LE(plan.picture.size(), kMaxFloorPlanBytes);
  EXPECT_LT(plan.width, 2000);
  // The outer edges stay where they were: half a pixel outside the outer centres.
  EXPECT_LT((OnSite(plan, -0.5, -0.5) - Eigen::Vector2d(-0.05, 0.05)).norm(), 1e-3);
  EXPECT_NEAR(OnSite(plan, plan.width - 0.5, 0).x(), 199.95, 1e-3);
}

TEST_F(FloorPlanTest, Refusals) {
  const std::string picture = Picture("plan.png", 40, 30);
  ExpectRefused(picture, Align("1,1,0,0\n"), "align.csv: two different points");
  ExpectRefused(picture, Align("1,1,0,0\n1,1,5,5\n"), "align.csv: two different points");
  ExpectRefused(picture, Align("1,1,5,5\n9,9,5,5\n"), "align.csv: the points are one place");
  ExpectRefused(picture, Align("1,x,0,0\n"), "align.csv line 2");
  const std::string mirrored = Align("0,0,0,0\n10,0,10,0\n0,10,0,10\n");
  ExpectRefused(picture, mirrored, "do not fit");
  ExpectRefused(folder_.Write("plan.txt", std::string_view("hello")), Align("0,0,0,0\n1,0,1,0\n"),
                "plan.txt: not a PNG or JPEG");
  ExpectRefused(folder_ / "absent.png", Align("0,0,0,0\n1,0,1,0\n"), "absent.png");
}

}  // namespace
}  // namespace viewfix
