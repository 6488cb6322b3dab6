// SPDX-License-Identifier: BSD-3-Clause
#include <fcntl.h>
#include <gmock/gmock.h>
#include <spawn.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <csignal>
#include <fstream>
#include <iterator>
#include <sstream>

#include "tests/testing/jpeg_encoder.h"
#include "tests/testing/landmark_site.h"
#include "tests/testing/run_program.h"
#include "tests/testing/temp_folder.h"
#include "tests/testing/test_key.h"
#include "tests/testing/tiny_model.h"

namespace viewfix {
namespace {

using testing::HasSubstr;
using testing::Not;
using testing::SizeIs;
using testing::StartsWith;

constexpr int kWidth = 200;
constexpr int kHeight = 150;

ProgramRun Viewfixd(std::vector<std::string> arguments) {
  arguments.insert(arguments.begin(), VIEWFIXD);
  return RunProgram(arguments);
}

class ViewfixdTest : public testing::Test {
 protected:
  void SetUp() override {
    model_ = folder_.Write("site.vfx", TinyModel());
    for (std::uint32_t i = 0; i < 3; ++i) {
      folder_.Write("walk/" + std::to_string(i) + ".jpg",
                    EncodeJpeg(MakeTexture(kWidth, kHeight, i), kWidth, kHeight, 1));
    }
    const std::vector<std::uint8_t> plain(std::size_t{kWidth} * kHeight, 128);
    folder_.Write("walk/plain.jpg", EncodeJpeg(plain, kWidth, kHeight, 1));
  }

  std::vector<std::string> Arguments() const {
    return {"--model", model_, "--camera", "replay:" + folder_ / "walk"};
  }
  ProgramRun Replay(const std::vector<std::string>& more = {}) const {
    std::vector<std::string> arguments = Arguments();
    arguments.insert(arguments.end(), more.begin(), more.end());
    return Viewfixd(arguments);
  }

