// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "platform/store/byte_stream.h"

namespace viewfix {

// Bytes in their order over a serial line that loses and changes some. Frames, each sent again
// until the other side has acknowledged it:
//   A5 5A  type u8  session u16  sequence u16  length u16  payload  CRC-32 (of type to payload) u32
// Little endian; types: 1 hello (the laptop begins a session of a number drawn at random),
// 2 data, 3 acknowledgement (of the sequence number; of a hello, 65535), 4 end.
class SerialLink : public ByteStream {
 public:
  enum class Side { kLaptop, kBoard };

  // The laptop greets the board, for 10 s at most (kIo: nobody answers); the board's side does
  // nothing yet. kIo also: no such device, or no serial line.
  static Result<std::unique_ptr<SerialLink>> Open(const std::string& device, int baud, Side side);
  ~SerialLink() override;
  SerialLink(const SerialLink&) = delete;
  SerialLink& operator=(const SerialLink&) = delete;

  // Board: waits for the next session. kIo: the device is gone.
  Status Accept();
  // kIo: the other side is silent, or has begun another session.
  Result<std::size_t> Read(std::span<std::uint8_t> bytes) override;
  Status Write(std::span<const std::uint8_t> bytes) override;

 private:
  enum class Type : std::uint8_t { kHello = 1, kData = 2, kAck = 3, kEnd = 4 };
  struct Frame {
    Type type;
    std::uint16_t session;
    std::uint16_t sequence;
    std::span<const std::uint8_t> payload;
  };

  SerialLink(int fd, int baud, Side side) : fd_(fd), baud_(baud), side_(side) {}
  Status Greet();
  Status Send(Type type, std::uint16_t sequence, std::span<const std::uint8_t> payload);
  // Takes what comes within the time, and what it says to heart.
  Status Pump(int timeout_ms);
  bool TakeFrame();
  Status Handle(const Frame& frame);
  int TimeoutMs(std::size_t payload) const;

  int fd_;
  int baud_;
  Side side_;
  std::vector<std::uint8_t> raw_;      // from the line, not yet frames
  std::vector<std::uint8_t> arrived_;  // payloads in order, not yet read
  std::uint16_t session_ = 0;
  std::uint16_t next_session_ = 0;  // board: of a hello that came during another session
  std::uint16_t send_sequence_ = 0;
  std::uint16_t receive_sequence_ = 0;
  int acknowledged_ = -1;
  bool in_session_ = false;
  bool greeted_again_ = false;
  bool ended_ = false;
};

}  // namespace viewfix
