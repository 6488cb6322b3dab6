// SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <random>
#include <utility>
#include <vector>

#include "models/huffman_decoder.h"
#include "models/huffman_encoder.h"

namespace viewfix {
namespace {

using Bytes = std::vector<std::uint8_t>;

constexpr int kColumns[] = {1, 4, 16};

ByteRows RowsOf(const std::vector<Bytes>& rows) { return {rows.begin(), rows.end()}; }

// Small numbers mostly, each column's about a value of its own; rows of 0 to 40.
std::vector<Bytes> SkewedRows(int size, int columns) {
  std::mt19937 random(5);
  std::geometric_distribution<int> small(0.2);
  std::vector<Bytes> rows(size);
  for (Bytes& row : rows) {
    row.resize(random() % 41);
    for (std::size_t i = 0; i < row.size(); ++i) {
      row[i] = static_cast<std::uint8_t>(small(random) + 50 * (i % columns));
    }
  }
  return rows;
}

std::vector<Bytes> Read(const EncodedRows& encoded, const std::vector<Bytes>& like, bool* at_end) {
  std::optional<HuffmanDecoder> decoder = HuffmanDecoder::Open(encoded.tables, encoded.rows);
  EXPECT_TRUE(decoder);
  std::vector<Bytes> rows;
  for (const Bytes& row : like) {
    decoder->StartRow();
    rows.emplace_back();
    for (std::size_t i = 0; i < row.size(); ++i) rows.back().push_back(decoder->Next());
  }
  *at_end = decoder->IsAtEnd();
  return rows;
}

void ExpectReadBack(const EncodedRows& encoded, const std::vector<Bytes>& rows) {
  bool at_end = false;
  EXPECT_EQ(Read(encoded, rows, &at_end), rows);
  EXPECT_TRUE(at_end);
}

// Bits that an ideal code of one table a column takes.
double EntropyOf(const std::vector<Bytes>& rows, int columns) {
  std::vector<std::array<double, 256>> counts(columns);
  for (const Bytes& row : rows) {
    for (std::size_t i = 0; i < row.size(); ++i) ++counts[i % columns][row[i]];
  }
  double bits = 0;
  for (const auto& column : counts) {
    double all = 0;
    for (const double count : column) all += count;
    for (const double count : column) bits += count > 0 ? count * std::log2(all / count) : 0;
  }
  return bits;
}

TEST(Huffman, AreReadBack) {
  for (const int columns : kColumns) {
    const std::vector<Bytes> rows = SkewedRows(500, columns);
    const EncodedRows coded = EncodeRows(RowsOf(rows), kColumns);
    EXPECT_FALSE(coded.tables.empty());
    ExpectReadBack(coded, rows);
  }
}

TEST(Huffman, TakeHardlyMoreThanTheirEntropy) {
  for (const int columns : kColumns) {
    const std::vector<Bytes> rows = SkewedRows(20'000, columns);
    std::size_t size = 0;
    for (const Bytes& row : rows) size += row.size();
    const EncodedRows coded = EncodeRows(RowsOf(rows), kColumns);
    EXPECT_EQ(coded.tables.size(), columns * kCodeTableBytes);
    const auto bits = 8 * static_cast<double>(coded.rows.size());
    // A row's last byte is half empty, a Huffman code some hundredths of a bit too long.
    const double ideal = EntropyOf(rows, columns) + 4 * static_cast<double>(rows.size());
    EXPECT_GT(bits, EntropyOf(rows, columns));
    EXPECT_LT(bits, ideal + 0.05 * static_cast<double>(size));
  }
}

TEST(Huffman, LieAsTheyAreWhereCodesWouldNotPay) {
  std::mt19937 random(3);
  std::vector<Bytes> rows(10, Bytes(30));
  for (Bytes& row : rows) {
    for (std::uint8_t& byte : row) byte = static_cast<std::uint8_t>(random());
  }
  const EncodedRows coded = EncodeRows(RowsOf(rows), kColumns);
  EXPECT_TRUE(coded.tables.empty());
  EXPECT_EQ(coded.rows.size(), 300U);
  ExpectReadBack(coded, rows);
  ExpectReadBack(EncodeRows({}, kColumns), {});
}

TEST(Huffman, AChangedRowChangesNoOther) {
  std::vector<Bytes> rows = SkewedRows(500, 1);
  const EncodedRows before = EncodeRows(RowsOf(rows), kColumns);
  const EncodedRows ahead = EncodeRowsBy(before.tables, RowsOf({rows.begin(), rows.begin() + 200}));
  const EncodedRows behind = EncodeRowsBy(before.tables, RowsOf({rows.begin() + 201, rows.end()}));
  rows[200] = {255, 254, 0, 1, 99};  // with bytes that the tables were not made for
  const EncodedRows after = EncodeRowsBy(before.tables, RowsOf(rows));
  EXPECT_TRUE(std::equal(ahead.rows.begin(), ahead.rows.end(), after.rows.begin()));
  EXPECT_TRUE(std::equal(behind.rows.rbegin(), behind.rows.rend(), after.rows.rbegin()));
  ExpectReadBack(after, rows);
}

TEST(Huffman, NoCodeIsTooLong) {
  // Counts that grow as Fibonacci's make Huffman's tree as deep as there are bytes.
  Bytes row;
  std::size_t count = 1, before = 1;
  for (int byte = 0; byte < 24; ++byte) {
    row.insert(row.end(), count, static_cast<std::uint8_t>(byte));
    count += std::exchange(before, count);
  }
  const EncodedRows coded = EncodeRows({row}, kColumns);
  int longest = 0;
  for (int byte = 0; byte < 256; ++byte) {
    longest = std::max(longest, CodeLengthOf(coded.tables, byte));
  }
  EXPECT_EQ(longest, kMaxCodeLength);
  ExpectReadBack(coded, {row});
}

TEST(Huffman, MissingBytesAreSeen) {
  const std::vector<Bytes> rows = SkewedRows(50, 1);
  for (const bool coded_at_all : {true, false}) {
    const EncodedRows whole =
        coded_at_all ? EncodeRows(RowsOf(rows), kColumns) : EncodeRowsBy({}, RowsOf(rows));
    for (std::size_t size = 0; size < whole.rows.size(); ++size) {
      const EncodedRows part = {whole.tables, {whole.rows.begin(), whole.rows.begin() + size}};
      bool at_end = true;
      Read(part, rows, &at_end);
      EXPECT_FALSE(at_end) << size;
    }
    EncodedRows more = whole;
    more.rows.push_back(0);
    bool at_end = true;
    EXPECT_EQ(Read(more, rows, &at_end), rows);
    EXPECT_FALSE(at_end);
  }
}

Bytes TableOf(int length) { return Bytes(kCodeTableBytes, static_cast<std::uint8_t>(17 * length)); }

TEST(Huffman, TablesOfNoCompleteCodeAreRefused) {
  EXPECT_TRUE(HuffmanDecoder::Open(TableOf(8), {}));
  EXPECT_FALSE(HuffmanDecoder::Open(TableOf(0), {}));   // no code
  EXPECT_FALSE(HuffmanDecoder::Open(TableOf(7), {}));   // more codes than bits tell apart
  EXPECT_FALSE(HuffmanDecoder::Open(TableOf(9), {}));   // codes that stand for nothing
  EXPECT_FALSE(HuffmanDecoder::Open(TableOf(15), {}));  // the same
  EXPECT_FALSE(HuffmanDecoder::Open(Bytes(kCodeTableBytes - 1, 0x88), {}));
  Bytes second = TableOf(8);
  second.resize(2 * kCodeTableBytes, 0x99);
  EXPECT_FALSE(HuffmanDecoder::Open(second, {}));
  EXPECT_TRUE(HuffmanDecoder::Open(Bytes(kMaxCodeColumns * kCodeTableBytes, 0x88), {}));
  EXPECT_FALSE(HuffmanDecoder::Open(Bytes((kMaxCodeColumns + 1) * kCodeTableBytes, 0x88), {}));
}

// A complete code, grown by splitting codes at random: lengths up to the longest.
Bytes RandomTable(std::mt19937& random) {
  std::vector<int> lengths = {0};
  while (lengths.size() < 256) {
    const std::size_t i = random() % lengths.size();
    if (lengths[i] == kMaxCodeLength) continue;
    lengths.push_back(++lengths[i]);
  }
  std::shuffle(lengths.begin(), lengths.end(), random);
  Bytes table;
  for (int byte = 0; byte < 256; byte += 2) {
    table.push_back(static_cast<std::uint8_t>(lengths[byte] + 16 * lengths[byte + 1]));
  }
  return table;
}

TEST(Huffman, AnyCompleteCodeIsReadBack) {
  std::mt19937 random(19);
  int longest = 0, shortest = kMaxCodeLength;
  for (int round = 0; round < 200; ++round) {
    Bytes tables = RandomTable(random);
    for (int byte = 0; byte < 256; ++byte) {
      longest = std::max(longest, CodeLengthOf(tables, byte));
      shortest = std::min(shortest, CodeLengthOf(tables, byte));
    }
    const Bytes second = RandomTable(random);
    tables.insert(tables.end(), second.begin(), second.end());
    std::vector<Bytes> rows(5, Bytes(200));
    for (Bytes& row : rows) {
      for (std::uint8_t& byte : row) byte = static_cast<std::uint8_t>(random());
    }
    ExpectReadBack(EncodeRowsBy(tables, RowsOf(rows)), rows);
  }
  EXPECT_EQ(longest, kMaxCodeLength);
  EXPECT_LT(shortest, 5);
}

TEST(Huffman, AnyBytesAreReadByAnyTables) {
  std::mt19937 random(11);
  for (int round = 0; round < 200; ++round) {
    const Bytes tables = round % 2 == 0 ? RandomTable(random) : Bytes();
    Bytes rows(random() % 50);
    for (std::uint8_t& byte : rows) byte = static_cast<std::uint8_t>(random());
    std::optional<HuffmanDecoder> decoder = HuffmanDecoder::Open(tables, rows);
    ASSERT_TRUE(decoder);
    for (int i = 0; i < 1000; ++i) {
      if (random() % 10 == 0) decoder->StartRow();
      (void)decoder->Next();
    }
    EXPECT_EQ(decoder->Next(), 0);
    EXPECT_FALSE(decoder->IsAtEnd());
  }
}

TEST(Huffman, PaddingIsZeros) {
  Bytes table(kCodeTableBytes, 0x88);
  table[0] = 0x97;  // byte 0 of 7 bits, byte 1 of 9: the code stays complete with another of 9
  table[1] = 0x98;
  const Bytes row = {0, 0, 0};  // 21 bits
  EncodedRows encoded = EncodeRowsBy(table, {row, row});
  ExpectReadBack(encoded, {row, row});
  for (const std::size_t last : {2, 5}) {
    EncodedRows changed = encoded;
    changed.rows[last] |= 1;
    bool at_end = true;
    EXPECT_EQ(Read(changed, {row, row}, &at_end)[0], row);
    EXPECT_FALSE(at_end);
  }
}

}  // namespace
}  // namespace viewfix