  TempFolder folder_;
  std::string model_;
};

void ExpectOneLine(const ProgramRun& run, int exit_code, const std::string& about) {
  EXPECT_EQ(run.exit_code, exit_code);
  EXPECT_EQ(run.out, "");
  EXPECT_THAT(Lines(run.err), SizeIs(1));
  EXPECT_THAT(run.err, StartsWith("viewfixd: "));
  EXPECT_THAT(run.err, HasSubstr(about));
}

std::string Between(const std::string& line, const std::string& from, const std::string& to) {
  const std::size_t begin = line.find(from);
  return line.substr(begin, line.find(to, begin) - begin);
}

TEST_F(ViewfixdTest, ReplaysAFolder) {
  const ProgramRun run = Replay();
  EXPECT_EQ(run.exit_code, 0) << run.err;
  const std::vector<std::string> lines = Lines(run.out);
  ASSERT_THAT(lines, SizeIs(4));
  for (int i = 0; i < 4; ++i) {
    EXPECT_THAT(lines[i], StartsWith("{\"schema\":1,\"seq\":" + std::to_string(i) + ","));
    EXPECT_THAT(lines[i], HasSubstr(i < 3 ? "\"location\":\"floor1/" : "\"location\":null"));
  }
  EXPECT_EQ(run.err, "viewfixd: 4 frames, 3 localized, 0 unusable\n");
}

TEST_F(ViewfixdTest, TwoRunsAgreeTimesAside) {
  const std::vector<std::string> first = Lines(Replay().out);
  const std::vector<std::string> second = Lines(Replay({"--publish", "stdout"}).out);
  ASSERT_EQ(first.size(), second.size());
  for (std::size_t i = 0; i < first.size(); ++i) {
    EXPECT_EQ(Between(first[i], "\"model\"", "\"ms\""), Between(second[i], "\"model\"", "\"ms\""));
  }
}

// The same JPEG turned by its EXIF block and by the option: the same pixels, the same fix.
TEST_F(ViewfixdTest, RotateTurnsFramesClockwise) {
  const std::vector<std::uint8_t> pixels = MakeTexture(kWidth, kHeight, 1);
  folder_.Write("plain/1.jpg", EncodeJpeg(pixels, kWidth, kHeight, 1));
  const auto fix_of = [&](const std::string& folder, const std::string& rotate) {
    const std::string camera = "replay:" + folder_ / folder;
    const ProgramRun run = Viewfixd({"--model", model_, "--camera", camera, "--rotate", rotate});
    return Between(run.out, "\"confidence\"", "\"pose\":null,");
  };
  const std::string unturned = fix_of("plain", "0");
  for (const auto& [orientation, rotate] : {std::pair(6, "90"), {3, "180"}, {8, "270"}}) {
    const JpegEncoding encoding = {.app1 = MakeExif(orientation, 0, false)};
    folder_.Write("turned/1.jpg", EncodeJpeg(pixels, kWidth, kHeight, 1, encoding));
    EXPECT_EQ(fix_of("plain", rotate), fix_of("turned", "0")) << rotate;
    EXPECT_NE(fix_of("plain", rotate), unturned) << rotate;
  }
}

TEST_F(ViewfixdTest, AWindowTakesThreeToEightFrames) {
  EXPECT_EQ(Replay({"--window", "5"}).exit_code, 0);
  EXPECT_EQ(Replay({"--window", "0"}).exit_code, 0);
  for (const char* window : {"2", "9", "-1", "5x", ""}) {
    ExpectOneLine(Replay({"--window", window}), 2, "--window");
  }
}

// The same frame again and again: surer and surer, unless each is judged alone.
TEST_F(ViewfixdTest, FramesThatAgreeGainConfidence) {
  for (const char* name : {"still/0.jpg", "still/1.jpg", "still/2.jpg"}) {
    folder_.Write(name, EncodeJpeg(MakeTexture(kWidth, kHeight, 1), kWidth, kHeight, 1));
  }
  const auto confidences = [&](const std::vector<std::string>& more) {
    std::vector<std::string> arguments = {"--model", model_, "--camera",
                                          "replay:" + folder_ / "still"};
    arguments.insert(arguments.end(), more.begin(), more.end());
    const ProgramRun run = Viewfixd(arguments);
    EXPECT_EQ(run.exit_code, 0) << run.err;
    std::vector<double> values;
    for (const std::string& line : Lines(run.out)) {
      values.push_back(std::stod(Between(line, "\"confidence\":", ",").substr(13)));
    }
    return values;
  };
  const auto alone = confidences({"--filter", "off"});
  ASSERT_THAT(alone, SizeIs(3));
  EXPECT_THAT(alone, testing::Each(alone[0]));
  for (const auto& filtered : {confidences({}), confidences({"--filter", "on"})}) {
    ASSERT_THAT(filtered, SizeIs(3));
    EXPECT_EQ(filtered[0], alone[0]);
    EXPECT_GT(filtered[1], filtered[0]);
    EXPECT_GT(filtered[2], filtered[1]);
  }
  ExpectOneLine(Replay({"--filter", "maybe"}), 2, "--filter maybe: not on or off");
}

TEST_F(ViewfixdTest, AnUnreadableFrameIsNamedCountedAndPassedOver) {
  folder_.Write("walk/1.jpg", "no JPEG");
  const ProgramRun run = Replay();
  EXPECT_EQ(run.exit_code, 0);
  EXPECT_THAT(Lines(run.out), SizeIs(3));
  EXPECT_THAT(run.out, Not(HasSubstr("\"seq\":1,")));
  EXPECT_THAT(run.err, HasSubstr("walk/1.jpg"));
  EXPECT_THAT(run.err, HasSubstr("3 frames, 2 localized, 1 unusable"));
}

TEST_F(ViewfixdTest, NoReadableFrameIsAFailure) {
  folder_.Write("bad/1.jpg", "no JPEG");
  const ProgramRun run = Viewfixd({"--model", model_, "--camera", "replay:" + folder_ / "bad"});
  EXPECT_EQ(run.exit_code, 1);
  EXPECT_THAT(run.err, HasSubstr("no frame could be used"));
}

TEST_F(ViewfixdTest, WrongUsageIsTwo) {
  const std::vector<std::vector<std::string>> wrong = {
      {},
      {"--model", model_},
      {"--camera", "replay:walk"},
      {"--model"},
      {"--nonsense"},
      {"-x"},
      {"--model", model_, "--camera", "replay:"},
      {"--model", model_, "--camera", "replay:walk", "--rotate", "45"},
      {"--model", model_, "--camera", "replay:walk", "--publish", "mqtt:here"},
      {"--model", model_, "--camera", "replay:walk", "more"},
  };
  for (const auto& arguments : wrong) ExpectOneLine(Viewfixd(arguments), 2, "see viewfixd --help");
}

TEST_F(ViewfixdTest, HelpAndVersion) {
  const ProgramRun help = Viewfixd({"--help"});
  EXPECT_EQ(help.exit_code, 0);
  EXPECT_THAT(help.out, HasSubstr("Example: viewfixd --model"));
  const ProgramRun version = Viewfixd({"--version"});
  EXPECT_EQ(version.exit_code, 0);
  EXPECT_THAT(version.out, StartsWith("viewfixd "));
}

TEST_F(ViewfixdTest, FailuresNameFileAndCause) {
  const std::string camera = "replay:" + folder_ / "walk";
  ExpectOneLine(Viewfixd({"--model", folder_ / "none.vfx", "--camera", camera}), 1,
                "none.vfx: No such file");
  ExpectOneLine(Viewfixd({"--model", folder_ / "walk/1.jpg", "--camera", camera}), 1, "walk/1.jpg");
  ExpectOneLine(Viewfixd({"--model", folder_.path(), "--camera", camera}), 1, "Is a directory");
  ExpectOneLine(Viewfixd({"--model", model_, "--camera", "replay:" + folder_ / "none"}), 1,
                "no such folder");
  folder_.Write("images.csv", "file\n1.jpg\n");
  ExpectOneLine(Viewfixd({"--model", model_, "--camera", "replay:" + folder_.path()}), 1,
                "images.csv");
}

TEST_F(ViewfixdTest, RefusesADamagedModel) {
  std::vector<std::uint8_t> bytes = TinyModel();
  bytes[bytes.size() / 2] ^= 1;
  folder_.Write("site.vfx", bytes);
  ExpectOneLine(Replay(), 1, "site.vfx");
  bytes.resize(bytes.size() / 3);
  folder_.Write("site.vfx", bytes);
  ExpectOneLine(Replay(), 1, "site.vfx");
}

TEST_F(ViewfixdTest, RefusesFeaturesItCannotMake) {
  ModelData data = TinyModelData();
  ++data.features.version;
  folder_.Write("site.vfx", *WriteModel(data));
  ExpectOneLine(Replay(), 1, "site.vfx");
}

std::string CalibrationYaml(const LandmarkSite& site, double fx) {
  const Camera& c = site.camera;
  std::ostringstream yaml;
  yaml << "%YAML:1.0\n---\nimage_width: " << c.width << "\nimage_height: " << c.height
       << "\ncamera_matrix: !!opencv-matrix\n  rows: 3\n  cols: 3\n  dt: d\n  data: [" << fx
       << ", 0, " << c.cx << ", 0, " << fx << ", " << c.cy << ", 0, 0, 1]\n";
  return yaml.str();
}

TEST_F(ViewfixdTest, FramesWithoutTheColoursThatTheModelWantsAreWarnedOfOnce) {
  const std::string model = folder_.Write("colours.vfx", *WriteModel(ColourModelData()));
  const auto errors_of = [&](int channels) {
    const auto pixels = MakeTexture(channels * kWidth, kHeight, 1);
    for (const char* name : {"frames/0.jpg", "frames/1.jpg"}) {
      folder_.Write(name, EncodeJpeg(pixels, kWidth, kHeight, channels));
    }
    return Viewfixd({"--model", model, "--camera", "replay:" + folder_ / "frames"}).err;
  };
  EXPECT_THAT(Lines(errors_of(1)), SizeIs(2));
  EXPECT_THAT(errors_of(1), HasSubstr("frames come without"));
  EXPECT_THAT(errors_of(1), HasSubstr("--features surf"));
  EXPECT_THAT(errors_of(3), Not(HasSubstr("frames come without")));
}

TEST_F(ViewfixdTest, CalibrationReplacesTheModelsCamera) {
  LandmarkSite site = MakeLandmarkSite();
  site.data.camera.intrinsics[0] = site.data.camera.intrinsics[1] = 120;  // wrong
  const std::string model = folder_.Write("landmarks.vfx", *WriteModel(site.data));
  folder_.Write("one/0.jpg", EncodeJpeg(site.pixels, site.width, site.height, 1));
  const std::string good = folder_.Write("good.yaml", CalibrationYaml(site, site.camera.fx));
  const auto run = [&](const std::vector<std::string>& more) {
    std::vector<std::string> arguments = {"--model", model, "--camera",
                                          "replay:" + folder_ / "one"};
    arguments.insert(arguments.end(), more.begin(), more.end());
    return Viewfixd(arguments);
  };
  const ProgramRun with = run({"--calibration", good});
  EXPECT_EQ(with.exit_code, 0) << with.err;
  EXPECT_THAT(with.out, HasSubstr("\"pose\":{\"frame\":\"world_from_cam\",\"map\":0,"));
  EXPECT_NE(Between(with.out, "\"inliers\"", "\"reasons\""),
            Between(run({}).out, "\"inliers\"", "\"reasons\""));
  ExpectOneLine(run({"--calibration", folder_ / "none.yaml"}), 1, "none.yaml: No such file");
  const std::string broken = folder_.Write("broken.yaml", CalibrationYaml(site, 0));
  ExpectOneLine(run({"--calibration", broken}), 1, "broken.yaml");
  const std::string empty = folder_.Write("empty.yaml", "");
  ExpectOneLine(run({"--calibration", empty}), 1, "empty.yaml");
  ExpectOneLine(run({"--calibration", ""}), 2, "--calibration needs a file");
}

// One of the calibration's shape at twice its size, and one of another: the first two are
// localized, the third is named and passed over.
TEST_F(ViewfixdTest, AFrameOfAnotherShapeThanItsCalibrationIsNamedAndPassedOver) {
  const LandmarkSite site = MakeLandmarkSite();
  const std::string model = folder_.Write("landmarks.vfx", *WriteModel(site.data));
  const std::string yaml = folder_.Write("camera.yaml", CalibrationYaml(site, site.camera.fx));
  std::vector<std::uint8_t> doubled;
  for (int y = 0; y < 2 * site.height; ++y) {
    for (int x = 0; x < 2 * site.width; ++x) {
      doubled.push_back(site.pixels[y / 2 * site.width + x / 2]);
    }
  }
  folder_.Write("mixed/0.jpg", EncodeJpeg(site.pixels, site.width, site.height, 1));
  folder_.Write("mixed/1.jpg", EncodeJpeg(site.pixels, site.height, site.width, 1));
  folder_.Write("mixed/2.jpg", EncodeJpeg(doubled, 2 * site.width, 2 * site.height, 1));
  const ProgramRun run = Viewfixd(
      {"--model", model, "--camera", "replay:" + folder_ / "mixed", "--calibration", yaml});
  EXPECT_EQ(run.exit_code, 0) << run.err;
  const std::vector<std::string> lines = Lines(run.out);
  ASSERT_THAT(lines, SizeIs(2)) << run.err;
  for (const std::string& line : lines) EXPECT_THAT(line, HasSubstr("\"pose\":{"));
  EXPECT_THAT(lines[1], HasSubstr("\"seq\":2,"));
  EXPECT_EQ(run.err,
            "viewfixd: image and camera calibration differ in shape: 1.jpg: 240x320 pixels, "
            "calibrated at 320x240\n"
            "viewfixd: 2 frames, 2 localized, 1 unusable\n");
}

// The same frame again and again: from the second on it is tracked, and stays where it is.
TEST_F(ViewfixdTest, AWalkIsTracked) {
  const LandmarkSite site = MakeLandmarkSite();
  const std::string model = folder_.Write("landmarks.vfx", *WriteModel(site.data));
  folder_.Write("still/0.jpg", EncodeJpeg(site.pixels, site.width, site.height, 1));
  folder_.Write("still/images.csv", "path\n0.jpg\n0.jpg\n0.jpg\n");
  const ProgramRun run = Viewfixd({"--model", model, "--camera", "replay:" + folder_ / "still"});
  const std::vector<std::string> lines = Lines(run.out);
  ASSERT_THAT(lines, SizeIs(3)) << run.err;
  for (int i = 0; i < 3; ++i) {
    EXPECT_THAT(lines[i], HasSubstr("\"pose\":{"));
    // A tracked frame is not scored.
    EXPECT_EQ(lines[i].find("\"score\":0,") != std::string::npos, i > 0) << lines[i];
  }
}

TEST_F(ViewfixdTest, AFullDiskIsAFailure) {
  const std::string command = std::string(VIEWFIXD) + " --model " + model_ +
                              " --camera replay:" + folder_ / "walk" + " > /dev/full";
  const ProgramRun run = RunProgram({"/bin/sh", "-c", command});
  ExpectOneLine(run, 1, "No space left on device");
}

// viewfixd with its stdout on a pipe, over a walk far longer than the pipe holds.
class ViewfixdPipeTest : public ViewfixdTest {
 protected:
  void SetUp() override {
    ViewfixdTest::SetUp();
    std::string rows = "path\n";
    for (int i = 0; i < 5000; ++i) rows += "0.jpg\n";
    folder_.Write("walk/images.csv", rows);
    int ends[2];
    ASSERT_EQ(::pipe2(ends, O_CLOEXEC), 0);
    reader_ = ends[0];
    Spawn(ends[1]);
    ::close(ends[1]);
    char first = 0;
    ASSERT_EQ(::read(reader_, &first, 1), 1);
  }
  void TearDown() override { CloseReader(); }

