// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <filesystem>
#include <string>

#include "firmware_tools/dataset/image_set.h"
#include "platform/camera/jpeg_decoder.h"

namespace viewfix {

// Whether the name ends like that of an image: .jpg, .jpeg, .png, .pgm, .ppm, .bmp, .tif, .tiff
// or .webp, in upper or lower case.
bool IsImageFileName(const std::filesystem::path& file);

// Grey pixels and chroma of an image file, EXIF orientation applied. A JPEG goes through
// DecodeJpeg(), so that the laptop sees the board's pixels; other formats through OpenCV. Throws
// ToolError("cannot read image FILE: cause") for anything that is not a whole image.
// `exif` is filled for JPEG only, else reset.
YuvImage LoadImage(const std::filesystem::path& file, ExifInfo* exif = nullptr);

// Its two halves, for who wants the file's bytes too.
std::string ReadImageFile(const std::filesystem::path& file);
YuvImage DecodeImage(const std::filesystem::path& file, const std::string& bytes,
                     ExifInfo* exif = nullptr);

}  // namespace viewfix
