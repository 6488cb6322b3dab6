// SPDX-License-Identifier: BSD-3-Clause
// The viewfix command as a user runs it. Every refusal is one line that names the file.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>

#include "models/model_view.h"
#include "platform/file.h"
#include "tests/firmware_tools/cli/viewfix_program.h"
#include "tests/testing/jpeg_encoder.h"
#include "tests/testing/small_site.h"

namespace viewfix {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

ProgramRun TrainSite(const std::string& set, const std::string& model) {
  return Viewfix({"train", set, "--out", model, "--words", "20", "--max-features", "100"});
}

// PREFIX0, PREFIX1, ... (g++ 12 warns wrongly of `"a" + std::to_string(i)`.)
std::string Numbered(std::string prefix, int i) { return prefix += std::to_string(i); }

class CliTest : public ::testing::Test {
 protected:
  std::string Site(int per_view = 6) { return WriteSmallSite(folder_, "site", per_view); }
  std::string Model() const { return folder_ / "site.vfx"; }
  // The same with poses and a calibration: each view is a wall, two metres in front of a camera
  // that moves 5 cm to the right from image to image.
  std::string SiteWithPoses() {
    const std::string site = Site(8);
    folder_.Write("site/calibration.yaml",
                  std::string_view("%YAML:1.0\n---\nimage_width: 160\nimage_height: 120\n"
                                   "camera_matrix: !!opencv-matrix\n   rows: 3\n   cols: 3\n"
                                   "   dt: d\n   data: [ 160, 0, 79.5, 0, 160, 59.5, 0, 0, 1 ]\n"));
    std::string csv = "path,location,view,capture,tx,ty,tz,qx,qy,qz,qw\n";
    int wall = 0;
    for (const char* location : {"atrium", "bar", "cellar"}) {
      for (const char* view : {"left", "right"}) {
        const std::string name = std::string(location) + "-" + view;
        for (int i = 0; i < 8; ++i) {
          csv += Numbered(name + "-", i) + ".jpg," + location + "," + view + "," + name + "," +
                 std::to_string(10 * wall + 0.05 * i) + ",0," + std::to_string(wall % 2 * 5) +
                 ",0,0,0,1\n";
        }
        ++wall;
      }
    }
    folder_.Write("site/images.csv", csv);
    return site;
  }
  // Training fails with one line that holds `words`, and writes nothing.
  void ExpectTrainRefuses(const std::string& set, const std::vector<std::string>& words) {
    const ProgramRun run = TrainSite(set, Model());
    EXPECT_EQ(run.exit_code, 1) << run.err;
    EXPECT_THAT(LastLine(run), HasSubstr("viewfix: "));
    for (const std::string& word : words) EXPECT_THAT(LastLine(run), HasSubstr(word));
    EXPECT_FALSE(std::filesystem::exists(Model()));
  }
  void AppendRow(const std::string& row) {
    std::ofstream(folder_ / "site/images.csv", std::ios::app) << row << "\n";
  }

