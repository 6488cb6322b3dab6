// SPDX-License-Identifier: BSD-3-Clause
#include "platform/publish/json_line.h"

#include <algorithm>
#include <charconv>
#include <chrono>
#include <cmath>

#include "platform/utf8.h"

namespace viewfix {

void JsonLine::Raw(std::string_view text) {
  const std::size_t count = std::min(text.size(), kCapacity - size_);
  std::copy_n(text.data(), count, buffer_.data() + size_);
  size_ += count;
}

void JsonLine::EscapedByte(char byte) {
  if (byte == '"') return Raw("\\\"");
  if (byte == '\\') return Raw("\\\\");
  if (static_cast<unsigned char>(byte) >= 0x20) return Raw({&byte, 1});
  const char hex[] = "0123456789abcdef";
  const char escape[] = {'\\', 'u', '0', '0', hex[byte >> 4], hex[byte & 15]};
  Raw({escape, sizeof escape});
}

void JsonLine::String(std::string_view text) {
  Raw("\"");
  while (!text.empty()) {
    const std::size_t length = Utf8Length(text);
    if (length == 0) {
      Raw("\xEF\xBF\xBD");
    } else if (length == 1) {
      EscapedByte(text.front());
    } else {
      Raw(text.substr(0, length));
    }
    text.remove_prefix(std::max<std::size_t>(length, 1));
  }
  Raw("\"");
}

void JsonLine::Integer(std::int64_t value) {
  char digits[24];
  const auto end = std::to_chars(digits, digits + sizeof digits, value).ptr;
  Raw({digits, static_cast<std::size_t>(end - digits)});
}

void JsonLine::Float(float value) {
  if (!std::isfinite(value)) return Raw("null");
  char digits[24];  // at most 15: -1.17549435e-38
  const auto end = std::to_chars(digits, digits + sizeof digits, value).ptr;
  Raw({digits, static_cast<std::size_t>(end - digits)});
}

void JsonLine::Digits(std::int64_t value, int width) {
  std::int64_t limit = 10;
  for (int i = 1; i < width; ++i, limit *= 10) {
    if (value < limit) Raw("0");
  }
  Integer(value);
}

void JsonLine::Time(std::int64_t utc_ns) {
  using namespace std::chrono;
  const sys_time<milliseconds> time(floor<milliseconds>(nanoseconds(utc_ns)));
  const auto day = floor<days>(time);
  const year_month_day date(day);
  const hh_mm_ss clock(time - day);
  Raw("\"");
  Digits(int{date.year()}, 4);
  Raw("-");
  Digits(unsigned{date.month()}, 2);
  Raw("-");
  Digits(unsigned{date.day()}, 2);
  Raw("T");
  Digits(clock.hours().count(), 2);
  Raw(":");
  Digits(clock.minutes().count(), 2);
  Raw(":");
  Digits(clock.seconds().count(), 2);
  Raw(".");
  Digits(clock.subseconds().count(), 3);
  Raw("Z\"");
}

}  // namespace viewfix
