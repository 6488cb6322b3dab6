// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "engine/base/status.h"

namespace viewfix {

// A CSV file with a header line. Every row has header.size() cells.
struct CsvTable {
  struct Row {
    int line = 0;  // of the file, from 1; a quoted cell may span several
    std::vector<std::string> cells;
  };
  std::vector<std::string> header;
  std::vector<Row> rows;

  // Index of the column called `name`; -1: there is none.
  int Column(std::string_view name) const;
};

// Splits RFC 4180 text: cells between commas, quoted where they hold commas,
// quotes or line ends; lines end in LF or CRLF. A UTF-8 byte order mark is
// skipped, and so are empty lines. kCorrupt, naming the line: a NUL byte, bytes that are
// not UTF-8, an unclosed quote, text after a closing quote, a row with more or fewer cells
// than the header, a column name twice, no header at all.
Result<CsvTable> ParseCsv(std::string_view text);

// Whether `text` is well-formed UTF-8 (RFC 3629).
bool IsUtf8(std::string_view text);

// `cell` as it stands in a CSV line: quoted only where it must be.
std::string QuoteCsv(std::string_view cell);

}  // namespace viewfix
