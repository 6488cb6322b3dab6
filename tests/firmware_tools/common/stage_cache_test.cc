// SPDX-License-Identifier: BSD-3-Clause
#include "firmware_tools/common/stage_cache.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "firmware_tools/common/parallel.h"
#include "firmware_tools/dataset/image_set.h"
#include "platform/file.h"
#include "tests/testing/temp_folder.h"

namespace viewfix {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

namespace fs = std::filesystem;

using Numbers = std::vector<int>;

struct Codec {
  void Save(const Numbers& numbers, ByteWriter& writer) const {
    writer.Add(std::uint64_t{numbers.size()});
    writer.AddAll(std::span<const int>(numbers));
  }
  bool Load(ByteReader& reader, Numbers& numbers) const {
    const auto count = reader.Take<std::uint64_t>();
    if (!reader.Has(count, sizeof(int))) return false;
    numbers.resize(count);
    reader.TakeAll(std::span<int>(numbers));
    return true;
  }
};

Hash256 KeyOf(int value) {
  ContentHash key;
  key.Add(value);
  return key.Result();
}

class StageCacheTest : public ::testing::Test {
 protected:
  // Of a run of its own, unless a cache is given. Counts in `computed_`.
  Numbers Recall(int key) {
    StageCache cache(Folder());
    return Recall(key, cache);
  }
  Numbers Recall(int key, StageCache& cache) {
    return cache.Recall("numbers", KeyOf(key), Codec(), [&] {
      ++computed_;
      return Result(key);
    });
  }
  static Numbers Result(int key) { return {key, key + 1, key + 2}; }
  std::string Folder() const { return folder_ / "stages"; }
  std::string FileOf(int key) const { return Folder() + "/" + Hex(KeyOf(key)); }
  std::vector<std::string> Names() const {
    std::vector<std::string> names;
    for (const auto& entry : fs::directory_iterator(Folder())) {
      names.push_back(entry.path().filename().string());
    }
    return names;
  }

  TempFolder folder_;
  int computed_ = 0;
};

TEST_F(StageCacheTest, WhatWasComputedIsKept) {
  EXPECT_EQ(Recall(1), Result(1));
  StageCache next(Folder());
  EXPECT_EQ(Recall(1, next), Result(1));
  EXPECT_EQ(computed_, 1);
  EXPECT_EQ(Recall(2, next), Result(2));
  EXPECT_EQ(computed_, 2);
  EXPECT_THAT(next.Report(), ElementsAre("numbers: 1 of 2 kept"));
  EXPECT_THAT(next.failure(), IsEmpty());
}

TEST_F(StageCacheTest, DamageIsComputedAgain) {
  Recall(1);
  const auto whole = *ReadFile(FileOf(1));
  const auto expect_mended = [&](std::span<const std::uint8_t> bytes, std::size_t at) {
    ASSERT_TRUE(WriteFileAtomically(FileOf(1), bytes).ok());
    computed_ = 0;
    EXPECT_EQ(Recall(1), Result(1)) << at;
    EXPECT_EQ(computed_, 1) << at;
    EXPECT_EQ(*ReadFile(FileOf(1)), whole) << at;
  };
  for (std::size_t i = 0; i < whole.size(); ++i) {
    auto flipped = whole;
    flipped[i] ^= 4;
    expect_mended(flipped, i);
    expect_mended(std::span(whole).first(i), i);
  }
  auto longer = whole;
  longer.push_back(0);
  expect_mended(longer, longer.size());
}

TEST_F(StageCacheTest, AnotherKeysFileIsNoneOfThisOne) {
  Recall(1);
  fs::copy_file(FileOf(1), FileOf(2));
  EXPECT_EQ(Recall(2), Result(2));
  EXPECT_EQ(computed_, 2);
}

// Its sum is right, its contents are not those of this codec: another version's, say.
TEST_F(StageCacheTest, WhatTheCodecDoesNotKnowIsComputedAgain) {
  struct Other {
    void Save(const Numbers& numbers, ByteWriter& writer) const { writer.Add(numbers[0]); }
    bool Load(ByteReader& /*reader*/, Numbers& /*numbers*/) const { return false; }
  };
  StageCache cache(Folder());
  cache.Recall("numbers", KeyOf(1), Other(), [] { return Result(1); });
  EXPECT_EQ(Recall(1), Result(1));
  EXPECT_EQ(computed_, 1);
}

TEST_F(StageCacheTest, WhatIsNoFileIsLeftAlone) {
  fs::create_directories(FileOf(1));
  StageCache cache(Folder());
  EXPECT_EQ(Recall(1, cache), Result(1));
  EXPECT_THAT(cache.failure(), HasSubstr(FileOf(1)));
  EXPECT_TRUE(fs::is_directory(FileOf(1)));
}

TEST_F(StageCacheTest, AFolderThatCannotBeMadeIsRefused) {
  folder_.Write("stages", "a file");
  EXPECT_THROW(StageCache cache(Folder()), ToolError);
}

TEST_F(StageCacheTest, WhatFailsIsNotKept) {
  StageCache cache(Folder());
  const auto fail = []() -> Numbers { throw ToolError("no"); };
  EXPECT_THROW(cache.Recall("numbers", KeyOf(1), Codec(), fail), ToolError);
  EXPECT_THAT(Names(), IsEmpty());
  EXPECT_EQ(Recall(1), Result(1));
}

TEST_F(StageCacheTest, OnlyWhatTheLastRunUsedIsLeft) {
  for (const int key : {1, 2, 3}) Recall(key);
  folder_.Write("stages/" + Hex(KeyOf(3)) + ".tmp-77", "of a run that was killed");
  folder_.Write("stages/notes.txt", "the user's");
  StageCache cache(Folder());
  Recall(2, cache);
  Recall(4, cache);
  cache.RemoveUnused();
  EXPECT_THAT(Names(), ::testing::UnorderedElementsAre(Hex(KeyOf(2)), Hex(KeyOf(4)), "notes.txt"));
}

TEST_F(StageCacheTest, ThreadsMayAskForTheSame) {
  StageCache cache(Folder());
  ParallelFor(200, 4, [&](int i) {
    const Numbers numbers =
        cache.Recall("numbers", KeyOf(i % 3), Codec(), [&] { return Result(i % 3); });
    EXPECT_EQ(numbers, Result(i % 3));
  });
  EXPECT_THAT(cache.failure(), IsEmpty());
  for (const int key : {0, 1, 2}) Recall(key);
  EXPECT_EQ(computed_, 0);
}

TEST(ContentHashTest, TellsWhereOneTextEnds) {
  const auto of = [](std::string_view a, std::string_view b) {
    ContentHash hash;
    hash.AddText(a);
    hash.AddText(b);
    return Hex(hash.Result());
  };
  EXPECT_NE(of("ab", "c"), of("a", "bc"));
  EXPECT_EQ(of("ab", "c"), of("ab", "c"));
}

// RFC 7693's function at 256 bits.
TEST(ContentHashTest, IsBlake2b) {
  EXPECT_EQ(Hex(ContentHash().Result()),
            "0e5751c026e543b2e8ab2eb06099daa1d1e5df47778f7787faab45cdf12fe3a8");
}

}  // namespace
}  // namespace viewfix
