// SPDX-License-Identifier: BSD-3-Clause
#include "platform/store/store_files.h"

#include <dirent.h>
#include <fcntl.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <sys/statvfs.h>
#include <unistd.h>

#include <cerrno>
#include <cstdio>
#include <cstring>
#include <utility>

namespace viewfix {
namespace {

constexpr mode_t kGroupFile = 0664;
constexpr mode_t kGroupFolder = 02775;  // what is made in it belongs to its group
constexpr const char* kLockName = "lock";

class RealFiles : public FileOps {
 public:
  explicit RealFiles(int folder) : folder_(folder) {}
  ~RealFiles() override { ::close(folder_); }

  int Open(const std::string& name, int flags) override {
    const int fd =
        ::openat(folder_, name.c_str(), flags | O_NOFOLLOW | O_CLOEXEC | O_NONBLOCK, kGroupFile);
    // The umask may keep the group out; where the file is another member's it is as it should be.
    if (fd >= 0 && (flags & O_CREAT) != 0) static_cast<void>(::fchmod(fd, kGroupFile));
    return fd;
  }
  ssize_t Read(int fd, std::span<std::uint8_t> bytes) override {
    return ::read(fd, bytes.data(), bytes.size());
  }
  ssize_t Write(int fd, std::span<const std::uint8_t> bytes) override {
    return ::write(fd, bytes.data(), bytes.size());
  }
  std::int64_t SeekEnd(int fd) override { return ::lseek(fd, 0, SEEK_END); }
  std::int64_t Size(int fd) override {
    struct stat info = {};
    if (::fstat(fd, &info) != 0) return -1;
    if (S_ISREG(info.st_mode) && info.st_nlink <= 1) return info.st_size;
    errno = ELOOP;
    return -1;
  }
  int Fsync(int fd) override { return ::fsync(fd); }
  int Close(int fd) override { return ::close(fd); }
  int FsyncFolder() override { return ::fsync(folder_); }
  int Rename(const std::string& from, const std::string& to) override {
    return ::renameat(folder_, from.c_str(), folder_, to.c_str());
  }
  int Unlink(const std::string& name) override { return ::unlinkat(folder_, name.c_str(), 0); }
  int List(std::vector<std::string>& names) override {
    const int fd = ::openat(folder_, ".", O_RDONLY | O_DIRECTORY | O_CLOEXEC);
    DIR* const dir = fd < 0 ? nullptr : ::fdopendir(fd);
    if (dir == nullptr) return -1;
    while (const dirent* entry = ::readdir(dir)) names.emplace_back(entry->d_name);
    ::closedir(dir);
    return 0;
  }
  std::int64_t FreeBytes() override {
    struct statvfs info = {};
    if (::fstatvfs(folder_, &info) != 0) return -1;
    return static_cast<std::int64_t>(info.f_bavail) * static_cast<std::int64_t>(info.f_frsize);
  }
  int Lock() override {
    const int fd = Open(kLockName, O_RDONLY | O_CREAT);
    if (fd < 0 || ::flock(fd, LOCK_EX | LOCK_NB) == 0) return fd;
    const int error = errno;
    ::close(fd);
    errno = error;
    return -1;
  }

