// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <filesystem>
#include <string>
#include <string_view>

#include "engine/base/status.h"

namespace viewfix {

// "not UTF-8 text (line 7)": a status as part of an error line.
std::string Describe(const Status& status);

// The whole file; throws ToolError naming the file and the cause.
std::string ReadTextFile(const std::filesystem::path& file);

// All or nothing: `file` is replaced by a complete new one. Throws ToolError.
void WriteTextFile(const std::filesystem::path& file, std::string_view text);

}  // namespace viewfix
