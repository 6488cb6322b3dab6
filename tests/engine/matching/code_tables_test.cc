// SPDX-License-Identifier: BSD-3-Clause
#include "engine/matching/code_tables.h"

#include <gtest/gtest.h>

#include <vector>

#include "models/model_view.h"
#include "tests/engine/matching/random_bytes.h"

namespace viewfix {
namespace {

TEST(CodeTables, HoldWhatEachCodeAdds) {
  constexpr int kParts = 3, kPiece = 5, kDim = kParts * kPiece;
  const std::vector<std::int8_t> codebook = RandomBytes(kCodesOfPart * kDim, 1);
  for (const CpuPath path : CpuPathsHere()) {
    CodeTables tables(codebook, kParts, kDim, path);
    for (const int n : {kTileQueries, 1, 7}) {
      const std::vector<std::int8_t> descriptors = RandomBytes(n * kDim, n);
      tables.Fill(descriptors);
      for (int i = 0; i < n; ++i) {
        for (int code = 0; code < kParts * kCodesOfPart; ++code) {
          const std::int8_t* const piece = &descriptors[i * kDim + code / kCodesOfPart * kPiece];
          int expected = 0;
          for (int d = 0; d < kPiece; ++d) expected += piece[d] * codebook[code * kPiece + d];
          ASSERT_EQ(tables.Of(i)[code], expected) << static_cast<int>(path) << " " << i;
        }
      }
    }
  }
}

}  // namespace
}  // namespace viewfix
