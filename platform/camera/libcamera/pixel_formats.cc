// SPDX-License-Identifier: BSD-3-Clause
#include "platform/camera/libcamera/pixel_formats.h"

#include <linux/videodev2.h>

#include "platform/camera/v4l2/to_yuv.h"

namespace viewfix {

std::uint32_t V4l2FormatOf(std::uint32_t drm_format) {
  switch (drm_format) {
    case v4l2_fourcc('R', '8', ' ', ' '):
      return V4L2_PIX_FMT_GREY;
    // DRM names the bytes of a little-endian number from its upper end, V4L2 as they lie in memory.
    case v4l2_fourcc('B', 'G', '2', '4'):
      return V4L2_PIX_FMT_RGB24;
    case v4l2_fourcc('R', 'G', '2', '4'):
      return V4L2_PIX_FMT_BGR24;
    default:
      return KnowsPixelFormat(drm_format) ? drm_format : 0;
  }
}

}  // namespace viewfix
