// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cassert>
#include <cstddef>
#include <string_view>
#include <utility>
#include <variant>

namespace viewfix {

enum class StatusCode {
  kOk,
  kInvalidArgument,    // the caller's value is outside what the function states
  kNotFound,           // no such file, name or index
  kCorrupt,            // bytes that do not say what they claim to say
  kUnsupported,        // well formed, but this build cannot do it
  kIo,                 // the operating system refused a read or write
  kResourceExhausted,  // a stated capacity is too small
  kCancelled,          // the user asked to stop
};

// "invalid argument", "not found", ...
const char* StatusCodeName(StatusCode code);

// What went wrong, without heap: a static text says what, a short detail says
// where or which (a file, a field, a number). Details beyond the capacity are
// cut, keeping the end, where a path names its file.
class [[nodiscard]] Status {
 public:
  static constexpr std::size_t kDetailCapacity = 240;

  Status() = default;
  // `text` must outlive the status: pass a string literal.
  Status(StatusCode code, const char* text, std::string_view detail = {});

  bool ok() const { return code_ == StatusCode::kOk; }
  StatusCode code() const { return code_; }
  const char* text() const { return text_; }
  std::string_view detail() const { return {detail_, detail_size_}; }

 private:
  StatusCode code_ = StatusCode::kOk;
  const char* text_ = "";
  std::size_t detail_size_ = 0;
  char detail_[kDetailCapacity] = {};
};

// A value, or the Status that says why there is none.
template <typename T>
class [[nodiscard]] Result {
 public:
  Result(T value) : state_(std::move(value)) {}  // NOLINT: implicit by design
  Result(Status status) : state_(status) { assert(!status.ok()); }  // NOLINT

  bool ok() const { return state_.index() == 0; }
  Status status() const { return ok() ? Status() : std::get<1>(state_); }

  T& value() { return std::get<0>(state_); }
  const T& value() const { return std::get<0>(state_); }
  T& operator*() { return value(); }
  const T& operator*() const { return value(); }
  T* operator->() { return &value(); }
  const T* operator->() const { return &value(); }

 private:
  std::variant<T, Status> state_;
};

}  // namespace viewfix
