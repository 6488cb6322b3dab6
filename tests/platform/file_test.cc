// SPDX-License-Identifier: BSD-3-Clause
#include "platform/file.h"

#include <gmock/gmock.h>
#include <sys/resource.h>

#include <csignal>
#include <filesystem>

#include "tests/testing/temp_folder.h"

namespace viewfix {
namespace {

using testing::HasSubstr;

std::size_t EntriesIn(const std::string& folder) {
  const auto entries = std::filesystem::directory_iterator(folder);
  return static_cast<std::size_t>(std::distance(begin(entries), end(entries)));
}

// While it lives, no file grows beyond `bytes`: writing fails midway as on a full disk.
class FileSizeLimit {
 public:
  explicit FileSizeLimit(rlim_t bytes) {
    std::signal(SIGXFSZ, SIG_IGN);
    getrlimit(RLIMIT_FSIZE, &before_);
    const rlimit limited = {bytes, before_.rlim_max};
    setrlimit(RLIMIT_FSIZE, &limited);
  }
  ~FileSizeLimit() {
    setrlimit(RLIMIT_FSIZE, &before_);
    std::signal(SIGXFSZ, SIG_DFL);
  }

 private:
  rlimit before_ = {};
};

TEST(FileTest, ReadsBackWhatWasWritten) {
  const TempFolder folder;
  for (const std::size_t size : {0, 1, 65535, 65536, 65537, 300000}) {
    std::vector<std::uint8_t> bytes(size);
    for (std::size_t i = 0; i < size; ++i) bytes[i] = static_cast<std::uint8_t>(i * 31 + i / 256);
    ASSERT_TRUE(WriteFileAtomically(folder / "file", bytes).ok());
    const auto read = ReadFile(folder / "file");
    ASSERT_TRUE(read.ok());
    EXPECT_EQ(*read, bytes);
  }
  EXPECT_EQ(EntriesIn(folder.path()), 1U);
}

TEST(FileTest, ReadsFilesWithoutASize) {
  const auto read = ReadFile("/proc/self/maps");
  ASSERT_TRUE(read.ok());
  EXPECT_FALSE(read->empty());
}

TEST(FileTest, NamesAMissingFile) {
  const TempFolder folder;
  const Status status = ReadFile(folder / "none.vfx").status();
  EXPECT_EQ(status.code(), StatusCode::kNotFound);
  EXPECT_THAT(std::string(status.detail()), HasSubstr("none.vfx: No such file"));
}

TEST(FileTest, RefusesAFolder) {
  const TempFolder folder;
  EXPECT_EQ(ReadFile(folder.path()).status().code(), StatusCode::kIo);
  EXPECT_EQ(WriteFileAtomically(folder.path(), {}).code(), StatusCode::kIo);
}

TEST(FileTest, WritesNothingIntoAMissingFolder) {
  const TempFolder folder;
  const Status status = WriteFileAtomically(folder / "none/site.vfx", {});
  EXPECT_EQ(status.code(), StatusCode::kNotFound);
  EXPECT_THAT(std::string(status.detail()), HasSubstr("none/site.vfx: No such file"));
  EXPECT_EQ(EntriesIn(folder.path()), 0U);
}

TEST(FileTest, AFailedWriteLeavesTheOldFileAlone) {
  const TempFolder folder;
  const std::string path = folder.Write("site.vfx", "old");
  Status status;
  {
    const FileSizeLimit limit(1000);
    status = WriteFileAtomically(path, std::vector<std::uint8_t>(5000));
  }
  EXPECT_EQ(status.code(), StatusCode::kIo);
  EXPECT_THAT(std::string(status.detail()), HasSubstr("site.vfx: File too large"));
  EXPECT_EQ(ReadFile(path)->size(), 3U);
  EXPECT_EQ(EntriesIn(folder.path()), 1U);
}

TEST(FileTest, AboutFileKeepsCodeAndReason) {
  const Status status = AboutFile("a.jpg", {StatusCode::kCorrupt, "damaged JPEG", "no end"});
  EXPECT_EQ(status.code(), StatusCode::kCorrupt);
  EXPECT_STREQ(status.text(), "damaged JPEG");
  EXPECT_EQ(status.detail(), "a.jpg: no end");
}

}  // namespace
}  // namespace viewfix
