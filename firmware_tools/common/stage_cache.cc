// SPDX-License-Identifier: BSD-3-Clause
#include "firmware_tools/common/stage_cache.h"

#include <algorithm>
#include <string_view>
#include <utility>

#include "firmware_tools/dataset/image_set.h"
#include "firmware_tools/dataset/tool_file.h"
#include "platform/file.h"

namespace viewfix {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kNameLength = 2 * sizeof(Hash256);

// A file begins with it: of its name and of what follows.
Hash256 SumOf(const Hash256& key, std::span<const std::uint8_t> payload) {
  ContentHash sum;
  sum.AddAll(std::span<const std::uint8_t>(key));
  sum.AddAll(payload);
  return sum.Result();
}

// A name that this class gives, or WriteFileAtomically() while it writes one.
bool IsOurs(const std::string& name) {
  const std::string_view stem = std::string_view(name).substr(0, kNameLength);
  const std::string_view rest = std::string_view(name).substr(stem.size());
  return stem.size() == kNameLength &&
         stem.find_first_not_of("0123456789abcdef") == std::string_view::npos &&
         (rest.empty() || rest.starts_with(".tmp-"));
}

}  // namespace

void ByteWriter::Append(std::span<const std::uint8_t> bytes) {
  bytes_.insert(bytes_.end(), bytes.begin(), bytes.end());
}

StageCache::StageCache(fs::path folder) : folder_(std::move(folder)) {
  std::error_code error;
  fs::create_directories(folder_, error);
  if (error) throw ToolError(folder_.string() + ": " + error.message());
}

fs::path StageCache::FileOf(const Hash256& key) const { return folder_ / Hex(key); }

std::optional<std::vector<std::uint8_t>> StageCache::Read(const Hash256& key) {
  const fs::path file = FileOf(key);
  {
    const std::lock_guard lock(mutex_);
    used_.insert(file.filename().string());
  }
  std::error_code error;
  if (!fs::is_regular_file(file, error)) return std::nullopt;  // a pipe would never end
  auto bytes = ReadFile(file.string());
  if (!bytes.ok() || bytes->size() < sizeof(Hash256)) return std::nullopt;
  const std::span payload = std::span<const std::uint8_t>(*bytes).subspan(sizeof(Hash256));
  if (!std::ranges::equal(SumOf(key, payload), std::span(*bytes).first(sizeof(Hash256)))) {
    return std::nullopt;
  }
  return std::vector<std::uint8_t>(payload.begin(), payload.end());
}

void StageCache::Write(const Hash256& key, std::span<const std::uint8_t> payload) {
  const fs::path file = FileOf(key);
  {
    const std::lock_guard lock(mutex_);
    if (!written_.insert(file.filename().string()).second) return;
  }
  const Hash256 sum = SumOf(key, payload);
  std::vector<std::uint8_t> bytes(sum.begin(), sum.end());
  bytes.insert(bytes.end(), payload.begin(), payload.end());
  // What a power cut leaves is found out by its sum.
  const Status status = WriteFileAtomically(file.string(), bytes, Durability::kNotFlushed);
  const std::lock_guard lock(mutex_);
  if (!status.ok() && failure_.empty()) failure_ = Describe(status);
}

void StageCache::Count(const std::string& stage, bool taken) {
  const std::lock_guard lock(mutex_);
  Counts& counts = counts_[stage];
  ++counts.asked;
  counts.taken += taken ? 1 : 0;
}

void StageCache::RemoveUnused() {
  const std::lock_guard lock(mutex_);
  std::error_code error;
  std::vector<fs::path> unused;
  for (const fs::directory_entry& entry : fs::directory_iterator(folder_, error)) {
    const std::string name = entry.path().filename().string();
    if (IsOurs(name) && !used_.contains(name)) unused.push_back(entry.path());
  }
  for (const fs::path& file : unused) fs::remove(file, error);
}

std::vector<std::string> StageCache::Report() const {
  const std::lock_guard lock(mutex_);
  std::vector<std::string> lines;
  for (const auto& [stage, counts] : counts_) {
    lines.push_back(stage + ": " + std::to_string(counts.taken) + " of " +
                    std::to_string(counts.asked) + " kept");
  }
  return lines;
}

std::string StageCache::failure() const {
  const std::lock_guard lock(mutex_);
  return failure_;
}

}  // namespace viewfix
