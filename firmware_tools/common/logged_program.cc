// SPDX-License-Identifier: BSD-3-Clause
#include "firmware_tools/common/logged_program.h"

#include <fcntl.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <chrono>
#include <csignal>
#include <cstring>
#include <fstream>
#include <iterator>
#include <optional>
#include <sstream>
#include <thread>

#include "firmware_tools/dataset/image_set.h"

namespace viewfix {
namespace {

constexpr int kQuotedLines = 8;

// A child that does not outlive this object.
class Child {
 public:
  Child(const std::vector<std::string>& command, const std::filesystem::path& log) {
    posix_spawn_file_actions_t files;
    posix_spawn_file_actions_init(&files);
    posix_spawn_file_actions_addopen(&files, STDIN_FILENO, "/dev/null", O_RDONLY, 0);
    posix_spawn_file_actions_addopen(&files, STDOUT_FILENO, log.c_str(),
                                     O_WRONLY | O_CREAT | O_APPEND, 0644);
    posix_spawn_file_actions_adddup2(&files, STDOUT_FILENO, STDERR_FILENO);
    std::vector<char*> arguments;
    for (const std::string& word : command) arguments.push_back(const_cast<char*>(word.c_str()));
    arguments.push_back(nullptr);
    const int error = posix_spawnp(&pid_, arguments[0], &files, nullptr, arguments.data(), environ);
    posix_spawn_file_actions_destroy(&files);
    if (error == ENOENT) {
      throw ToolError(command[0] + ": not found; install it or leave out what needs it");
    }
    if (error != 0) throw ToolError(command[0] + ": " + std::strerror(error));
  }
  ~Child() {
    if (pid_ <= 0) return;
    kill(pid_, SIGKILL);
    waitpid(pid_, nullptr, 0);
  }
  Child(const Child&) = delete;
  Child& operator=(const Child&) = delete;

  // The status of waitpid(), once the program has ended.
  std::optional<int> Ended() {
    int status = 0;
    if (waitpid(pid_, &status, WNOHANG) != pid_) return std::nullopt;
    pid_ = 0;
    return status;
  }

 private:
  pid_t pid_ = 0;
};

// What is added to a file while it grows.
class Tail {
 public:
  explicit Tail(std::filesystem::path file) : file_(std::move(file)) {
    std::error_code error;
    const auto size = std::filesystem::file_size(file_, error);
    position_ = error ? 0 : static_cast<std::streamoff>(size);
  }
  std::string Read() {
    std::ifstream stream(file_, std::ios::binary);
    stream.seekg(position_);
    std::string added(std::istreambuf_iterator<char>(stream), {});
    position_ += static_cast<std::streamoff>(added.size());
    return added;
  }

 private:
  std::filesystem::path file_;
  std::streamoff position_ = 0;
};

std::string LastLines(const std::string& text) {
  std::vector<std::string> lines;
  std::istringstream stream(text);
  for (std::string line; std::getline(stream, line);) {
    if (!line.empty()) lines.push_back(line);
  }
  const std::size_t first = lines.size() > kQuotedLines ? lines.size() - kQuotedLines : 0;
  std::string last;
  for (std::size_t i = first; i < lines.size(); ++i) last += "\n  " + lines[i];
  return last;
}

std::string Outcome(int status) {
  if (WIFEXITED(status)) return "exit code " + std::to_string(WEXITSTATUS(status));
  return std::string("ended by signal: ") + strsignal(WTERMSIG(status));
}

}  // namespace

void RunLogged(const std::vector<std::string>& command, const std::filesystem::path& log,
               const std::function<void(const std::string& added)>& poll) {
  using std::chrono::milliseconds;
  Tail tail(log);
  std::string printed;
  Child child(command, log);
  const auto read = [&] {
    const std::string added = tail.Read();
    printed += added;
    if (poll) poll(added);
  };
  std::optional<int> status;
  for (milliseconds pause(5); !(status = child.Ended());
       pause = std::min(pause * 2, milliseconds(200))) {
    read();
    std::this_thread::sleep_for(pause);
  }
  read();
  if (WIFEXITED(*status) && WEXITSTATUS(*status) == 0) return;
  throw ToolError(command[0] + " failed (" + Outcome(*status) + "); the end of " + log.string() +
                  ":" + LastLines(printed));
}

}  // namespace viewfix
