// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <span>

#include "platform/camera/jpeg_decoder.h"

namespace viewfix {

// What an APP1 segment ("Exif\0\0" and a TIFF block) says. Never fails: what it does not
// say, or says wrongly, keeps ExifInfo's defaults.
ExifInfo ParseExif(std::span<const std::uint8_t> segment);

}  // namespace viewfix
