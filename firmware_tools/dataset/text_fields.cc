// SPDX-License-Identifier: BSD-3-Clause
#include "firmware_tools/dataset/text_fields.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <utility>

#include "firmware_tools/dataset/image_set.h"

namespace viewfix {
namespace {

constexpr std::string_view kBlanks = " \t\r\v\f";
constexpr std::size_t kMaxQuoted = 40;  // characters of a field quoted in an error

template <typename T>
bool Parse(std::string_view text, T& value) {
  if (text.starts_with('+')) text.remove_prefix(1);
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  return error == std::errc() && end == text.data() + text.size();
}

}  // namespace

TextFields::TextFields(std::filesystem::path file, std::string_view text)
    : file_(std::move(file)), text_(text) {
  if (text_.starts_with("\xEF\xBB\xBF")) text_.remove_prefix(3);
}

bool TextFields::NextLine() {
  if (text_.empty()) return false;
  const std::size_t end = std::min(text_.find('\n'), text_.size());
  line_ = text_.substr(0, end);
  text_.remove_prefix(std::min(end + 1, text_.size()));
  ++line_number_;
  return true;
}

bool TextFields::NextDataLine() {
  while (NextLine()) {
    SkipBlanks();
    if (!line_.empty() && line_.front() != '#') return true;
  }
  return false;
}

void TextFields::SkipBlanks() {
  line_.remove_prefix(std::min(line_.find_first_not_of(kBlanks), line_.size()));
}

bool TextFields::AtLineEnd() {
  SkipBlanks();
  return line_.empty();
}

std::string_view TextFields::Word(const char* what) {
  SkipBlanks();
  if (line_.empty()) Fail(std::string("the line ends before ") + what);
  const std::string_view word = line_.substr(0, line_.find_first_of(kBlanks));
  line_.remove_prefix(word.size());
  return word;
}

double TextFields::Number(const char* what) {
  const std::string_view word = Word(what);
  double value = 0;
  if (!Parse(word, value) || !std::isfinite(value)) {
    Fail(std::string(what) + " is not a number: " + std::string(word.substr(0, kMaxQuoted)));
  }
  return value;
}

std::int64_t TextFields::Whole(const char* what) {
  const std::string_view word = Word(what);
  std::int64_t value = 0;
  if (!Parse(word, value)) {
    Fail(std::string(what) + " is not a whole number: " + std::string(word.substr(0, kMaxQuoted)));
  }
  return value;
}

std::string_view TextFields::RestOfLine() {
  SkipBlanks();
  const std::size_t last = line_.find_last_not_of(kBlanks);
  return std::exchange(line_, {}).substr(0, last == std::string_view::npos ? 0 : last + 1);
}

void TextFields::Fail(const std::string& cause) const {
  throw ToolError(file_.string() + " line " + std::to_string(line_number_) + ": " + cause);
}

std::string ExactNumber(double value) {
  std::array<char, 32> text;
  const auto end = std::to_chars(text.data(), text.data() + text.size(), value).ptr;
  return {text.data(), end};
}

}  // namespace viewfix
