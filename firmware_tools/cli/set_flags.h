// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <CLI/CLI.hpp>
#include <string>

#include "firmware_tools/dataset/image_set.h"

namespace viewfix {

// --poses, shared by the commands that take an image set.
void AddPosesFlag(CLI::App& command, std::string& poses);

// The image set, with the poses of that file or folder if `poses` is not empty; says on stderr
// how many images of the set got one. Throws ToolError.
ImageSet LoadImageSetWithPoses(const std::string& set, const std::string& poses);

}  // namespace viewfix
