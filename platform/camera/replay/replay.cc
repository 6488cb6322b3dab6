// SPDX-License-Identifier: BSD-3-Clause
#include "platform/camera/replay/replay.h"

#include <algorithm>
#include <cctype>
#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <filesystem>
#include <mutex>
#include <system_error>
#include <utility>
#include <vector>

#include "platform/clock.h"
#include "platform/csv.h"
#include "platform/file.h"

namespace viewfix {
namespace {

namespace fs = std::filesystem;

Status Refused(const char* text, const fs::path& path, const std::error_code& error) {
  return AboutFile(path.string(), {StatusCode::kIo, text, error.message()});
}

// In lower case: ".jpg".
std::string EndingOf(const fs::path& path) {
  std::string ending = path.extension().string();
  std::transform(ending.begin(), ending.end(), ending.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return ending;
}

bool IsJpegName(const fs::path& path) {
  const std::string ending = EndingOf(path);
  return ending == ".jpg" || ending == ".jpeg";
}

// Paths below `folder`, relative to it.
Result<std::vector<fs::path>> ListJpegs(const fs::path& folder) {
  std::vector<fs::path> names;
  std::error_code error;
  fs::recursive_directory_iterator entry(folder, error);
  for (; !error && entry != fs::recursive_directory_iterator(); entry.increment(error)) {
    const fs::path& path = entry->path();
    if (IsJpegName(path) && !entry->is_directory(error)) {
      names.push_back(path.lexically_relative(folder));
    }
  }
  if (error) return Refused("cannot list folder", folder, error);
  std::sort(names.begin(), names.end());
  return names;
}

Result<std::vector<fs::path>> ListCsv(const fs::path& csv) {
  const Result<std::vector<std::uint8_t>> bytes = ReadFile(csv.string());
  if (!bytes.ok()) return bytes.status();
  const Result<CsvTable> table =
      ParseCsv({reinterpret_cast<const char*>(bytes->data()), bytes->size()});
  if (!table.ok()) return AboutFile(csv.string(), table.status());
  const int column = table->Column("path");
  if (column < 0) return Status(StatusCode::kCorrupt, "no column `path`", csv.string());
  std::vector<fs::path> names;
  for (const CsvTable::Row& row : table->rows) names.emplace_back(row.cells[column]);
  return names;
}

// One path a line; empty lines and those that begin with # are passed over.
Result<std::vector<fs::path>> ListText(const fs::path& text) {
  const Result<std::vector<std::uint8_t>> bytes = ReadFile(text.string());
  if (!bytes.ok()) return bytes.status();
  std::vector<fs::path> names;
  std::string line;
  const auto take = [&] {
    if (!line.empty() && line.back() == '\r') line.pop_back();
    if (!line.empty() && line.front() != '#') names.emplace_back(line);
    line.clear();
  };
  for (const std::uint8_t byte : *bytes) {
    byte == '\n' ? take() : line.push_back(static_cast<char>(byte));
  }
  take();
  return names;
}

class Folder : public Recording {
 public:
  Folder(fs::path folder, std::vector<fs::path> names)
      : folder_(std::move(folder)), names_(std::move(names)) {}

  Status Next(Frame& frame) override {
    if (next_ == names_.size()) return {StatusCode::kNotFound, "end of replay"};
    const fs::path& name = names_[next_++];
    const fs::path path = folder_ / name;
    frame.name = name.string();
    const Result<std::vector<std::uint8_t>> bytes = ReadFile(path.string());
    // Not kNotFound, which would say that the source has ended.
    if (!bytes.ok()) return {StatusCode::kIo, bytes.status().text(), bytes.status().detail()};
    const Status status = DecodeJpeg(*bytes, frame.image);
    return status.ok() ? status : AboutFile(path.string(), status);
  }

  Status Rewind() override {
    next_ = 0;
    return {};
  }

 private:
  fs::path folder_;
  std::vector<fs::path> names_;
  std::size_t next_ = 0;
};

constexpr double kDefaultRate = 10;  // frames a second, in real time

class Replay : public FrameSource {
 public:
  Replay(std::unique_ptr<Recording> recording, const CameraSettings& settings)
      : recording_(std::move(recording)),
        loop_(settings.loop),
        interval_(!settings.real_time ? 0
                                      : 1e9 / (settings.rate > 0 ? settings.rate : kDefaultRate)),
        next_time_(MonotonicNs()) {}

  Status Next(Frame& frame) override {
    if (!WaitUntilDue()) return {StatusCode::kCancelled, "not yet"};
    frame.sequence = sequence_++;
    frame.capture_time_ns = MonotonicNs();
    Status status = recording_->Next(frame);
    // A recording without a frame has no second round.
    if (status.code() == StatusCode::kNotFound && loop_ && sequence_ > round_began_ + 1) {
      if (status = recording_->Rewind(); status.ok()) status = recording_->Next(frame);
      round_began_ = frame.sequence;
    }
    return status;
  }

  bool live() const override { return interval_ > 0; }

  void Wake() override {
    const std::lock_guard lock(mutex_);
    woken_ = true;
    wake_.notify_all();
  }

  CameraCondition condition() const override { return {true, "replay"}; }
  CameraCounts counts() const override { return {.delivered = sequence_}; }

 private:
  bool WaitUntilDue() {
    if (interval_ == 0) return true;
    std::unique_lock lock(mutex_);
    woken_ = false;
    const std::int64_t wait_ns = next_time_ - MonotonicNs();
    if (wait_ns > 0 &&
        wake_.wait_for(lock, std::chrono::nanoseconds(wait_ns), [&] { return woken_; })) {
      return false;
    }
    // Whoever reads too slowly gets no burst later.
    next_time_ = std::max(next_time_ + static_cast<std::int64_t>(interval_), MonotonicNs());
    return true;
  }

  std::unique_ptr<Recording> recording_;
  const bool loop_;
  const double interval_;  // nanoseconds; 0: full speed
  std::int64_t next_time_;
  std::uint64_t sequence_ = 0;
  std::uint64_t round_began_ = 0;
  std::mutex mutex_;
  std::condition_variable wake_;
  bool woken_ = false;
};

}  // namespace

namespace {

// `names` are relative to `folder`; `where` is what the user named.
Result<std::unique_ptr<Recording>> Images(const fs::path& folder, const std::string& where,
                                          Result<std::vector<fs::path>> names) {
  if (!names.ok()) return names.status();
  if (names->empty()) return Status(StatusCode::kNotFound, "no JPEG image in", where);
  return std::unique_ptr<Recording>(std::make_unique<Folder>(folder, std::move(*names)));
}

}  // namespace

Result<std::unique_ptr<Recording>> OpenFolder(const std::string& folder) {
  std::error_code error;
  const fs::path csv = fs::path(folder) / "images.csv";
  return Images(folder, folder, fs::exists(csv, error) ? ListCsv(csv) : ListJpegs(folder));
}

Result<std::unique_ptr<Recording>> OpenList(const std::string& list) {
  const fs::path path = list;
  return Images(path.parent_path(), list,
                EndingOf(path) == ".csv" ? ListCsv(path) : ListText(path));
}

bool IsListName(const std::string& path) {
  const std::string ending = EndingOf(path);
  return ending == ".csv" || ending == ".txt";
}

std::unique_ptr<FrameSource> MakeReplay(std::unique_ptr<Recording> recording,
                                        const CameraSettings& settings) {
  return std::make_unique<Replay>(std::move(recording), settings);
}

Result<std::unique_ptr<FrameSource>> OpenReplay(const CameraSettings& settings) {
  const std::string& where = settings.where;
  std::error_code error;
  const fs::file_status kind = fs::status(where, error);
  if (kind.type() == fs::file_type::not_found) {
    return Status(StatusCode::kNotFound, "no such folder, list or video", where);
  }
  if (error) return Refused("cannot open", where, error);
  Result<std::unique_ptr<Recording>> recording = fs::is_directory(kind) ? OpenFolder(where)
                                                 : IsListName(where)    ? OpenList(where)
                                                                        : OpenVideo(where);
  if (!recording.ok()) return recording.status();
  return MakeReplay(std::move(*recording), settings);
}

Result<std::unique_ptr<FrameSource>> OpenReplay(const std::string& folder) {
  CameraSettings settings;
  settings.where = folder;
  return OpenReplay(settings);
}

}  // namespace viewfix
