// SPDX-License-Identifier: BSD-3-Clause
#include "engine/matching/code_scan.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstdlib>
#include <vector>

#include "tests/engine/image/test_image.h"

namespace viewfix {
namespace {

constexpr int kParts = 8;
constexpr int kDetails = CodeScan::kMaxBlocks * kScanBlock;

struct Blocks {
  explicit Blocks(std::uint64_t seed) : codes(kDetails * kParts), norm2(kDetails) {
    TestRandom random(seed);
    for (std::uint8_t& code : codes) code = static_cast<std::uint8_t>(random.Below(256));
    for (std::uint16_t& n : norm2) n = static_cast<std::uint16_t>(random.Below(65536));
  }

  std::int32_t Sum(const std::vector<std::int32_t>& table, int detail) const {
    std::int32_t sum = 0;
    for (int p = 0; p < kParts; ++p) {
      const int row = (detail / kScanBlock * kParts + p) * kScanBlock;
      sum += table[p * kCodesOfPart + codes[row + ScanPlace(detail % kScanBlock)]];
    }
    return sum;
  }

  std::vector<std::uint8_t> codes;
  std::vector<std::uint16_t> norm2;
};

std::vector<std::int32_t> RandomTable(int limit, std::uint64_t seed) {
  TestRandom random(seed);
  std::vector<std::int32_t> table(kParts * kCodesOfPart);
  for (std::int32_t& value : table) {
    value = static_cast<std::int32_t>(random.Below(2 * limit + 1)) - limit;
  }
  return table;
}

TEST(ScanPlace, IsAnotherForEachDetail) {
  std::vector<int> places;
  for (int i = 0; i < kScanBlock; ++i) places.push_back(ScanPlace(i));
  std::sort(places.begin(), places.end());
  for (int i = 0; i < kScanBlock; ++i) EXPECT_EQ(places[i], i);
}

// Whatever reaches the limit is found; what is found misses it by no more than tables lose as
// bytes.
TEST(CodeScan, MissesNothing) {
  if (!CodeScan::Has(BestCpuPath())) GTEST_SKIP() << "this processor has no such lookup";
  for (const CpuPath path : CpuPathsHere()) {
    if (!CodeScan::Has(path)) continue;
    CodeScan scan(kParts, path);
    for (const int limit : {0, 1, 100, 127, 128, 1000, CodeScan::kMaxSum / kParts}) {
      const Blocks blocks(limit + 1);
      const std::vector<std::int32_t> table = RandomTable(limit, limit);
      scan.SetTable(table.data());
      const std::int32_t lost = kParts * (limit / 64 + 1);
      for (const std::int32_t least : {-100'000, -33'000, -16'000, -1, 0, 2000, 33'000, 100'000}) {
        std::vector<std::uint64_t> found(CodeScan::kMaxBlocks);
        scan.Scan(blocks.codes.data(), blocks.norm2.data(), CodeScan::kMaxBlocks, least,
                  found.data());
        for (int d = 0; d < kDetails; ++d) {
          const std::int32_t sum = blocks.Sum(table, d);
          ASSERT_GE(scan.AtMost(d), sum);
          ASSERT_LE(scan.AtMost(d), sum + lost);
          const bool is_found = (found[d / kScanBlock] >> d % kScanBlock & 1) != 0;
          const std::int32_t reached = sum - blocks.norm2[d] / 2;
          // Limits beyond 16 bits are cut, and then more is found.
          const bool is_missed =
              reached + 2 * lost < least && std::abs(least) < 32'000 - kParts * limit;
          ASSERT_TRUE(is_found || reached < least) << limit << " " << least << " " << d;
          ASSERT_FALSE(is_found && is_missed) << limit << " " << least << " " << d;
        }
      }
    }
  }
}

// One part alone may be as large as a sum.
TEST(CodeScan, TakesTheLargestEntries) {
  if (!CodeScan::Has(BestCpuPath())) GTEST_SKIP() << "this processor has no such lookup";
  for (const CpuPath path : CpuPathsHere()) {
    if (!CodeScan::Has(path)) continue;
    const Blocks blocks(3);
    std::vector<std::int32_t> table(kParts * kCodesOfPart, 0);
    for (int c = 0; c < kCodesOfPart; ++c) {
      table[c] = c % 2 == 0 ? CodeScan::kMaxSum : -CodeScan::kMaxSum;
    }
    CodeScan scan(kParts, path);
    scan.SetTable(table.data());
    std::vector<std::uint64_t> found(CodeScan::kMaxBlocks);
    scan.Scan(blocks.codes.data(), blocks.norm2.data(), CodeScan::kMaxBlocks, -128, found.data());
    for (int d = 0; d < kDetails; ++d) {
      ASSERT_GE(scan.AtMost(d), blocks.Sum(table, d));
      if (blocks.Sum(table, d) - blocks.norm2[d] / 2 < -128) continue;
      ASSERT_TRUE((found[d / kScanBlock] >> d % kScanBlock & 1) != 0) << d;
    }
  }
}

}  // namespace
}  // namespace viewfix
