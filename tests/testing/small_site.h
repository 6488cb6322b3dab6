// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>

#include "tests/testing/temp_folder.h"

namespace viewfix {

// Writes the image set folder/NAME: three locations ("atrium", "bar", "cellar") of two views
// ("left", "right"), `per_view` JPEGs of 160 x 120 each, the last of each view a test image.
// A view is one texture, shifted from image to image. Returns the set's path.
std::string WriteSmallSite(const TempFolder& folder, const std::string& name, int per_view);

}  // namespace viewfix
