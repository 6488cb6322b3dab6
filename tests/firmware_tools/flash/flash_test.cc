// SPDX-License-Identifier: BSD-3-Clause
#include <fcntl.h>
#include <gmock/gmock.h>
#include <poll.h>
#include <pty.h>
#include <spawn.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <termios.h>
#include <unistd.h>

#include <atomic>
#include <csignal>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <random>
#include <string>
#include <thread>

#include "firmware_tools/dataset/image_set.h"
#include "firmware_tools/dataset/tool_file.h"
#include "firmware_tools/flash/link.h"
#include "models/model_writer.h"
#include "tests/firmware_tools/cli/viewfix_program.h"
#include "tests/testing/temp_folder.h"
#include "tests/testing/test_key.h"
#include "tests/testing/tiny_model.h"

namespace viewfix {
namespace {

using testing::ContainsRegex;
using testing::HasSubstr;
using testing::Not;
using Json = nlohmann::json;

// Tells models apart, and fills them with what does not compress.
std::vector<std::uint8_t> NumberedModel(int number, std::size_t filler = 300'000) {
  ModelData data = TinyModelData();
  std::mt19937 random(7);
  data.record = "{\"number\": " + std::to_string(number) + ", \"filler\": \"";
  for (std::size_t i = 0; i < filler; ++i) {
    data.record += static_cast<char>('#' + random() % 57);
  }
  data.record += "\"}";
  return *WriteModel(data);
}

class FlashTest : public testing::Test {
 protected:
  void SetUp() override {
    for (int number : {1, 2}) {
      const auto bytes = NumberedModel(number);
      const std::string path = folder_.Write(Model(number), bytes);
      folder_.Write(Model(number) + ".minisig",
                    key_.Sign(bytes, {"museum", static_cast<std::uint64_t>(number)}));
    }
    key_file_ = folder_.Write("museum.pub", key_.OpenText());
    Trusting("store");
  }

  static std::string Model(int number) { return std::to_string(number) + ".vfx"; }
  std::string PathOf(int number) const { return folder_ / Model(number); }
  // A board's store with the key in the trust folder beside it.
  void Trusting(const std::string& store) const {
    std::filesystem::create_directories(folder_ / store);
    folder_.Write(store + "/trust/museum.pub", key_.OpenText());
  }
  std::string Dir(const std::string& store = "store") const { return "dir:" + folder_ / store; }
  ProgramRun Status(const std::string& store = "store") const {
    return RunProgram({VIEWFIXD, "store", "status", "--json", "--store", folder_ / store, "--trust",
                       folder_ / (store + "/trust")});
  }
  int VersionAt(const std::string& store = "store") const {
    const ProgramRun run = Status(store);
    EXPECT_EQ(run.exit_code, 0) << run.err;
    const Json current = Json::parse(run.out).at("current");
    return current.is_null() ? 0 : current.at("version").get<int>();
  }

