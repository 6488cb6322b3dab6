// SPDX-License-Identifier: BSD-3-Clause
#include "models/huffman_decoder.h"

#include <algorithm>

namespace viewfix {

std::optional<HuffmanDecoder> HuffmanDecoder::Open(std::span<const std::uint8_t> tables,
                                                   std::span<const std::uint8_t> rows) {
  if (tables.size() % kCodeTableBytes != 0 || tables.size() / kCodeTableBytes > kMaxCodeColumns) {
    return std::nullopt;
  }
  HuffmanDecoder reader;
  reader.rows_ = rows;
  reader.columns_.resize(tables.size() / kCodeTableBytes);
  for (std::size_t c = 0; c < reader.columns_.size(); ++c) {
    const auto table = tables.subspan(c * kCodeTableBytes, kCodeTableBytes);
    if (!Fill(table, reader.columns_[c])) return std::nullopt;
  }
  return reader;
}

// Codes ascend with their lengths, and within a length with their bytes.
bool HuffmanDecoder::Fill(std::span<const std::uint8_t> table, Column& column) {
  for (int byte = 0; byte < 256; ++byte) ++column.num_codes[CodeLengthOf(table, byte)];
  if (column.num_codes[0] != 0) return false;
  int code = 0, idx = 0;
  for (int length = 1; length <= kMaxCodeLength; ++length) {
    code *= 2;
    column.first_code[length] = code;
    column.first_idx[length] = idx;
    for (int byte = 0; byte < 256; ++byte) {
      if (CodeLengthOf(table, byte) != length) continue;
      if (code >= 1 << length) return false;  // more codes than there is room for
      if (length <= kShortBits) {
        const int rest = kShortBits - length;
        std::fill_n(column.short_codes.begin() + (std::ptrdiff_t{code} << rest), 1 << rest,
                    Code{static_cast<std::uint8_t>(byte), static_cast<std::uint8_t>(length)});
      }
      column.bytes[idx++] = static_cast<std::uint8_t>(byte);
      ++code;
    }
  }
  return code == 1 << kMaxCodeLength;
}

HuffmanDecoder::Code HuffmanDecoder::FindLong(const Column& column) const {
  int length = kShortBits + 1;
  int nth = 0;
  for (;; ++length) {  // ends, as the codes are complete
    nth = static_cast<int>(window_ >> (64 - length)) - column.first_code[length];
    if (length == kMaxCodeLength || nth < column.num_codes[length]) break;
  }
  return {column.bytes[column.first_idx[length] + nth], static_cast<std::uint8_t>(length)};
}

}  // namespace viewfix
