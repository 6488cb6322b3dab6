// SPDX-License-Identifier: BSD-3-Clause
#include "tests/platform/store/memory_disk.h"

#include <fcntl.h>

#include <algorithm>
#include <cerrno>

namespace viewfix {

void MemoryDisk::FailAt(int call, bool power_cut) {
  calls_ = 0;
  fail_at_ = call;
  power_cut_ = power_cut;
}

bool MemoryDisk::Fails() {
  ++calls_;
  const bool fails = fail_at_ != 0 && (calls_ == fail_at_ || (power_cut_ && calls_ > fail_at_));
  if (fails) errno = EIO;
  return fails;
}

std::unique_ptr<MemoryDisk> MemoryDisk::AfterPowerCut(Unflushed bytes, int names) const {
  Names_ found = flushed_names_;
  for (int i = 0; i < names; ++i) {
    const Change& change = journal_[i];
    if (!change.from.empty()) found.erase(change.from);
    if (change.file == nullptr) {
      found.erase(change.to);
    } else {
      found[change.to] = change.file;
    }
  }
  auto disk = std::make_unique<MemoryDisk>();
  for (const auto& [name, file] : found) {
    std::vector<std::uint8_t> content = file->flushed;
    if (bytes == Unflushed::kKept) content = file->bytes;
    if (bytes == Unflushed::kHalf && file->bytes.size() > content.size()) {
      const std::size_t half = (content.size() + file->bytes.size()) / 2;
      content.assign(file->bytes.begin(), file->bytes.begin() + static_cast<std::ptrdiff_t>(half));
    }
    disk->names_[name] = std::make_shared<File>(File{content, content});
  }
  disk->flushed_names_ = disk->names_;
  return disk;
}

std::vector<std::string> MemoryDisk::Names() const {
  std::vector<std::string> names;
  for (const auto& [name, file] : names_) names.push_back(name);
  return names;
}

int MemoryDisk::NewDescriptor(std::shared_ptr<File> file) {
  open_[next_fd_] = {std::move(file), 0};
  return next_fd_++;
}

int MemoryDisk::Open(const std::string& name, int flags) {
  if (Fails()) return -1;
  const auto found = names_.find(name);
  if (found != names_.end() && (flags & O_EXCL) != 0) {
    errno = EEXIST;
    return -1;
  }
  if (found == names_.end() && (flags & O_CREAT) == 0) {
    errno = ENOENT;
    return -1;
  }
  if (found != names_.end()) return NewDescriptor(found->second);
  const auto file = std::make_shared<File>();
  names_[name] = file;
  journal_.push_back({"", name, file});
  return NewDescriptor(file);
}

ssize_t MemoryDisk::Read(int fd, std::span<std::uint8_t> bytes) {
  if (Fails()) return -1;
  OpenFile& open = open_.at(fd);
  const std::size_t left =
      open.file->bytes.size() - std::min(open.position, open.file->bytes.size());
  const std::size_t count = std::min(left, bytes.size());
  std::copy_n(open.file->bytes.begin() + static_cast<std::ptrdiff_t>(open.position), count,
              bytes.begin());
  open.position += count;
  return static_cast<ssize_t>(count);
}

ssize_t MemoryDisk::Write(int fd, std::span<const std::uint8_t> bytes) {
  OpenFile& open = open_.at(fd);
  const bool fails = Fails();
  if (fails && power_cut_ && calls_ > fail_at_) return -1;
  const auto written = fails ? bytes.first(bytes.size() / 2) : bytes;
  std::vector<std::uint8_t>& content = open.file->bytes;
  content.resize(std::max(content.size(), open.position + written.size()));
  std::copy(written.begin(), written.end(),
            content.begin() + static_cast<std::ptrdiff_t>(open.position));
  open.position += written.size();
  errno = EIO;
  return fails ? -1 : static_cast<ssize_t>(written.size());
}

std::int64_t MemoryDisk::SeekEnd(int fd) {
  if (Fails()) return -1;
  OpenFile& open = open_.at(fd);
  open.position = open.file->bytes.size();
  return static_cast<std::int64_t>(open.position);
}

std::int64_t MemoryDisk::Size(int fd) {
  if (Fails()) return -1;
  return static_cast<std::int64_t>(open_.at(fd).file->bytes.size());
}

int MemoryDisk::Fsync(int fd) {
  if (Fails()) return -1;
  if (lies_) return 0;
  File& file = *open_.at(fd).file;
  file.flushed = file.bytes;
  return 0;
}

int MemoryDisk::Close(int fd) {
  open_.erase(fd);
  return Fails() ? -1 : 0;
}

int MemoryDisk::FsyncFolder() {
  if (Fails()) return -1;
  if (lies_) return 0;
  flushed_names_ = names_;
  journal_.clear();
  return 0;
}

int MemoryDisk::Rename(const std::string& from, const std::string& to) {
  if (Fails()) return -1;
  const auto found = names_.find(from);
  if (found == names_.end()) {
    errno = ENOENT;
    return -1;
  }
  journal_.push_back({from, to, found->second});
  names_[to] = found->second;
  names_.erase(from);
  return 0;
}

int MemoryDisk::Unlink(const std::string& name) {
  if (Fails()) return -1;
  if (names_.erase(name) == 0) {
    errno = ENOENT;
    return -1;
  }
  journal_.push_back({"", name, nullptr});
  return 0;
}

int MemoryDisk::List(std::vector<std::string>& names) {
  if (Fails()) return -1;
  names = Names();
  return 0;
}

int MemoryDisk::Lock() {
  if (Fails()) return -1;
  return NewDescriptor(std::make_shared<File>());
}

}  // namespace viewfix
