// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "engine/base/status.h"

namespace viewfix {

// No file that Viewfix reads is larger: a model, a photograph, a table.
inline constexpr std::size_t kMaxFileBytes = std::size_t{1} << 30;

// The bytes of a file or pipe. The error's detail names the path and the system's
// reason. kNotFound: no such file; kIo: not readable, a folder; kResourceExhausted: over
// kMaxFileBytes (an endless device, say).
Result<std::vector<std::uint8_t>> ReadFile(const std::string& path);

// Whether a file has to be whole after a power cut too: flushing takes milliseconds.
enum class Durability { kFlushed, kNotFlushed };

// Puts `bytes` in place of the file, or leaves what was there: written beside it under
// another name (`path`.tmp-NUMBER), flushed to the disk, then renamed. A failure (kIo, with path
// and reason, e.g. a full disk) leaves no temporary file.
Status WriteFileAtomically(const std::string& path, std::span<const std::uint8_t> bytes,
                           Durability durability = Durability::kFlushed);

// `status` with the file it is about at the front of its detail.
Status AboutFile(const std::string& path, const Status& status);

}  // namespace viewfix
