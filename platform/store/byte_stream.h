// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "engine/base/status.h"

namespace viewfix {

// Bytes in their order, to and from another program.
class ByteStream {
 public:
  virtual ~ByteStream() = default;
  // Waits for some; 0: the other side has ended. kIo: the link broke.
  virtual Result<std::size_t> Read(std::span<std::uint8_t> bytes) = 0;
  // All of them.
  virtual Status Write(std::span<const std::uint8_t> bytes) = 0;
};

// A pair of pipes; both are borrowed.
class PipeStream : public ByteStream {
 public:
  PipeStream(int in, int out) : in_(in), out_(out) {}
  Result<std::size_t> Read(std::span<std::uint8_t> bytes) override;
  Status Write(std::span<const std::uint8_t> bytes) override;

 private:
  int in_;
  int out_;
};

// Lines of words, and counted bytes between them.
class Conversation {
 public:
  static constexpr std::size_t kMaxLineBytes = 1024;

  explicit Conversation(ByteStream& stream) : stream_(stream) {}

  // Without its end. kIo: the other side ended, or broke off; kCorrupt: no line of this protocol.
  Result<std::string> ReadLine();
  // kIo: fewer came.
  Status ReadExactly(std::span<std::uint8_t> bytes);
  // Some, at most so many; 0: the other side has ended.
  Result<std::size_t> ReadSome(std::span<std::uint8_t> bytes);
  Status WriteLine(std::string_view line);
  // Whether the other side is gone: there is nobody to tell anything.
  bool broken() const { return broken_; }
  Status WriteBytes(std::span<const std::uint8_t> bytes) { return stream_.Write(bytes); }

 private:
  Status Fill();

  ByteStream& stream_;
  std::vector<std::uint8_t> buffer_;
  std::size_t taken_ = 0;
  bool broken_ = false;
};

// The words of a line, at single spaces.
std::vector<std::string_view> Words(std::string_view line);
// false: not a number in digits alone.
bool ParseNumber(std::string_view word, std::uint64_t& value);

}  // namespace viewfix
