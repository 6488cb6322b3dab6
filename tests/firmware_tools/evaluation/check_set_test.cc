// SPDX-License-Identifier: BSD-3-Clause
#include "firmware_tools/evaluation/check_set.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <nlohmann/json.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <set>
#include <string>

#include "tests/testing/temp_folder.h"

namespace viewfix {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::IsSupersetOf;
using Kinds = std::set<std::string>;

constexpr int kWidth = 240;
constexpr int kHeight = 180;
constexpr int kStep = 14;   // pixels from one image of a walk to the next
constexpr int kImages = 9;  // of a view

// A wall full of things to recognize, as wide as a walk along it.
cv::Mat Wall(int seed) {
  cv::RNG random(static_cast<std::uint64_t>(seed) + 1);
  cv::Mat wall(kHeight, kWidth + kStep * kImages, CV_8U, cv::Scalar(120));
  for (int i = 0; i < 150; ++i) {
    const cv::Point at(random.uniform(0, wall.cols), random.uniform(0, wall.rows));
    const cv::Scalar grey(random.uniform(30, 230));
    const int size = random.uniform(4, 14);
    if (i % 2 == 0) {
      cv::circle(wall, at, size, grey, cv::FILLED);
    } else {
      cv::rectangle(wall, cv::Rect(at, cv::Size(size, random.uniform(4, 24))), grey, cv::FILLED);
    }
  }
  return wall;
}

cv::Mat ImageOf(const cv::Mat& wall, int i) {
  return wall(cv::Rect(i * kStep, 0, kWidth, kHeight)).clone();
}

// Three locations with two views each: a walk of nine images along a wall of its own.
class CheckImageSetTest : public ::testing::Test {
 protected:
  CheckImageSetTest() {
    set_.folder = set_.source = folder_.path();
    for (const char* location : {"cafe", "lobby", "stairs"}) {
      for (const char* view : {"left", "right"}) AddWalk(location, view, walls_++);
    }
  }

  void AddWalk(const std::string& location, const std::string& view, int wall_seed) {
    const cv::Mat wall = Wall(wall_seed);
    for (int i = 0; i < kImages; ++i) Add(location, view, ImageOf(wall, i));
  }

  ImageRecord& Add(const std::string& location, const std::string& view, const cv::Mat& image) {
    ImageRecord record;
    record.path = std::to_string(set_.images.size()) + ".png";
    record.location = location;
    record.view = view;
    set_.images.push_back(record);
    Draw(static_cast<int>(set_.images.size()) - 1, image);
    return set_.images.back();
  }

  // Images 0..8 are cafe/left, 9..17 cafe/right, 18..26 lobby/left, ...
  std::filesystem::path File(int i) const { return set_.FullPath(set_.images[i]); }
  void Draw(int i, const cv::Mat& image) const { cv::imwrite(File(i).string(), image); }
  cv::Mat Picture(int i) const { return cv::imread(File(i).string(), cv::IMREAD_GRAYSCALE); }
  void Erase(int begin, int end) {
    set_.images.erase(set_.images.begin() + begin, set_.images.begin() + end);
  }

  TrainOptions Options() const {
    TrainOptions options;
    options.features.max_features = 150;
    options.num_words = 60;
    options.jobs = 2;
    return options;
  }

  CheckReport Check() const { return CheckImageSet(set_, Options(), {}); }

  static Kinds KindsOf(const std::vector<Finding>& findings) {
    Kinds kinds;
    for (const Finding& finding : findings) kinds.insert(finding.kind);
    return kinds;
  }
  Kinds FoundKinds() const { return KindsOf(Check().findings); }
  Kinds LabelKinds() const { return KindsOf(CheckLabels(set_)); }

  // The only finding of a kind.
  static Finding Only(const std::vector<Finding>& findings, const std::string& kind) {
    Finding only;
    int count = 0;
    for (const Finding& finding : findings) {
      if (finding.kind != kind) continue;
      only = finding;
      ++count;
    }
    EXPECT_EQ(count, 1) << kind;
    return only;
  }

