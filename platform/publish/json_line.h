// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <cstdint>
#include <string_view>

namespace viewfix {

// Text of one JSON line, put together in a fixed buffer: no heap. What does not fit is left
// out; kCapacity holds any fix (fix_writer.cc proves it).
class JsonLine {
 public:
  static constexpr std::size_t kCapacity = 12288;

  void Clear() { size_ = 0; }
  std::string_view text() const { return {buffer_.data(), size_}; }

  // `text` as it is.
  void Raw(std::string_view text);
  // `text` as a JSON string (RFC 8259): UTF-8 kept, bytes that are not UTF-8 become U+FFFD.
  void String(std::string_view text);
  void Integer(std::int64_t value);
  // The shortest digits that read back as the same float: equal floats print equal on
  // every processor. null: not finite.
  void Float(float value);
  // At least `width` digits, zeros in front.
  void Digits(std::int64_t value, int width);
  // RFC 3339 in UTC with milliseconds, as a string: "2026-05-04T03:02:01.000Z".
  void Time(std::int64_t utc_ns);

 private:
  void EscapedByte(char byte);

  std::array<char, kCapacity> buffer_;
  std::size_t size_ = 0;
};

}  // namespace viewfix
