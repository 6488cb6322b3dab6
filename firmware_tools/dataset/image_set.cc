// SPDX-License-Identifier: BSD-3-Clause
#include "firmware_tools/dataset/image_set.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <functional>
#include <set>
#include <string_view>
#include <utility>

#include "firmware_tools/dataset/calibration_file.h"
#include "firmware_tools/dataset/image_loader.h"
#include "firmware_tools/dataset/pose_import.h"
#include "firmware_tools/dataset/text_fields.h"
#include "firmware_tools/dataset/tool_file.h"
#include "platform/csv.h"

namespace viewfix {
namespace {

namespace fs = std::filesystem;

constexpr char kCsvName[] = "images.csv";
constexpr std::array<const char*, 7> kPoseColumns = {"tx", "ty", "tz", "qx", "qy", "qz", "qw"};
constexpr std::array<const char*, 6> kPlainColumns = {"path",  "location", "view",
                                                      "split", "camera",   "capture"};
// A position further from the origin is a mistake, and its square would not be exact.
constexpr double kMaxCoordinate = 1e9;  // metres
constexpr double kMaxQuaternionLengthError = 1e-2;
constexpr double kRoundingOfUnitLength = 1e-12;  // below it a quaternion is kept to the bit

bool IsOneOf(std::string_view name, auto names) {
  return std::find(names.begin(), names.end(), name) != names.end();
}

// Two spellings of one path give one key.
std::string PathKey(const std::string& path) {
  return fs::path(path).lexically_normal().generic_string();
}

// Cameras by file, each read once.
class CameraFiles {
 public:
  explicit CameraFiles(ImageSet& set) : set_(set) {
    if (fs::exists(set.DefaultCalibration())) default_idx_ = Index(kCalibrationName);
  }

  int default_idx() const { return default_idx_; }

  int Index(const std::string& file) {
    const auto [found, is_new] = idx_by_file_.try_emplace(PathKey(file), int(set_.cameras.size()));
    if (is_new) set_.cameras.push_back(LoadCalibration(set_.folder / file));
    return found->second;
  }

 private:
  ImageSet& set_;
  std::map<std::string, int> idx_by_file_;
  int default_idx_ = -1;
};

// Turns the rows of a CSV into records.
class CsvReader {
 public:
  explicit CsvReader(ImageSet& set) : set_(set), cameras_(set) {}

  void Read() {
    Result<CsvTable> table = ParseCsv(ReadTextFile(set_.source));
    if (!table.ok()) throw ToolError(set_.source.string() + ": " + Describe(table.status()));
    table_ = std::move(*table);
    FindColumns();
    set_.images.reserve(table_.rows.size());
    for (const CsvTable::Row& row : table_.rows) {
      row_ = &row;
      ReadRow();
    }
  }

 private:
  [[noreturn]] void Fail(const std::string& cause) const {
    const std::string line = row_ == nullptr ? "" : " line " + std::to_string(row_->line);
    throw ToolError(set_.source.string() + line + ": " + cause);
  }

  void FindColumns() {
    for (std::size_t i = 0; i < kPlainColumns.size(); ++i)
      plain_[i] = table_.Column(kPlainColumns[i]);
    if (plain_[0] < 0) Fail("no column called path");
    int missing = 0;
    for (std::size_t i = 0; i < kPoseColumns.size(); ++i) {
      pose_[i] = table_.Column(kPoseColumns[i]);
      if (pose_[i] < 0) ++missing;
    }
    has_poses_ = missing == 0;
    if (missing == 0 || missing == 7) return;
    for (std::size_t i = 0; i < kPoseColumns.size(); ++i) {
      if (pose_[i] < 0) Fail(std::string("pose column ") + kPoseColumns[i] + " is missing");
    }
  }

  const std::string& Cell(int column) const {
    static const std::string kEmpty;
    return column < 0 ? kEmpty : row_->cells[column];
  }

  void ReadRow() {
    ImageRecord image;
    image.path = Cell(plain_[0]);
    image.location = Cell(plain_[1]);
    image.view = Cell(plain_[2]);
    image.capture = Cell(plain_[5]);
    if (image.path.empty()) Fail("the path is empty");
    CheckUnique(image.path);
    CheckLocation(image.location);
    image.is_test = ReadSplit(Cell(plain_[3]));
    image.camera_idx = ReadCamera(Cell(plain_[4]));
    if (has_poses_) image.pose = ReadPose();
    KeepOthers(image);
    set_.images.push_back(std::move(image));
  }

