// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <string>

#include "platform/store/minisign.h"

namespace viewfix {

// A key pair for tests, the same for the same number, and what it signs.
class TestKey {
 public:
  explicit TestKey(int number);
  const PublicKey& open() const { return open_; }
  std::string OpenText() const;
  std::string Sign(std::span<const std::uint8_t> bytes, const ModelClaim& claim) const;

 private:
  PublicKey open_;
  std::array<std::uint8_t, 64> secret_{};
};

}  // namespace viewfix
