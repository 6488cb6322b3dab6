// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>

namespace viewfix {

// libcamera names pixel formats by DRM's codes, we by V4L2's. 0: none that ToYuv() reads.
std::uint32_t V4l2FormatOf(std::uint32_t drm_format);

}  // namespace viewfix
