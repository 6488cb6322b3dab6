// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <string_view>

namespace viewfix {

// The lines of a text file, one after the other, and the blank-separated fields of each. What is
// not as expected throws ToolError("FILE line N: cause"). The text must outlive the reader.
class TextFields {
 public:
  TextFields(std::filesystem::path file, std::string_view text);

  // Goes to the next line; false: there is none. A CR before the line's end does not count.
  bool NextLine();
  // The same, passing over empty lines and those that begin with #.
  bool NextDataLine();

  bool AtLineEnd();
  std::string_view Word(const char* what);
  double Number(const char* what);  // finite
  std::int64_t Whole(const char* what);
  std::string_view RestOfLine();  // without the blanks around it

  [[noreturn]] void Fail(const std::string& cause) const;

 private:
  void SkipBlanks();

  std::filesystem::path file_;
  std::string_view text_;  // behind the current line
  std::string_view line_;  // what is left of it
  int line_number_ = 0;
};

// The shortest text that reads back as the same double.
std::string ExactNumber(double value);

}  // namespace viewfix
