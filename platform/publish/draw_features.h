// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <span>

#include "engine/localizer.h"
#include "platform/camera/jpeg_decoder.h"
#include "platform/publish/jpeg_encoder.h"

namespace viewfix {

// The frame with a circle about each of its key points: green and thick where it speaks for the
// fix, thin and amber where not. Those beyond the picture, or of no size, are passed over.
RgbImage DrawFeatures(const YuvImage& frame, std::span<const SeenPoint> points);

}  // namespace viewfix
