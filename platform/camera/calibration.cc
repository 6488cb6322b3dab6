// SPDX-License-Identifier: BSD-3-Clause
#include "platform/camera/calibration.h"

#include <algorithm>
#include <cctype>
#include <charconv>
#include <cmath>
#include <map>
#include <optional>
#include <utility>
#include <vector>

#include "platform/file.h"

namespace viewfix {
namespace {

constexpr std::size_t kMaxBytes = 1 << 20;
constexpr int kMaxSide = 1 << 20;  // pixels
constexpr int kMaxNesting = 4;     // of braces
constexpr std::string_view kBlanks = " \t\r";

std::string_view Trim(std::string_view text) {
  text.remove_prefix(std::min(text.find_first_not_of(kBlanks), text.size()));
  return text.substr(0, text.find_last_not_of(kBlanks) + 1);
}

// Without a comment, which begins at a # behind a blank or at the line's begin.
std::string_view WithoutComment(std::string_view line) {
  for (std::size_t i = 0; i < line.size(); ++i) {
    if (line[i] == '#' && (i == 0 || kBlanks.find(line[i - 1]) != std::string_view::npos)) {
      return line.substr(0, i);
    }
  }
  return line;
}

std::string_view WithoutQuotes(std::string_view text) {
  const bool quoted = text.size() >= 2 && (text.front() == '"' || text.front() == '\'') &&
                      text.back() == text.front();
  return quoted ? text.substr(1, text.size() - 2) : text;
}

// "!!opencv-matrix" and the like say what the keys below say too.
std::string_view WithoutTag(std::string_view text) {
  if (!text.starts_with('!')) return text;
  return Trim(text.substr(std::min(text.find_first_of(kBlanks), text.size())));
}

// Open minus closed brackets and braces.
int Nesting(std::string_view text) {
  return static_cast<int>(
      std::count_if(text.begin(), text.end(), [](char c) { return c == '[' || c == '{'; }) -
      std::count_if(text.begin(), text.end(), [](char c) { return c == ']' || c == '}'; }));
}

// The pieces between the commas that stand in no bracket.
std::vector<std::string_view> SplitAtCommas(std::string_view text) {
  std::vector<std::string_view> pieces;
  std::size_t begin = 0;
  int nesting = 0;
  for (std::size_t i = 0; i <= text.size(); ++i) {
    const bool at_end = i == text.size();
    if (!at_end) nesting += Nesting(text.substr(i, 1));
    if (!at_end && (text[i] != ',' || nesting > 0)) continue;
    const std::string_view piece = Trim(text.substr(begin, i - begin));
    if (!piece.empty()) pieces.push_back(piece);
    begin = i + 1;
  }
  return pieces;
}

// The scalars of a calibration file by their key: "image_width", "camera_matrix.data".
class Document {
 public:
  Status Parse(std::string_view text) {
    int number = 0;
    while (!text.empty()) {
      const std::size_t end = std::min(text.find('\n'), text.size());
      const std::string_view line = WithoutComment(text.substr(0, end));
      text.remove_prefix(std::min(end + 1, text.size()));
      Status status = TakeLine(line);
      ++number;
      if (!status.ok() && status.detail().empty()) {
        return {status.code(), status.text(), std::string("line ") += std::to_string(number)};
      }
      if (!status.ok()) return status;
    }
    if (!pending_.empty()) return {StatusCode::kCorrupt, "a bracket is not closed", pending_key_};
    return {};
  }

  bool empty() const { return values_.empty(); }

  // Null: there is no such key.
  const std::vector<std::string>* Find(const std::string& key) const {
    const auto found = values_.find(key);
    return found == values_.end() ? nullptr : &found->second;
  }

 private:
  Status TakeLine(std::string_view line) {
    const std::string_view content = Trim(line);
    if (!pending_.empty()) return Continue(content);
    const bool is_mark = line.starts_with('%') || content == "---" || content == "...";
    if (content.empty() || is_mark) return {};
    if (content.starts_with("- ")) return TakeListItem(Trim(content.substr(2)));
    const bool is_top = content.data() == line.data();
    const std::size_t colon = content.find(':');
    if (colon == std::string_view::npos) return {StatusCode::kCorrupt, "not `key: value`"};
    std::string key(WithoutQuotes(Trim(content.substr(0, colon))));
    if (is_top) {
      section_ = key;
    } else {
      key = section_ + "." + key;
    }
    pending_key_ = key;
    return Continue(WithoutTag(Trim(content.substr(colon + 1))));
  }

  // Of a value over several lines, all of it is gathered first.
  Status Continue(std::string_view more) {
    pending_.append(more).append(" ");
    nesting_ += Nesting(more);
    if (nesting_ > 0) return {};
    nesting_ = 0;
    const std::string value = std::exchange(pending_, {});
    return Store(pending_key_, Trim(value), 0);
  }

