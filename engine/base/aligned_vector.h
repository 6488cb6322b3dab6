// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <new>
#include <vector>

namespace viewfix {

inline constexpr std::size_t kCacheLine = 64;  // bytes; also the longest vector's

template <typename T>
struct CacheLineAllocator {
  using value_type = T;

  CacheLineAllocator() = default;
  template <typename U>
  CacheLineAllocator(const CacheLineAllocator<U>&) {}  // NOLINT: containers convert

  T* allocate(std::size_t count) {
    return static_cast<T*>(::operator new(count * sizeof(T), std::align_val_t(kCacheLine)));
  }
  void deallocate(T* values, std::size_t) {
    ::operator delete(values, std::align_val_t(kCacheLine));
  }
  bool operator==(const CacheLineAllocator&) const { return true; }
};

// Begins a cache line: vectors that are written across two take much longer.
template <typename T>
using AlignedVector = std::vector<T, CacheLineAllocator<T>>;

}  // namespace viewfix
