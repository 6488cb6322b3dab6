// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

namespace viewfix {

// Rows of bytes in canonical Huffman codes [1]. Each row begins with a whole byte, so that a
// changed row leaves the others' bytes as they were: what `flash` sends of a changed model stays
// small. Byte i of a row has the table i mod columns, since the numbers of a descriptor are spread
// each in its own way. A code's first bit is its byte's highest; what is left of a row's last byte
// is zeros. [1] D. Hirschberg, D. Lelewer, Efficient decoding of prefix codes, CACM 33 (1990).

inline constexpr int kMaxCodeLength = 15;
inline constexpr std::size_t kMaxCodeColumns = 128;
// A table is the code lengths of all 256 bytes, 1..15, two a byte: the even one's in the lower
// four bits.
inline constexpr std::size_t kCodeTableBytes = 128;
constexpr int CodeLengthOf(std::span<const std::uint8_t> table, int byte) {
  const int both = table[byte / 2];
  return byte % 2 == 0 ? both & 15 : both >> 4;
}

// Reads rows one after another, and never beyond their end: what is missing is zeros.
class HuffmanDecoder {
 public:
  //   tables [columns, kCodeTableBytes], at most kMaxCodeColumns; empty: the rows are stored as
  //   they
  //          are
  //   rows   borrowed
  // None: the tables are not those of complete prefix codes.
  static std::optional<HuffmanDecoder> Open(std::span<const std::uint8_t> tables,
                                            std::span<const std::uint8_t> rows);

  // To be called before the first byte of every row.
  void StartRow() {
    SkipPadding();
    column_ = 0;
  }

  // The row's next byte.
  std::uint8_t Next() {
    if (num_bits_ < kMaxCodeLength) Refill();
    if (columns_.empty()) return NextStored();
    const Column& column = columns_[column_];
    if (++column_ == columns_.size()) column_ = 0;
    Code code = column.short_codes[static_cast<std::size_t>(window_ >> (64 - kShortBits))];
    if (code.length == 0) code = FindLong(column);
    return Skip(code.length) ? code.byte : 0;
  }

  // Whether that was all, and nothing was missing or broken.
  bool IsAtEnd() {
    SkipPadding();
    return !broken_ && num_bits_ == 0 && position_ == rows_.size();
  }

 private:
  static constexpr int kShortBits = 10;

  struct Code {
    std::uint8_t byte = 0;
    std::uint8_t length = 0;
  };

  struct Column {
    // By the next bits; of no length where the code is longer.
    std::array<Code, 1 << kShortBits> short_codes{};
    // Codes of one length follow each other.
    std::array<int, kMaxCodeLength + 1> first_code{};  // of each length
    std::array<int, kMaxCodeLength + 1> first_idx{};   // of its byte, in `bytes`
    std::array<int, kMaxCodeLength + 1> num_codes{};
    std::array<std::uint8_t, 256> bytes{};  // in the order of their codes
  };

  static bool Fill(std::span<const std::uint8_t> table, Column& column);
  Code FindLong(const Column& column) const;

  std::uint8_t NextStored() {
    const auto byte = static_cast<std::uint8_t>(window_ >> 56);
    return Skip(8) ? byte : 0;
  }

  // False: there were not so many, and there is no more.
  bool Skip(int bits) {
    broken_ = broken_ || bits > num_bits_;
    if (broken_) bits = num_bits_;
    window_ <<= bits;
    num_bits_ -= bits;
    return !broken_;
  }

  void SkipPadding() {
    const int bits = num_bits_ % 8;
    broken_ = broken_ || (bits > 0 && window_ >> (64 - bits) != 0);
    Skip(bits);
  }

  void Refill() {
    for (; num_bits_ <= 48 && position_ < rows_.size(); num_bits_ += 8) {
      window_ |= std::uint64_t{rows_[position_++]} << (56 - num_bits_);
    }
  }

  std::vector<Column> columns_;
  std::size_t column_ = 0;  // of the next byte
  std::span<const std::uint8_t> rows_;
  std::size_t position_ = 0;  // in rows_, of what is not in the window yet
  std::uint64_t window_ = 0;  // the next bits from the highest on, zeros behind them
  int num_bits_ = 0;
  bool broken_ = false;
};

}  // namespace viewfix
