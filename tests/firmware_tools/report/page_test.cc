// SPDX-License-Identifier: BSD-3-Clause
#include "firmware_tools/report/page.h"

#include <gmock/gmock.h>

#include <nlohmann/json.hpp>

#include "firmware_tools/dataset/image_set.h"

namespace viewfix {
namespace {

using testing::HasSubstr;
using testing::Not;

TEST(FillPageTest, MarksInWhatIsFilledInStay) {
  const PagePart parts[] = {{"/*A*/", "a /*B*/"}, {"/*B*/", "b /*A*/"}};
  EXPECT_EQ(FillPage("<1/*B*/2/*A*/3>", parts), "<1b /*A*/2a /*B*/3>");
  EXPECT_EQ(FillPage("/*A*/", parts), "a /*B*/");
  EXPECT_EQ(FillPage("nothing", parts), "nothing");
}

TEST(ScriptJsonTest, NothingInAStringEndsTheScript) {
  const nlohmann::ordered_json json = {{"</script><!--", "<script>\xff & \" \\"}};
  const std::string text = ScriptJson(json);
  EXPECT_THAT(text, Not(HasSubstr("<")));
  const auto read = nlohmann::ordered_json::parse(text);
  EXPECT_EQ(read["</script><!--"], "<script>\xef\xbf\xbd & \" \\") << "bad UTF-8 is replaced";
}

TEST(UrlPathTest, WhatABrowserReadsOtherwiseIsEscaped) {
  EXPECT_EQ(UrlPath("../maps/a-1.html"), "./../maps/a-1.html");
  EXPECT_EQ(UrlPath("javascript:a(1)?#%"), "./javascript%3Aa%281%29%3F%23%25");
  EXPECT_EQ(UrlPath("\xc3\xa4"), "./%C3%A4");
}

TEST(PictureUrlTest, SaysWhatItIs) {
  const std::uint8_t png[] = {0x89, 'P', 'N', 'G'};
  EXPECT_EQ(PictureUrl(png), "data:image/png;base64,iVBORw==");
  const std::uint8_t jpeg[] = {0xff, 0xd8, 0xff};
  EXPECT_EQ(PictureUrl(jpeg), "data:image/jpeg;base64,/9j/");
}

TEST(CheckLibraryTest, SaysWhatIsMissingAndWhatToDo) {
  EXPECT_NO_THROW(CheckLibrary("--report", "code", "Chart.js"));
  try {
    CheckLibrary("--report", "", "Chart.js");
    FAIL() << "no library";
  } catch (const ToolError& error) {
    EXPECT_THAT(error.what(), HasSubstr("--report: "));
    EXPECT_THAT(error.what(), HasSubstr("Chart.js"));
    EXPECT_THAT(error.what(), HasSubstr("toolchains/fetch_web_libraries.sh"));
  }
}

}  // namespace
}  // namespace viewfix
