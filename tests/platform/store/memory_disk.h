// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <map>
#include <memory>
#include <string>
#include <vector>

#include "platform/store/store_files.h"

namespace viewfix {

// A folder in memory that knows what a disk would still hold after a power cut: the bytes that were
// flushed, under the names that were. Any call can be made to fail.
class MemoryDisk : public FileOps {
 public:
  // What becomes of bytes that were written and not flushed.
  enum class Unflushed { kLost, kKept, kHalf };

  // Counting from 1 from now on, the call of this number fails; once, or (`power_cut`) with all
  // that come after it. A write that fails has written half.
  void FailAt(int call, bool power_cut);
  // From now on it says that it flushed, and does not.
  void Lie() { lies_ = true; }
  int calls() const { return calls_; }
  bool failed() const { return fail_at_ != 0 && calls_ >= fail_at_; }

  // How many changes of names were not flushed.
  int unflushed_names() const { return static_cast<int>(journal_.size()); }
  // The disk as it is found after the power came back: of the names' changes the first so many.
  std::unique_ptr<MemoryDisk> AfterPowerCut(Unflushed bytes, int names) const;

  bool Has(const std::string& name) const { return names_.contains(name); }
  std::vector<std::uint8_t>& Bytes(const std::string& name) { return names_.at(name)->bytes; }
  std::vector<std::string> Names() const;

  int Open(const std::string& name, int flags) override;
  ssize_t Read(int fd, std::span<std::uint8_t> bytes) override;
  ssize_t Write(int fd, std::span<const std::uint8_t> bytes) override;
  std::int64_t SeekEnd(int fd) override;
  std::int64_t Size(int fd) override;
  int Fsync(int fd) override;
  int Close(int fd) override;
  int FsyncFolder() override;
  int Rename(const std::string& from, const std::string& to) override;
  int Unlink(const std::string& name) override;
  int List(std::vector<std::string>& names) override;
  std::int64_t FreeBytes() override { return 1 << 30; }
  int Lock() override;

 private:
  struct File {
    std::vector<std::uint8_t> bytes;
    std::vector<std::uint8_t> flushed;
  };
  using Names_ = std::map<std::string, std::shared_ptr<File>>;
  struct OpenFile {
    std::shared_ptr<File> file;
    std::size_t position = 0;
  };
  // A change of names: `to` becomes `file` (null: goes), and `from`, if not empty, goes.
  struct Change {
    std::string from;
    std::string to;
    std::shared_ptr<File> file;
  };
  bool Fails();
  int NewDescriptor(std::shared_ptr<File> file);

  Names_ names_;
  Names_ flushed_names_;
  std::vector<Change> journal_;
  std::map<int, OpenFile> open_;
  int next_fd_ = 100;
  int calls_ = 0;
  int fail_at_ = 0;
  bool power_cut_ = false;
  bool lies_ = false;
};

}  // namespace viewfix
