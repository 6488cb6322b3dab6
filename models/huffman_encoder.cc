// SPDX-License-Identifier: BSD-3-Clause
#include "models/huffman_encoder.h"

#include <algorithm>
#include <array>
#include <functional>
#include <queue>
#include <utility>

namespace viewfix {
namespace {

using Counts = std::array<std::uint64_t, 256>;
using Lengths = std::array<int, 256>;

// Huffman's tree: the depth of every byte. Of equal weights the one made first.
Lengths DepthsOf(const Counts& counts) {
  struct Node {
    std::uint64_t weight;
    int children[2];
  };
  std::vector<Node> nodes;
  std::priority_queue<std::pair<std::uint64_t, int>, std::vector<std::pair<std::uint64_t, int>>,
                      std::greater<>>
      left;
  const auto add = [&](const Node& node) {
    left.emplace(node.weight, static_cast<int>(nodes.size()));
    nodes.push_back(node);
  };
  for (const std::uint64_t count : counts) add({count, {-1, -1}});
  const auto take = [&] {
    const int node = left.top().second;
    left.pop();
    return node;
  };
  while (left.size() > 1) {
    const int a = take();
    const int b = take();
    add({nodes[a].weight + nodes[b].weight, {a, b}});
  }
  std::vector<int> depth(nodes.size(), 0);
  for (int n = static_cast<int>(nodes.size()) - 1; n >= 256; --n) {
    for (const int child : nodes[n].children) depth[child] = depth[n] + 1;
  }
  Lengths lengths;
  std::copy_n(depth.begin(), lengths.size(), lengths.begin());
  return lengths;
}

// A code for every byte, as a base's tables must do for whatever comes: bytes that do not occur
// count for next to nothing. Counts are evened out until no code is too long.
Lengths CodeLengths(Counts counts) {
  for (std::uint64_t& count : counts) count = 256 * count + 1;
  for (;;) {
    const Lengths lengths = DepthsOf(counts);
    if (*std::ranges::max_element(lengths) <= kMaxCodeLength) return lengths;
    for (std::uint64_t& count : counts) count = count / 2 + 1;
  }
}

std::vector<Counts> CountBytes(const ByteRows& rows, int columns) {
  std::vector<Counts> counts(columns, Counts{});
  for (const auto row : rows) {
    for (std::size_t i = 0; i < row.size(); ++i) ++counts[i % columns][row[i]];
  }
  return counts;
}

std::vector<std::uint8_t> MakeTables(const ByteRows& rows, int columns) {
  std::vector<std::uint8_t> tables;
  for (const Counts& counts : CountBytes(rows, columns)) {
    const Lengths lengths = CodeLengths(counts);
    for (std::size_t byte = 0; byte < lengths.size(); byte += 2) {
      tables.push_back(static_cast<std::uint8_t>(lengths[byte] + 16 * lengths[byte + 1]));
    }
  }
  return tables;
}

// The bytes' codes: codes ascend with their lengths, and within a length with their bytes.
struct Codes {
  Lengths length;
  std::array<std::uint32_t, 256> code;
};

Codes CodesOf(std::span<const std::uint8_t> table) {
  Codes codes{};
  std::uint32_t next = 0;
  for (int length = 1; length <= kMaxCodeLength; ++length) {
    next *= 2;
    for (int byte = 0; byte < 256; ++byte) {
      if (CodeLengthOf(table, byte) != length) continue;
      codes.length[byte] = length;
      codes.code[byte] = next++;
    }
  }
  return codes;
}

// The highest bit of a byte first.
class BitWriter {
 public:
  void Write(std::uint32_t code, int length) {
    for (int i = length - 1; i >= 0; --i) {
      if (free_ == 0) {
        bytes_.push_back(0);
        free_ = 8;
      }
      bytes_.back() = static_cast<std::uint8_t>(bytes_.back() | (code >> i & 1) << --free_);
    }
  }
  void EndRow() { free_ = 0; }
  std::vector<std::uint8_t> Take() { return std::move(bytes_); }

 private:
  std::vector<std::uint8_t> bytes_;
  int free_ = 0;  // bits of the last byte
};

}  // namespace

EncodedRows EncodeRows(const ByteRows& rows, std::span<const int> columns) {
  EncodedRows best = EncodeRowsBy({}, rows);
  for (const int c : columns) {
    EncodedRows encoded = EncodeRowsBy(MakeTables(rows, c), rows);
    if (encoded.size() < best.size()) best = std::move(encoded);
  }
  return best;
}

EncodedRows EncodeRowsBy(const std::vector<std::uint8_t>& tables, const ByteRows& rows) {
  if (tables.empty()) {
    EncodedRows plain;
    for (const auto row : rows) plain.rows.insert(plain.rows.end(), row.begin(), row.end());
    return plain;
  }
  std::vector<Codes> columns;
  for (std::size_t t = 0; t < tables.size(); t += kCodeTableBytes) {
    columns.push_back(CodesOf(std::span(tables).subspan(t, kCodeTableBytes)));
  }
  BitWriter writer;
  for (const auto row : rows) {
    for (std::size_t i = 0; i < row.size(); ++i) {
      const Codes& codes = columns[i % columns.size()];
      writer.Write(codes.code[row[i]], codes.length[row[i]]);
    }
    writer.EndRow();
  }
  return {tables, writer.Take()};
}

}  // namespace viewfix
