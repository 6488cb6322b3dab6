// SPDX-License-Identifier: BSD-3-Clause
//
// viewfixd as it runs for months: what changes under it, and what is missing.
#include <fcntl.h>
#include <gmock/gmock.h>
#include <poll.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <csignal>
#include <filesystem>
#include <fstream>
#include <functional>
#include <iterator>

#include "tests/testing/jpeg_encoder.h"
#include "tests/testing/run_program.h"
#include "tests/testing/temp_folder.h"
#include "tests/testing/tiny_model.h"

namespace viewfix {
namespace {

using testing::HasSubstr;

constexpr int kWidth = 200;
constexpr int kHeight = 150;
constexpr int kPatienceMs = 20'000;

// A viewfixd whose stdout is read line by line. Killed at the end of the scope.
class Daemon {
 public:
  Daemon(const TempFolder& folder, std::vector<std::string> words) : err_(folder / "err") {
    int ends[2];
    EXPECT_EQ(::pipe2(ends, O_CLOEXEC), 0);
    out_ = ends[0];
    posix_spawn_file_actions_t files;
    posix_spawn_file_actions_init(&files);
    posix_spawn_file_actions_adddup2(&files, ends[1], STDOUT_FILENO);
    posix_spawn_file_actions_addopen(&files, STDERR_FILENO, err_.c_str(),
                                     O_WRONLY | O_CREAT | O_TRUNC, 0600);
    words.insert(words.begin(), VIEWFIXD);
    std::vector<char*> arguments;
    for (std::string& word : words) arguments.push_back(word.data());
    arguments.push_back(nullptr);
    EXPECT_EQ(posix_spawn(&pid_, VIEWFIXD, &files, nullptr, arguments.data(), environ), 0);
    posix_spawn_file_actions_destroy(&files);
    ::close(ends[1]);
  }
  ~Daemon() {
    if (pid_ > 0) {
      ::kill(pid_, SIGKILL);
      ::waitpid(pid_, nullptr, 0);
    }
    ::close(out_);
  }
  Daemon(const Daemon&) = delete;
  Daemon& operator=(const Daemon&) = delete;

  void Signal(int signal) const { ::kill(pid_, signal); }

  // The next line; empty: none came in time.
  std::string Line() {
    pollfd waiting = {out_, POLLIN, 0};
    char buffer[4096];
    while (text_.find('\n') == std::string::npos) {
      if (::poll(&waiting, 1, kPatienceMs) <= 0) return {};
      const ssize_t got = ::read(out_, buffer, sizeof buffer);
      if (got <= 0) return {};
      text_.append(buffer, static_cast<std::size_t>(got));
    }
    std::string line = text_.substr(0, text_.find('\n'));
    text_.erase(0, line.size() + 1);
    return line;
  }

  // The first line with this in it; empty: none of the next thousand.
  std::string LineWith(const std::string& part) {
    for (int i = 0; i < 1000; ++i) {
      std::string line = Line();
      if (line.empty() || line.find(part) != std::string::npos) return line;
    }
    return {};
  }

  // Its exit code after SIGTERM.
  int End() {
    Signal(SIGTERM);
    int status = 0;
    ::waitpid(std::exchange(pid_, 0), &status, 0);
    return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
  }
  std::string Errors() const {
    std::ifstream file(err_);
    return {std::istreambuf_iterator<char>(file), {}};
  }

 private:
  std::string err_;
  int out_ = -1;
  pid_t pid_ = 0;
  std::string text_;
};

class DaemonTest : public testing::Test {
 protected:
  void SetUp() override {
    PutModel(TinyModelData());
    folder_.Write("walk/0.jpg", EncodeJpeg(MakeTexture(kWidth, kHeight, 1), kWidth, kHeight, 1));
  }

  // As it should be done: written beside its place, then renamed.
  void PutModel(const ModelData& data) {
    folder_.Write("site.new", *WriteModel(data));
    std::filesystem::rename(folder_ / "site.new", folder_ / "site.vfx");
  }
  // A camera's frames come at their own pace; without `real_time`, each waits for its answer.
  void PutConfig(const std::string& more, bool real_time = true) {
    folder_.Write("viewfixd.toml", "model = \"" + folder_ / "site.vfx" +
                                       "\"\ncamera = \"replay:" + folder_ / "walk" +
                                       "\"\nreal_time = " + (real_time ? "true" : "false") +
                                       "\nloop = true\nrate = 50\n" + more);
  }
  std::vector<std::string> WithConfig() const { return {"--config", folder_ / "viewfixd.toml"}; }

