// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <functional>
#include <stdexcept>
#include <string>
#include <vector>

#include "firmware_tools/flash/link.h"
#include "platform/store/store.h"

namespace viewfix {

// What is to come onto boards.
struct FlashJob {
  std::vector<std::uint8_t> model;
  std::string signature;  // the text of its .minisig; empty: unsigned
  // Models that boards may have: if one of them has, only what differs is sent.
  std::vector<std::vector<std::uint8_t>> bases;
  bool allow_older = false;
  bool allow_other_site = false;
};

struct FlashOutcome {
  std::string model_id;
  Encoding encoding = Encoding::kRaw;
  std::uint64_t bytes_sent = 0;  // of the transfer, this time
  std::uint64_t resumed_at = 0;  // were there already
};

// The link broke; what arrived is kept by the board. Worth another try, unlike a board's refusal,
// which is a ToolError.
class LinkBroke : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

using FlashProgress = std::function<void(std::uint64_t sent, std::uint64_t total)>;

// One try. Throws LinkBroke or ToolError.
FlashOutcome FlashBoard(BoardLink& link, const FlashJob& job, const FlashProgress& progress);

// A file of `provision`: key, revoke, site, configuration or calibration, and its text.
struct ProvisionFile {
  std::string what;
  std::string text;
};
void ProvisionBoard(BoardLink& link, const std::vector<ProvisionFile>& files);

}  // namespace viewfix
