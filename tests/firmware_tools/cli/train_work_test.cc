// SPDX-License-Identifier: BSD-3-Clause
// viewfix train --work: what a folder keeps saves time and changes nothing.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>

#include "platform/file.h"
#include "tests/firmware_tools/cli/viewfix_program.h"
#include "tests/testing/jpeg_encoder.h"
#include "tests/testing/small_site.h"

namespace viewfix {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

namespace fs = std::filesystem;

class TrainWorkTest : public ::testing::Test {
 protected:
  // What the training says of the folder.
  std::string TrainWithFolder(const std::vector<std::string>& more = {}) {
    return Train(kept_, more, true).err;
  }
  // The same training without it gives the same bytes.
  void ExpectModelOfNoFolder(const std::vector<std::string>& more = {}) {
    const ProgramRun run = Train(plain_, more, false);
    EXPECT_THAT(run.err, Not(HasSubstr("kept")));
    EXPECT_EQ(*ReadFile(kept_), *ReadFile(plain_));
  }
  ProgramRun Train(const std::string& model, const std::vector<std::string>& more, bool folder) {
    std::vector<std::string> command = {"train",   site_, "--out",          model,
                                        "--words", "20",  "--max-features", "100"};
    if (folder) command.insert(command.end(), {"--work", work_});
    command.insert(command.end(), more.begin(), more.end());
    ProgramRun run = Viewfix(command);
    EXPECT_EQ(run.exit_code, 0) << run.err;
    return run;
  }
  void AddPhotograph(std::uint32_t seed) {
    const std::string name = "added" + std::to_string(seed) + ".jpg";
    folder_.Write("site/" + name, EncodeJpeg(MakeTexture(160, 120, seed), 160, 120, 1));
    std::ofstream(folder_ / "site/images.csv", std::ios::app) << name << ",bar,left,train\n";
  }
  std::vector<std::string> FilesKept() const {
    std::vector<std::string> files;
    for (const auto& entry : fs::directory_iterator(work_ + "/stages")) {
      files.push_back(entry.path().string());
    }
    return files;
  }

  TempFolder folder_;
  std::string site_ = WriteSmallSite(folder_, "site", 6);  // 30 images to train with
  std::string work_ = folder_ / "work";
  std::string kept_ = folder_ / "kept.vfx";
  std::string plain_ = folder_ / "plain.vfx";
};

TEST_F(TrainWorkTest, TheModelIsTheSameColdAndWarm) {
  EXPECT_THAT(TrainWithFolder(), HasSubstr("features (100 an image): 0 of 30 kept\n"));
  ExpectModelOfNoFolder();
  const std::string warm = TrainWithFolder();
  EXPECT_THAT(warm, HasSubstr("features (100 an image): 30 of 30 kept\n"));
  EXPECT_THAT(warm, HasSubstr("vocabulary: 1 of 1 kept\n"));
  ExpectModelOfNoFolder();
}

TEST_F(TrainWorkTest, AddedPhotographsAloneAreLookedAt) {
  TrainWithFolder();
  AddPhotograph(81);
  AddPhotograph(82);
  const std::string err = TrainWithFolder();
  EXPECT_THAT(err, HasSubstr("features (100 an image): 30 of 32 kept\n"));
  EXPECT_THAT(err, HasSubstr("vocabulary: 0 of 1 kept\n"));
  ExpectModelOfNoFolder();
}

TEST_F(TrainWorkTest, AnotherOptionIsAnotherResult) {
  TrainWithFolder();
  const std::string upright = TrainWithFolder({"--upright"});
  EXPECT_THAT(upright, HasSubstr("features (100 an image): 0 of 30 kept\n"));
  ExpectModelOfNoFolder({"--upright"});
  TrainWithFolder();
  const std::string seed = TrainWithFolder({"--seed", "2"});
  EXPECT_THAT(seed, HasSubstr("features (100 an image): 30 of 30 kept\n"));
  EXPECT_THAT(seed, HasSubstr("vocabulary: 0 of 1 kept\n"));
  ExpectModelOfNoFolder({"--seed", "2"});
}

TEST_F(TrainWorkTest, TheFolderHoldsWhatTheLastTrainingUsed) {
  TrainWithFolder();
  EXPECT_EQ(FilesKept().size(), 31U) << "30 images, one vocabulary";
  TrainWithFolder({"--upright"});
  EXPECT_EQ(FilesKept().size(), 31U);
}

TEST_F(TrainWorkTest, DamageIsNoticed) {
  TrainWithFolder();
  for (const std::string& file : FilesKept()) {
    auto bytes = *ReadFile(file);
    bytes[bytes.size() / 2] ^= 1;
    ASSERT_TRUE(WriteFileAtomically(file, bytes).ok());
  }
  const std::string err = TrainWithFolder();
  EXPECT_THAT(err, HasSubstr("features (100 an image): 0 of 30 kept\n"));
  EXPECT_THAT(err, HasSubstr("vocabulary: 0 of 1 kept\n"));
  ExpectModelOfNoFolder();
}

TEST_F(TrainWorkTest, AFolderThatCannotBeMadeIsRefused) {
  folder_.Write("work", "a file");
  const ProgramRun run =
      Viewfix({"train", site_, "--out", kept_, "--words", "20", "--work", work_});
  EXPECT_EQ(run.exit_code, 1);
  EXPECT_THAT(LastLine(run), HasSubstr(work_));
}

}  // namespace
}  // namespace viewfix
