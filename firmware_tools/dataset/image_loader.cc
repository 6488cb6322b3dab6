// SPDX-License-Identifier: BSD-3-Clause
#include "firmware_tools/dataset/image_loader.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <string>
#include <string_view>

#include "firmware_tools/dataset/tool_file.h"

namespace viewfix {
namespace {

namespace fs = std::filesystem;

[[noreturn]] void Fail(const fs::path& file, const std::string& cause) {
  throw ToolError("cannot read image " + file.string() + ": " + cause);
}

// libpng writes to stderr about these, and OpenCV passes nothing on.
bool IsCutPng(std::string_view bytes) {
  return bytes.starts_with("\x89PNG") && !bytes.substr(bytes.size() - 8).starts_with("IEND");
}

// Empty: not an image, or one of a size beyond OpenCV's limits.
cv::Mat Decode(const std::string& bytes, cv::ImreadModes mode) {
  try {
    return cv::imdecode(cv::Mat(1, int(bytes.size()), CV_8U, const_cast<char*>(bytes.data())),
                        mode);
  } catch (const cv::Exception&) {
    return {};
  }
}

// Chroma of half the size.
void AddChroma(const cv::Mat& colours, YuvImage& image) {
  cv::Mat halved, ycrcb;
  cv::resize(colours, halved, {image.ChromaWidth(), image.ChromaHeight()}, 0, 0, cv::INTER_AREA);
  cv::cvtColor(halved, ycrcb, cv::COLOR_BGR2YCrCb);
  image.ResizeChroma();
  cv::Mat cb(halved.size(), CV_8U, image.cb.data()), cr(halved.size(), CV_8U, image.cr.data());
  cv::extractChannel(ycrcb, cr, 1);
  cv::extractChannel(ycrcb, cb, 2);
}

YuvImage DecodeOther(const fs::path& file, const std::string& bytes) {
  if (bytes.size() < 8 || IsCutPng(bytes)) Fail(file, "cut short");
  const cv::Mat pixels = Decode(bytes, cv::IMREAD_GRAYSCALE);
  if (pixels.empty()) Fail(file, "not an image, or a damaged one");
  if (pixels.cols > kMaxImageSide || pixels.rows > kMaxImageSide ||
      std::int64_t{pixels.cols} * pixels.rows > kMaxImagePixels) {
    Fail(file, "larger than " + std::to_string(kMaxImageSide) + " pixels a side or 16 megapixels");
  }
  const cv::Mat rows = pixels.isContinuous() ? pixels : pixels.clone();
  YuvImage image = {rows.cols, rows.rows, {rows.data, rows.data + rows.total()}};
  const cv::Mat colours = Decode(bytes, cv::IMREAD_COLOR);
  if (colours.size() == pixels.size()) AddChroma(colours, image);
  return image;
}

}  // namespace

bool IsImageFileName(const fs::path& file) {
  constexpr std::array<std::string_view, 9> kExtensions = {".jpg", ".jpeg", ".png",  ".pgm", ".ppm",
                                                           ".bmp", ".tif",  ".tiff", ".webp"};
  std::string extension = file.extension().string();
  std::transform(extension.begin(), extension.end(), extension.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return std::find(kExtensions.begin(), kExtensions.end(), extension) != kExtensions.end();
}

std::string ReadImageFile(const fs::path& file) {
  std::error_code error;
  const fs::file_status status = fs::status(file, error);
  if (!fs::exists(status)) Fail(file, "no such file");
  if (!fs::is_regular_file(status)) Fail(file, "not a file");
  std::string bytes = ReadTextFile(file);
  if (bytes.empty()) Fail(file, "the file is empty");
  return bytes;
}

YuvImage DecodeImage(const fs::path& file, const std::string& bytes, ExifInfo* exif) {
  if (exif != nullptr) *exif = {};
  if (!bytes.starts_with("\xFF\xD8")) return DecodeOther(file, bytes);
  YuvImage image;
  const std::span data(reinterpret_cast<const std::uint8_t*>(bytes.data()), bytes.size());
  const Status status = DecodeJpeg(data, image, exif);
  if (!status.ok()) Fail(file, Describe(status));
  return image;
}

YuvImage LoadImage(const fs::path& file, ExifInfo* exif) {
  return DecodeImage(file, ReadImageFile(file), exif);
}

}  // namespace viewfix
