// SPDX-License-Identifier: BSD-3-Clause
#include "firmware_tools/dataset/tool_file.h"

#include <cstdint>
#include <span>

#include "firmware_tools/dataset/image_set.h"
#include "platform/file.h"

namespace viewfix {

std::string Describe(const Status& status) {
  std::string text = status.text();
  if (!status.detail().empty()) text += " (" + std::string(status.detail()) + ")";
  return text;
}

std::string ReadTextFile(const std::filesystem::path& file) {
  const auto bytes = ReadFile(file.string());
  if (!bytes.ok()) throw ToolError(Describe(bytes.status()));
  return {bytes->begin(), bytes->end()};
}

void WriteTextFile(const std::filesystem::path& file, std::string_view text) {
  const Status status = WriteFileAtomically(
      file.string(), {reinterpret_cast<const std::uint8_t*>(text.data()), text.size()});
  if (!status.ok()) throw ToolError(Describe(status));
}

}  // namespace viewfix