  Status TakeListItem(std::string_view item) {
    if (pending_key_.empty()) return {StatusCode::kCorrupt, "not `key: value`"};
    values_[pending_key_].emplace_back(WithoutQuotes(item));
    return {};
  }

  Status Store(const std::string& key, std::string_view value, int depth) {
    if (depth > kMaxNesting) return {StatusCode::kUnsupported, "braces nested too deep", key};
    const char open = value.empty() ? ' ' : value.front();
    if (open == '{' && value.back() == '}') {
      for (const std::string_view pair : SplitAtCommas(value.substr(1, value.size() - 2))) {
        const std::size_t colon = pair.find(':');
        if (colon == std::string_view::npos) {
          return {StatusCode::kCorrupt, "not `key: value` in braces", key};
        }
        const std::string inner(WithoutQuotes(Trim(pair.substr(0, colon))));
        Status status = Store(key + "." + inner, Trim(pair.substr(colon + 1)), depth + 1);
        if (!status.ok()) return status;
      }
      return {};
    }
    const auto [place, is_new] = values_.try_emplace(key);
    if (!is_new) return {StatusCode::kCorrupt, "a key stands there twice", key};
    if (open == '[' && value.back() == ']') {
      for (const std::string_view piece : SplitAtCommas(value.substr(1, value.size() - 2))) {
        place->second.emplace_back(WithoutQuotes(piece));
      }
    } else if (!value.empty()) {
      place->second.emplace_back(WithoutQuotes(value));
    }
    return {};
  }