  void CheckUnique(const std::string& path) {
    const auto [first, is_new] = line_by_path_.try_emplace(PathKey(path), row_->line);
    if (!is_new) Fail("path " + path + " stands in line " + std::to_string(first->second) + " too");
  }

  void CheckLocation(const std::string& location) const {
    const bool has_empty_part = location.find("//") != std::string::npos ||
                                location.substr(0, 1) == "/" ||
                                (!location.empty() && location.back() == '/');
    if (has_empty_part) Fail("location " + location + " has an empty part between its slashes");
  }

  bool ReadSplit(const std::string& split) const {
    if (split != "train" && split != "test" && !split.empty()) {
      Fail("split is " + split + ", not train or test");
    }
    return split == "test";
  }

  int ReadCamera(const std::string& file) {
    if (file.empty()) return cameras_.default_idx();
    try {
      return cameras_.Index(file);
    } catch (const ToolError& error) {
      Fail(error.what());
    }
  }

  std::optional<Pose> ReadPose() const {
    std::array<double, 7> value;
    int empty = 0;
    for (std::size_t i = 0; i < value.size(); ++i) {
      if (Cell(pose_[i]).empty()) {
        ++empty;
      } else {
        value[i] = ReadNumber(i);
      }
    }
    if (empty == 7) return std::nullopt;
    if (empty > 0) Fail("some pose cells are empty and some are not");
    Pose pose;
    pose.cam_in_world = {value[0], value[1], value[2]};
    if (pose.cam_in_world.cwiseAbs().maxCoeff() > kMaxCoordinate) {
      Fail("the position is more than 1e9 m from the origin");
    }
    pose.world_from_cam = ReadQuaternion({value[6], value[3], value[4], value[5]});
    return pose;
  }

  double ReadNumber(std::size_t i) const {
    const std::string& text = Cell(pose_[i]);
    double value = 0;
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
    const std::string name = kPoseColumns[i];
    if (error == std::errc::invalid_argument || end != text.data() + text.size()) {
      Fail(name + " is not a number: " + text.substr(0, 40));
    }
    if (error != std::errc() || !std::isfinite(value)) {
      Fail(name + " is not finite: " + text.substr(0, 40));
    }
    return value;
  }

  Eigen::Quaterniond ReadQuaternion(const Eigen::Quaterniond& q) const {
    const double length_error = std::abs(q.coeffs().stableNorm() - 1);
    if (!(length_error <= kMaxQuaternionLengthError)) {
      Fail("the quaternion qx,qy,qz,qw has not length 1");
    }
    return length_error <= kRoundingOfUnitLength ? q : q.normalized();
  }

  void KeepOthers(ImageRecord& image) const {
    for (std::size_t i = 0; i < table_.header.size(); ++i) {
      const std::string& name = table_.header[i];
      const bool known = IsOneOf(name, kPlainColumns) || IsOneOf(name, kPoseColumns);
      if (!known && !row_->cells[i].empty()) image.other[name] = row_->cells[i];
    }
  }

