# SPDX-License-Identifier: BSD-3-Clause
# cmake -DPAGE=page.html -DOUT=page.cc -DHEADER=path/of/header.h -DFUNCTION=PageHtml -P embed_page.cmake
# Writes a source file whose function, declared in the header, returns the file's bytes: none
# where PAGE is empty.
set(bytes "0")
set(size 0)
if(NOT PAGE STREQUAL "")
  file(READ "${PAGE}" hex HEX)
  string(REGEX REPLACE "(..)" "0x\\1," bytes "${hex}")
  file(SIZE "${PAGE}" size)
endif()
file(WRITE "${OUT}" "#include \"${HEADER}\"
namespace viewfix {
namespace {
constexpr unsigned char kBytes[] = {${bytes}};
}  // namespace
std::string_view ${FUNCTION}() {
  return {reinterpret_cast<const char*>(kBytes), ${size}};
}
}  // namespace viewfix
")
