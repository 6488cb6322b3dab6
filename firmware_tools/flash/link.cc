// SPDX-License-Identifier: BSD-3-Clause
#include "firmware_tools/flash/link.h"

#include <fcntl.h>
#include <spawn.h>
#include <sys/mman.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <charconv>
#include <cstring>
#include <filesystem>
#include <thread>
#include <vector>

#include "firmware_tools/dataset/image_set.h"
#include "firmware_tools/dataset/tool_file.h"
#include "platform/store/flash_server.h"
#include "platform/store/serial_link.h"
#include "platform/store/store.h"

namespace viewfix {
namespace {

constexpr std::string_view kFolder = "dir:";
constexpr std::string_view kSsh = "ssh://";
constexpr std::string_view kSerial = "serial:";

// A pair of connected ends; the second one goes to the other side.
struct Ends {
  int here = -1;
  int there = -1;
};

Ends Connect() {
  int ends[2];
  if (socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, ends) != 0) {
    throw ToolError(std::string("no pair of sockets: ") + std::strerror(errno));
  }
  return {ends[0], ends[1]};
}

// The store of a mounted card, served by a thread of this process.
class FolderLink : public BoardLink {
 public:
  FolderLink(const std::string& store, const std::string& trust) : ends_(Connect()) {
    thread_ = std::thread([store, trust, end = ends_.there] {
      PipeStream stream(end, end);
      Serve(store, trust, stream);
      ::close(end);
    });
  }
  ~FolderLink() override {
    ::close(ends_.here);
    thread_.join();
  }
  FolderLink(const FolderLink&) = delete;
  FolderLink& operator=(const FolderLink&) = delete;

  Result<std::size_t> Read(std::span<std::uint8_t> bytes) override { return pipe_.Read(bytes); }
  Status Write(std::span<const std::uint8_t> bytes) override { return pipe_.Write(bytes); }

 private:
  static void Say(PipeStream& stream, const Status& status) {
    static_cast<void>(Conversation(stream).WriteLine("error " + Describe(status)));
  }
  static void Serve(const std::string& store_folder, const std::string& trust_folder,
                    PipeStream& stream) {
    const Result<Trust> trust = ReadTrust(trust_folder);
    if (!trust.ok()) return Say(stream, trust.status());
    const auto files = OpenFolder(store_folder, true);
    if (!files.ok()) return Say(stream, files.status());
    Store store(**files, *trust);
    static_cast<void>(ServeFlash(stream, store, {2, trust_folder}));
  }

  Ends ends_;
  PipeStream pipe_{ends_.here, ends_.here};
  std::thread thread_;
};

// The system's OpenSSH, or what stands in for it.
class SshLink : public BoardLink {
 public:
  explicit SshLink(const std::vector<std::string>& command)
      : ends_(Connect()), errors_(memfd_create("ssh", MFD_CLOEXEC)) {
    posix_spawn_file_actions_t files;
    posix_spawn_file_actions_init(&files);
    posix_spawn_file_actions_adddup2(&files, ends_.there, STDIN_FILENO);
    posix_spawn_file_actions_adddup2(&files, ends_.there, STDOUT_FILENO);
    posix_spawn_file_actions_adddup2(&files, errors_, STDERR_FILENO);
    std::vector<char*> arguments;
    for (const std::string& word : command) arguments.push_back(const_cast<char*>(word.c_str()));
    arguments.push_back(nullptr);
    const int error = posix_spawnp(&pid_, arguments[0], &files, nullptr, arguments.data(), environ);
    posix_spawn_file_actions_destroy(&files);
    ::close(ends_.there);
    if (error == 0) return;
    Release();
    throw ToolError(command[0] + ": " + std::strerror(error));
  }
  ~SshLink() override {
    Release();
    Wait();
  }
  SshLink(const SshLink&) = delete;
  SshLink& operator=(const SshLink&) = delete;

  Result<std::size_t> Read(std::span<std::uint8_t> bytes) override { return pipe_.Read(bytes); }
  Status Write(std::span<const std::uint8_t> bytes) override { return pipe_.Write(bytes); }

  std::string LastWords() override {
    ::shutdown(ends_.here, SHUT_RDWR);
    Wait();
    char text[512];
    const off_t size = ::lseek(errors_, 0, SEEK_END);
    const off_t from = size > off_t{sizeof text} ? size - off_t{sizeof text} : 0;
    const ssize_t got = ::pread(errors_, text, sizeof text, from);
    std::string_view words(text, got > 0 ? static_cast<std::size_t>(got) : 0);
    while (!words.empty() && (words.back() == '\n' || words.back() == '\r')) words.remove_suffix(1);
    const std::size_t line = words.rfind('\n');
    return std::string(line == std::string_view::npos ? words : words.substr(line + 1));
  }

