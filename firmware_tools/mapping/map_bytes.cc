// SPDX-License-Identifier: BSD-3-Clause
#include "firmware_tools/mapping/map_bytes.h"

namespace viewfix {

void HashCamera(const Camera& camera, ContentHash& hash) {
  hash.Add(camera.model);
  hash.Add(camera.width);
  hash.Add(camera.height);
  for (const double v : {camera.fx, camera.fy, camera.cx, camera.cy}) hash.Add(v);
  hash.AddAll(std::span<const double>(camera.distortion));
}

void HashPose(const Rigid3& pose, ContentHash& hash) {
  hash.AddAll(std::span<const double>(pose.rotation.coeffs().data(), 4));
  hash.AddAll(std::span<const double>(pose.translation.data(), 3));
}

void SavePose(const Rigid3& pose, ByteWriter& writer) {
  writer.AddAll(std::span<const double>(pose.rotation.coeffs().data(), 4));
  writer.AddAll(std::span<const double>(pose.translation.data(), 3));
}

void LoadPose(ByteReader& reader, Rigid3& pose) {
  reader.TakeAll(std::span<double>(pose.rotation.coeffs().data(), 4));
  reader.TakeAll(std::span<double>(pose.translation.data(), 3));
}

}  // namespace viewfix
