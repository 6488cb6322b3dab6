// SPDX-License-Identifier: BSD-3-Clause
#include "firmware_tools/mapping/colmap_database.h"

#include <sqlite3.h>

#include <memory>
#include <string>

#include "firmware_tools/mapping/colmap_convention.h"
#include "firmware_tools/mapping/colmap_records.h"

namespace viewfix {
namespace {

// Of COLMAP's TwoViewGeometry: calibrated, an essential matrix fits. Values of its files.
constexpr int kCalibrated = 2;

class Database {
 public:
  explicit Database(const std::filesystem::path& file) : file_(file) {
    sqlite3* handle = nullptr;
    const int code = sqlite3_open_v2(file.c_str(), &handle, SQLITE_OPEN_READWRITE, nullptr);
    handle_.reset(handle);
    Check(code);
  }

  void Run(const char* sql) { Check(sqlite3_exec(handle_.get(), sql, nullptr, nullptr, nullptr)); }

  void Check(int code) const {
    if (code == SQLITE_OK || code == SQLITE_DONE) return;
    throw ToolError(file_.string() + ": " + sqlite3_errmsg(handle_.get()));
  }

  sqlite3* handle() const { return handle_.get(); }

 private:
  struct Close {
    void operator()(sqlite3* handle) const { sqlite3_close(handle); }
  };
  std::filesystem::path file_;
  std::unique_ptr<sqlite3, Close> handle_;
};

// One INSERT, run again and again with other values.
class Insert {
 public:
  Insert(Database& database, const char* sql) : database_(database) {
    sqlite3_stmt* statement = nullptr;
    const int code = sqlite3_prepare_v2(database.handle(), sql, -1, &statement, nullptr);
    statement_.reset(statement);
    database.Check(code);
  }

  Insert& Integer(std::int64_t value) {
    database_.Check(sqlite3_bind_int64(statement_.get(), ++column_, value));
    return *this;
  }
  Insert& Text(const std::string& value) {
    database_.Check(
        sqlite3_bind_text(statement_.get(), ++column_, value.c_str(), -1, SQLITE_TRANSIENT));
    return *this;
  }
  template <typename T>
  Insert& Blob(const std::vector<T>& values) {
    database_.Check(sqlite3_bind_blob64(statement_.get(), ++column_, values.data(),
                                        values.size() * sizeof(T), SQLITE_TRANSIENT));
    return *this;
  }
  void Run() {
    database_.Check(sqlite3_step(statement_.get()));
    database_.Check(sqlite3_reset(statement_.get()));
    column_ = 0;
  }

 private:
  struct Finalize {
    void operator()(sqlite3_stmt* statement) const { sqlite3_finalize(statement); }
  };
  Database& database_;
  std::unique_ptr<sqlite3_stmt, Finalize> statement_;
  int column_ = 0;
};

void WriteCameras(const MapInput& input, Database& database) {
  Insert insert(database, "INSERT INTO cameras VALUES (?, ?, ?, ?, ?, 1)");
  for (std::size_t i = 0; i < input.cameras.size(); ++i) {
    const std::int64_t id = ColmapId(static_cast<int>(i));
    const ColmapCamera camera = CameraToColmap(input.cameras[i], static_cast<std::uint32_t>(id));
    insert.Integer(id).Integer(camera.model->id);
    insert.Integer(static_cast<std::int64_t>(camera.width));
    insert.Integer(static_cast<std::int64_t>(camera.height)).Blob(camera.params).Run();
  }
}

void WriteImages(const MapInput& input, Database& database) {
  Insert images(database, "INSERT INTO images (image_id, name, camera_id) VALUES (?, ?, ?)");
  Insert keypoints(database, "INSERT INTO keypoints VALUES (?, ?, 2, ?)");
  for (std::size_t i = 0; i < input.frames.size(); ++i) {
    const MapFrame& frame = input.frames[i];
    if (frame.features->keypoints.empty()) continue;
    const std::int64_t id = ColmapId(static_cast<int>(i));
    images.Integer(id).Text(frame.name).Integer(ColmapId(frame.camera_idx)).Run();
    std::vector<float> pixels;
    for (const Keypoint& keypoint : frame.features->keypoints) {
      const Eigen::Vector2f pixel = ToColmapPixel(Pixel(keypoint)).cast<float>();
      pixels.insert(pixels.end(), {pixel.x(), pixel.y()});
    }
    keypoints.Integer(id).Integer(static_cast<std::int64_t>(pixels.size() / 2)).Blob(pixels).Run();
  }
}

void WritePairs(std::span<const VerifiedPair> pairs, Database& database) {
  Insert insert(database,
                "INSERT INTO two_view_geometries (pair_id, rows, cols, data, config) "
                "VALUES (?, ?, 2, ?, ?)");
  for (const VerifiedPair& pair : pairs) {
    std::vector<std::uint32_t> matches;
    for (const FeatureMatch& match : pair.matches) {
      matches.push_back(static_cast<std::uint32_t>(match.first_idx));
      matches.push_back(static_cast<std::uint32_t>(match.second_idx));
    }
    insert.Integer(ColmapPairId(pair.frames));
    insert.Integer(static_cast<std::int64_t>(pair.matches.size()));
    insert.Blob(matches).Integer(kCalibrated).Run();
  }
}

}  // namespace

void WriteColmapDatabase(const MapInput& input, std::span<const VerifiedPair> pairs,
                         const std::filesystem::path& file) {
  Database database(file);
  database.Run("BEGIN");
  WriteCameras(input, database);
  WriteImages(input, database);
  WritePairs(pairs, database);
  database.Run("COMMIT");
}

}  // namespace viewfix
