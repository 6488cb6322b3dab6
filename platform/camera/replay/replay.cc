// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <cctype>
#include <cstdint>
#include <filesystem>
#include <system_error>
#include <utility>
#include <vector>

#include "platform/camera/frame_source.h"
#include "platform/clock.h"
#include "platform/csv.h"
#include "platform/file.h"

namespace viewfix {
namespace {

namespace fs = std::filesystem;

Status Refused(const char* text, const fs::path& path, const std::error_code& error) {
  return AboutFile(path.string(), {StatusCode::kIo, text, error.message()});
}

bool IsJpegName(const fs::path& path) {
  std::string ending = path.extension().string();
  std::transform(ending.begin(), ending.end(), ending.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
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

class Replay : public FrameSource {
 public:
  Replay(fs::path folder, std::vector<fs::path> names)
      : folder_(std::move(folder)), names_(std::move(names)) {}

  Status Next(Frame& frame) override {
    if (next_ == names_.size()) return {StatusCode::kNotFound, "end of replay"};
    const fs::path& name = names_[next_];
    const fs::path path = folder_ / name;
    frame.sequence = next_++;
    frame.name = name.string();
    frame.capture_time_ns = MonotonicNs();
    const Result<std::vector<std::uint8_t>> bytes = ReadFile(path.string());
    // Not kNotFound, which would say that the source has ended.
    if (!bytes.ok()) return {StatusCode::kIo, bytes.status().text(), bytes.status().detail()};
    const Status status = DecodeJpeg(*bytes, frame.image);
    return status.ok() ? status : AboutFile(path.string(), status);
  }

 private:
  fs::path folder_;
  std::vector<fs::path> names_;
  std::size_t next_ = 0;
};

}  // namespace

Result<std::unique_ptr<FrameSource>> OpenReplay(const std::string& folder) {
  std::error_code error;
  const fs::file_status kind = fs::status(folder, error);
  if (kind.type() == fs::file_type::not_found) {
    return Status(StatusCode::kNotFound, "no such folder", folder);
  }
  if (error) return Refused("cannot open folder", folder, error);
  if (!fs::is_directory(kind)) return Status(StatusCode::kInvalidArgument, "not a folder", folder);
  const fs::path csv = fs::path(folder) / "images.csv";
  Result<std::vector<fs::path>> names =
      fs::exists(csv, error) ? ListCsv(csv) : ListJpegs(fs::path(folder));
  if (!names.ok()) return names.status();
  if (names->empty()) return Status(StatusCode::kNotFound, "no JPEG image in", folder);
  return std::unique_ptr<FrameSource>(std::make_unique<Replay>(folder, std::move(*names)));
}

}  // namespace viewfix
