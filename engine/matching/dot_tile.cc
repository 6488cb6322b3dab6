// SPDX-License-Identifier: BSD-3-Clause
#include "engine/matching/dot_tile.h"

#include <algorithm>
#include <array>
#include <cassert>
#include <cstring>
#include <limits>
#include <numeric>

namespace viewfix {
namespace {

constexpr int RoundUp(int n, int step) { return (n + step - 1) / step * step; }

std::int32_t Norm2(std::span<const std::int8_t> descriptor) {
  return std::inner_product(descriptor.begin(), descriptor.end(), descriptor.begin(),
                            std::int32_t{0});
}

}  // namespace

DotTile::DotTile(int dim, CpuPath path)
    : dim_(dim),
      kernels_(KernelsFor(path)),
      depth_(RoundUp(dim, kernels_.together)),
      tile_end_(std::size_t{kTileQueries} * depth_ * kernels_.value_bytes * kernels_.copies),
      block_end_(std::size_t{kTileRows} * depth_ * kernels_.value_bytes),
      tile_bytes_(tile_end_),
      block_bytes_(block_end_ + kernels_.block_tail_bytes) {
  assert(dim >= 1 && dim <= kMaxDescriptorDim);
  assert(kernels_.row_offset == 0 || kernels_.block_tail_bytes == 0);
  if (kernels_.row_offset != 0 || kernels_.block_tail_bytes != 0) {
    tile_bytes_ += kTileQueries * sizeof(std::int32_t);
  }
}

void DotTile::PackQuery(std::span<const std::int8_t> descriptor, int query,
                        std::uint8_t* tile) const {
  kernels_.pack_query(descriptor, query, 0, depth_, tile);
  const auto put = [&](std::int32_t value) {
    std::memcpy(tile + tile_end_ + sizeof(value) * query, &value, sizeof(value));
  };
  if (kernels_.row_offset != 0) {
    put(-kernels_.row_offset *
        std::accumulate(descriptor.begin(), descriptor.end(), std::int32_t{0}));
  }
  if (kernels_.block_tail_bytes == 0) return;
  const bool fits = std::ranges::find(descriptor, -128) == descriptor.end();
  put(fits ? Norm2(descriptor) : std::numeric_limits<std::int32_t>::max());
}

void DotTile::PackQueries(std::span<const std::int8_t> descriptors, std::uint8_t* tile) const {
  const int n = static_cast<int>(descriptors.size()) / dim_;
  assert(n <= kTileQueries);
  for (int i = 0; i < n; ++i) PackQuery(descriptors.subspan(std::size_t(i) * dim_, dim_), i, tile);
}

void DotTile::PackRow(std::span<const std::int8_t> descriptor, int row, std::uint8_t* block) const {
  kernels_.pack_row(descriptor, row, kernels_.row_offset, depth_, block);
  if (kernels_.block_tail_bytes == 0) return;
  std::int32_t longest2 = 0;
  if (row > 0) std::memcpy(&longest2, block + block_end_, sizeof(longest2));
  longest2 = std::max(longest2, Norm2(descriptor));
  std::memcpy(block + block_end_, &longest2, sizeof(longest2));
}

std::vector<std::uint8_t> DotTile::PackBlocks(std::span<const std::int8_t> descriptors) const {
  static constexpr std::array<std::int8_t, kMaxDescriptorDim> kZeros{};
  const std::size_t size = descriptors.size() / dim_;
  const std::size_t blocks = (size + kTileRows - 1) / kTileRows;
  std::vector<std::uint8_t> packed(blocks * block_bytes_);
  for (std::size_t i = 0; i < blocks * kTileRows; ++i) {
    PackRow(i < size ? descriptors.subspan(i * dim_, dim_) : std::span(kZeros).first(dim_),
            static_cast<int>(i % kTileRows), &packed[i / kTileRows * block_bytes_]);
  }
  return packed;
}

}  // namespace viewfix