  TempFolder folder_;
  const TestKey key_{1};
  std::string key_file_;
};

TEST_F(FlashTest, IntoAFolder) {
  const ProgramRun run = Viewfix({"flash", PathOf(1), "--to", Dir()});
  EXPECT_EQ(run.exit_code, 0) << run.err;
  EXPECT_THAT(run.out, ContainsRegex("dir:.*store: model [0-9a-f]{16}, "));
  EXPECT_EQ(VersionAt(), 1);
  EXPECT_EQ(Viewfix({"flash", PathOf(2), "--to", Dir()}).exit_code, 0);
  EXPECT_EQ(VersionAt(), 2);
  EXPECT_EQ(Viewfix({"flash", PathOf(2), "--to", Dir()}).exit_code, 0) << "there already";
}

TEST_F(FlashTest, ARefusalIsOneLine) {
  ASSERT_EQ(Viewfix({"flash", PathOf(2), "--to", Dir()}).exit_code, 0);
  const ProgramRun older = Viewfix({"flash", PathOf(1), "--to", Dir()});
  EXPECT_EQ(older.exit_code, 1);
  EXPECT_THAT(older.out, HasSubstr("FAILED: an older model"));
  EXPECT_EQ(Viewfix({"flash", PathOf(1), "--allow", "older", "--to", Dir()}).exit_code, 0);
  std::filesystem::remove(PathOf(2) + ".minisig");
  const ProgramRun unsigned_model = Viewfix({"flash", PathOf(2), "--to", Dir()});
  EXPECT_EQ(unsigned_model.exit_code, 1);
  EXPECT_THAT(unsigned_model.out, HasSubstr("FAILED: the model is not signed"));
  EXPECT_EQ(VersionAt(), 1);
  EXPECT_EQ(Viewfix({"flash", PathOf(1)}).exit_code, 2);
  EXPECT_EQ(Viewfix({"flash", PathOf(1), "--to", "ftp://x"}).exit_code, 1);
}

TEST_F(FlashTest, SendsWhatDiffersFromTheBoardsModel) {
  ASSERT_EQ(Viewfix({"flash", PathOf(1), "--to", Dir()}).exit_code, 0);
  const ProgramRun run =
      Viewfix({"flash", PathOf(2), "--base", PathOf(1), "--to", Dir(), "--json"});
  ASSERT_EQ(run.exit_code, 0) << run.err;
  const Json sent = Json::parse(Lines(run.out).at(0));
  EXPECT_LT(sent.at("total").get<int>(), 3000);
  EXPECT_EQ(Json::parse(Lines(run.out).back()).at("failed"), 0);
  EXPECT_EQ(VersionAt(), 2);
}

TEST_F(FlashTest, ManyBoardsAndASummary) {
  Trusting("hall");
  std::filesystem::create_directories(folder_ / "stairs");  // trusts nobody
  const std::string boards = folder_.Write(
      "boards.txt", "# the building\n" + Dir() + "\n" + Dir("hall") + "  # new\n" + Dir("stairs"));
  const ProgramRun run = Viewfix({"flash", PathOf(1), "--boards", boards, "--json"});
  EXPECT_EQ(run.exit_code, 1);
  EXPECT_THAT(run.err, HasSubstr("1 of 3 boards failed: " + Dir("stairs")));
  const Json summary = Json::parse(Lines(run.out).back());
  EXPECT_EQ(summary.at("boards"), 3);
  EXPECT_EQ(summary.at("failed"), 1);
  EXPECT_EQ(VersionAt(), 1);
  EXPECT_EQ(VersionAt("hall"), 1);
  EXPECT_FALSE(std::filesystem::exists(folder_ / "stairs/pointer-1"));
  const std::string twice = folder_.Write("twice.txt", Dir() + "\n" + Dir() + "\n");
  const ProgramRun again = Viewfix({"flash", PathOf(1), "--boards", twice});
  EXPECT_EQ(again.exit_code, 1);
  EXPECT_THAT(again.err, HasSubstr("twice.txt (line 2): "));
}

TEST_F(FlashTest, ProvisionedBoardsTakeModels) {
  const ProgramRun run = Viewfix({"provision", "--key", key_file_, "--site", "museum", "--to",
                                  "dir:" + folder_ / "card/var/lib/viewfix"});
  EXPECT_EQ(run.exit_code, 1) << "no such folder yet";
  std::filesystem::create_directories(folder_ / "card/var/lib/viewfix");
  std::filesystem::create_directories(folder_ / "card/etc/viewfix");
  const std::string configuration = folder_.Write("my.toml", std::string("# mine\n"));
  const std::string card = "dir:" + folder_ / "card/var/lib/viewfix";
  const ProgramRun good = Viewfix({"provision", "--key", key_file_, "--site", "museum", "--config",
                                   configuration, "--to", card});
  EXPECT_EQ(good.exit_code, 0) << good.out << good.err;
  EXPECT_EQ(ReadTextFile(folder_ / "card/etc/viewfix/trust/site"), "museum\n");
  EXPECT_EQ(ReadTextFile(folder_ / "card/etc/viewfix/viewfixd.toml"), "# mine\n");
  EXPECT_EQ(Viewfix({"flash", PathOf(1), "--to", card}).exit_code, 0);
  const ProgramRun last =
      Viewfix({"provision", "--revoke", KeyIdText(key_.open().id), "--to", card});
  EXPECT_EQ(last.exit_code, 1);
  EXPECT_THAT(last.out, HasSubstr("the last trusted key"));
}

TEST(BoardAddressTest, ReadsWhatTheHelpSays) {
  BoardAddress address = ParseAddress("ssh://pi@hall-cam:2222/srv/models");
  EXPECT_EQ(address.host, "pi@hall-cam");
  EXPECT_EQ(address.port, 2222);
  EXPECT_EQ(address.folder, "/srv/models");
  address = ParseAddress("ssh://[fe80::1]:22");
  EXPECT_EQ(address.host, "fe80::1");
  EXPECT_EQ(address.port, 22);
  EXPECT_EQ(ParseAddress("ssh://hall-cam/").folder, "");
  EXPECT_EQ(ParseAddress("serial:/dev/ttyACM0").device, "/dev/ttyACM0");
  for (const char* wrong : {"", "dir:", "ssh://", "ssh://:22", "ssh://a:0", "ssh://a:99999",
                            "ssh://a:x", "ssh://-oProxyCommand=x", "serial:", "hall-cam"}) {
    EXPECT_THROW(ParseAddress(wrong), ToolError) << wrong;
  }
}

// A program named ssh that runs the command here, and can lose the link.
class FakeSshTest : public FlashTest {
 protected:
  void SetUp() override {
    FlashTest::SetUp();
    Trusting("a board's store");
    const std::string path = folder_.Write("bin/ssh", R"(#!/bin/sh
while [ "$1" != -- ]; do shift; done
shift
echo "$1" >> )" + (folder_ / "hosts") + R"(
if [ -e )" + (folder_ / "cut") + R"( ]; then
  rm )" + (folder_ / "cut") + R"(
  dd bs=1 count=100000 2> /dev/null | sh -c "$2"
  echo "client_loop: send disconnect: Broken pipe" >&2
  exit 255
fi
exec sh -c "$2"
)");
    ASSERT_EQ(chmod(path.c_str(), 0755), 0);
  }
  ProgramRun Flash(std::vector<std::string> more, const std::string& program = VIEWFIXD) const {
    std::vector<std::string> command = {"/usr/bin/env",
                                        "PATH=" + folder_ / "bin" + ":/usr/bin:/bin",
                                        VIEWFIX,
                                        "flash",
                                        "--board-program",
                                        program,
                                        "--trust",
                                        folder_ / "a board's store/trust",
                                        "--to",
                                        "ssh://pi@hall-cam" + folder_ / "a board's store"};
    command.insert(command.end(), more.begin(), more.end());
    return RunProgram(command);
  }
};

TEST_F(FakeSshTest, RunsTheBoardsOwnProgram) {
  const ProgramRun run = Flash({PathOf(1)});
  EXPECT_EQ(run.exit_code, 0) << run.out << run.err;
  EXPECT_EQ(ReadTextFile(folder_ / "hosts"), "pi@hall-cam\n");
  EXPECT_EQ(VersionAt("a board's store"), 1);
}

TEST_F(FakeSshTest, GoesOnWhereTheLinkBroke) {
  folder_.Write("cut", std::string());
  const ProgramRun run = Flash({PathOf(1), "--json"});
  ASSERT_EQ(run.exit_code, 0) << run.out << run.err;
  EXPECT_EQ(Lines(ReadTextFile(folder_ / "hosts")).size(), 2U);
  const auto lines = Lines(run.out);
  const Json done = Json::parse(lines.at(lines.size() - 2));
  EXPECT_EQ(done.at("tries"), 2);
  EXPECT_THAT(done.at("text").get<std::string>(), HasSubstr("resumed"));
  EXPECT_EQ(VersionAt("a board's store"), 1);
}

TEST_F(FakeSshTest, WithoutRetriesTheNextCommandGoesOn) {
  folder_.Write("cut", std::string());
  const ProgramRun cut = Flash({PathOf(1), "--retries", "0"});
  EXPECT_EQ(cut.exit_code, 1);
  EXPECT_THAT(cut.out, HasSubstr("send disconnect: Broken pipe"));
  EXPECT_THAT(Flash({PathOf(1)}).out, HasSubstr("resumed"));
}

TEST_F(FakeSshTest, ABoardWithoutViewfixdSaysSo) {
  const ProgramRun run = Flash({PathOf(1), "--retries", "0"}, "/none/viewfixd");
  EXPECT_EQ(run.exit_code, 1);
  EXPECT_THAT(run.out + run.err, HasSubstr("/none/viewfixd: not found"));
}

// Two serial lines' far ends, joined by a thread that loses and changes some bytes.
class NoisyCable {
 public:
  explicit NoisyCable(int bytes_between_faults) : every_(bytes_between_faults) {
    for (End& end : ends_) {
      char name[128];
      int near = -1;
      EXPECT_EQ(openpty(&end.master, &near, name, nullptr, nullptr), 0);
      termios line = {};
      tcgetattr(near, &line);
      cfmakeraw(&line);
      tcsetattr(near, TCSANOW, &line);
      end.near = near;  // held open: the line does not hang up between sessions
      end.name = name;
    }
    thread_ = std::thread([this] { Relay(); });
  }
  ~NoisyCable() {
    stop_ = true;
    thread_.join();
    for (const End& end : ends_) {
      ::close(end.master);
      ::close(end.near);
    }
  }
  NoisyCable(const NoisyCable&) = delete;
  NoisyCable& operator=(const NoisyCable&) = delete;
  const std::string& laptop() const { return ends_[0].name; }
  const std::string& board() const { return ends_[1].name; }
  int faults() const { return faults_; }

