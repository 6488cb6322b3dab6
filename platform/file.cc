// SPDX-License-Identifier: BSD-3-Clause
#include "platform/file.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <string_view>
#include <utility>

namespace viewfix {
namespace {

constexpr std::size_t kReadBytes = std::size_t{1} << 16;

// Call right after the system call that failed: it reads errno.
Status SystemError(const char* text, const std::string& path) {
  const int error = errno;
  const bool absent = error == ENOENT || error == ENOTDIR;
  return {absent ? StatusCode::kNotFound : StatusCode::kIo, text,
          path + ": " + std::strerror(error)};
}

class FileDescriptor {
 public:
  explicit FileDescriptor(int fd) : fd_(fd) {}
  ~FileDescriptor() {
    if (fd_ >= 0) ::close(fd_);
  }
  FileDescriptor(const FileDescriptor&) = delete;
  FileDescriptor& operator=(const FileDescriptor&) = delete;

  int get() const { return fd_; }
  // Some file systems report a full disk only here.
  bool Close() { return ::close(std::exchange(fd_, -1)) == 0; }

 private:
  int fd_;
};

// What fstat() says is a guess to start with: pipes and /proc have no size.
std::size_t SizeGuess(int fd) {
  struct stat info = {};
  if (::fstat(fd, &info) != 0 || !S_ISREG(info.st_mode) || info.st_size < 0) return kReadBytes;
  const auto size = static_cast<std::uint64_t>(info.st_size);
  return size < kMaxFileBytes ? static_cast<std::size_t>(size) + 1 : kMaxFileBytes + 1;
}

bool WriteAll(int fd, std::span<const std::uint8_t> bytes) {
  while (!bytes.empty()) {
    const ssize_t written = ::write(fd, bytes.data(), bytes.size());
    if (written < 0 && errno == EINTR) continue;
    if (written < 0) return false;
    bytes = bytes.subspan(static_cast<std::size_t>(written));
  }
  return true;
}

// A rename lasts through a power cut only once its folder is flushed. Some file systems
// cannot flush a folder; the file itself is whole either way.
void FlushFolder(const std::string& path) {
  const std::size_t slash = path.rfind('/');
  const std::string folder = slash == std::string::npos ? "." : path.substr(0, slash + 1);
  const FileDescriptor fd(::open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC));
  if (fd.get() >= 0) ::fsync(fd.get());
}

}  // namespace

Result<std::vector<std::uint8_t>> ReadFile(const std::string& path) {
  const FileDescriptor fd(::open(path.c_str(), O_RDONLY | O_CLOEXEC));
  if (fd.get() < 0) return SystemError("cannot open", path);
  std::vector<std::uint8_t> bytes(SizeGuess(fd.get()));
  std::size_t size = 0;
  while (true) {
    const ssize_t got = ::read(fd.get(), bytes.data() + size, bytes.size() - size);
    if (got < 0 && errno == EINTR) continue;
    if (got < 0) return SystemError("cannot read", path);
    if (got == 0) break;
    size += static_cast<std::size_t>(got);
    if (size > kMaxFileBytes) return Status(StatusCode::kResourceExhausted, "file too large", path);
    if (size == bytes.size()) bytes.resize(std::min(2 * size, kMaxFileBytes + 1));
  }
  bytes.resize(size);
  return bytes;
}

Status WriteFileAtomically(const std::string& path, std::span<const std::uint8_t> bytes,
                           Durability durability) {
  const bool flushed = durability == Durability::kFlushed;
  const std::string temporary = path + ".tmp-" + std::to_string(::getpid());
  FileDescriptor fd(::open(temporary.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0666));
  if (fd.get() < 0) return SystemError("cannot create", path);
  if (WriteAll(fd.get(), bytes) && (!flushed || ::fsync(fd.get()) == 0) && fd.Close() &&
      std::rename(temporary.c_str(), path.c_str()) == 0) {
    if (flushed) FlushFolder(path);
    return {};
  }
  const Status status = SystemError("cannot write", path);
  ::unlink(temporary.c_str());
  return status;
}

Status AboutFile(const std::string& path, const Status& status) {
  std::string detail = path;
  if (!status.detail().empty()) detail.append(": ").append(status.detail());
  return {status.code(), status.text(), detail};
}

}  // namespace viewfix