  TempFolder folder_;
  ImageSet set_;
  int walls_ = 0;
};

TEST_F(CheckImageSetTest, FindsNothingInACleanSet) {
  const CheckReport report = Check();
  for (const Finding& finding : report.findings) ADD_FAILURE() << finding.text;
  EXPECT_EQ(report.images, 54);
  EXPECT_EQ(report.train_images, 54);
  EXPECT_GT(report.expected_location_accuracy, 0.9);
  ASSERT_EQ(report.recall.size(), 6);
  EXPECT_EQ(report.recall[0].location, "cafe");
  EXPECT_EQ(report.recall[0].view, "left");
  EXPECT_EQ(report.recall[0].images, kImages);
  EXPECT_EQ(report.recall[0].held_out, kImages);
}

TEST_F(CheckImageSetTest, DoesNotDependOnThreads) {
  Draw(4, ImageOf(Wall(77), 0));
  TrainOptions options = Options();
  const std::string two = ToJson(CheckImageSet(set_, options, {})).dump();
  options.jobs = 1;
  EXPECT_EQ(ToJson(CheckImageSet(set_, options, {})).dump(), two);
}

TEST_F(CheckImageSetTest, PassesInterruptsOn) {
  const StageProgress interrupt = [](const std::string& stage) {
    return [stage](int, int) {
      if (stage == "walks") throw ToolError("interrupted");
    };
  };
  EXPECT_THROW(CheckImageSet(set_, Options(), interrupt), ToolError);
}

TEST_F(CheckImageSetTest, FindsUnreadableFiles) {
  std::filesystem::remove(File(1));
  folder_.Write(set_.images[20].path, "not an image");
  std::filesystem::resize_file(File(40), std::filesystem::file_size(File(40)) / 2);
  const CheckReport report = Check();
  EXPECT_EQ(KindsOf(report.findings), Kinds{"unreadable"});
  ASSERT_EQ(report.findings.size(), 3);
  EXPECT_THAT(report.findings[0].text, HasSubstr("1.png: no such file"));
  EXPECT_THAT(report.findings[1].images, ElementsAre("20.png"));
  EXPECT_THAT(report.findings[2].images, ElementsAre("40.png"));
}

TEST_F(CheckImageSetTest, FindsBlur) {
  const auto blur = [&](int i) {
    cv::Mat blurred;
    cv::GaussianBlur(Picture(i), blurred, {}, 3.0);
    Draw(i, blurred);
  };
  blur(3);
  Finding finding = Only(Check().findings, "blurred");
  EXPECT_EQ(finding.severity, Severity::kNote);
  EXPECT_THAT(finding.images, ElementsAre("3.png"));
  EXPECT_THAT(finding.locations, ElementsAre("cafe"));
  for (const int i : {5, 7, 12, 14}) blur(i);
  finding = Only(Check().findings, "blurred");
  EXPECT_EQ(finding.severity, Severity::kWarning);
  EXPECT_THAT(finding.text, HasSubstr("cafe: 5 of 18 images are blurred"));
  EXPECT_THAT(finding.text, HasSubstr("3.png, 5.png, 7.png and 2 more"));
}

TEST_F(CheckImageSetTest, FindsBadExposure) {
  Draw(3, Picture(3) * 0.08);
  cv::Mat bright = Picture(30);
  bright.colRange(0, 120).setTo(255);
  Draw(30, bright);
  const CheckReport report = Check();
  EXPECT_THAT(Only(report.findings, "dark").images, ElementsAre("3.png"));
  EXPECT_THAT(Only(report.findings, "overexposed").images, ElementsAre("30.png"));
}

TEST_F(CheckImageSetTest, FindsPlainImages) {
  Draw(22, cv::Mat(kHeight, kWidth, CV_8U, cv::Scalar(130)));
  const CheckReport report = Check();
  EXPECT_EQ(KindsOf(report.findings), Kinds{"no_features"});
  EXPECT_THAT(report.findings[0].images, ElementsAre("22.png"));
}

TEST_F(CheckImageSetTest, FindsDuplicates) {
  Draw(1, Picture(0));
  EXPECT_EQ(Only(Check().findings, "duplicate").severity, Severity::kNote);
  set_.images[1].is_test = true;
  EXPECT_EQ(Only(Check().findings, "duplicate_in_test").severity, Severity::kWarning);
  Draw(1, Picture(40));
  const Finding finding = Only(Check().findings, "duplicate_other_location");
  EXPECT_EQ(finding.severity, Severity::kError);
  EXPECT_THAT(finding.locations, ElementsAre("cafe", "stairs"));
}

TEST_F(CheckImageSetTest, FindsBrokenWalks) {
  const cv::Mat elsewhere = Wall(50);
  for (int i = 5; i < kImages; ++i) Draw(i, ImageOf(elsewhere, i));
  const Finding finding = Only(Check().findings, "broken_walk");
  EXPECT_THAT(finding.images, ElementsAre("4.png", "5.png"));
  EXPECT_THAT(finding.text, HasSubstr("cafe: the walk jumps 1 time"));
}

TEST_F(CheckImageSetTest, OneBadImageBreaksNoWalk) {
  Draw(4, ImageOf(Wall(50), 0));
  EXPECT_EQ(FoundKinds().count("broken_walk"), 0);
}

TEST_F(CheckImageSetTest, ImagesHeldBackForTestingBreakNoWalk) {
  const cv::Mat elsewhere = Wall(50);
  for (int i = 5; i < kImages; ++i) Draw(i, ImageOf(elsewhere, i));
  set_.images[4].is_test = true;
  EXPECT_EQ(FoundKinds().count("broken_walk"), 0);
}

TEST_F(CheckImageSetTest, FollowsANamedCaptureThroughLocations) {
  // A walk from the cafe into the lobby, whose walls do not join.
  for (int i = 9; i < 27; ++i) set_.images[i].capture = "walk7";
  const Finding finding = Only(Check().findings, "broken_walk");
  EXPECT_THAT(finding.images, ElementsAre("17.png", "18.png"));
  EXPECT_THAT(finding.text, HasSubstr("walk7"));
}

TEST_F(CheckImageSetTest, FindsWrongLabels) {
  // An image of the lobby among the cafe's.
  Draw(13, Wall(2)(cv::Rect(kStep * 4 + kStep / 2, 0, kWidth, kHeight)));
  const CheckReport report = Check();
  const Finding finding = Only(report.findings, "wrong_label");
  EXPECT_THAT(finding.images, ElementsAre("13.png"));
  EXPECT_THAT(finding.locations, ElementsAre("cafe", "lobby"));
  EXPECT_EQ(KindsOf(report.findings).count("near_duplicate"), 0);
}

TEST_F(CheckImageSetTest, FindsPlacesThatLookTheSame) {
  // The cafe's twin: images between the cafe's, so that each is nearer to the other location's
  // than to the next of its own, and taken in another order, so that what is held out here is
  // not held out there.
  const cv::Mat left = Wall(0);
  const cv::Mat right = Wall(1);
  for (const int i : {0, 4, 8, 3, 7, 2, 6, 1, 5}) {
    const cv::Rect at(kStep * i + kStep / 2, 0, kWidth, kHeight);
    Add("twin", "left", left(at).clone());
    Add("twin", "right", right(at).clone());
  }
  std::set<std::string> near_duplicates;
  std::set<std::string> poor;
  for (const Finding& finding : Check().findings) {
    if (finding.kind == "near_duplicate") {
      EXPECT_THAT(finding.locations, ElementsAre("cafe", "twin"));
      near_duplicates.insert(finding.images[0]);
    } else {
      EXPECT_EQ(finding.kind, "poor_recall") << finding.text;
      poor.insert(finding.text.substr(0, finding.text.find(':')));
      EXPECT_THAT(finding.text, HasSubstr(" of 9 held-out images found, mostly taken for "));
      EXPECT_THAT(finding.text, HasSubstr("take more images of "));
      EXPECT_FALSE(finding.images.empty());
    }
  }
  EXPECT_GE(near_duplicates.size(), 6);
  EXPECT_FALSE(poor.empty());
  for (const std::string& place : poor) {
    EXPECT_TRUE(place.starts_with("cafe/") || place.starts_with("twin/")) << place;
  }
}

TEST_F(CheckImageSetTest, SaysWhatTrainingWouldRefuse) {
  for (int i = 18; i < 36; ++i) folder_.Write(set_.images[i].path, "");
  const CheckReport report = Check();
  EXPECT_THAT(Only(report.findings, "too_many_unusable").text, HasSubstr("18 of 54"));
  EXPECT_THAT(Only(report.findings, "empty_location").locations, ElementsAre("lobby"));
  EXPECT_EQ(report.findings[0].severity, Severity::kError);
  EXPECT_EQ(report.findings.back().severity, Severity::kWarning);
}

TEST_F(CheckImageSetTest, ReportsASetWithNothingInIt) {
  for (std::size_t i = 0; i < set_.images.size(); ++i) folder_.Write(set_.images[i].path, "");
  EXPECT_THAT(FoundKinds(), IsSupersetOf({"unreadable", "too_many_unusable", "empty_location",
                                          "too_few_features"}));
}

TEST_F(CheckImageSetTest, FindsMissingLabels) {
  set_.images[0].location.clear();
  EXPECT_EQ(LabelKinds(), Kinds{"unlabelled"});
  for (ImageRecord& image : set_.images) image.location.clear();
  EXPECT_EQ(FoundKinds(), Kinds{"no_locations"});
  for (ImageRecord& image : set_.images) image.is_test = true;
  EXPECT_THAT(FoundKinds(), IsSupersetOf({"no_training_images"}));
}

TEST_F(CheckImageSetTest, MakesLocationsFromPoses) {
  for (std::size_t i = 0; i < set_.images.size(); ++i) {
    set_.images[i].location.clear();
    set_.images[i].view.clear();
    set_.images[i].pose = Pose{Eigen::Quaterniond::Identity(), {double(i / 9), 0, 0}};
  }
  const CheckReport report = Check();
  EXPECT_THAT(LabelKinds(), IsEmpty());
  EXPECT_FALSE(report.recall.empty());
}

TEST_F(CheckImageSetTest, FindsThinLocations) {
  Erase(41, 54);
  EXPECT_THAT(LabelKinds(), IsSupersetOf({"thin_location"}));
  Erase(37, 41);
  const Finding finding = Only(CheckLabels(set_), "thin_location");
  EXPECT_EQ(finding.severity, Severity::kError);
  EXPECT_THAT(finding.text, HasSubstr("stairs: only 1 training image: take at least 7 more"));
}

TEST_F(CheckImageSetTest, FindsSingleLocations) {
  Erase(18, 54);
  EXPECT_EQ(FoundKinds(), Kinds{"one_location"});
}

TEST_F(CheckImageSetTest, FindsLocationsThatAreTestedOnly) {
  for (int i = 36; i < 54; ++i) set_.images[i].is_test = true;
  EXPECT_EQ(LabelKinds(), Kinds{"untrained_location"});
}

TEST_F(CheckImageSetTest, FindsOneSidedLocations) {
  Erase(45, 54);
  const Finding one = Only(CheckLabels(set_), "one_view");
  EXPECT_THAT(one.locations, ElementsAre("stairs"));
  EXPECT_THAT(one.text, HasSubstr("at least right"));
  set_.images[44].view = "back";
  set_.images[43].view = "back";
  EXPECT_THAT(Only(CheckLabels(set_), "missing_view").text, HasSubstr("no images of view right"));
  set_.images[44].view = set_.images[43].view = "right";
  EXPECT_EQ(LabelKinds(), Kinds{});
  set_.images[43].view = "left";
  EXPECT_THAT(Only(CheckLabels(set_), "unbalanced_views").text,
              HasSubstr("stairs/right: only 1 images, where left has 8"));
}

TEST_F(CheckImageSetTest, ReportsAsJson) {
  std::filesystem::remove(File(1));
  const auto json = ToJson(Check());
  EXPECT_EQ(json["schema"], 1);
  EXPECT_EQ(json["images"], 54);
  EXPECT_EQ(json["findings"][0]["severity"], "warning");
  EXPECT_EQ(json["findings"][0]["kind"], "unreadable");
  EXPECT_EQ(json["findings"][0]["images"][0], "1.png");
  EXPECT_EQ(json["recall"].size(), 6);
  EXPECT_GT(json["expected_location_accuracy"], 0.5);
  EXPECT_TRUE(ToJson(CheckReport())["expected_location_accuracy"].is_null());
}

}  // namespace
}  // namespace viewfix