 private:
  struct End {
    int master = -1;
    int near = -1;
    std::string name;
  };
  void Relay() {
    std::mt19937 random(3);
    while (!stop_) {
      pollfd ready[2] = {{ends_[0].master, POLLIN, 0}, {ends_[1].master, POLLIN, 0}};
      ::poll(ready, 2, 50);
      for (int from : {0, 1}) {
        if ((ready[from].revents & POLLIN) == 0) continue;
        char bytes[1024];
        const ssize_t got = ::read(ends_[from].master, bytes, sizeof bytes);
        if (got > 0) Pass(bytes, got, ends_[1 - from].master, random);
      }
    }
  }
  void Pass(char* bytes, ssize_t got, int to, std::mt19937& random) {
    for (ssize_t i = 0; i < got; ++i) {
      const bool fault = every_ > 0 && random() % every_ == 0;
      if (fault) ++faults_;
      if (fault && random() % 2 == 0) continue;
      const char byte = fault ? static_cast<char>(bytes[i] ^ 0x10) : bytes[i];
      static_cast<void>(!::write(to, &byte, 1));
    }
  }

  End ends_[2];
  int every_;
  std::atomic<int> faults_ = 0;
  std::atomic<bool> stop_ = false;
  std::thread thread_;
};

// viewfixd store serial, until the end of the scope.
class SerialBoard {
 public:
  SerialBoard(const std::string& device, const std::string& store) {
    std::vector<std::string> words = {VIEWFIXD, "store",   "serial",         device,   "--store",
                                      store,    "--trust", store + "/trust", "--baud", "921600"};
    std::vector<char*> arguments;
    for (std::string& word : words) arguments.push_back(word.data());
    arguments.push_back(nullptr);
    posix_spawn_file_actions_t files;
    posix_spawn_file_actions_init(&files);
    posix_spawn_file_actions_addopen(&files, STDERR_FILENO, "/dev/null", O_WRONLY, 0);
    EXPECT_EQ(posix_spawn(&pid_, VIEWFIXD, &files, nullptr, arguments.data(), environ), 0);
    posix_spawn_file_actions_destroy(&files);
  }
  ~SerialBoard() {
    ::kill(pid_, SIGTERM);
    ::waitpid(pid_, nullptr, 0);
  }
  SerialBoard(const SerialBoard&) = delete;
  SerialBoard& operator=(const SerialBoard&) = delete;

