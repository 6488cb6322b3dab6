// SPDX-License-Identifier: BSD-3-Clause
#include "platform/store/serial_link.h"

#include <fcntl.h>
#include <poll.h>
#include <sodium.h>
#include <termios.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>

#include "platform/clock.h"

namespace viewfix {
namespace {

constexpr std::uint8_t kMark0 = 0xA5;
constexpr std::uint8_t kMark1 = 0x5A;
constexpr std::size_t kHeaderBytes = 9;
constexpr std::size_t kCrcBytes = 4;
constexpr std::size_t kMaxPayload = 4096;
constexpr std::uint16_t kHelloSequence = 65535;
constexpr int kTries = 10;
constexpr int kGreetings = 20;
constexpr int kGreetingMs = 500;
// Of a peer in the middle of a conversation: it may be verifying a model.
constexpr int kSilenceMs = 120'000;

std::uint32_t Crc32(std::span<const std::uint8_t> bytes) {
  std::uint32_t crc = 0xFFFFFFFFU;
  for (const std::uint8_t byte : bytes) {
    crc ^= byte;
    for (int bit = 0; bit < 8; ++bit) crc = (crc >> 1) ^ ((crc & 1U) != 0 ? 0xEDB88320U : 0U);
  }
  return ~crc;
}

void Put(std::vector<std::uint8_t>& to, std::uint32_t value, int bytes) {
  for (int i = 0; i < bytes; ++i) to.push_back(static_cast<std::uint8_t>(value >> (8 * i)));
}

std::uint32_t Get(std::span<const std::uint8_t> from, int bytes) {
  std::uint32_t value = 0;
  for (int i = 0; i < bytes; ++i) value |= std::uint32_t{from[i]} << (8 * i);
  return value;
}

Status LineFault(const char* text, const std::string& device) {
  return {StatusCode::kIo, text, device + ": " + std::strerror(errno)};
}

speed_t SpeedOf(int baud) {
  switch (baud) {
    case 9600:
      return B9600;
    case 38400:
      return B38400;
    case 57600:
      return B57600;
    case 115200:
      return B115200;
    case 230400:
      return B230400;
    case 460800:
      return B460800;
    case 921600:
      return B921600;
    default:
      return B0;
  }
}

}  // namespace

Result<std::unique_ptr<SerialLink>> SerialLink::Open(const std::string& device, int baud,
                                                     Side side) {
  const int fd = ::open(device.c_str(), O_RDWR | O_NOCTTY | O_NONBLOCK | O_CLOEXEC);
  if (fd < 0) return LineFault("cannot open", device);
  std::unique_ptr<SerialLink> link(new SerialLink(fd, baud, side));
  termios line = {};
  const speed_t speed = SpeedOf(baud);
  if (speed == B0) {
    return Status(StatusCode::kInvalidArgument, "no such speed of a serial line",
                  std::to_string(baud));
  }
  if (::tcgetattr(fd, &line) != 0) return LineFault("not a serial line", device);
  ::cfmakeraw(&line);
  line.c_cflag |= CLOCAL | CREAD;
  ::cfsetspeed(&line, speed);
  if (::tcsetattr(fd, TCSANOW, &line) != 0) return LineFault("cannot set up the line", device);
  if (side == Side::kLaptop) {
    if (Status status = link->Greet(); !status.ok()) return status;
  }
  return link;
}

SerialLink::~SerialLink() {
  if (side_ == Side::kLaptop && in_session_) static_cast<void>(Send(Type::kEnd, 0, {}));
  ::close(fd_);
}

Status SerialLink::Greet() {
  session_ = static_cast<std::uint16_t>(1 + randombytes_uniform(65534));
  in_session_ = true;
  for (int i = 0; i < kGreetings; ++i) {
    if (Status status = Send(Type::kHello, 0, {}); !status.ok()) return status;
    const std::int64_t until = MonotonicNs() + std::int64_t{kGreetingMs} * 1'000'000;
    while (MonotonicNs() < until) {
      if (Status status = Pump(kGreetingMs); !status.ok()) return status;
      if (acknowledged_ == kHelloSequence) return {};
    }
  }
  in_session_ = false;
  return {StatusCode::kIo, "no board answers at the serial line"};
}

Status SerialLink::Accept() {
  in_session_ = false;
  while (!greeted_again_) {
    if (Status status = Pump(1000); !status.ok()) return status;
  }
  session_ = next_session_;
  send_sequence_ = receive_sequence_ = 0;
  acknowledged_ = -1;
  arrived_.clear();
  in_session_ = true;
  greeted_again_ = ended_ = false;
  return Send(Type::kAck, kHelloSequence, {});
}

int SerialLink::TimeoutMs(std::size_t payload) const {
  const double frame_ms = 10'000.0 * static_cast<double>(payload + 64) / baud_;
  return 500 + static_cast<int>(4 * frame_ms);
}

Status SerialLink::Send(Type type, std::uint16_t sequence, std::span<const std::uint8_t> payload) {
  std::vector<std::uint8_t> frame = {kMark0, kMark1, static_cast<std::uint8_t>(type)};
  Put(frame, session_, 2);
  Put(frame, sequence, 2);
  Put(frame, static_cast<std::uint32_t>(payload.size()), 2);
  frame.insert(frame.end(), payload.begin(), payload.end());
  Put(frame, Crc32(std::span(frame).subspan(2)), kCrcBytes);
  std::span<const std::uint8_t> left = frame;
  while (!left.empty()) {
    const ssize_t written = ::write(fd_, left.data(), left.size());
    if (written > 0) {
      left = left.subspan(static_cast<std::size_t>(written));
      continue;
    }
    if (written < 0 && errno != EAGAIN && errno != EINTR) {
      return LineFault("cannot write", "serial line");
    }
    pollfd ready = {fd_, POLLOUT, 0};
    if (::poll(&ready, 1, TimeoutMs(frame.size())) == 0) {
      return {StatusCode::kIo, "the serial line takes nothing"};
    }
  }
  return {};
}

Status SerialLink::Pump(int timeout_ms) {
  if (TakeFrame()) return {};
  pollfd ready = {fd_, POLLIN, 0};
  const int events = ::poll(&ready, 1, timeout_ms);
  if (events == 0 || (events < 0 && errno == EINTR)) return {};
  std::array<std::uint8_t, 4096> bytes;
  const ssize_t got = ::read(fd_, bytes.data(), bytes.size());
  if (got < 0 && (errno == EAGAIN || errno == EINTR)) return {};
  if (got < 0) return LineFault("cannot read", "serial line");
  if (got == 0) return {StatusCode::kIo, "the serial line was closed"};
  raw_.insert(raw_.end(), bytes.begin(), bytes.begin() + got);
  while (TakeFrame()) {
  }
  return {};
}

// Noise is passed over, byte by byte, until a frame with a good checksum begins.
bool SerialLink::TakeFrame() {
  std::size_t at = 0;
  bool taken = false;
  while (!taken && raw_.size() - at >= kHeaderBytes + kCrcBytes) {
    const auto rest = std::span<const std::uint8_t>(raw_).subspan(at);
    const std::size_t length = Get(rest.subspan(7), 2);
    if (rest[0] != kMark0 || rest[1] != kMark1 || length > kMaxPayload) {
      ++at;
      continue;
    }
    const std::size_t size = kHeaderBytes + length + kCrcBytes;
    if (rest.size() < size) break;
    if (Crc32(rest.subspan(2, size - 2 - kCrcBytes)) != Get(rest.subspan(size - kCrcBytes), 4)) {
      ++at;
      continue;
    }
    const std::vector<std::uint8_t> payload(
        rest.begin() + kHeaderBytes,
        rest.begin() + kHeaderBytes + static_cast<std::ptrdiff_t>(length));
    const Frame frame = {static_cast<Type>(rest[2]),
                         static_cast<std::uint16_t>(Get(rest.subspan(3), 2)),
                         static_cast<std::uint16_t>(Get(rest.subspan(5), 2)), payload};
    static_cast<void>(Handle(frame));  // what could not be acknowledged comes again
    at += size;
    taken = true;
  }
  raw_.erase(raw_.begin(), raw_.begin() + static_cast<std::ptrdiff_t>(at));
  return taken;
}

Status SerialLink::Handle(const Frame& frame) {
  if (frame.type == Type::kHello && side_ == Side::kBoard) {
    // The acknowledgement was lost, and the same greeting comes again.
    if (in_session_ && frame.session == session_) return Send(Type::kAck, kHelloSequence, {});
    next_session_ = frame.session;
    greeted_again_ = true;
    return {};
  }
  if (!in_session_ || frame.session != session_) return {};
  if (frame.type == Type::kAck) acknowledged_ = frame.sequence;
  if (frame.type == Type::kEnd) ended_ = true;
  if (frame.type != Type::kData) return {};
  if (frame.sequence == receive_sequence_) {
    arrived_.insert(arrived_.end(), frame.payload.begin(), frame.payload.end());
    receive_sequence_ = static_cast<std::uint16_t>((receive_sequence_ + 1) % kHelloSequence);
  }
  return Send(Type::kAck, frame.sequence, {});
}

Result<std::size_t> SerialLink::Read(std::span<std::uint8_t> bytes) {
  const std::int64_t until = MonotonicNs() + std::int64_t{kSilenceMs} * 1'000'000;
  while (arrived_.empty()) {
    if (greeted_again_) return Status(StatusCode::kIo, "the laptop began anew");
    if (ended_) return std::size_t{0};
    if (MonotonicNs() > until) return Status(StatusCode::kIo, "the serial line is silent");
    if (Status status = Pump(1000); !status.ok()) return status;
  }
  const std::size_t count = std::min(bytes.size(), arrived_.size());
  std::copy_n(arrived_.begin(), count, bytes.begin());
  arrived_.erase(arrived_.begin(), arrived_.begin() + static_cast<std::ptrdiff_t>(count));
  return count;
}

Status SerialLink::Write(std::span<const std::uint8_t> bytes) {
  while (!bytes.empty()) {
    const auto payload = bytes.first(std::min(bytes.size(), kMaxPayload));
    bool there = false;
    for (int i = 0; i < kTries && !there; ++i) {
      acknowledged_ = -1;
      if (Status status = Send(Type::kData, send_sequence_, payload); !status.ok()) return status;
      const int timeout_ms = TimeoutMs(payload.size());
      const std::int64_t until = MonotonicNs() + std::int64_t{timeout_ms} * 1'000'000;
      while (!there && MonotonicNs() < until) {
        if (Status status = Pump(timeout_ms); !status.ok()) return status;
        if (greeted_again_) return {StatusCode::kIo, "the laptop began anew"};
        if (ended_) return {StatusCode::kIo, "the link was closed"};
        there = acknowledged_ == send_sequence_;
      }
    }
    if (!there) return {StatusCode::kIo, "the other side of the serial line does not answer"};
    send_sequence_ = static_cast<std::uint16_t>((send_sequence_ + 1) % kHelloSequence);
    bytes = bytes.subspan(payload.size());
  }
  return {};
}

}  // namespace viewfix