  void Spawn(int out) {
    posix_spawn_file_actions_t files;
    posix_spawn_file_actions_init(&files);
    posix_spawn_file_actions_adddup2(&files, out, STDOUT_FILENO);
    posix_spawn_file_actions_addopen(&files, STDERR_FILENO, (folder_ / "err").c_str(),
                                     O_WRONLY | O_CREAT, 0600);
    std::vector<std::string> words = Arguments();
    words.insert(words.begin(), VIEWFIXD);
    std::vector<char*> arguments;
    for (std::string& word : words) arguments.push_back(word.data());
    arguments.push_back(nullptr);
    ASSERT_EQ(posix_spawn(&pid_, VIEWFIXD, &files, nullptr, arguments.data(), environ), 0);
    posix_spawn_file_actions_destroy(&files);
  }
  void CloseReader() {
    if (reader_ >= 0) ::close(reader_);
    reader_ = -1;
  }
  int Wait() const {
    int status = 0;
    waitpid(pid_, &status, 0);
    return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
  }
  std::string Errors() const {
    std::ifstream file(folder_ / "err");
    return {std::istreambuf_iterator<char>(file), {}};
  }

  int reader_ = -1;
  pid_t pid_ = 0;
};

TEST_F(ViewfixdPipeTest, EndsQuietlyWhenNobodyReads) {
  CloseReader();
  EXPECT_EQ(Wait(), 0);
  EXPECT_EQ(Errors(), "");
}

TEST_F(ViewfixdPipeTest, ASignalEndsItCleanly) {
  ::kill(pid_, SIGTERM);
  std::string text(1 << 16, ' ');
  while (::read(reader_, text.data(), text.size()) > 0) {
  }
  EXPECT_EQ(Wait(), 0);
  EXPECT_THAT(Errors(), HasSubstr("localized, 0 unusable"));
  EXPECT_THAT(Errors(), Not(HasSubstr("5000 frames")));
}

// A camera whose driver does not answer, so to speak: nobody ever writes to this pipe.
TEST_F(ViewfixdPipeTest, ASignalEndsItWhateverACameraWaitsFor) {
  ::kill(pid_, SIGKILL);
  Wait();
  ASSERT_EQ(::mkfifo((folder_ / "walk/stuck.jpg").c_str(), 0600), 0);
  folder_.Write("walk/images.csv", std::string_view("path\n0.jpg\nstuck.jpg\n"));
  int ends[2];
  ASSERT_EQ(::pipe2(ends, O_CLOEXEC), 0);
  Spawn(ends[1]);
  ::close(ends[1]);
  char first = 0;
  ASSERT_EQ(::read(ends[0], &first, 1), 1);
  ::close(ends[0]);
  ::kill(pid_, SIGTERM);
  EXPECT_EQ(Wait(), 0);
}

TEST_F(ViewfixdTest, StartsFromTheStoresModel) {
  const std::string store = folder_ / "store";
  const std::string trust = folder_ / "trust";
  folder_.Write("trust/museum.pub", TestKey(1).OpenText());
  const std::vector<std::string> run = {"--store", store,      "--trust",
                                        trust,     "--camera", "replay:" + folder_ / "walk"};
  ExpectOneLine(Viewfixd(run), 1, "store: No such file");
  const auto in_store = [&](std::vector<std::string> words) {
    words.insert(words.begin(), "store");
    words.insert(words.end(), {"--store", store, "--trust", trust});
    return Viewfixd(words);
  };
  ExpectOneLine(in_store({"install", model_}), 1, "not signed");
  folder_.Write("site.vfx.minisig", TestKey(1).Sign(TinyModel(), {"museum", 3}));
  EXPECT_EQ(in_store({"install", model_}).exit_code, 0);
  const ProgramRun frames = Viewfixd(run);
  EXPECT_EQ(frames.exit_code, 0) << frames.err;
  EXPECT_THAT(Lines(frames.out), SizeIs(4));
  const ProgramRun status = in_store({"status"});
  EXPECT_THAT(status.out, HasSubstr("site museum, version 3 (on trial, 1 starts"));
  const std::string id = status.out.substr(10, 16);
  EXPECT_THAT(frames.out, HasSubstr("\"model\":\"" + id + "\""));
  EXPECT_EQ(in_store({"confirm"}).exit_code, 0);
  EXPECT_THAT(in_store({"status", "--json"}).out, HasSubstr("\"confirmed\":true"));
  ExpectOneLine(in_store({"rollback"}), 1, "no model to go back to");
  EXPECT_EQ(in_store({"gc"}).exit_code, 0);
  folder_.Write("store/" + id + ".vfx", std::string("broken"));
  EXPECT_EQ(in_store({"status"}).exit_code, 1);
  ExpectOneLine(Viewfixd(run), 1, "not the model that was installed");
}

TEST_F(ViewfixdTest, WrongUsageOfTheStoreSaysSo) {
  for (const std::vector<std::string>& wrong : {std::vector<std::string>{"store"},
                                                {"store", "fly"},
                                                {"store", "install"},
                                                {"store", "status", "x"},
                                                {"store", "gc", "--keep", "1"},
                                                {"store", "status", "--no"},
                                                {"store", "install", "x", "--allow", "all"},
                                                {"store", "status", "--store"},
                                                {"store", "serial", "/dev/null", "--baud", "1"}}) {
    ExpectOneLine(Viewfixd(wrong), 2, "see viewfixd store --help");
  }
  EXPECT_THAT(Viewfixd({"store", "--help"}).out, HasSubstr("viewfixd store status"));
}

}  // namespace
}  // namespace viewfix
