// SPDX-License-Identifier: BSD-3-Clause
#include "firmware_tools/simulation/scene.h"

#include <algorithm>
#include <cmath>

namespace viewfix::simulation {
namespace {

constexpr float kLightGrid = 0.22f;   // metres between the nodes of a light map
constexpr float kCornerReach = 1.2f;  // metres within which things darken each other
constexpr float kSurfaceOffset = 0.012f;

// Directions of a hemisphere about +z, cosine-weighted.
std::vector<Eigen::Vector3f> HemisphereDirections() {
  std::vector<Eigen::Vector3f> directions;
  for (const auto& [height, count] : {std::pair{0.92f, 4}, {0.7f, 6}, {0.35f, 6}}) {
    const float radius = std::sqrt(1 - height * height);
    for (int i = 0; i < count; ++i) {
      const float angle = 6.2831853f * (static_cast<float>(i) + height) / static_cast<float>(count);
      directions.emplace_back(radius * std::cos(angle), radius * std::sin(angle), height);
    }
  }
  return directions;
}

}  // namespace

void Scene::AddPlane(Planes& planes, const Quad& quad) {
  const Eigen::Vector3f n = quad.Normal();
  const Eigen::Vector3f u = quad.right / quad.right.squaredNorm();
  const Eigen::Vector3f v = quad.down / quad.down.squaredNorm();
  planes.nx.push_back(n.x()), planes.ny.push_back(n.y()), planes.nz.push_back(n.z());
  planes.ux.push_back(u.x()), planes.uy.push_back(u.y()), planes.uz.push_back(u.z());
  planes.vx.push_back(v.x()), planes.vy.push_back(v.y()), planes.vz.push_back(v.z());
  planes.offset.push_back(n.dot(quad.corner));
  planes.u0.push_back(u.dot(quad.corner));
  planes.v0.push_back(v.dot(quad.corner));
}

void Scene::Add(Quad quad) {
  AddPlane(all_, quad);
  if (quad.casts_shadow) AddPlane(shadow_casters_, quad);
  quads_.push_back(std::move(quad));
}

Scene Scene::Mirrored(float width) const {
  const Eigen::Vector3f flip(-1, 1, 1);
  const auto mirrored = [&](const Eigen::Vector3f& at) -> Eigen::Vector3f {
    return flip.cwiseProduct(at) + width * Eigen::Vector3f::UnitX();
  };
  Scene scene;
  for (Quad quad : quads_) {
    quad.corner = mirrored(quad.corner + quad.right);
    quad.right = -flip.cwiseProduct(quad.right);
    quad.down = flip.cwiseProduct(quad.down);
    scene.Add(std::move(quad));
  }
  for (const Lamp& lamp : lamps_) scene.AddLamp({mirrored(lamp.position), lamp.power});
  return scene;
}

float Scene::Nearest(const Planes& p, const Eigen::Vector3f& from, const Eigen::Vector3f& step,
                     float limit) {
  constexpr std::size_t kChunk = 64;
  float nearest = limit;
  const float ox = from.x(), oy = from.y(), oz = from.z();
  const float dx = step.x(), dy = step.y(), dz = step.z();
  const std::size_t count = p.nx.size();
  // Distances first, their minimum after: the first loop is vectorized.
  float distance[kChunk];
  for (std::size_t start = 0; start < count; start += kChunk) {
    const std::size_t size = std::min(kChunk, count - start);
    for (std::size_t j = 0; j < size; ++j) {
      const std::size_t i = start + j;
      const float towards = p.nx[i] * dx + p.ny[i] * dy + p.nz[i] * dz;
      const float t = (p.offset[i] - p.nx[i] * ox - p.ny[i] * oy - p.nz[i] * oz) / towards;
      const float x = ox + t * dx, y = oy + t * dy, z = oz + t * dz;
      const float u = p.ux[i] * x + p.uy[i] * y + p.uz[i] * z - p.u0[i];
      const float v = p.vx[i] * x + p.vy[i] * y + p.vz[i] * z - p.v0[i];
      const float off_u = std::abs(u - 0.5f), off_v = std::abs(v - 0.5f);
      const float off = off_u > off_v ? off_u : off_v;
      const float inside = off <= 0.5f ? t : limit;
      distance[j] = inside > 0 ? inside : limit;
    }
    for (std::size_t j = 0; j < size; ++j) nearest = std::min(nearest, distance[j]);
  }
  return nearest;
}

float Scene::Distance(const Eigen::Vector3f& from, const Eigen::Vector3f& direction,
                      float limit) const {
  return Nearest(all_, from, direction, limit);
}

bool Scene::Shadowed(const Eigen::Vector3f& from, const Eigen::Vector3f& to) const {
  return Nearest(shadow_casters_, from, to - from, 0.98f) < 0.98f;
}

Eigen::Vector2f Scene::LightAt(const Eigen::Vector3f& point, const Eigen::Vector3f& normal) const {
  static const std::vector<Eigen::Vector3f> directions = HemisphereDirections();
  const Eigen::Vector3f any =
      std::abs(normal.z()) > 0.9f ? Eigen::Vector3f::UnitX() : Eigen::Vector3f::UnitZ();
  const Eigen::Vector3f side = normal.cross(any).normalized();
  const Eigen::Vector3f other = normal.cross(side);
  float open = 0, weight = 0;
  for (const Eigen::Vector3f& d : directions) {
    const Eigen::Vector3f direction = d.x() * side + d.y() * other + d.z() * normal;
    const float reach = Nearest(shadow_casters_, point, direction, kCornerReach) / kCornerReach;
    open += d.z() * std::sqrt(reach);
    weight += d.z();
  }
  float lamps = 0;
  for (const Lamp& lamp : lamps_) {
    const Eigen::Vector3f to_lamp = lamp.position - point;
    const float distance = to_lamp.norm();
    const float facing = normal.dot(to_lamp) / distance;
    // The 0.15 lets lamps reach the ceiling around them, as light bounces there.
    const float shine = std::max(0.15f, to_lamp.z() / distance);
    if (facing <= 0 || Shadowed(point, lamp.position)) continue;
    lamps += lamp.power * facing * shine / (0.5f + distance * distance);
  }
  return {open / weight, lamps};
}

void Scene::BakeLight() {
  light_maps_.clear();
  for (const Quad& quad : quads_) {
    LightMap map;
    const auto nodes = [](float length) {
      return std::clamp(static_cast<int>(length / kLightGrid) + 2, 2, 24);
    };
    map.nodes_u = nodes(quad.right.norm());
    map.nodes_v = nodes(quad.down.norm());
    const Eigen::Vector3f normal = quad.Normal();
    for (int v = 0; v < map.nodes_v; ++v) {
      for (int u = 0; u < map.nodes_u; ++u) {
        // Nodes at the border move inwards: in a corner they would lie inside a wall.
        const auto inside = [](int i, int n) {
          return std::clamp(static_cast<float>(i) / static_cast<float>(n - 1), 0.03f, 0.97f);
        };
        const Eigen::Vector3f point = quad.corner + inside(u, map.nodes_u) * quad.right +
                                      inside(v, map.nodes_v) * quad.down + kSurfaceOffset * normal;
        map.light.push_back(LightAt(point, normal));
      }
    }
    light_maps_.push_back(std::move(map));
  }
}

}  // namespace viewfix::simulation
