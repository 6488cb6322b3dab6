// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <cstring>
#include <filesystem>
#include <map>
#include <mutex>
#include <optional>
#include <set>
#include <span>
#include <string>
#include <type_traits>
#include <vector>

#include "firmware_tools/common/content_hash.h"

namespace viewfix {

// Values one after another, as they stand in memory: for files that stay on this machine.
class ByteWriter {
 public:
  template <typename T>
  requires(std::is_arithmetic_v<T>) void Add(T value) { AddAll(std::span<const T>(&value, 1)); }
  template <typename T>
  requires(std::is_arithmetic_v<T>) void AddAll(std::span<const T> values) {
    Append({reinterpret_cast<const std::uint8_t*>(values.data()), values.size_bytes()});
  }

  const std::vector<std::uint8_t>& bytes() const { return bytes_; }

 private:
  void Append(std::span<const std::uint8_t> bytes);

  std::vector<std::uint8_t> bytes_;
};

// What ByteWriter wrote. Behind the end there is nothing to take, and AtEnd() is false for ever.
class ByteReader {
 public:
  explicit ByteReader(std::span<const std::uint8_t> bytes) : bytes_(bytes) {}

  template <typename T>
  requires(std::is_arithmetic_v<T>) T Take() {
    T value{};
    TakeAll(std::span(&value, 1));
    return value;
  }

  template <typename T>
  requires(std::is_arithmetic_v<T>) void TakeAll(std::span<T> values) {
    if (values.empty() || !Has(values.size(), sizeof(T))) return;
    std::memcpy(values.data(), bytes_.data(), values.size_bytes());
    bytes_ = bytes_.subspan(values.size_bytes());
  }

  // Whether so many values are left; if not, the bytes are none of ours.
  bool Has(std::size_t count, std::size_t bytes_each) {
    is_whole_ = is_whole_ && count <= bytes_.size() / bytes_each;
    return is_whole_;
  }
  bool AtEnd() const { return is_whole_ && bytes_.empty(); }

 private:
  std::span<const std::uint8_t> bytes_;
  bool is_whole_ = true;
};

// Results of long stages, kept from one run to the next: each in a file of its own, under the hash
// of everything that decides it. A file that is damaged, or was not written here, counts as absent:
// it carries the hash of its name and contents. Files are whole or not there, so that a run that
// was killed leaves what it had. Thread-safe.
class StageCache {
 public:
  // Throws ToolError where the folder cannot be made.
  explicit StageCache(std::filesystem::path folder);

  // What was kept under `key`, else what `compute` gives, which is then kept. What it throws is
  // thrown on. A file that cannot be written (a full disk) is counted in failure(), no more.
  //   stage  for Report()
  //   codec  Save(const T&, ByteWriter&); Load(ByteReader&, T&), which returns whether it is one
  template <typename Codec, typename Compute>
  auto Recall(const std::string& stage, const Hash256& key, const Codec& codec, Compute compute) {
    std::invoke_result_t<Compute> value;
    if (const auto bytes = Read(key)) {
      ByteReader reader(*bytes);
      if (codec.Load(reader, value) && reader.AtEnd()) {
        Count(stage, true);
        return value;
      }
    }
    Count(stage, false);
    value = compute();
    ByteWriter writer;
    codec.Save(value, writer);
    Write(key, writer.bytes());
    return value;
  }

  // Removes the files that nothing asked for since this was made, so that the folder holds what
  // the last finished run needed. Files with other names than this class gives stay.
  void RemoveUnused();

  // "features: 180 of 190 kept", for each stage.
  std::vector<std::string> Report() const;
  // Why the first file that could not be written was not; empty: all were.
  std::string failure() const;

 private:
  struct Counts {
    int taken = 0;
    int asked = 0;
  };

  std::filesystem::path FileOf(const Hash256& key) const;
  std::optional<std::vector<std::uint8_t>> Read(const Hash256& key);
  void Write(const Hash256& key, std::span<const std::uint8_t> payload);
  void Count(const std::string& stage, bool taken);

  std::filesystem::path folder_;
  mutable std::mutex mutex_;  // guards what follows
  std::map<std::string, Counts> counts_;
  std::set<std::string> used_;     // names of files
  std::set<std::string> written_;  // of these: no two threads write one
  std::string failure_;
};

}  // namespace viewfix