 private:
  int folder_;
};

}  // namespace

Result<std::unique_ptr<FileOps>> OpenFolder(const std::string& path, bool make) {
  if (make && ::mkdir(path.c_str(), kGroupFolder & 0777) == 0) {
    static_cast<void>(::chmod(path.c_str(), kGroupFolder));
  }
  const int folder = ::open(path.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  if (folder < 0) return FileFault("cannot open the folder", path);
  return std::unique_ptr<FileOps>(std::make_unique<RealFiles>(folder));
}

Status FileFault(const char* text, const std::string& name) {
  const int error = errno;
  const StatusCode code = error == ENOENT ? StatusCode::kNotFound : StatusCode::kIo;
  if (error == ELOOP) return {code, text, name + ": a link, or not a plain file"};
  return {code, text, name + ": " + std::strerror(error)};
}

StoreFile::StoreFile(FileOps& files, std::string name, int fd)
    : files_(&files), name_(std::move(name)), fd_(fd) {}

StoreFile::StoreFile(StoreFile&& other) noexcept
    : files_(other.files_), name_(std::move(other.name_)), fd_(std::exchange(other.fd_, -1)) {}

StoreFile::~StoreFile() {
  if (fd_ >= 0) files_->Close(fd_);
}

Result<StoreFile> StoreFile::Open(FileOps& files, const std::string& name, int flags) {
  const int fd = files.Open(name, flags);
  if (fd < 0) return FileFault("cannot open", name);
  StoreFile file(files, name, fd);
  // Refuses pipes, devices and files that have a second name elsewhere.
  if (const Result<std::uint64_t> size = file.Size(); !size.ok()) return size.status();
  return file;
}

Result<std::uint64_t> StoreFile::Size() const {
  const std::int64_t size = files_->Size(fd_);
  if (size < 0) return FileFault("cannot use", name_);
  return static_cast<std::uint64_t>(size);
}

Result<std::uint64_t> StoreFile::SeekEnd() {
  const std::int64_t end = files_->SeekEnd(fd_);
  if (end < 0) return FileFault("cannot use", name_);
  return static_cast<std::uint64_t>(end);
}

Status StoreFile::Write(std::span<const std::uint8_t> bytes) {
  while (!bytes.empty()) {
    const ssize_t written = files_->Write(fd_, bytes);
    if (written < 0 && errno == EINTR) continue;
    if (written < 0) return FileFault("cannot write", name_);
    bytes = bytes.subspan(static_cast<std::size_t>(written));
  }
  return {};
}

Status StoreFile::Finish() {
  if (files_->Fsync(fd_) != 0) return FileFault("cannot flush", name_);
  if (files_->Close(std::exchange(fd_, -1)) != 0) return FileFault("cannot close", name_);
  return {};
}

Result<std::vector<std::uint8_t>> ReadStoreFile(FileOps& files, const std::string& name,
                                                std::size_t max_bytes) {
  const Result<StoreFile> file = StoreFile::Open(files, name, O_RDONLY);
  if (!file.ok()) return file.status();
  const Result<std::uint64_t> size = file->Size();
  if (!size.ok()) return size.status();
  if (*size > max_bytes) return Status(StatusCode::kResourceExhausted, "file too large", name);
  std::vector<std::uint8_t> bytes(static_cast<std::size_t>(*size));
  std::size_t done = 0;
  while (done < bytes.size()) {
    const ssize_t got = files.Read(file->fd_, std::span(bytes).subspan(done));
    if (got < 0 && errno == EINTR) continue;
    if (got < 0) return FileFault("cannot read", name);
    if (got == 0) break;  // it shrank meanwhile
    done += static_cast<std::size_t>(got);
  }
  bytes.resize(done);
  return bytes;
}

Result<std::string> ReadStoreText(FileOps& files, const std::string& name, std::size_t max_bytes) {
  const auto bytes = ReadStoreFile(files, name, max_bytes);
  if (!bytes.ok()) return bytes.status();
  return std::string(bytes->begin(), bytes->end());
}

Status ReplaceStoreFile(FileOps& files, const std::string& name,
                        std::span<const std::uint8_t> bytes) {
  const std::string temporary = "tmp-" + std::to_string(::getpid()) + "-" + name;
  files.Unlink(temporary);  // of an earlier process with this number
  const auto write = [&]() -> Status {
    Result<StoreFile> file = StoreFile::Open(files, temporary, O_WRONLY | O_CREAT | O_EXCL);
    if (!file.ok()) return file.status();
    if (Status status = file->Write(bytes); !status.ok()) return status;
    return file->Finish();
  };
  Status status = write();
  if (status.ok()) status = RenameStoreFile(files, temporary, name);
  if (!status.ok()) files.Unlink(temporary);
  return status;
}

Status ReplaceStoreText(FileOps& files, const std::string& name, std::string_view text) {
  return ReplaceStoreFile(files, name,
                          {reinterpret_cast<const std::uint8_t*>(text.data()), text.size()});
}

Status RenameStoreFile(FileOps& files, const std::string& from, const std::string& to) {
  if (files.Rename(from, to) != 0) return FileFault("cannot rename", from);
  if (files.FsyncFolder() != 0) return FileFault("cannot flush the folder of", to);
  return {};
}

}  // namespace viewfix
