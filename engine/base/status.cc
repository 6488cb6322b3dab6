// SPDX-License-Identifier: BSD-3-Clause
#include "engine/base/status.h"

#include <algorithm>

namespace viewfix {

const char* StatusCodeName(StatusCode code) {
  switch (code) {
    case StatusCode::kOk:
      return "ok";
    case StatusCode::kInvalidArgument:
      return "invalid argument";
    case StatusCode::kNotFound:
      return "not found";
    case StatusCode::kCorrupt:
      return "corrupt";
    case StatusCode::kUnsupported:
      return "unsupported";
    case StatusCode::kIo:
      return "input/output error";
    case StatusCode::kResourceExhausted:
      return "resource exhausted";
    case StatusCode::kCancelled:
      return "cancelled";
  }
  return "unknown";
}

Status::Status(StatusCode code, const char* text, std::string_view detail)
    : code_(code), text_(text), detail_size_(std::min(detail.size(), kDetailCapacity)) {
  const std::string_view kept = detail.substr(detail.size() - detail_size_);
  std::copy(kept.begin(), kept.end(), detail_);
}

}  // namespace viewfix