  TempFolder folder_;
};

std::string FieldOf(const std::string& line, const std::string& key) {
  const std::size_t at = line.find("\"" + key + "\":");
  const std::size_t begin = at + key.size() + 3;
  return line.substr(begin, line.find(',', begin) - begin);
}

TEST_F(DaemonTest, ANewModelIsTakenUpWithoutLosingAFrame) {
  PutConfig("max_fps = 50\n", /*real_time=*/false);
  Daemon daemon(folder_, WithConfig());
  const std::string first = daemon.Line();
  ASSERT_THAT(first, HasSubstr("\"state\":\"localized\""));
  ModelData other = TinyModelData();
  other.bias[0] += 0.5F;
  PutModel(other);
  std::uint64_t sequence = std::stoull(FieldOf(first, "seq"));
  std::string line = first;
  for (int i = 0; i < 2000 && FieldOf(line, "model") == FieldOf(first, "model"); ++i) {
    line = daemon.Line();
    ASSERT_FALSE(line.empty());
    EXPECT_EQ(std::stoull(FieldOf(line, "seq")), sequence + 1);
    sequence = std::stoull(FieldOf(line, "seq"));
  }
  EXPECT_NE(FieldOf(line, "model"), FieldOf(first, "model"));
  EXPECT_EQ(daemon.End(), 0);
  EXPECT_THAT(daemon.Errors(), HasSubstr("is in use"));
}

// Frames that were under way for the grey model say nothing; the next ones do.
TEST_F(DaemonTest, AModelThatWantsColoursIsWarnedOfAGreyCamera) {
  PutConfig("max_fps = 50\n", /*real_time=*/false);
  Daemon daemon(folder_, WithConfig());
  const std::string first = daemon.Line();
  PutModel(ColourModelData());
  std::string line = first;
  for (int i = 0; i < 2000 && FieldOf(line, "model") == FieldOf(first, "model"); ++i) {
    line = daemon.Line();
  }
  for (int i = 0; i < 3; ++i) ASSERT_FALSE(daemon.Line().empty());
  EXPECT_EQ(daemon.End(), 0);
  EXPECT_THAT(daemon.Errors(), HasSubstr("frames come without"));
}

TEST_F(DaemonTest, ADamagedModelLeavesTheOldOneInUse) {
  PutConfig("");
  Daemon daemon(folder_, WithConfig());
  const std::string model = FieldOf(daemon.Line(), "model");
  folder_.Write("site.vfx", "damaged");
  daemon.Signal(SIGHUP);
  for (int i = 0; i < 100; ++i) EXPECT_EQ(FieldOf(daemon.Line(), "model"), model);
  EXPECT_EQ(daemon.End(), 0);
  EXPECT_THAT(daemon.Errors(), HasSubstr("site.vfx"));
}

TEST_F(DaemonTest, AHangUpReadsTheConfigurationAgain) {
  PutConfig("");
  Daemon daemon(folder_, WithConfig());
  const std::string upright = FieldOf(daemon.Line(), "score");
  PutConfig("rotate = 90\n");
  daemon.Signal(SIGHUP);
  std::string score = upright;
  for (int i = 0; i < 500 && score == upright; ++i) score = FieldOf(daemon.Line(), "score");
  EXPECT_NE(score, upright);
  // A broken one changes nothing.
  PutConfig("rotate = 45\n");
  daemon.Signal(SIGHUP);
  for (int i = 0; i < 100; ++i) EXPECT_EQ(FieldOf(daemon.Line(), "score"), score);
  EXPECT_EQ(daemon.End(), 0);
  EXPECT_THAT(daemon.Errors(), HasSubstr("viewfixd.toml:6: --rotate 45"));
}

TEST_F(DaemonTest, AnotherCameraGoesOnCounting) {
  PutConfig("");
  folder_.Write("other/0.jpg", EncodeJpeg(MakeTexture(kWidth, kHeight, 9), kWidth, kHeight, 1));
  Daemon daemon(folder_, WithConfig());
  const std::string first = daemon.Line();
  std::filesystem::rename(folder_ / "walk", folder_ / "away");
  std::filesystem::rename(folder_ / "other", folder_ / "walk");
  PutConfig("size = \"320x240\"\n");  // the same folder's name; a setting of the camera differs
  daemon.Signal(SIGHUP);
  std::string line = first;
  std::uint64_t sequence = std::stoull(FieldOf(first, "seq"));
  for (int i = 0; i < 500 && FieldOf(line, "score") == FieldOf(first, "score"); ++i) {
    line = daemon.Line();
    ASSERT_FALSE(line.empty());
    EXPECT_GT(std::stoull(FieldOf(line, "seq")), sequence);
    sequence = std::stoull(FieldOf(line, "seq"));
  }
  EXPECT_NE(FieldOf(line, "score"), FieldOf(first, "score"));
}

TEST_F(DaemonTest, AMissingModelIsAStateUntilItComes) {
  std::filesystem::rename(folder_ / "site.vfx", folder_ / "away.vfx");
  PutConfig("");
  Daemon daemon(folder_, WithConfig());
  const std::string line = daemon.Line();
  EXPECT_THAT(line, HasSubstr("\"state\":\"no_model\",\"location\":null"));
  EXPECT_THAT(line, HasSubstr("site.vfx: No such file"));
  EXPECT_THAT(line, HasSubstr("\"model\":null"));
  std::filesystem::rename(folder_ / "away.vfx", folder_ / "site.vfx");
  EXPECT_THAT(daemon.LineWith("\"localized\""), HasSubstr("\"location\":\"floor1/"));
  EXPECT_EQ(daemon.End(), 0);
}

TEST_F(DaemonTest, AMissingCameraIsAState) {
  Daemon daemon(folder_, {"--model", folder_ / "site.vfx", "--camera", "v4l2:/dev/video-none"});
  for (int i = 0; i < 2; ++i) {
    const std::string line = daemon.LineWith("No such file");
    EXPECT_THAT(line, HasSubstr("\"state\":\"no_camera\",\"location\":null"));
    EXPECT_THAT(line, HasSubstr("/dev/video-none"));
  }
  EXPECT_EQ(daemon.End(), 0);
}

TEST_F(DaemonTest, AStillSceneIsLookedAtLessOften) {
  PutConfig("idle_fps = 1\nmax_fps = 25\n");
  Daemon daemon(folder_, WithConfig());
  std::uint64_t before = std::stoull(FieldOf(daemon.Line(), "seq"));
  std::uint64_t gap = 0;
  for (int i = 0; i < 200 && gap < 10; ++i) {
    const std::uint64_t sequence = std::stoull(FieldOf(daemon.Line(), "seq"));
    gap = sequence - before;
    before = sequence;
  }
  EXPECT_GE(gap, 10U);  // of 50 frames a second, 25 of them answered while something moves
  EXPECT_EQ(daemon.End(), 0);
}

TEST_F(DaemonTest, CheckConfigSaysWhatIsWrong) {
  PutConfig("");
  const auto check = [&] {
    return RunProgram({VIEWFIXD, "--check-config", "--config", folder_ / "viewfixd.toml"});
  };
  EXPECT_EQ(check().exit_code, 0);
  PutConfig("publish = \"http:0.0.0.0:8080\"\n");
  EXPECT_EQ(check().exit_code, 2);
  EXPECT_THAT(check().err, HasSubstr("needs --token-file"));
  PutConfig("nonsense = 1\n");
  EXPECT_EQ(check().exit_code, 2);
  EXPECT_THAT(check().err, HasSubstr("viewfixd.toml:6: unknown setting nonsense"));
}

TEST_F(DaemonTest, FlagsWinOverTheFile) {
  PutConfig("publish = \"none\"\n");
  Daemon daemon(folder_, {"--config", folder_ / "viewfixd.toml", "--publish", "stdout"});
  EXPECT_NE(daemon.Line(), "");
}

}  // namespace
}  // namespace viewfix
