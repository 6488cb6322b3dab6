// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "platform/camera/jpeg_decoder.h"

namespace viewfix {

// `stored` as it is to be looked at, by EXIF orientation 1..8 (tag 0x0112 of Exif 2.32):
// 1 as it is, 2 mirrored left-right, 3 turned by 180 degrees, 4 mirrored top-bottom,
// 5 transposed, 6 turned by 90 degrees clockwise, 7 transposed over the other diagonal,
// 8 turned by 90 degrees anticlockwise. Other values count as 1. Allocates only where
// `upright` is too small; the two must be different images.
void Orient(const YuvImage& stored, int orientation, YuvImage& upright);

}  // namespace viewfix