  ImageSet& set_;
  CameraFiles cameras_;
  CsvTable table_;
  const CsvTable::Row* row_ = nullptr;  // being read
  std::array<int, kPlainColumns.size()> plain_{};
  std::array<int, kPoseColumns.size()> pose_{};
  bool has_poses_ = false;
  std::map<std::string, int> line_by_path_;
};

// location/view/file, location/file or file; what is above the last folder but one
// belongs to the location.
ImageRecord RecordFromPath(const fs::path& relative) {
  ImageRecord image;
  image.path = relative.generic_string();
  const fs::path folder = relative.parent_path();
  const bool has_view = folder.has_parent_path();
  image.location = (has_view ? folder.parent_path() : folder).generic_string();
  if (has_view) image.view = folder.filename().string();
  return image;
}

void ReadFolder(ImageSet& set) {
  std::error_code error;
  fs::recursive_directory_iterator at(set.folder, error);
  for (; !error && at != fs::recursive_directory_iterator(); at.increment(error)) {
    const bool hidden = at->path().filename().string().front() == '.';
    if (hidden && at->is_directory()) at.disable_recursion_pending();
    if (hidden || !at->is_regular_file() || !IsImageFileName(at->path())) continue;
    if (!IsUtf8(at->path().string())) throw ToolError("not a UTF-8 name: " + at->path().string());
    set.images.push_back(RecordFromPath(at->path().lexically_relative(set.folder)));
  }
  if (error) throw ToolError("cannot list " + set.folder.string() + ": " + error.message());
  std::sort(set.images.begin(), set.images.end(),
            [](const ImageRecord& a, const ImageRecord& b) { return a.path < b.path; });
  const int camera_idx = CameraFiles(set).default_idx();
  for (ImageRecord& image : set.images) image.camera_idx = camera_idx;
}

// The files that SaveImageSet() gives the cameras. The default's name is free for the first one
// only where every image has a camera.
std::vector<std::string> CameraFileNames(const ImageSet& set) {
  const bool all_have_one = std::all_of(set.images.begin(), set.images.end(),
                                        [](const ImageRecord& i) { return i.camera_idx >= 0; });
  std::vector<std::string> names;
  for (std::size_t i = 0; i < set.cameras.size(); ++i) {
    names.push_back(i == 0 && all_have_one ? kCalibrationName
                                           : "camera_" + std::to_string(i) + ".yaml");
  }
  return names;
}

// A column of the CSV to write: its name and its cell for an image.
struct Column {
  std::string name;
  std::function<std::string(const ImageRecord&)> cell;
};

void AddPoseColumns(std::vector<Column>& columns) {
  for (int i = 0; i < 7; ++i) {
    columns.push_back({kPoseColumns[i], [i](const ImageRecord& image) -> std::string {
                         if (!image.pose) return {};
                         return ExactNumber(i < 3 ? image.pose->cam_in_world[i]
                                                  : image.pose->world_from_cam.coeffs()[i - 3]);
                       }});
  }
}

std::vector<Column> AllColumns(const ImageSet& set) {
  std::vector<Column> columns = {
      {"path", [](const ImageRecord& image) { return image.path; }},
      {"location", [](const ImageRecord& image) { return image.location; }},
      {"view", [](const ImageRecord& image) { return image.view; }},
      {"capture", [](const ImageRecord& image) { return image.capture; }},
      {"camera", [names = CameraFileNames(set)](const ImageRecord& image) -> std::string {
         if (image.camera_idx < 0) return {};
         const std::string& name = names.at(image.camera_idx);
         return name == kCalibrationName ? "" : name;
       }}};
  const bool has_test = std::any_of(set.images.begin(), set.images.end(),
                                    [](const ImageRecord& image) { return image.is_test; });
  if (has_test) {
    columns.push_back(
        {"split", [](const ImageRecord& image) { return image.is_test ? "test" : "train"; }});
  }
  AddPoseColumns(columns);
  std::set<std::string> others;
  for (const ImageRecord& image : set.images) {
    for (const auto& [name, cell] : image.other) others.insert(name);
  }
  for (const std::string& name : others) {
    columns.push_back({name, [name](const ImageRecord& image) {
                         const auto found = image.other.find(name);
                         return found == image.other.end() ? std::string() : found->second;
                       }});
  }
  return columns;
}

std::string CsvText(const ImageSet& set) {
  std::vector<Column> columns = AllColumns(set);
  std::erase_if(columns, [&](const Column& column) {
    return column.name != "path" &&
           std::all_of(set.images.begin(), set.images.end(),
                       [&](const ImageRecord& image) { return column.cell(image).empty(); });
  });
  std::string text;
  for (const Column& column : columns) text += QuoteCsv(column.name) + ",";
  text.back() = '\n';
  for (const ImageRecord& image : set.images) {
    for (const Column& column : columns) text += QuoteCsv(column.cell(image)) + ",";
    text.back() = '\n';
  }
  return text;
}

}  // namespace

ImageSet LoadImageSet(const fs::path& path) try {
  if (!fs::exists(path)) throw ToolError("no such image set: " + path.string());
  ImageSet set;
  const bool is_folder = fs::is_directory(path);
  set.folder = is_folder ? path : path.parent_path();
  const bool has_csv = !is_folder || fs::exists(path / kCsvName);
  set.source = is_folder && has_csv ? path / kCsvName : path;
  if (has_csv) {
    CsvReader(set).Read();
  } else if (std::optional<ImageSet> posed = LoadPosedImageSet(path)) {
    set = std::move(*posed);
  } else {
    ReadFolder(set);
  }
  if (set.images.empty()) throw ToolError("image set " + set.source.string() + " has no images");
  return set;
} catch (const fs::filesystem_error& error) {
  throw ToolError("cannot read " + error.path1().string() + ": " + error.code().message());
}

void SaveImageSet(const ImageSet& set) {
  const std::vector<std::string> names = CameraFileNames(set);
  for (std::size_t i = 0; i < set.cameras.size(); ++i) {
    SaveCalibration(set.cameras[i], set.folder / names[i]);
  }
  WriteTextFile(set.folder / kCsvName, CsvText(set));
}

}  // namespace viewfix
