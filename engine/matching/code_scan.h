// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <vector>

#include "engine/base/cpu_path.h"
#include "models/model_view.h"

namespace viewfix {

// Details by their codes, many at once: which of them may be near a descriptor. Where a
// processor looks up whole vectors in a table, this passes over far ones faster than a loop
// over details could; those that are left are for the caller to judge.
inline constexpr int kScanBlock = 64;

// Where the code of detail i of a block, 0..63, lies among the block's codes of one part: as 16-bit
// numbers, the lower bytes are those of the first half, the upper bytes those of the second.
constexpr int ScanPlace(int i) { return i % 32 * 2 + i / 32; }

// Allocates in the constructor only.
class CodeScan {
 public:
  // Whether a path has such a lookup; on others nothing here is to be called.
  static bool Has([[maybe_unused]] CpuPath path) {
#if defined(__x86_64__)
    return path >= CpuPath::kAvx512;
#elif defined(__aarch64__)
    return true;
#else
    return false;
#endif
  }
  // parts in 1..128: sums of bytes fit into 16 bits
  CodeScan(int parts, CpuPath path);

  // The largest magnitude of what codes add, and of its sums over parts.
  static constexpr std::int32_t kMaxSum = 32640;
  // What each code of a part adds: [parts, kCodesOfPart]
  void SetTable(const std::int32_t* table);

  // Blocks that a part is looked up for at once.
  static constexpr int kMaxBlocks = 16;
  //   num_blocks <= kMaxBlocks
  //   codes [num_blocks, parts, kScanBlock]   norm2 [num_blocks, kScanBlock]
  //   found [num_blocks] bit i: s - norm2[i] / 2 may be >= least, with s the sum over parts of
  //     table[p][code], and the half rounded down. A few of those below it are found, too; none
  //     of the others is missed.
  void Scan(const std::uint8_t* codes, const std::uint16_t* norm2, int num_blocks,
            std::int32_t least, std::uint64_t* found);
  // What s of detail i of the blocks last scanned is at most.
  std::int32_t AtMost(int i) const { return (sums_[i] << shift_) - parts_ * largest_; }

 private:
  int parts_;
  [[maybe_unused]] CpuPath path_;         // where there is a lookup at all
  bool bytes_;                            // tables are looked up as bytes, rounded up
  std::vector<std::int16_t> word_table_;  // [parts, kCodesOfPart] where bytes are not looked up
  std::vector<std::uint8_t> byte_table_;  // the same (table + largest) / 2^shift
  std::int32_t largest_ = 0;              // magnitude in the table
  int shift_ = 0;
  std::vector<std::int16_t> sums_;  // [kMaxBlocks, kScanBlock]
};

}  // namespace viewfix
