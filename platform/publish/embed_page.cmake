# SPDX-License-Identifier: BSD-3-Clause
# cmake -DPAGE=page.html -DOUT=live_page.cc -P embed_page.cmake
# Writes a source file whose function returns the page's bytes.
file(READ "${PAGE}" hex HEX)
string(REGEX REPLACE "(..)" "0x\\1," bytes "${hex}")
file(WRITE "${OUT}" "#include \"platform/publish/http_output.h\"
namespace viewfix {
namespace {
constexpr unsigned char kPage[] = {${bytes}};
}  // namespace
std::string_view LivePageHtml() {
  return {reinterpret_cast<const char*>(kPage), sizeof kPage};
}
}  // namespace viewfix
")
