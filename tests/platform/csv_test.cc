// SPDX-License-Identifier: BSD-3-Clause
#include "platform/csv.h"

#include <gtest/gtest.h>

#include <random>
#include <string>
#include <vector>

namespace viewfix {
namespace {

std::vector<std::string> Cells(std::string_view csv) {
  const Result<CsvTable> table = ParseCsv(csv);
  EXPECT_TRUE(table.ok()) << csv << table.status().text();
  return table.ok() && !table->rows.empty() ? table->rows[0].cells : std::vector<std::string>();
}

std::string ErrorOf(std::string_view csv) {
  const Result<CsvTable> table = ParseCsv(csv);
  if (table.ok()) return "no error";
  EXPECT_EQ(table.status().code(), StatusCode::kCorrupt);
  return table.status().text() + std::string(", ") + std::string(table.status().detail());
}

TEST(ParseCsv, SplitsCells) {
  EXPECT_EQ(Cells("a,b\n1,2\n"), (std::vector<std::string>{"1", "2"}));
  EXPECT_EQ(Cells("a,b\r\n1,2"), (std::vector<std::string>{"1", "2"}));
  EXPECT_EQ(Cells("a,b\n,\n"), (std::vector<std::string>{"", ""}));
  EXPECT_EQ(Cells("a,b\n1,"), (std::vector<std::string>{"1", ""}));
  EXPECT_EQ(Cells("a,b\n\"x,\"\"y\"\"\n z\", w \n"),
            (std::vector<std::string>{"x,\"y\"\n z", " w "}));
  EXPECT_EQ(Cells("a\n\"\"\n"), (std::vector<std::string>{""}));
  EXPECT_EQ(Cells("a\n5\" tile\n"), (std::vector<std::string>{"5\" tile"}));
}

TEST(ParseCsv, FindsColumnsAndLines) {
  const Result<CsvTable> table = ParseCsv("\xEF\xBB\xBFpath,note\n\na.jpg,\"1\n2\"\n\r\nb.jpg,\n");
  ASSERT_TRUE(table.ok());
  EXPECT_EQ(table->Column("path"), 0);
  EXPECT_EQ(table->Column("note"), 1);
  EXPECT_EQ(table->Column("Path"), -1);
  ASSERT_EQ(table->rows.size(), 2);
  EXPECT_EQ(table->rows[0].line, 3);
  EXPECT_EQ(table->rows[1].line, 6);
}

TEST(ParseCsv, NamesLineAndCause) {
  EXPECT_EQ(ErrorOf(""), "no header line, line 1");
  EXPECT_EQ(ErrorOf("\r\n\n"), "no header line, line 1");
  EXPECT_EQ(ErrorOf("a,a\n"), "a column name stands twice in the header, line 1");
  EXPECT_EQ(ErrorOf("a,b\n1,2\n1\n"), "a row has not as many cells as the header, line 3");
  EXPECT_EQ(ErrorOf("a\n\n\"1\n"), "a quoted cell that does not end, line 3");
  EXPECT_EQ(ErrorOf("a\n\"1\n\"2\n"), "text after a closing quote, line 3");
  EXPECT_EQ(ErrorOf(std::string_view("a\nb\0\n", 5)), "a NUL byte, line 2");
}

TEST(ParseCsv, RefusesWhatIsNotUtf8) {
  EXPECT_TRUE(IsUtf8("B\xC3\xBCro \xE2\x82\xAC \xF0\x9F\x93\xB7"));
  for (const char* text : {"\xFF", "\x80", "\xC3", "\xC0\x80", "\xE2\x82", "\xE0\x80\x80",
                           "\xED\xA0\x80", "\xF4\x90\x80\x80", "\xF5\x80\x80\x80", "\xC3\xC3"}) {
    EXPECT_FALSE(IsUtf8(text));
    EXPECT_EQ(ErrorOf(std::string("a\n") + text), "not UTF-8 text, line 2");
  }
}

TEST(ParseCsv, GivesQuotedCellsBack) {
  std::mt19937 random(5);
  const std::string alphabet = "a,\"\r\n ";
  for (int round = 0; round < 500; ++round) {
    std::vector<std::string> cells(3);
    for (std::string& cell : cells) {
      for (int i = static_cast<int>(random() % 6); i > 0; --i) {
        cell.push_back(alphabet[random() % alphabet.size()]);
      }
    }
    const std::string row =
        QuoteCsv(cells[0]) + "," + QuoteCsv(cells[1]) + "," + QuoteCsv(cells[2]);
    EXPECT_EQ(Cells("x,y,z\r\n" + row + "\r\n"), cells) << row;
  }
}

}  // namespace
}  // namespace viewfix