  std::map<std::string, std::vector<std::string>> values_;
  std::string section_;      // key of the last line that is not indented
  std::string pending_;      // a value whose brackets are open yet
  int nesting_ = 0;          // of pending_
  std::string pending_key_;  // of the last value begun
};

std::string Lower(std::string_view text) {
  std::string lower(text);
  std::transform(lower.begin(), lower.end(), lower.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return lower;
}

Status ParseNumber(std::string_view text, const std::string& key, double& number) {
  if (text.starts_with('+')) text.remove_prefix(1);
  const std::string lower = Lower(text);
  if (lower == ".nan" || lower == ".inf" || lower == "-.inf") {
    return {StatusCode::kCorrupt, "a number is not finite", key};
  }
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), number);
  if (error == std::errc::invalid_argument || end != text.data() + text.size()) {
    return {StatusCode::kCorrupt, "not a number", key};
  }
  if (error != std::errc() || !std::isfinite(number)) {
    return {StatusCode::kCorrupt, "a number is not finite", key};
  }
  return {};
}

// A matrix's rows, columns and numbers; a plain list counts as one row.
struct Matrix {
  int rows = 0, cols = 0;
  std::vector<double> data;
};

Status ReadWhole(const Document& document, const std::string& key, int& value) {
  const std::vector<std::string>* words = document.Find(key);
  double number = 0;
  if (words == nullptr || words->size() != 1 || !ParseNumber(words->front(), key, number).ok() ||
      number != std::floor(number) || std::abs(number) > kMaxSide) {
    return {StatusCode::kCorrupt, "no whole number", key};
  }
  value = static_cast<int>(number);
  return {};
}

Status ReadMatrix(const Document& document, const std::string& key, Matrix& matrix) {
  const std::vector<std::string>* words = document.Find(key + ".data");
  const bool has_size = words != nullptr;
  if (!has_size) words = document.Find(key);
  if (words == nullptr) return {};
  for (const std::string& word : *words) {
    Status status = ParseNumber(word, key, matrix.data.emplace_back());
    if (!status.ok()) return status;
  }
  matrix.rows = 1;
  matrix.cols = static_cast<int>(matrix.data.size());
  if (!has_size) return {};
  for (const auto& [name, size] : {std::pair(".rows", &matrix.rows), {".cols", &matrix.cols}}) {
    Status status = ReadWhole(document, key + name, *size);
    if (!status.ok()) return status;
  }
  if (matrix.rows < 0 || matrix.cols < 0 ||
      std::size_t(matrix.rows) * std::size_t(matrix.cols) != matrix.data.size()) {
    return {StatusCode::kCorrupt, "rows and cols are not those of the data", key};
  }
  return {};
}

Status ReadSide(const Document& document, const char* key, int& side) {
  Status status = ReadWhole(document, key, side);
  if (!status.ok()) return status;
  return side > 0 ? Status() : Status(StatusCode::kCorrupt, "not positive", key);
}

Status ReadCameraMatrix(const Document& document, Camera& camera) {
  Matrix k;
  Status status = ReadMatrix(document, "camera_matrix", k);
  if (!status.ok()) return status;
  if (k.data.size() != 9 || (k.rows != 3 && k.rows != 1)) {
    return {StatusCode::kCorrupt, "no 3x3 matrix", "camera_matrix"};
  }
  const auto& m = k.data;
  if (m[1] != 0 || m[3] != 0 || m[6] != 0 || m[7] != 0 || m[8] != 1) {
    return {StatusCode::kUnsupported, "not of the form [fx 0 cx; 0 fy cy; 0 0 1]", "camera_matrix"};
  }
  camera.fx = m[0];
  camera.cx = m[2];
  camera.fy = m[4];
  camera.cy = m[5];
  if (camera.fx > 0 && camera.fy > 0) return {};
  return {StatusCode::kCorrupt, "a focal length is not positive", "camera_matrix"};
}

// The model that the file names; nothing: it names none.
Status ReadModelName(const Document& document, std::optional<CameraModel>& model) {
  for (const char* flag : {"fisheye_model", "fisheye"}) {
    int value = 0;
    if (ReadWhole(document, flag, value).ok() && value != 0) model = CameraModel::kKannalaBrandt;
  }
  const std::vector<std::string>* words = document.Find("distortion_model");
  if (words == nullptr || words->empty()) return {};
  const std::string name = Lower(words->front());
  if (name == "equidistant" || name == "fisheye") {
    model = CameraModel::kKannalaBrandt;
  } else if (name == "plumb_bob" || name == "rational_polynomial") {
    model = CameraModel::kBrownConrady;
  } else {
    return {StatusCode::kUnsupported,
            "distortion_model is not plumb_bob, rational_polynomial, equidistant or fisheye",
            words->front()};
  }
  return {};
}

Status ReadDistortion(const Document& document, Camera& camera) {
  constexpr const char* kKey = "distortion_coefficients";
  std::optional<CameraModel> named;
  if (Status status = ReadModelName(document, named); !status.ok()) return status;
  Matrix k;
  if (Status status = ReadMatrix(document, kKey, k); !status.ok()) return status;
  const std::size_t count = k.data.size();
  const bool is_fisheye = named == CameraModel::kKannalaBrandt;
  if (is_fisheye && count != 4) {
    return {StatusCode::kCorrupt, "a fisheye has 4 of them", kKey};
  }
  if (count != 0 && count != 4 && count != 5 && count != 8 && count != 12 && count != 14) {
    return {StatusCode::kCorrupt, "not 4, 5, 8, 12 or 14 numbers", kKey};
  }
  const auto is_zero = [](double value) { return value == 0; };
  const auto behind = k.data.begin() + std::ptrdiff_t(std::min(count, camera.distortion.size()));
  if (!std::all_of(behind, k.data.end(), is_zero)) {
    return {StatusCode::kUnsupported, "thin prism or tilted sensor", kKey};
  }
  std::copy(k.data.begin(), behind, camera.distortion.begin());
  const bool is_pinhole = !is_fisheye && std::all_of(k.data.begin(), k.data.end(), is_zero);
  camera.model = is_fisheye   ? CameraModel::kKannalaBrandt
                 : is_pinhole ? CameraModel::kPinhole
                              : CameraModel::kBrownConrady;
  return {};
}

}  // namespace

Result<Camera> ParseCalibration(std::string_view text) {
  if (text.size() > kMaxBytes) return Status(StatusCode::kCorrupt, "too large for a calibration");
  if (text.find('\0') != std::string_view::npos) {
    return Status(StatusCode::kCorrupt, "not a text file");
  }
  if (text.starts_with("\xEF\xBB\xBF")) text.remove_prefix(3);
  Document document;
  const Status parsed = document.Parse(text);
  if (document.empty()) {
    return Status(StatusCode::kCorrupt, "not a calibration in OpenCV's or ROS's YAML");
  }
  if (!parsed.ok()) return parsed;
  Camera camera;
  Status status = ReadSide(document, "image_width", camera.width);
  if (status.ok()) status = ReadSide(document, "image_height", camera.height);
  if (status.ok()) status = ReadCameraMatrix(document, camera);
  if (status.ok()) status = ReadDistortion(document, camera);
  if (!status.ok()) return status;
  return camera;
}

Result<Camera> ReadCalibration(const std::string& path) {
  const auto bytes = ReadFile(path);
  if (!bytes.ok()) return bytes.status();
  const Result<Camera> camera =
      ParseCalibration({reinterpret_cast<const char*>(bytes->data()), bytes->size()});
  if (!camera.ok()) return AboutFile(path, camera.status());
  return camera;
}

}  // namespace viewfix
