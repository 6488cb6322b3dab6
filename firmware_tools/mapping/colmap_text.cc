// SPDX-License-Identifier: BSD-3-Clause
#include <limits>

#include "firmware_tools/dataset/image_set.h"
#include "firmware_tools/dataset/text_fields.h"
#include "firmware_tools/dataset/tool_file.h"
#include "firmware_tools/mapping/colmap_records.h"

namespace viewfix {
namespace {

namespace fs = std::filesystem;

std::uint32_t Id32(TextFields& fields, const char* what) {
  const std::int64_t id = fields.Whole(what);
  if (id < 0 || id > std::numeric_limits<std::uint32_t>::max()) {
    fields.Fail(std::string(what) + " is out of range");
  }
  return static_cast<std::uint32_t>(id);
}

Eigen::Vector3d Vector3(TextFields& fields, const char* what) {
  const double x = fields.Number(what), y = fields.Number(what), z = fields.Number(what);
  return {x, y, z};
}

std::vector<ColmapCamera> ReadCameras(const fs::path& file) {
  const std::string text = ReadTextFile(file);
  std::vector<ColmapCamera> cameras;
  for (TextFields fields(file, text); fields.NextDataLine();) {
    ColmapCamera camera;
    camera.id = Id32(fields, "the camera's id");
    const std::string model(fields.Word("the camera model"));
    camera.model = FindColmapCameraModel(model);
    if (camera.model == nullptr) fields.Fail("camera model " + model + " is not supported");
    camera.width = Id32(fields, "the width");
    camera.height = Id32(fields, "the height");
    for (int i = 0; i < camera.model->num_params; ++i) {
      camera.params.push_back(fields.Number("a camera parameter"));
    }
    if (!fields.AtLineEnd()) fields.Fail("too many parameters for " + model);
    cameras.push_back(std::move(camera));
  }
  return cameras;
}

void ReadKeypoints(TextFields& fields, ColmapImage& image) {
  while (!fields.AtLineEnd()) {
    const double x = fields.Number("a key point's x");
    const double y = fields.Number("a key point's y");
    image.keypoints.emplace_back(x, y);
    const std::int64_t id = fields.Whole("a key point's point id");
    image.point_ids.push_back(id < 0 ? kNoColmapPoint : static_cast<std::uint64_t>(id));
  }
}

std::vector<ColmapImage> ReadImages(const fs::path& file) {
  const std::string text = ReadTextFile(file);
  std::vector<ColmapImage> images;
  for (TextFields fields(file, text); fields.NextDataLine();) {
    ColmapImage image;
    image.id = Id32(fields, "the image's id");
    image.cam_from_world.w() = fields.Number("the quaternion");
    image.cam_from_world.vec() = Vector3(fields, "the quaternion");
    image.translation = Vector3(fields, "the translation");
    image.camera_id = Id32(fields, "the camera's id");
    image.name = fields.RestOfLine();
    if (image.name.empty()) fields.Fail("the image has no name");
    // Editors drop the empty line that ends the file.
    if (fields.NextLine()) ReadKeypoints(fields, image);
    images.push_back(std::move(image));
  }
  return images;
}

std::vector<ColmapPoint> ReadPoints(const fs::path& file) {
  const std::string text = ReadTextFile(file);
  std::vector<ColmapPoint> points;
  for (TextFields fields(file, text); fields.NextDataLine();) {
    ColmapPoint point;
    const std::int64_t id = fields.Whole("the point's id");
    if (id < 0) fields.Fail("the point's id is out of range");
    point.id = static_cast<std::uint64_t>(id);
    point.position = Vector3(fields, "the position");
    for (int i = 0; i < 3; ++i) fields.Whole("the colour");
    point.error_px = fields.Number("the error");
    while (!fields.AtLineEnd()) {
      const std::uint32_t image_id = Id32(fields, "a track's image id");
      point.track.emplace_back(image_id, Id32(fields, "a track's key point"));
    }
    points.push_back(std::move(point));
  }
  return points;
}

void Append(std::string& text, const Eigen::Vector3d& v) {
  for (const double value : v) text.append(" ").append(ExactNumber(value));
}

std::string CamerasText(const ColmapRecords& records) {
  std::string text = "# CAMERA_ID, MODEL, WIDTH, HEIGHT, PARAMS[]\n";
  for (const ColmapCamera& camera : records.cameras) {
    text.append(std::to_string(camera.id)).append(" ").append(camera.model->name);
    text.append(" ").append(std::to_string(camera.width));
    text.append(" ").append(std::to_string(camera.height));
    for (const double value : camera.params) text.append(" ").append(ExactNumber(value));
    text += '\n';
  }
  return text;
}

std::string ImagesText(const ColmapRecords& records) {
  std::string text =
      "# IMAGE_ID, QW, QX, QY, QZ, TX, TY, TZ, CAMERA_ID, NAME\n# POINTS2D[] as (X, Y, "
      "POINT3D_ID)\n";
  for (const ColmapImage& image : records.images) {
    text.append(std::to_string(image.id)).append(" ");
    text.append(ExactNumber(image.cam_from_world.w()));
    Append(text, image.cam_from_world.vec());
    Append(text, image.translation);
    text.append(" ").append(std::to_string(image.camera_id)).append(" ").append(image.name);
    text += '\n';
    for (std::size_t i = 0; i < image.keypoints.size(); ++i) {
      const std::uint64_t id = image.point_ids[i];
      if (i > 0) text += ' ';
      text.append(ExactNumber(image.keypoints[i].x())).append(" ");
      text.append(ExactNumber(image.keypoints[i].y())).append(" ");
      text.append(id == kNoColmapPoint ? "-1" : std::to_string(id));
    }
    text += '\n';
  }
  return text;
}

std::string PointsText(const ColmapRecords& records) {
  std::string text = "# POINT3D_ID, X, Y, Z, R, G, B, ERROR, TRACK[] as (IMAGE_ID, POINT2D_IDX)\n";
  for (const ColmapPoint& point : records.points) {
    text += std::to_string(point.id);
    Append(text, point.position);
    text.append(" 128 128 128 ").append(ExactNumber(point.error_px));
    for (const auto& [image_id, keypoint] : point.track) {
      text.append(" ").append(std::to_string(image_id));
      text.append(" ").append(std::to_string(keypoint));
    }
    text += '\n';
  }
  return text;
}

}  // namespace

ColmapRecords ReadColmapText(const fs::path& folder) {
  return {ReadCameras(folder / "cameras.txt"), ReadImages(folder / "images.txt"),
          ReadPoints(folder / "points3D.txt")};
}

void WriteColmapText(const ColmapRecords& records, const fs::path& folder) {
  for (const ColmapImage& image : records.images) {
    if (image.name.find_first_of(" \t\r\n\v\f") == std::string::npos) continue;
    throw ToolError(folder.string() +
                    ": COLMAP's text format has no names with blanks: " + image.name);
  }
  WriteTextFile(folder / "cameras.txt", CamerasText(records));
  WriteTextFile(folder / "images.txt", ImagesText(records));
  WriteTextFile(folder / "points3D.txt", PointsText(records));
}

}  // namespace viewfix