 private:
  pid_t pid_ = 0;
};

class SerialTest : public FlashTest {
 protected:
  ProgramRun Flash(const NoisyCable& cable, int number) const {
    return Viewfix(
        {"flash", PathOf(number), "--to", "serial:" + cable.laptop(), "--baud", "921600"});
  }
};

TEST_F(SerialTest, FlashesOneAfterAnother) {
  const NoisyCable cable(0);
  const SerialBoard board(cable.board(), folder_ / "store");
  for (int number : {1, 2}) {
    const ProgramRun run = Flash(cable, number);
    EXPECT_EQ(run.exit_code, 0) << run.out << run.err;
    EXPECT_EQ(VersionAt(), number);
  }
}

TEST_F(SerialTest, NoiseCostsTimeAndNothingElse) {
  const NoisyCable cable(20000);
  const SerialBoard board(cable.board(), folder_ / "store");
  const ProgramRun run = Flash(cable, 1);
  EXPECT_EQ(run.exit_code, 0) << run.out << run.err;
  EXPECT_EQ(VersionAt(), 1);
  EXPECT_GT(cable.faults(), 3);
}

TEST_F(SerialTest, WhatIsNoSerialLineSaysSo) {
  const ProgramRun run = Viewfix({"flash", PathOf(1), "--to", "serial:/dev/null"});
  EXPECT_EQ(run.exit_code, 1);
  EXPECT_THAT(run.out, HasSubstr("not a serial line (/dev/null"));
}

// The real thing: an OpenSSH server of our own on a free port of the loopback.
class RealSshTest : public FlashTest {
 protected:
  void SetUp() override {
    FlashTest::SetUp();
    const std::string sshd = "/usr/sbin/sshd";
    if (access(sshd.c_str(), X_OK) != 0 || access("/usr/bin/ssh-keygen", X_OK) != 0) {
      GTEST_SKIP() << "sshd is not installed (Debian's openssh-server)";
    }
    if (geteuid() == 0) std::filesystem::create_directories("/run/sshd");
    for (const char* name : {"host", "user"}) {
      ASSERT_EQ(
          RunProgram({"/usr/bin/ssh-keygen", "-q", "-t", "ed25519", "-N", "", "-f", folder_ / name})
              .exit_code,
          0);
    }
    port_ = 20000 + static_cast<int>(getpid() % 30000);
    const std::string configuration = folder_.Write(
        "sshd_config", "Port " + std::to_string(port_) + "\nListenAddress 127.0.0.1\nHostKey " +
                           (folder_ / "host") + "\nAuthorizedKeysFile " + (folder_ / "user.pub") +
                           "\nStrictModes no\nUsePAM no\nPasswordAuthentication no\nPidFile none\n"
                           "PermitRootLogin yes\n");
    std::vector<std::string> words = {sshd, "-D", "-f", configuration, "-E", folder_ / "sshd.log"};
    std::vector<char*> arguments;
    for (std::string& word : words) arguments.push_back(word.data());
    arguments.push_back(nullptr);
    ASSERT_EQ(posix_spawn(&pid_, sshd.c_str(), nullptr, nullptr, arguments.data(), environ), 0);
    // ssh as the user has it, with a configuration of the test's own.
    const std::string program = folder_.Write(
        "bin/ssh", "#!/bin/sh\nexec /usr/bin/ssh -F none -i '" + (folder_ / "user") +
                       "' -o StrictHostKeyChecking=no -o UserKnownHostsFile=/dev/null "
                       "-o LogLevel=ERROR \"$@\"\n");
    ASSERT_EQ(chmod(program.c_str(), 0755), 0);
    if (!Answers()) GTEST_SKIP() << "sshd does not take us: " << ReadTextFile(folder_ / "sshd.log");
  }
  void TearDown() override {
    if (pid_ == 0) return;
    ::kill(pid_, SIGTERM);
    ::waitpid(pid_, nullptr, 0);
  }
  bool Answers() const {
    for (int i = 0; i < 50; ++i) {
      const ProgramRun run = RunProgram({folder_ / "bin/ssh", "-o", "BatchMode=yes", "-p",
                                         std::to_string(port_), "127.0.0.1", "true"});
      if (run.exit_code == 0) return true;
      usleep(100'000);
    }
    return false;
  }
  ProgramRun Flash(std::vector<std::string> more) const {
    std::vector<std::string> command = {
        "/usr/bin/env",
        "PATH=" + folder_ / "bin" + ":/usr/bin:/bin",
        VIEWFIX,
        "flash",
        "--board-program",
        VIEWFIXD,
        "--trust",
        folder_ / "store/trust",
        "--to",
        "ssh://127.0.0.1:" + std::to_string(port_) + folder_ / "store"};
    command.insert(command.end(), more.begin(), more.end());
    return RunProgram(command);
  }

  int port_ = 0;
  pid_t pid_ = 0;
};

TEST_F(RealSshTest, Flashes) {
  for (int number : {1, 2}) {
    const ProgramRun run = Flash({PathOf(number)});
    EXPECT_EQ(run.exit_code, 0) << run.out << run.err;
    EXPECT_EQ(VersionAt(), number);
  }
  const ProgramRun older = Flash({PathOf(1)});
  EXPECT_EQ(older.exit_code, 1);
  EXPECT_THAT(older.out, HasSubstr("an older model"));
}

}  // namespace
}  // namespace viewfix
