// SPDX-License-Identifier: BSD-3-Clause
#include "platform/csv.h"

#include <algorithm>
#include <cstdio>
#include <set>
#include <utility>

#include "platform/utf8.h"

namespace viewfix {
namespace {

Status Broken(const char* text, int line) {
  char detail[32];
  const int size = std::snprintf(detail, sizeof detail, "line %d", line);
  return {StatusCode::kCorrupt, text, {detail, static_cast<std::size_t>(size)}};
}

Status CheckText(std::string_view text) {
  int line = 1;
  while (!text.empty()) {
    const std::size_t length = Utf8Length(text);
    if (length == 0) return Broken("not UTF-8 text", line);
    if (text.front() == '\0') return Broken("a NUL byte", line);
    if (text.front() == '\n') ++line;
    text.remove_prefix(length);
  }
  return {};
}

// Reads row after row from text that CheckText() has passed.
class RowReader {
 public:
  explicit RowReader(std::string_view text) : text_(text) {}

  // The next row that is not an empty line; without cells at the end.
  Result<CsvTable::Row> Next() {
    CsvTable::Row row;
    while (at_ < text_.size() && SkipLineEnd()) {
    }
    row.line = line_;
    while (at_ < text_.size()) {
      std::string cell;
      if (Status status = ReadCell(cell); !status.ok()) return status;
      row.cells.push_back(std::move(cell));
      if (at_ == text_.size() || SkipLineEnd()) break;
      ++at_;  // the comma
      if (at_ == text_.size()) row.cells.emplace_back();
    }
    return row;
  }

 private:
  bool AtLineEnd() const { return text_[at_] == '\n' || text_.substr(at_, 2) == "\r\n"; }

  bool SkipLineEnd() {
    if (!AtLineEnd()) return false;
    at_ += text_[at_] == '\r' ? 2 : 1;
    ++line_;
    return true;
  }

  // Stops at the comma or line end after the cell, or at the end of the text.
  Status ReadCell(std::string& cell) {
    if (text_[at_] == '"') return ReadQuotedCell(cell);
    const std::size_t begin = at_;
    while (at_ < text_.size() && text_[at_] != ',' && !AtLineEnd()) ++at_;
    cell = text_.substr(begin, at_ - begin);
    return {};
  }

  Status ReadQuotedCell(std::string& cell) {
    const int first_line = line_;
    for (++at_; at_ < text_.size(); ++at_) {
      if (text_[at_] == '"') {
        if (text_.substr(at_, 2) != "\"\"") break;
        ++at_;
      }
      if (text_[at_] == '\n') ++line_;
      cell.push_back(text_[at_]);
    }
    if (at_ == text_.size()) return Broken("a quoted cell that does not end", first_line);
    ++at_;
    if (at_ < text_.size() && text_[at_] != ',' && !AtLineEnd()) {
      return Broken("text after a closing quote", line_);
    }
    return {};
  }

  std::string_view text_;
  std::size_t at_ = 0;
  int line_ = 1;
};

}  // namespace

int CsvTable::Column(std::string_view name) const {
  const auto found = std::find(header.begin(), header.end(), name);
  return found == header.end() ? -1 : static_cast<int>(found - header.begin());
}

Result<CsvTable> ParseCsv(std::string_view text) {
  if (text.substr(0, 3) == "\xEF\xBB\xBF") text.remove_prefix(3);
  if (Status status = CheckText(text); !status.ok()) return status;
  RowReader reader(text);
  CsvTable table;
  Result<CsvTable::Row> row = reader.Next();
  if (!row.ok()) return row.status();
  if (row->cells.empty()) return Broken("no header line", 1);
  table.header = std::move(row->cells);
  if (std::set<std::string>(table.header.begin(), table.header.end()).size() <
      table.header.size()) {
    return Broken("a column name stands twice in the header", row->line);
  }
  while (true) {
    row = reader.Next();
    if (!row.ok()) return row.status();
    if (row->cells.empty()) return table;
    if (row->cells.size() != table.header.size()) {
      return Broken("a row has not as many cells as the header", row->line);
    }
    table.rows.push_back(std::move(*row));
  }
}

bool IsUtf8(std::string_view text) {
  while (!text.empty()) {
    const std::size_t length = Utf8Length(text);
    if (length == 0) return false;
    text.remove_prefix(length);
  }
  return true;
}

std::string QuoteCsv(std::string_view cell) {
  if (cell.find_first_of(",\"\r\n") == std::string_view::npos) return std::string(cell);
  std::string quoted = "\"";
  for (const char c : cell) {
    if (c == '"') quoted.push_back('"');
    quoted.push_back(c);
  }
  quoted.push_back('"');
  return quoted;
}

}  // namespace viewfix
