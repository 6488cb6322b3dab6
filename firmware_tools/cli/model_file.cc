// SPDX-License-Identifier: BSD-3-Clause
#include <utility>

#include "firmware_tools/cli/commands.h"
#include "firmware_tools/dataset/image_set.h"
#include "platform/file.h"

namespace viewfix {

std::vector<unsigned char> ReadModelFile(const std::string& path) {
  auto bytes = ReadFile(path);
  if (!bytes.ok()) {
    throw ToolError(std::string(bytes.status().text()) + ": " +
                    std::string(bytes.status().detail()));
  }
  return std::move(*bytes);
}

}  // namespace viewfix
