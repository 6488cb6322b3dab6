// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <memory>
#include <string>
#include <string_view>

#include "platform/store/byte_stream.h"

namespace viewfix {

// Where a board is, as the command line says it.
struct BoardAddress {
  enum class Kind { kFolder, kSsh, kSerial };
  Kind kind = Kind::kFolder;
  std::string text;    // as given
  std::string folder;  // kFolder: the store; kSsh: the store on the board, empty: its default
  std::string host;    // kSsh: user@host
  int port = 0;        // kSsh: 0: as ssh's own configuration says
  std::string device;  // kSerial
};

// dir:PATH, ssh://[user@]host[:port][/store/folder], serial:/dev/ttyX. Throws ToolError.
BoardAddress ParseAddress(const std::string& text);

struct LinkOptions {
  std::string trust;                 // the board's trust folder; empty: its default
  std::string program = "viewfixd";  // on the board, over ssh
  std::string ssh = "ssh";           // the program that makes the connection
  int baud = 115200;                 // of a serial line; USB ones do not care
};

// A conversation with `viewfixd store receive` on the board, or, for a folder, with the same code
// in this process.
class BoardLink : public ByteStream {
 public:
  // Why the other side has ended: ssh's last words, say. Empty: nothing is known. Waits for it.
  virtual std::string LastWords() { return {}; }
};

// Throws ToolError where it cannot even begin; most faults show when the link is used.
std::unique_ptr<BoardLink> OpenLink(const BoardAddress& address, const LinkOptions& options);

}  // namespace viewfix
