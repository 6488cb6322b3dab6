// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Geometry>
#include <vector>

#include "firmware_tools/simulation/texture.h"

namespace viewfix::simulation {

// A textured rectangle. Seen from its front, `right` and `down` are its edges;
// the front normal is down x right. Metres, world frame (z up).
struct Quad {
  Eigen::Vector3f corner;  // top left
  Eigen::Vector3f right;
  Eigen::Vector3f down;  // orthogonal to `right`
  TexturePtr texture;
  float repeat_u = 1, repeat_v = 1;  // how often the texture repeats along each edge
  Eigen::Vector3f tint{1, 1, 1};     // BGR, multiplies the texture (linear light)
  float glow = 0;                    // light of its own, 1 = as bright as a lit white wall
  bool casts_shadow = true;
  bool two_sided = false;

  Eigen::Vector3f Normal() const { return down.cross(right).normalized(); }
};

// A lamp that shines downwards.
struct Lamp {
  Eigen::Vector3f position;
  float power = 1;
};

// What of the light arrives at the nodes of a grid over one quad.
struct LightMap {
  int nodes_u = 1, nodes_v = 1;
  std::vector<Eigen::Vector2f> light;  // per node: (skylight left by the corners around, lamps)
};

// Rectangles and lamps of one room.
class Scene {
 public:
  void Add(Quad quad);
  void AddLamp(Lamp lamp) { lamps_.push_back(lamp); }

  const std::vector<Quad>& quads() const { return quads_; }
  const std::vector<LightMap>& light_maps() const { return light_maps_; }

  // The scene with left and right exchanged about x = width / 2; textures stay readable.
  Scene Mirrored(float width) const;

  // Distance along unit-length `direction` to the nearest rectangle, either side of
  // it, or `limit`. Holes in textures count as solid.
  float Distance(const Eigen::Vector3f& from, const Eigen::Vector3f& direction, float limit) const;

  // Computes light_maps(): call once, after the last Add.
  void BakeLight();

 private:
  bool Shadowed(const Eigen::Vector3f& from, const Eigen::Vector3f& to) const;
  Eigen::Vector2f LightAt(const Eigen::Vector3f& point, const Eigen::Vector3f& normal) const;

  std::vector<Quad> quads_;
  std::vector<Lamp> lamps_;
  std::vector<LightMap> light_maps_;
  // The rectangles again, one array a coordinate, for rays against all of them:
  // plane n.x = offset, and u = right_n.x - right_offset in 0..1 (v likewise).
  struct Planes {
    std::vector<float> nx, ny, nz, offset;
    std::vector<float> ux, uy, uz, u0, vx, vy, vz, v0;
  };
  void AddPlane(Planes& planes, const Quad& quad);
  static float Nearest(const Planes& planes, const Eigen::Vector3f& from,
                       const Eigen::Vector3f& step, float limit);
  Planes all_, shadow_casters_;
};

}  // namespace viewfix::simulation
