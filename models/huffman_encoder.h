// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "models/huffman_decoder.h"

namespace viewfix {

// What HuffmanDecoder reads.
struct EncodedRows {
  std::vector<std::uint8_t> tables;  // [columns, kCodeTableBytes]; empty: rows as they are
  std::vector<std::uint8_t> rows;
  std::size_t size() const { return tables.size() + rows.size(); }
};

using ByteRows = std::vector<std::span<const std::uint8_t>>;

// As few bytes as that comes to with tables for one of the numbers of columns given, or stored as
// they are. The same rows give the same bytes.
EncodedRows EncodeRows(const ByteRows& rows, std::span<const int> columns);

// By the tables given, which HuffmanDecoder::Open() takes: those of other rows, which encode these
// with a little more. None: stored as they are.
EncodedRows EncodeRowsBy(const std::vector<std::uint8_t>& tables, const ByteRows& rows);

}  // namespace viewfix
