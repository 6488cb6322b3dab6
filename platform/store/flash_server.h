// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>

#include "platform/store/byte_stream.h"
#include "platform/store/store.h"

namespace viewfix {

// The board's side of a flash, the same over ssh, a serial line and in one process. Lines of text;
// L the laptop, B the board:
//
//   L  viewfix-flash 1 install
//   B  board CURRENT_HASH|none
//   L  model SIZE HASH [older] [other-site]
//   L  signature SIZE                                followed by so many bytes
//   L  transfer raw|zstd|patch SIZE HASH
//   B  offset N                                      that many are here from before
//   L  (the transfer's bytes from N on)
//   B  installed ID
//
//   L  viewfix-flash 1 provision
//   B  board CURRENT_HASH|none
//   L  file key|revoke|site|configuration|calibration SIZE    followed by so many bytes; any number
//   L  end
//   B  provisioned
//
// Instead of any answer: "error WHY", and the board hangs up. Nothing is written before the offer
// is found good.
struct FlashServerOptions {
  int keep = 2;              // models that stay
  std::string trust_folder;  // for provision; the other files go into the folder above it
};

// One conversation. An error was told to the other side too, if it is still there.
Status ServeFlash(ByteStream& stream, Store& store, const FlashServerOptions& options);

inline constexpr std::string_view kFlashGreeting = "viewfix-flash 1 ";
std::string EncodingName(Encoding encoding);
std::string TransferHashText(const TransferHash& hash);

}  // namespace viewfix
