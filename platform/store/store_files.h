// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <sys/types.h>

#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "engine/base/status.h"

namespace viewfix {

// Every call of the operating system that the store makes, in one folder without subfolders: names
// have no slash. Calls return what the system calls do, -1 with errno set where they fail. Tests
// put in one that fails, or that forgets what was not flushed.
class FileOps {
 public:
  virtual ~FileOps() = default;
  // Never follows a link, never waits for a pipe's other end.
  virtual int Open(const std::string& name, int flags) = 0;
  virtual ssize_t Read(int fd, std::span<std::uint8_t> bytes) = 0;
  virtual ssize_t Write(int fd, std::span<const std::uint8_t> bytes) = 0;
  virtual std::int64_t SeekEnd(int fd) = 0;
  // Of a regular file with one name; -1 with ELOOP for anything else.
  virtual std::int64_t Size(int fd) = 0;
  virtual int Fsync(int fd) = 0;
  virtual int Close(int fd) = 0;
  virtual int FsyncFolder() = 0;
  virtual int Rename(const std::string& from, const std::string& to) = 0;
  virtual int Unlink(const std::string& name) = 0;
  virtual int List(std::vector<std::string>& names) = 0;
  virtual std::int64_t FreeBytes() = 0;
  // One process at a time holds the folder's lock: -1 with EWOULDBLOCK if another does. Returns
  // what Close() gives back.
  virtual int Lock() = 0;
};

// The real one. `make`: the folder is made, for a group to share, if it is not there.
Result<std::unique_ptr<FileOps>> OpenFolder(const std::string& path, bool make);

// Right after a call that failed: it reads errno. kNotFound where there is no such file.
Status FileFault(const char* text, const std::string& name);

// A file of the folder, open. Errors name it.
class StoreFile {
 public:
  static Result<StoreFile> Open(FileOps& files, const std::string& name, int flags);
  StoreFile(StoreFile&& other) noexcept;
  StoreFile& operator=(StoreFile&&) = delete;
  ~StoreFile();

  Result<std::uint64_t> Size() const;
  // Where the next Write() goes on, from now on: the file's end.
  Result<std::uint64_t> SeekEnd();
  Status Write(std::span<const std::uint8_t> bytes);
  // Flushes to the disk and closes.
  Status Finish();

 private:
  StoreFile(FileOps& files, std::string name, int fd);
  FileOps* files_;
  std::string name_;
  int fd_;
  friend Result<std::vector<std::uint8_t>> ReadStoreFile(FileOps&, const std::string&, std::size_t);
};

// The whole file. kResourceExhausted: larger than `max_bytes`, found before any of it is read.
Result<std::vector<std::uint8_t>> ReadStoreFile(FileOps& files, const std::string& name,
                                                std::size_t max_bytes);
Result<std::string> ReadStoreText(FileOps& files, const std::string& name, std::size_t max_bytes);

// Puts a complete file in the place of `name`: written under another name, flushed, renamed, the
// folder flushed. Whatever fails: what was there before is still there.
Status ReplaceStoreFile(FileOps& files, const std::string& name,
                        std::span<const std::uint8_t> bytes);
Status ReplaceStoreText(FileOps& files, const std::string& name, std::string_view text);

// Flushed so that the file's new name lasts.
Status RenameStoreFile(FileOps& files, const std::string& from, const std::string& to);

}  // namespace viewfix
