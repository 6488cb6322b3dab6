// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <memory>
#include <string>

#include "platform/camera/frame_source.h"

namespace viewfix {

// What a replay reads from, again from the start where it is looped.
class Recording {
 public:
  virtual ~Recording() = default;
  // Fills name and image. kNotFound: it has ended; other errors concern this frame alone.
  virtual Status Next(Frame& frame) = 0;
  virtual Status Rewind() = 0;
};

// A folder's pictures (frame_source.h says which).
Result<std::unique_ptr<Recording>> OpenFolder(const std::string& folder);

// A list of pictures, and whether a file's name is that of one (the same).
Result<std::unique_ptr<Recording>> OpenList(const std::string& list);
bool IsListName(const std::string& path);

// A video, decoded to grey by an ffmpeg process.
Result<std::unique_ptr<Recording>> OpenVideo(const std::string& path);

// A recording as a source of frames, at the pace that the settings say.
std::unique_ptr<FrameSource> MakeReplay(std::unique_ptr<Recording> recording,
                                        const CameraSettings& settings);

}  // namespace viewfix