 private:
  void Release() {
    if (ends_.here >= 0) ::close(ends_.here);
    if (errors_ >= 0) ::close(errors_);
    ends_.here = errors_ = -1;
  }
  void Wait() {
    if (pid_ > 0) ::waitpid(pid_, nullptr, 0);
    pid_ = 0;
  }

  Ends ends_;
  PipeStream pipe_{ends_.here, ends_.here};
  int errors_;
  pid_t pid_ = 0;
};

class SerialBoardLink : public BoardLink {
 public:
  explicit SerialBoardLink(std::unique_ptr<SerialLink> link) : link_(std::move(link)) {}
  Result<std::size_t> Read(std::span<std::uint8_t> bytes) override { return link_->Read(bytes); }
  Status Write(std::span<const std::uint8_t> bytes) override { return link_->Write(bytes); }

 private:
  std::unique_ptr<SerialLink> link_;
};

// What a shell takes as one word.
std::string Quoted(const std::string& word) {
  std::string text = "'";
  for (const char c : word) {
    if (c == '\'') {
      text += "'\\''";
    } else {
      text += c;
    }
  }
  return text + "'";
}

std::vector<std::string> SshCommand(const BoardAddress& address, const LinkOptions& options) {
  // No question may wait for an answer that nobody gives, and a dead link must end.
  std::vector<std::string> command = {options.ssh, "-T",
                                      "-o",        "BatchMode=yes",
                                      "-o",        "ServerAliveInterval=5",
                                      "-o",        "ServerAliveCountMax=3"};
  if (address.port != 0) command.insert(command.end(), {"-p", std::to_string(address.port)});
  std::string remote = Quoted(options.program) + " store receive";
  if (!address.folder.empty()) remote += " --store " + Quoted(address.folder);
  if (!options.trust.empty()) remote += " --trust " + Quoted(options.trust);
  command.insert(command.end(), {"--", address.host, remote});
  return command;
}

// Beside a store at ROOT/var/lib/viewfix lies ROOT/etc/viewfix/trust; else the store's own.
std::string TrustOfFolder(const std::string& store) {
  constexpr std::string_view kOnCard = "/var/lib/viewfix";
  std::string path = std::filesystem::absolute(store).lexically_normal().string();
  while (path.ends_with('/')) path.pop_back();
  if (!path.ends_with(kOnCard)) return path + "/trust";
  return path.substr(0, path.size() - kOnCard.size()) + kDefaultTrust;
}

void ParseSsh(std::string_view rest, BoardAddress& address) {
  const std::size_t slash = rest.find('/');
  if (slash != std::string_view::npos && slash + 1 < rest.size()) {
    address.folder = rest.substr(slash);
  }
  std::string_view host = rest.substr(0, slash);
  const std::size_t colon = host.rfind(':');
  // Colons of an IPv6 address stand in brackets.
  if (colon != std::string_view::npos && host.find(']', colon) == std::string_view::npos) {
    const std::string_view port = host.substr(colon + 1);
    const auto read = std::from_chars(port.data(), port.data() + port.size(), address.port);
    if (read.ec != std::errc() || read.ptr != port.data() + port.size() || address.port < 1 ||
        address.port > 65535) {
      throw ToolError(address.text + ": no port number: " + std::string(port));
    }
    host = host.substr(0, colon);
  }
  address.host = host;
  std::erase(address.host, '[');
  std::erase(address.host, ']');
  if (address.host.empty() || address.host.front() == '-') {
    throw ToolError(address.text + ": no host's name");
  }
}

}  // namespace

BoardAddress ParseAddress(const std::string& text) {
  BoardAddress address;
  address.text = text;
  const std::string_view all = text;
  if (all.starts_with(kFolder) && all.size() > kFolder.size()) {
    address.folder = all.substr(kFolder.size());
    return address;
  }
  if (all.starts_with(kSerial) && all.size() > kSerial.size()) {
    address.kind = BoardAddress::Kind::kSerial;
    address.device = all.substr(kSerial.size());
    return address;
  }
  if (!all.starts_with(kSsh)) {
    throw ToolError(text + ": not dir:PATH, ssh://HOST or serial:DEVICE");
  }
  address.kind = BoardAddress::Kind::kSsh;
  ParseSsh(all.substr(kSsh.size()), address);
  return address;
}

std::unique_ptr<BoardLink> OpenLink(const BoardAddress& address, const LinkOptions& options) {
  switch (address.kind) {
    case BoardAddress::Kind::kFolder:
      return std::make_unique<FolderLink>(
          address.folder, options.trust.empty() ? TrustOfFolder(address.folder) : options.trust);
    case BoardAddress::Kind::kSsh:
      return std::make_unique<SshLink>(SshCommand(address, options));
    case BoardAddress::Kind::kSerial:
      break;
  }
  auto link = SerialLink::Open(address.device, options.baud, SerialLink::Side::kLaptop);
  if (!link.ok()) throw ToolError(Describe(link.status()));
  return std::make_unique<SerialBoardLink>(std::move(*link));
}

}  // namespace viewfix
