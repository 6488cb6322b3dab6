// SPDX-License-Identifier: BSD-3-Clause
#include "firmware_tools/simulation/renderer.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstring>
#include <limits>
#include <numeric>

namespace viewfix::simulation {
namespace {

constexpr int kPacketSide = 8;                 // pixels
constexpr int kRaysPerSide = 2 * kPacketSide;  // 2x2 rays a pixel
constexpr int kRays = kRaysPerSide * kRaysPerSide;
constexpr int kBlockSide = 64;  // pixels, first step of culling
constexpr float kNear = 0.02f;  // metres
constexpr float kFar = std::numeric_limits<float>::max();

// Inverts x_d = x (1 + k1 r^2 + k2 r^4) by fixed-point iteration.
Eigen::Vector2d Undistort(const Calibration& c, double px, double py) {
  const Eigen::Vector2d distorted((px - c.cx) / c.fx, (py - c.cy) / c.fy);
  const double k1 = c.distortion.size() > 0 ? c.distortion[0] : 0;
  const double k2 = c.distortion.size() > 1 ? c.distortion[1] : 0;
  Eigen::Vector2d x = distorted;
  for (int i = 0; i < 25; ++i) {
    const double r2 = x.squaredNorm();
    x = distorted / (1 + k1 * r2 + k2 * r2 * r2);
  }
  return x;
}

std::array<float, 256> LinearFromByte() {
  std::array<float, 256> table;
  for (int i = 0; i < 256; ++i) table[i] = std::pow(static_cast<float>(i) / 255.f, 2.2f);
  return table;
}

}  // namespace

// A rectangle as seen from one camera position, for rays o + t d:
// t = plane / (normal . d), u = u0 + t (right_n . d), v likewise.
struct Renderer::Prepared {
  const Quad* quad;
  const LightMap* light_map;  // null: evenly lit
  Eigen::Vector3f normal, right_n, down_n;
  float plane, u0, v0;
  float texels_per_metre;
  std::array<Eigen::Vector3f, 4> corners_from_cam;  // world axes, camera at the origin
};

struct Renderer::Packet {
  alignas(32) float dx[kRays], dy[kRays], dz[kRays];
  alignas(32) float t[kRays], u[kRays], v[kRays];
  alignas(32) int quad[kRays];
};

Renderer::Renderer(const Calibration& calibration)
    : width_(calibration.width),
      height_(calibration.height),
      pixel_angle_(static_cast<float>(1 / calibration.fx)) {
  for (int y = 0; y < height_; y += kPacketSide) {
    for (int x = 0; x < width_; x += kPacketSide) {
      for (int i = 0; i < kRays; ++i) {
        const double px = x + (i % kRaysPerSide) * 0.5 - 0.25;
        const double py = y + (i / kRaysPerSide) * 0.5 - 0.25;
        const Eigen::Vector2d ray = Undistort(calibration, px, py);
        ray_x_.push_back(static_cast<float>(ray.x()));
        ray_y_.push_back(static_cast<float>(ray.y()));
      }
    }
  }
  for (int y = 0; y <= height_; y += kPacketSide) {
    for (int x = 0; x <= width_; x += kPacketSide) {
      corner_rays_.push_back(Undistort(calibration, x - 0.5, y - 0.5).cast<float>());
    }
  }
}

std::vector<int> Renderer::Cull(const std::vector<Prepared>& quads, std::span<const int> candidates,
                                const Eigen::Matrix3f& world_from_cam, cv::Rect pixels) const {
  const int columns = width_ / kPacketSide + 1;
  const auto corner = [&](int x, int y) {
    const Eigen::Vector2f& ray = corner_rays_[y / kPacketSide * columns + x / kPacketSide];
    return Eigen::Vector3f(ray.x(), ray.y(), 1);
  };
  const cv::Point end = pixels.br();
  const Eigen::Vector3f rays[4] = {corner(pixels.x, pixels.y), corner(end.x, pixels.y),
                                   corner(end.x, end.y), corner(pixels.x, end.y)};
  Eigen::Vector3f planes[4];
  for (int i = 0; i < 4; ++i) {
    planes[i] = world_from_cam * rays[i].cross(rays[(i + 1) % 4]).normalized();
  }
  // Distortion bows the sides of a packet between its corners; keep that margin.
  const float margin = pixels.width > kPacketSide ? 0.01f : 0.0005f;
  std::vector<int> kept;
  for (const int idx : candidates) {
    bool outside = false;
    for (const Eigen::Vector3f& plane : planes) {
      outside |= std::ranges::all_of(quads[idx].corners_from_cam, [&](const Eigen::Vector3f& c) {
        return plane.dot(c) < -margin * c.cwiseAbs().maxCoeff();
      });
    }
    if (!outside) kept.push_back(idx);
  }
  return kept;
}

namespace {

// Vectors of the compiler's own: compilers do not vectorize the loop below by themselves.
constexpr int kLanes = 4;
using Floats [[gnu::vector_size(16)]] = float;
using Ints [[gnu::vector_size(16)]] = int;

template <typename Vector, typename Scalar>
Vector Load(const Scalar* from) {
  Vector vector;
  std::memcpy(&vector, from, sizeof vector);
  return vector;
}

template <typename Vector, typename Scalar>
void Store(const Vector& vector, Scalar* to) {
  std::memcpy(to, &vector, sizeof vector);
}

// Nearest hits of the packet's rays with one rectangle.
template <typename Packet, typename Prepared>
void Intersect(const Prepared& q, int quad_idx, Packet& packet) {
  const float nx = q.normal.x(), ny = q.normal.y(), nz = q.normal.z();
  const float ux = q.right_n.x(), uy = q.right_n.y(), uz = q.right_n.z();
  const float vx = q.down_n.x(), vy = q.down_n.y(), vz = q.down_n.z();
  const float plane = q.plane, u0 = q.u0, v0 = q.v0;
  for (int i = 0; i < kRays; i += kLanes) {
    const Floats dx = Load<Floats>(packet.dx + i), dy = Load<Floats>(packet.dy + i),
                 dz = Load<Floats>(packet.dz + i);
    const Floats t = plane / (nx * dx + ny * dy + nz * dz);
    const Floats u = u0 + t * (ux * dx + uy * dy + uz * dz);
    const Floats v = v0 + t * (vx * dx + vy * dy + vz * dz);
    const Floats old_t = Load<Floats>(packet.t + i);
    const Ints hit = (t > kNear) & (t < old_t) & (u >= 0.f) & (u <= 1.f) & (v >= 0.f) & (v <= 1.f);
    Store(hit ? t : old_t, packet.t + i);
    Store(hit ? u : Load<Floats>(packet.u + i), packet.u + i);
    Store(hit ? v : Load<Floats>(packet.v + i), packet.v + i);
    Store(hit ? Ints{} + quad_idx : Load<Ints>(packet.quad + i), packet.quad + i);
  }
}

template <typename Prepared>
int MipLevel(const Prepared& q, const Eigen::Vector3f& direction, float t, float pixel_angle,
             float dither) {
  // A pixel's footprint on the surface: long where it is seen at a slant. The four
  // rays of a pixel share out the long side; past that, blur rather than alias.
  const float cosine = std::abs(q.normal.dot(direction)) / direction.norm();
  const float stretch = std::clamp(0.5f / std::max(cosine, 0.01f), 0.75f, 3.f);
  const float texels = t * pixel_angle * stretch * q.texels_per_metre * dither;
  return texels <= 1 ? 0 : static_cast<int>(std::bit_cast<std::uint32_t>(texels) >> 23) - 127;
}

// As Intersect, for textures with holes.
template <typename Packet, typename Prepared>
void IntersectWithHoles(const Prepared& q, int quad_idx, float pixel_angle, Packet& packet) {
  for (int i = 0; i < kRays; ++i) {
    const Eigen::Vector3f d(packet.dx[i], packet.dy[i], packet.dz[i]);
    const float t = q.plane / q.normal.dot(d);
    if (!(t > kNear && t < packet.t[i])) continue;
    const float u = q.u0 + t * q.right_n.dot(d), v = q.v0 + t * q.down_n.dot(d);
    if (!(u >= 0 && u <= 1 && v >= 0 && v <= 1)) continue;
    const int level = MipLevel(q, d, t, pixel_angle, 1);
    const std::uint32_t texel =
        q.quad->texture->Sample(u * q.quad->repeat_u, v * q.quad->repeat_v, level);
    if (texel >> 24 < 128) continue;
    packet.t[i] = t, packet.u[i] = u, packet.v[i] = v, packet.quad[i] = quad_idx;
  }
}

float LightOn(const LightMap& map, float u, float v, const Illumination& illumination) {
  const float x = u * static_cast<float>(map.nodes_u - 1);
  const float y = v * static_cast<float>(map.nodes_v - 1);
  const int x0 = std::min(static_cast<int>(x), map.nodes_u - 2);
  const int y0 = std::min(static_cast<int>(y), map.nodes_v - 2);
  const float fx = x - static_cast<float>(x0), fy = y - static_cast<float>(y0);
  const Eigen::Vector2f* row = map.light.data() + y0 * map.nodes_u + x0;
  const Eigen::Vector2f light = (1 - fy) * ((1 - fx) * row[0] + fx * row[1]) +
                                fy * ((1 - fx) * row[map.nodes_u] + fx * row[map.nodes_u + 1]);
  return illumination.skylight * light.x() + illumination.lamps * light.y();
}

}  // namespace

void Renderer::RenderPacket(const std::vector<Prepared>& quads, std::span<const int> candidates,
                            const Eigen::Matrix3f& world_from_cam, const Illumination& illumination,
                            cv::Point at, cv::Mat& image) const {
  static const std::array<float, 256> linear_from_byte = LinearFromByte();
  // Spreads the choice of mip level over a pixel's four rays: their mean is trilinear.
  static constexpr float kDither[2][2] = {{1.0f, 1.19f}, {1.68f, 1.41f}};
  Packet packet;
  const int packet_idx = at.y / kPacketSide * (width_ / kPacketSide) + at.x / kPacketSide;
  const float* ray_x = ray_x_.data() + static_cast<std::size_t>(packet_idx) * kRays;
  const float* ray_y = ray_y_.data() + static_cast<std::size_t>(packet_idx) * kRays;
  const Eigen::Matrix3f& r = world_from_cam;
  for (int i = 0; i < kRays; ++i) {
    packet.dx[i] = r(0, 0) * ray_x[i] + r(0, 1) * ray_y[i] + r(0, 2);
    packet.dy[i] = r(1, 0) * ray_x[i] + r(1, 1) * ray_y[i] + r(1, 2);
    packet.dz[i] = r(2, 0) * ray_x[i] + r(2, 1) * ray_y[i] + r(2, 2);
    packet.t[i] = kFar;
    packet.u[i] = packet.v[i] = 0;
    packet.quad[i] = -1;
  }
  for (const int idx : candidates) {
    if (quads[idx].quad->texture->has_alpha()) {
      IntersectWithHoles(quads[idx], idx, pixel_angle_, packet);
    } else {
      Intersect(quads[idx], idx, packet);
    }
  }
  for (int i = 0; i < kRays; ++i) {
    if (packet.quad[i] < 0) continue;
    const Prepared& q = quads[packet.quad[i]];
    const int column = i % kRaysPerSide, row = i / kRaysPerSide;
    const Eigen::Vector3f d(packet.dx[i], packet.dy[i], packet.dz[i]);
    const int level = MipLevel(q, d, packet.t[i], pixel_angle_, kDither[row & 1][column & 1]);
    const std::uint32_t texel = q.quad->texture->Sample(packet.u[i] * q.quad->repeat_u,
                                                        packet.v[i] * q.quad->repeat_v, level);
    const float light =
        q.quad->glow + (q.light_map ? LightOn(*q.light_map, packet.u[i], packet.v[i], illumination)
                                    : illumination.skylight + 0.3f * illumination.lamps);
    auto& pixel = image.at<cv::Vec3f>(at.y + row / 2, at.x + column / 2);
    for (int c = 0; c < 3; ++c) {
      pixel[c] += 0.25f * light * q.quad->tint[c] * linear_from_byte[texel >> (8 * c) & 255];
    }
  }
}

cv::Mat Renderer::Render(const Scene& scene, std::span<const Quad> visitors, const Pose& pose,
                         const Illumination& illumination) const {
  const Eigen::Vector3f camera = pose.cam_in_world.cast<float>();
  const Eigen::Matrix3f world_from_cam = pose.world_from_cam.toRotationMatrix().cast<float>();
  std::vector<Prepared> quads;
  const auto prepare = [&](const Quad& quad, const LightMap* light_map) {
    Prepared q{&quad, light_map, quad.Normal(), {}, {}, 0, 0, 0, 0, {}};
    const Eigen::Vector3f to_corner = quad.corner - camera;
    q.plane = q.normal.dot(to_corner);
    if (q.plane >= 0 && !quad.two_sided) return;  // seen from behind
    q.right_n = quad.right / quad.right.squaredNorm();
    q.down_n = quad.down / quad.down.squaredNorm();
    q.u0 = -q.right_n.dot(to_corner);
    q.v0 = -q.down_n.dot(to_corner);
    const float texels = static_cast<float>(quad.texture->width()) * quad.repeat_u *
                         static_cast<float>(quad.texture->height()) * quad.repeat_v;
    q.texels_per_metre = std::sqrt(texels / (quad.right.norm() * quad.down.norm()));
    q.corners_from_cam = {to_corner, to_corner + quad.right, to_corner + quad.down,
                          to_corner + quad.right + quad.down};
    quads.push_back(q);
  };
  for (std::size_t i = 0; i < scene.quads().size(); ++i) {
    prepare(scene.quads()[i], &scene.light_maps()[i]);
  }
  for (const Quad& quad : visitors) prepare(quad, nullptr);

  std::vector<int> all(quads.size());
  std::iota(all.begin(), all.end(), 0);
  cv::Mat image = cv::Mat::zeros(height_, width_, CV_32FC3);
  for (int y = 0; y < height_; y += kBlockSide) {
    for (int x = 0; x < width_; x += kBlockSide) {
      const cv::Rect block =
          cv::Rect(x, y, kBlockSide, kBlockSide) & cv::Rect(0, 0, width_, height_);
      const std::vector<int> in_block = Cull(quads, all, world_from_cam, block);
      for (int py = y; py < block.br().y; py += kPacketSide) {
        for (int px = x; px < block.br().x; px += kPacketSide) {
          const cv::Rect packet(px, py, kPacketSide, kPacketSide);
          RenderPacket(quads, Cull(quads, in_block, world_from_cam, packet), world_from_cam,
                       illumination, packet.tl(), image);
        }
      }
    }
  }
  return image;
}

}  // namespace viewfix::simulation
