// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <vector>

#include "platform/camera/jpeg_decoder.h"

namespace viewfix {

// A grey picture as a JPEG, for people to look at. Empty: libjpeg refuses the size.
std::vector<std::uint8_t> EncodeGreyJpeg(const GreyImage& image, int quality);

}  // namespace viewfix
