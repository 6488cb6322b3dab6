// SPDX-License-Identifier: BSD-3-Clause
#include "platform/store/byte_stream.h"

#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <charconv>
#include <cstring>

namespace viewfix {
namespace {

Status Broken(const char* text) { return {StatusCode::kIo, text, std::strerror(errno)}; }

}  // namespace

Result<std::size_t> PipeStream::Read(std::span<std::uint8_t> bytes) {
  while (true) {
    const ssize_t got = ::read(in_, bytes.data(), bytes.size());
    if (got >= 0) return static_cast<std::size_t>(got);
    if (errno != EINTR) return Broken("cannot read from the link");
  }
}

Status PipeStream::Write(std::span<const std::uint8_t> bytes) {
  while (!bytes.empty()) {
    const ssize_t written = ::write(out_, bytes.data(), bytes.size());
    if (written < 0 && errno == EINTR) continue;
    if (written < 0) return Broken("cannot write to the link");
    bytes = bytes.subspan(static_cast<std::size_t>(written));
  }
  return {};
}

Status Conversation::Fill() {
  if (taken_ < buffer_.size()) return {};
  buffer_.resize(65536);
  taken_ = 0;
  const Result<std::size_t> got = stream_.Read(buffer_);
  buffer_.resize(got.ok() ? *got : 0);
  broken_ = broken_ || buffer_.empty();
  if (!got.ok()) return got.status();
  return buffer_.empty() ? Status(StatusCode::kIo, "the link was closed") : Status();
}

Result<std::string> Conversation::ReadLine() {
  std::string line;
  while (true) {
    if (Status status = Fill(); !status.ok()) return status;
    const char c = static_cast<char>(buffer_[taken_++]);
    if (c == '\n') return line;
    if (line.size() == kMaxLineBytes || static_cast<unsigned char>(c) < 0x20) {
      return Status(StatusCode::kCorrupt, "the other side does not speak viewfix-flash");
    }
    line += c;
  }
}

Result<std::size_t> Conversation::ReadSome(std::span<std::uint8_t> bytes) {
  if (taken_ == buffer_.size()) {
    Result<std::size_t> got = stream_.Read(bytes);
    broken_ = broken_ || !got.ok() || *got == 0;
    return got;
  }
  const std::size_t count = std::min(bytes.size(), buffer_.size() - taken_);
  std::copy_n(buffer_.begin() + static_cast<std::ptrdiff_t>(taken_), count, bytes.begin());
  taken_ += count;
  return count;
}

Status Conversation::ReadExactly(std::span<std::uint8_t> bytes) {
  while (!bytes.empty()) {
    const Result<std::size_t> got = ReadSome(bytes);
    if (!got.ok()) return got.status();
    if (*got == 0) return {StatusCode::kIo, "the link was closed"};
    bytes = bytes.subspan(*got);
  }
  return {};
}

Status Conversation::WriteLine(std::string_view line) {
  std::string text(line);
  text += '\n';
  return stream_.Write({reinterpret_cast<const std::uint8_t*>(text.data()), text.size()});
}

std::vector<std::string_view> Words(std::string_view line) {
  std::vector<std::string_view> words;
  while (true) {
    const std::size_t space = line.find(' ');
    words.push_back(line.substr(0, space));
    if (space == std::string_view::npos) return words;
    line.remove_prefix(space + 1);
  }
}

bool ParseNumber(std::string_view word, std::uint64_t& value) {
  const auto read = std::from_chars(word.data(), word.data() + word.size(), value);
  return read.ec == std::errc() && read.ptr == word.data() + word.size();
}

}  // namespace viewfix