  TempFolder folder_;
};

TEST_F(CliTest, HelpAndUsage) {
  EXPECT_EQ(Viewfix({"--help"}).exit_code, 0);
  for (const char* command :
       {"simulate", "check", "train", "eval", "experiment", "inspect", "export", "calibrate"}) {
    const ProgramRun help = Viewfix({command, "--help"});
    EXPECT_EQ(help.exit_code, 0);
    EXPECT_THAT(help.out, HasSubstr("Example: viewfix"));
    EXPECT_EQ(Viewfix({command}).exit_code, 2) << command << " without arguments";
  }
  EXPECT_EQ(Viewfix({}).exit_code, 2);
  EXPECT_EQ(Viewfix({"fly"}).exit_code, 2);
  EXPECT_EQ(Viewfix({"train", "x", "--out", "y", "--words", "1"}).exit_code, 2);
  EXPECT_EQ(Viewfix({"train", "x", "--out", "y", "--views", "sideways"}).exit_code, 2);
}

TEST_F(CliTest, FromPhotographsToFigures) {
  const std::string site = Site();
  const ProgramRun train = TrainSite(site, Model());
  ASSERT_EQ(train.exit_code, 0) << train.err;
  const std::string figures_file = folder_ / "figures.json";
  const ProgramRun eval = Viewfix({"eval", site, "--model", Model(), "--json", figures_file});
  ASSERT_EQ(eval.exit_code, 0) << eval.err;
  const auto figures = nlohmann::json::parse(std::ifstream(figures_file));
  EXPECT_EQ(figures["schema"], 1);
  EXPECT_EQ(figures["images"], 6);
  EXPECT_EQ(figures["location"]["labelled"], 6);
  EXPECT_GE(figures["location"]["accuracy"], 0.8);
  EXPECT_GE(figures["view"]["accuracy"], 0.8);
  for (const char* key :
       {"model_bytes", "retrieval", "pose", "refusal", "confidence", "latency_ms"}) {
    EXPECT_TRUE(figures.contains(key)) << key;
  }
  EXPECT_TRUE(figures["unknown"].is_null());
  const ProgramRun inspect = Viewfix({"inspect", Model(), "--json"});
  ASSERT_EQ(inspect.exit_code, 0);
  const auto description = nlohmann::json::parse(inspect.out);
  EXPECT_EQ(description["words"], 20);
  EXPECT_EQ(description["locations"].size(), 3U);
  EXPECT_EQ(description["training"]["samples"], 30);
  const std::string text = Viewfix({"inspect", Model()}).out;
  EXPECT_THAT(text, HasSubstr("answers    from a confidence of"));
  if (const auto& bytes = description["localizer_bytes"]; !bytes.is_null()) {  // null: sanitizers'
    EXPECT_GT(bytes, 640 * 640);  // the largest image that features are found in, to begin with
    EXPECT_LT(bytes, 32 << 20);
    EXPECT_THAT(text, HasSubstr("MB besides the model"));
  }
}

TEST_F(CliTest, TheSameInputsGiveTheSameBytes) {
  const std::string site = Site();
  ASSERT_EQ(TrainSite(site, Model()).exit_code, 0);
  ASSERT_EQ(Viewfix({"train", site, "--out", folder_ / "again.vfx", "--words", "20",
                     "--max-features", "100", "--jobs", "3"})
                .exit_code,
            0);
  EXPECT_EQ(*ReadFile(Model()), *ReadFile(folder_ / "again.vfx"));
}

TEST_F(CliTest, ABaseKeepsWhatDidNotChange) {
  const std::string site = SiteWithPoses();
  ASSERT_EQ(TrainSite(site, Model()).exit_code, 0);
  std::filesystem::copy_file(site + "/bar-left-6.jpg", site + "/bar-left-1.jpg",
                             std::filesystem::copy_options::overwrite_existing);
  const std::string next = folder_ / "next.vfx";
  const ProgramRun train = Viewfix({"train", site, "--base", Model(), "--out", next});
  ASSERT_EQ(train.exit_code, 0) << train.err;
  EXPECT_THAT(train.out, HasSubstr("2 locations; trained anew: bar; gone: none"));
  EXPECT_EQ(Viewfix({"eval", site, "--model", next, "--split", "all"}).exit_code, 0);
  const auto record = nlohmann::json::parse(Viewfix({"inspect", next, "--json"}).out)["training"];
  EXPECT_EQ(record["base"]["kept"], 2);
  EXPECT_EQ(record["base"]["trained"], nlohmann::json({"bar"}));
  EXPECT_EQ(record["words"], 20);
  const ProgramRun both =
      Viewfix({"train", site, "--base", Model(), "--words", "30", "--out", next});
  EXPECT_EQ(both.exit_code, 2) << "a frozen vocabulary has its size";
  EXPECT_THAT(both.err, HasSubstr("--words"));
}

TEST_F(CliTest, EvalOfAnUnknownPlace) {
  const std::string site = Site();
  ASSERT_EQ(TrainSite(site, Model()).exit_code, 0);
  const std::string json = folder_ / "f.json";
  ASSERT_EQ(
      Viewfix({"eval", site, "--model", Model(), "--unknown", site, "--json", json}).exit_code, 0);
  EXPECT_EQ(nlohmann::json::parse(std::ifstream(json))["unknown"]["images"], 36);
}

TEST_F(CliTest, SetsThatCannotBeUsed) {
  ExpectTrainRefuses(folder_ / "nowhere", {"nowhere"});
  folder_.Write("a/images.csv", std::string_view("location\nx\n"));
  ExpectTrainRefuses(folder_ / "a", {"a/images.csv", "path"});
  folder_.Write("b/images.csv", std::string_view("path\nx.jpg\ny.jpg\nx.jpg\n"));
  ExpectTrainRefuses(folder_ / "b", {"b/images.csv", "x.jpg"});
  folder_.Write("c/images.csv",
                std::string_view("path,tx,ty,tz,qx,qy,qz,qw\nx.jpg,nan,0,0,0,0,0,1\n"));
  ExpectTrainRefuses(folder_ / "c", {"c/images.csv"});
}

TEST_F(CliTest, PosesFromAnotherFile) {
  const std::string site = Site();
  const std::string poses = folder_.Write("walk.tum", "bar-left-0 1 2 3 0 0 0 1\n");
  const ProgramRun train = Viewfix({"train", site, "--out", Model(), "--words", "20",
                                    "--max-features", "100", "--poses", poses});
  EXPECT_EQ(train.exit_code, 0) << train.err;
  EXPECT_THAT(train.err, HasSubstr("walk.tum: poses for 1 of 36 images"));
  const std::string bad = folder_.Write("bad.tum", "bar-left-0 1 2 3 0 0 0 0\n");
  const ProgramRun eval = Viewfix({"eval", site, "--model", Model(), "--poses", bad});
  EXPECT_EQ(eval.exit_code, 1);
  EXPECT_THAT(LastLine(eval), HasSubstr("bad.tum line 1"));
}

// Poses alone give no landmarks: where a map was asked for that is an error, else a warning.
TEST_F(CliTest, AMapUnderPosesNeedsACalibration) {
  const std::string site = SiteWithPoses();
  std::filesystem::remove(site + "/calibration.yaml");
  const ProgramRun asked =
      Viewfix({"train", site, "--out", Model(), "--words", "20", "--map", "poses"});
  EXPECT_EQ(asked.exit_code, 1);
  EXPECT_THAT(LastLine(asked), HasSubstr("site/images.csv: 48 of 48 images have no camera"));
  EXPECT_THAT(LastLine(asked), HasSubstr("site/calibration.yaml is wanted"));
  EXPECT_THAT(asked.err, Not(HasSubstr("features"))) << "said before any work";
  const ProgramRun train = TrainSite(site, Model());
  EXPECT_EQ(train.exit_code, 0) << train.err;
  EXPECT_THAT(train.err, HasSubstr("warning: 48 of 48 images have no camera for a map: "));
  EXPECT_THAT(train.err, HasSubstr("site/calibration.yaml is wanted"));
}

// As many as there is time for; those of a map keep colours beside their descriptors.
TEST_F(CliTest, FeaturesAreChosenByWhatTellsPlacesApart) {
  const std::string site = SiteWithPoses();
  const auto features_with = [&](const std::vector<std::string>& flags) {
    std::vector<std::string> command = {"train", site, "--out", Model(), "--words", "20"};
    command.insert(command.end(), flags.begin(), flags.end());
    EXPECT_EQ(Viewfix(command).exit_code, 0);
    return Viewfix({"inspect", Model()}).out;
  };
  EXPECT_THAT(features_with({}), HasSubstr("surf-chroma version 1, 1500 a frame"));
  EXPECT_THAT(features_with({"--map", "none"}), HasSubstr("color-surf version 1, 1600 a frame"));
  EXPECT_THAT(features_with({"--map", "none", "--details", "0"}),
              HasSubstr(" surf version 1, 800 a frame"));
  EXPECT_THAT(features_with({"--features", "surf", "--max-features", "100"}),
              HasSubstr(" surf version 1, 100 a frame"));
}

TEST_F(CliTest, RoomTooSmallForDetailsIsWarnedOf) {
  const std::string site = SiteWithPoses();
  const auto errors_with = [&](const std::string& megabytes) {
    return Viewfix({"train", site, "--out", Model(), "--words", "20", "--map", "none", "--details",
                    megabytes})
        .err;
  };
  EXPECT_THAT(errors_with("0.0001"), HasSubstr("warning: no details are kept"));
  EXPECT_THAT(errors_with("6"), Not(HasSubstr("no details")));
  EXPECT_THAT(errors_with("0"), Not(HasSubstr("no details"))) << "as asked";
}

TEST_F(CliTest, HowManyAnswersMayBeWrongIsTheUsers) {
  const std::string site = Site();
  const auto shares_of_model = [&] {
    const auto model = nlohmann::json::parse(Viewfix({"inspect", Model(), "--json"}).out);
    return model["training"]["wrong_shares"];
  };
  const auto shares_with = [&](const std::vector<std::string>& flags) {
    std::vector<std::string> command = {"train", site, "--out", Model(), "--words", "20"};
    command.insert(command.end(), flags.begin(), flags.end());
    EXPECT_EQ(Viewfix(command).exit_code, 0);
    return shares_of_model();
  };
  EXPECT_EQ(shares_with({"--max-wrong", "0.1"}).dump(),
            R"({"details":0.001,"poses":0.001,"scores":0.001})");
  EXPECT_EQ(shares_with({}).dump(), R"({"details":0.007,"poses":0.005,"scores":0.05})");
  shares_with({"--max-wrong", "0.1"});
  const std::string base = folder_ / "base.vfx";
  std::filesystem::rename(Model(), base);
  const ProgramRun again = Viewfix({"train", site, "--out", Model(), "--base", base});
  EXPECT_EQ(again.exit_code, 0) << again.err;
  EXPECT_EQ(shares_of_model().dump(), R"({"details":0.001,"poses":0.001,"scores":0.001})");
  for (const char* percent : {"0", "nan", "few"}) {
    const ProgramRun refused = Viewfix({"train", site, "--out", Model(), "--max-wrong", percent});
    EXPECT_NE(refused.exit_code, 0) << percent;
    EXPECT_THAT(refused.err, HasSubstr("--max-wrong: takes a number from 0.01 to 50"));
  }
}

// Of each row's photographs the last three have a pose and no name.
TEST_F(CliTest, UnlabelledPhotographsOfAWalkAreMapped) {
  const std::string site = SiteWithPoses();
  std::ifstream csv(site + "/images.csv");
  std::string walk;
  for (std::string line; std::getline(csv, line);) {
    const std::size_t comma = line.find(',');
    const std::size_t after = line.find(',', line.find(',', comma + 1) + 1);
    const bool unlabelled = comma > 4 && line[comma - 5] >= '5' && line[comma - 5] <= '9';
    walk += unlabelled ? line.substr(0, comma) + ",," + line.substr(after) : line;
    walk += '\n';
  }
  csv.close();
  folder_.Write("site/images.csv", walk);
  ASSERT_EQ(TrainSite(site, Model()).exit_code, 0);
  const auto description = nlohmann::json::parse(Viewfix({"inspect", Model(), "--json"}).out);
  EXPECT_EQ(description["training"]["samples"], 30);
  EXPECT_EQ(description["training"]["map"]["maps"][0]["images"], 48);
}

TEST_F(CliTest, AFolderKeepsAMapsPairsToo) {
  const std::string site = SiteWithPoses();
  ASSERT_EQ(TrainSite(site, Model()).exit_code, 0);
  const std::string kept = folder_ / "kept.vfx";
  const std::vector<std::string> command = {"train",          site, "--out",  kept,
                                            "--words",        "20", "--work", folder_ / "work",
                                            "--max-features", "100"};
  for (const char* count : {"pairs: 0 of ", "vocabulary: 1 of 1 kept"}) {
    const ProgramRun run = Viewfix(command);
    ASSERT_EQ(run.exit_code, 0) << run.err;
    EXPECT_THAT(run.err, HasSubstr(count));
    EXPECT_EQ(*ReadFile(kept), *ReadFile(Model()));
  }
}

TEST_F(CliTest, AMapOnTheFloorPlan) {
  const std::string site = SiteWithPoses();
  const std::string control = folder_.Write(
      "control.csv", std::string_view("name,x,y,z\natrium-left-0.jpg,100,0,7\n"
                                      "atrium-right-0.jpg,110,5,7\nbar-left-0.jpg,120,0,7\n"
                                      "cellar-left-0.jpg,140,0,7\ncellar-right-0.jpg,150,5,7\n"));
  const std::string plan = folder_.Write("plan.jpg", EncodeJpeg(MakeTexture(80, 60, 9), 80, 60, 1));
  const std::string align =
      folder_.Write("align.csv", std::string_view("px,py,x,y\n0,0,100,10\n79,0,179,10\n"));
  const ProgramRun train = Viewfix({"train", site, "--out", Model(), "--words", "20", "--control",
                                    control, "--floorplan", plan, "--floorplan-align", align});
  ASSERT_EQ(train.exit_code, 0) << train.err;
  EXPECT_THAT(train.err, HasSubstr("map 0: control points, median 0.000 m"));

  const auto description = nlohmann::json::parse(Viewfix({"inspect", Model(), "--json"}).out);
  EXPECT_EQ(description["maps"].size(), 1U);
  EXPECT_EQ(description["maps"][0]["metric"], true);
  EXPECT_GE(description["maps"][0]["extent"]["min"][0], 90);
  EXPECT_EQ(description["camera"]["width"], 160);
  EXPECT_EQ(description["floor_plan"]["width"], 80);
  EXPECT_EQ(description["training"]["map"]["maps"][0]["control"]["residuals"].size(), 5U);
  EXPECT_THAT(Viewfix({"inspect", Model()}).out, HasSubstr("floor plan 80 x 60"));

  const std::string json = folder_ / "f.json";
  const ProgramRun eval = Viewfix({"eval", site, "--model", Model(), "--split", "all", "--sequence",
                                   "--window", "3", "--json", json});
  ASSERT_EQ(eval.exit_code, 0) << eval.err;
  const auto figures = nlohmann::json::parse(std::ifstream(json));
  EXPECT_EQ(figures["sequence"], true);
  EXPECT_GE(figures["tracked"], 0.5);
  EXPECT_EQ(figures["frame_alone"]["sequence"], false);
  EXPECT_EQ(figures["frame_alone"]["frames"][3]["tracked"], false);
  EXPECT_LT(figures["pose"]["median_translation_m"], 0.05);
  EXPECT_LT(figures["frame_alone"]["pose"]["median_translation_m"], 0.05)
      << "compared in the frame of the set's poses";
  ASSERT_FALSE(figures["confidence"]["reliability"].empty());
  EXPECT_EQ(figures["confidence"]["risk_coverage"].back()["coverage"], 1);
  EXPECT_EQ(figures["filter"], false);

  ASSERT_EQ(
      Viewfix({"eval", site, "--model", Model(), "--split", "all", "--filter", "--json", json})
          .exit_code,
      0);
  const auto filtered = nlohmann::json::parse(std::ifstream(json));
  EXPECT_EQ(filtered["sequence"], true);
  EXPECT_EQ(filtered["filter"], true);
  EXPECT_GE(filtered["frames"][1]["confidence"], figures["frames"][1]["confidence"]);

  EXPECT_EQ(Viewfix({"export", Model(), "--format", "tum", "--out", folder_ / "m.tum"}).exit_code,
            0);
  EXPECT_TRUE(std::filesystem::exists(folder_ / "m.tum"));
}

TEST_F(CliTest, ControlsThatCannotBeUsed) {
  const std::string site = Site();
  const std::string control =
      folder_.Write("control.csv", std::string_view("name,x,y,z\nbar-left-0.jpg,1,2,3\n"));
  const ProgramRun none = Viewfix({"train", site, "--out", Model(), "--control", control});
  EXPECT_EQ(none.exit_code, 1);
  EXPECT_THAT(LastLine(none), HasSubstr("control.csv: no map to place by control points"));
  const ProgramRun one =
      Viewfix({"train", SiteWithPoses(), "--out", Model(), "--words", "20", "--control", control});
  EXPECT_EQ(one.exit_code, 1);
  EXPECT_THAT(LastLine(one), HasSubstr("control.csv: three control points are needed"));
  EXPECT_EQ(Viewfix({"train", site, "--out", Model(), "--floorplan", control}).exit_code, 2)
      << "without --floorplan-align";
  const ProgramRun absent =
      Viewfix({"train", site, "--out", Model(), "--tags", folder_ / "absent.csv"});
  EXPECT_EQ(absent.exit_code, 1);
  EXPECT_THAT(absent.err, Not(HasSubstr("features"))) << "said before any work";
}

TEST_F(CliTest, ExportOfAModelWithoutAMap) {
  ASSERT_EQ(TrainSite(Site(), Model()).exit_code, 0);
  const ProgramRun run =
      Viewfix({"export", Model(), "--format", "ply", "--out", folder_ / "m.ply"});
  EXPECT_EQ(run.exit_code, 1);
  EXPECT_THAT(LastLine(run), HasSubstr("site.vfx: the model has no landmarks"));
  EXPECT_EQ(Viewfix({"export", Model(), "--format", "obj", "--out", "x"}).exit_code, 2);
}

TEST_F(CliTest, CalibratePrintsTheBoardAndRefusesOtherPictures) {
  const std::string board = folder_ / "board.svg";
  EXPECT_EQ(Viewfix({"calibrate", "--print-board", board}).exit_code, 0);
  EXPECT_TRUE(std::filesystem::exists(board));
  EXPECT_EQ(Viewfix({"calibrate", Site()}).exit_code, 2) << "without --out";
  const ProgramRun run = Viewfix({"calibrate", Site(), "--out", folder_ / "c.yaml"});
  EXPECT_EQ(run.exit_code, 1);
  EXPECT_THAT(LastLine(run), HasSubstr("usable in 0 of 36 images"));
  EXPECT_FALSE(std::filesystem::exists(folder_ / "c.yaml"));
}

TEST_F(CliTest, ASetWithoutPlacesSaysWhatToAdd) {
  const std::string site = Site();
  std::string csv = "path\n";
  for (const auto& entry : std::filesystem::directory_iterator(site)) {
    if (entry.path().extension() == ".jpg") csv += entry.path().filename().string() + "\n";
  }
  folder_.Write("site/images.csv", csv);
  ExpectTrainRefuses(site, {"images.csv", "location", "poses"});
}

TEST_F(CliTest, OneBadPhotographIsSkippedAndCounted) {
  const std::string site = Site();
  const auto good = *ReadFile(site + "/bar-left-0.jpg");
  folder_.Write("site/truncated.jpg", std::span(good).first(good.size() / 2));
  folder_.Write("site/text.jpg", std::string_view("not an image"));
  AppendRow("truncated.jpg,bar,left,train");
  AppendRow("text.jpg,bar,left,train");
  AppendRow("missing.jpg,bar,left,train");
  const ProgramRun run = TrainSite(site, Model());
  EXPECT_EQ(run.exit_code, 0) << run.err;
  for (const char* name : {"truncated.jpg", "text.jpg", "missing.jpg", "3 of 33"}) {
    EXPECT_THAT(run.err, HasSubstr(name));
  }
}

TEST_F(CliTest, OddSizesAreSkipped) {
  const std::string site = Site();
  const std::vector<std::uint8_t> dot = {7};
  folder_.Write("site/dot.jpg", EncodeJpeg(dot, 1, 1, 1));
  folder_.Write("site/strip.jpg",
                EncodeJpeg(std::vector<std::uint8_t>(20000 * 10, 90), 20000, 10, 1));
  AppendRow("dot.jpg,bar,left,train");
  AppendRow("strip.jpg,bar,left,train");
  const ProgramRun run = TrainSite(site, Model());
  EXPECT_EQ(run.exit_code, 0) << run.err;
  EXPECT_THAT(run.err, HasSubstr("dot.jpg"));
  EXPECT_THAT(run.err, HasSubstr("strip.jpg"));
}

TEST_F(CliTest, TooManyBadPhotographsAreFatal) {
  const std::string site = Site();
  for (int i = 0; i < 12; ++i) AppendRow(Numbered("missing", i) + ".jpg,bar,left,train");
  ExpectTrainRefuses(site, {"images.csv", "12 of 42", "missing0.jpg"});
}

TEST_F(CliTest, ALocationLeftEmptyIsFatal) {
  const std::string site = Site();
  AppendRow("missing.jpg,dungeon,left,train");
  ExpectTrainRefuses(site, {"dungeon"});
}

TEST_F(CliTest, ALocationOfOneImageIsFatal) {
  const std::string site = Site();
  folder_.Write("site/lone.jpg", *ReadFile(site + "/bar-left-0.jpg"));
  AppendRow("lone.jpg,dungeon,left,train");
  ExpectTrainRefuses(site, {"dungeon", "one training image"});
}

TEST_F(CliTest, ALocationOfOneViewIsAWarning) {
  const std::string site = Site();
  for (int i = 0; i < 8; ++i) {
    const std::string name = Numbered("d", i) + ".jpg";
    folder_.Write("site/" + name, EncodeJpeg(MakeTexture(160, 120, 77 + i), 160, 120, 1));
    AppendRow(name + ",dungeon,left,train");
  }
  const ProgramRun run = TrainSite(site, Model());
  EXPECT_EQ(run.exit_code, 0);
  EXPECT_THAT(run.err, HasSubstr("dungeon: photographed in one direction only"));
}

TEST_F(CliTest, OutputsThatCannotBeWritten) {
  const std::string site = Site();
  const ProgramRun run = TrainSite(site, folder_ / "no/such/folder/m.vfx");
  EXPECT_EQ(run.exit_code, 1);
  EXPECT_THAT(LastLine(run), HasSubstr("no/such/folder"));
  EXPECT_THAT(run.err, Not(HasSubstr("features"))) << "said before any work";
  EXPECT_EQ(TrainSite(site, folder_.path()).exit_code, 1) << "a folder is no model file";
  EXPECT_EQ(Viewfix({"simulate", "--out", folder_ / "no/museum"}).exit_code, 1);
}

// /dev/full stands for a full disk where a file is opened; a limit on the file's size for one
// that fills up while writing.
TEST_F(CliTest, AFullDiskLeavesNothing) {
  const std::string site = Site();
  const ProgramRun run = RunProgram(
      {"/bin/bash", "-c",
       "trap '' XFSZ; ulimit -f 1; exec \"$0\" train \"$1\" --out \"$2\" --words 20 2>&1", VIEWFIX,
       site, Model()});
  EXPECT_EQ(run.exit_code, 1);
  EXPECT_THAT(run.out, HasSubstr("site.vfx"));
  EXPECT_FALSE(std::filesystem::exists(Model()));
  for (const auto& entry : std::filesystem::directory_iterator(folder_.path())) {
    EXPECT_EQ(entry.path().filename(), "site") << "a temporary file was left";
  }
}

TEST_F(CliTest, CtrlCWhileTrainingLeavesNothing) {
  const std::string site = Site(40);
  const ProgramRun run =
      RunProgram({"/bin/bash", "-c",
                  "\"$0\" train \"$1\" --out \"$2\" --words 200 2> \"$3\" & p=$!; "
                  "until grep -q features \"$3\"; do :; done; kill -TERM $p; wait $p",
                  VIEWFIX, site, Model(), folder_ / "log"});
  EXPECT_EQ(run.exit_code, 1);
  const auto log = *ReadFile(folder_ / "log");
  EXPECT_THAT(std::string(log.begin(), log.end()), HasSubstr("interrupted"));
  EXPECT_FALSE(std::filesystem::exists(Model()));
}

TEST_F(CliTest, DamagedModelsAreRefused) {
  const std::string site = Site();
  ASSERT_EQ(TrainSite(site, Model()).exit_code, 0);
  const auto good = *ReadFile(Model());
  auto flipped = good;
  flipped[flipped.size() / 2] ^= 4;
  auto newer = good;
  newer[8] = 200;
  const std::pair<std::string, std::vector<std::uint8_t>> damaged[] = {
      {"flipped.vfx", flipped},
      {"newer.vfx", newer},
      {"short.vfx", {good.begin(), good.begin() + static_cast<std::ptrdiff_t>(good.size() / 3)}},
      {"empty.vfx", {}}};
  for (const auto& [name, bytes] : damaged) {
    const std::string path = folder_.Write(name, bytes);
    for (const auto& command : {std::vector<std::string>{"inspect", path},
                                std::vector<std::string>{"eval", site, "--model", path}}) {
      const ProgramRun run = Viewfix(command);
      EXPECT_EQ(run.exit_code, 1) << name;
      EXPECT_THAT(LastLine(run), HasSubstr(name));
    }
  }
  EXPECT_THAT(Viewfix({"inspect", folder_ / "newer.vfx"}).err, HasSubstr("newer"));
  EXPECT_EQ(Viewfix({"inspect", folder_ / "absent.vfx"}).exit_code, 1);
}

TEST_F(CliTest, CheckReports) {
  const std::string site = Site();
  folder_.Write("site/text.jpg", std::string_view("not an image"));
  AppendRow("text.jpg,bar,left,train");
  const std::string json = folder_ / "check.json";
  const ProgramRun run = Viewfix({"check", site, "--json", json, "--max-features", "100"});
  EXPECT_EQ(run.exit_code, 0) << run.err;
  EXPECT_THAT(run.out, HasSubstr("text.jpg"));
  const auto report = nlohmann::json::parse(std::ifstream(json));
  EXPECT_EQ(report["findings"][0]["kind"], "unreadable");
  EXPECT_EQ(report["recall"].size(), 6U);
}

}  // namespace
}  // namespace viewfix
