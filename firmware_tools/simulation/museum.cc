// SPDX-License-Identifier: BSD-3-Clause
#include "firmware_tools/simulation/museum.h"

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <fstream>
#include <map>
#include <opencv2/core.hpp>

#include "firmware_tools/dataset/calibration_file.h"
#include "firmware_tools/dataset/image_set.h"
#include "firmware_tools/dataset/tool_file.h"
#include "firmware_tools/simulation/camera_effects.h"
#include "firmware_tools/simulation/random.h"
#include "firmware_tools/simulation/renderer.h"
#include "firmware_tools/simulation/room.h"
#include "firmware_tools/simulation/stand.h"

namespace viewfix {
namespace simulation {
namespace {

constexpr int kDistances = 20;
constexpr int kTestPerView = 3;
constexpr int kWalkImages = 774;  // with 600 of the locations: the paper's 1374
constexpr int kDistractorsPerRoom = 20;

// The one camera of the museum.
const Calibration kCamera = {640, 480, 520, 519, 318.7, 241.2, {-0.11, 0.035, 0, 0}};

// One photograph to render.
struct Shot {
  int room = 0;
  Stand stand;
  std::string stream;  // names the random stream of its exposure and its visitors
  bool visitors = false;
  ImageRecord record;
};

std::string Numbered(const std::string& folder, int number) {
  char name[16];
  std::snprintf(name, sizeof name, "/%04d.jpg", number);
  return "images/" + folder + name;
}

// `count` of the numbers 0..n-1, drawn at random.
std::vector<bool> DrawTest(int n, int count, Random& random) {
  std::vector<bool> is_test(n, false);
  while (count > 0) {
    const int i = random.Below(n);
    if (is_test[i]) continue;
    is_test[i] = true;
    --count;
  }
  return is_test;
}

void AddLocationShots(const Room& room, int room_idx, const SimulateOptions& options,
                      std::vector<Shot>& shots) {
  const int n = options.images_per_view;
  const int tests = std::max(1, n * kTestPerView / kDistances);
  for (const Approach& approach : room.approaches) {
    const std::string place = room.name + "/" + approach.view;
    Random random(options.seed, place);
    const std::vector<bool> is_test = DrawTest(n, tests, random);
    for (int i = 0; i < n; ++i) {
      const double share = (i + random.Uniform(0, 0.8)) / n;
      const double distance =
          double{approach.nearest} + share * double{approach.farthest - approach.nearest};
      Shot shot;
      shot.room = room_idx;
      shot.stand = FreeStand(room, approach, distance, random);
      shot.record.path = Numbered(place, i + 1);
      shot.record.location = room.name;
      shot.record.view = approach.view;
      shot.record.capture = place;
      shot.record.is_test = is_test[i];
      shot.stream = shot.record.path;
      shot.visitors = random.Chance(0.5);
      shots.push_back(std::move(shot));
    }
  }
}

// In through the middle, then to one side and to the other, looking about.
std::vector<Stand> Waypoints(const Room& room, Random& random) {
  std::vector<Stand> stands;
  const auto add = [&](int approach_idx, double share) {
    const Approach& approach = room.approaches[approach_idx];
    Stand stand = FreeStand(
        room, approach,
        double{approach.nearest} + share * double{approach.farthest - approach.nearest}, random);
    stand.roll = random.Uniform(-0.08, 0.08);
    stands.push_back(stand);
  };
  add(1, 1.0), add(1, 0.5), add(0, 0.8), add(0, 0.3), add(0, 0.8), add(1, 0.6), add(2, 0.8);
  add(2, 0.3), add(2, 0.8), add(1, 1.0);
  return stands;
}

Stand Between(const Stand& a, const Stand& b, double share) {
  Stand stand;
  stand.position = (1 - share) * a.position + share * b.position;
  stand.heading = a.heading + share * std::remainder(b.heading - a.heading, 2 * std::numbers::pi);
  stand.pitch = (1 - share) * a.pitch + share * b.pitch;
  stand.roll = (1 - share) * a.roll + share * b.roll;
  return stand;
}

void AddWalk(const std::vector<Room>& rooms, int locations, const SimulateOptions& options,
             std::vector<Shot>& shots) {
  for (int i = 0; i < kWalkImages; ++i) {
    const int room_idx = i * locations / kWalkImages;
    const int first = (room_idx * kWalkImages + locations - 1) / locations;
    const int next = ((room_idx + 1) * kWalkImages + locations - 1) / locations;
    const Room& room = rooms[room_idx];
    Random random(options.seed, "walk/" + room.name);
    const std::vector<Stand> waypoints = Waypoints(room, random);
    const double legs = static_cast<double>(waypoints.size() - 1);
    const double position = legs * (i - first) / (next - first);
    const auto leg = static_cast<std::size_t>(position);
    Shot shot;
    shot.room = room_idx;
    shot.stand = Between(waypoints[leg], waypoints[leg + 1], position - static_cast<double>(leg));
    shot.record.path = Numbered("walk", i + 1);
    shot.record.capture = "walk/" + room.name;
    shot.stream = shot.record.path;
    shots.push_back(std::move(shot));
  }
}

void AddDistractors(const Room& room, int room_idx, int count, const SimulateOptions& options,
                    std::vector<Shot>& shots) {
  Random random(options.seed, "distractor/" + room.name);
  for (int i = 0; i < count; ++i) {
    const Approach& approach = room.approaches[i % 3];
    Shot shot;
    shot.room = room_idx;
    shot.stand =
        FreeStand(room, approach,
                  random.Uniform(double{approach.nearest}, double{approach.farthest}), random);
    shot.record.path = Numbered(room.name, i + 1);
    shot.record.capture = room.name;
    shot.record.is_test = true;
    shot.stream = "distractor/" + shot.record.path;
    shot.visitors = random.Chance(0.5);
    shots.push_back(std::move(shot));
  }
}

// One to three people somewhere ahead, facing the camera.
std::vector<Quad> DrawVisitors(const Building& building, const Room& room, const Stand& stand,
                               Random& random) {
  std::vector<Quad> people;
  const int count = 1 + random.Below(3);
  for (int i = 0; i < count; ++i) {
    const double angle = stand.heading + random.Uniform(-0.5, 0.5);
    const Eigen::Vector3f ahead = Heading(angle);
    const Eigen::Vector3f eye = stand.position.cast<float>();
    const float free = room.scene.Distance(eye, ahead, 8.0f);
    const auto distance = static_cast<float>(random.Uniform(1.4, 4.0));
    if (distance > free - 0.2f) continue;
    const auto height = static_cast<float>(random.Uniform(1.6, 1.85));
    const float width = height * 0.36f;
    const Eigen::Vector3f right(ahead.y(), -ahead.x(), 0);
    Quad person;
    person.corner = eye + distance * ahead - 0.5f * width * right;
    person.corner.z() = height;
    person.right = width * right;
    person.down = {0, 0, -height};
    person.texture = building.people[random.Below(static_cast<int>(building.people.size()))];
    people.push_back(person);
  }
  return people;
}

void WriteImage(const std::filesystem::path& file, const std::vector<std::uint8_t>& bytes) {
  std::filesystem::create_directories(file.parent_path());
  std::ofstream stream(file, std::ios::binary);
  stream.write(reinterpret_cast<const char*>(bytes.data()),
               static_cast<std::streamsize>(bytes.size()));
  stream.close();
  if (!stream) throw ToolError(file.string() + ": cannot write: " + std::strerror(errno));
}

// Rooms stand in a row along x, 2 m apart, so that one frame serves the whole museum.
Eigen::Vector3d RoomOrigin(const std::vector<Room>& rooms, int room_idx) {
  double x = 0;
  for (int r = 0; r < room_idx; ++r) x += double{rooms[r].width} + 2;
  return {x, 0, 0};
}

struct Museum {
  Building building;
  std::vector<Room> rooms;  // the locations, then the distractors
  int locations = 0;

  explicit Museum(std::uint64_t seed) : building(seed) {
    for (const auto* names : {&LocationNames(), &DistractorNames()}) {
      for (const std::string& name : *names) rooms.push_back(BuildRoom(building, name, seed));
    }
    locations = static_cast<int>(LocationNames().size());
  }
};

void RenderShot(const Museum& museum, const Renderer& renderer, const SimulateOptions& options,
                const std::filesystem::path& folder, const Shot& shot) {
  const Room& room = museum.rooms[shot.room];
  Random random(options.seed, shot.stream);
  const Exposure exposure = DrawExposure(random, shot.record.is_test);
  std::vector<Quad> visitors;
  if (shot.visitors) visitors = DrawVisitors(museum.building, room, shot.stand, random);
  const cv::Mat light =
      renderer.Render(room.scene, visitors, PoseOf(shot.stand), exposure.illumination);
  WriteImage(folder / shot.record.path, Develop(light, exposure, random));
}

// Where some of the cameras stood, as somebody with a tape measure would write it down: to a
// millimetre, of the first and the last training image of each location and view.
void SaveControlPoints(const ImageSet& set, const std::filesystem::path& file) {
  std::map<std::string, std::vector<const ImageRecord*>> views;
  for (const ImageRecord& image : set.images) {
    if (!image.is_test && !image.location.empty()) views[image.capture].push_back(&image);
  }
  std::string text = "name,x,y,z\n";
  const auto add = [&](const ImageRecord& image) {
    const Eigen::Vector3d& at = image.pose->cam_in_world;
    char row[96];
    std::snprintf(row, sizeof row, ",%.3f,%.3f,%.3f\n", at.x(), at.y(), at.z());
    text.append(image.path).append(row);
  };
  for (const auto& [view, images] : views) {
    add(*images.front());
    if (images.size() > 1) add(*images.back());
  }
  WriteTextFile(file, text);
}

ImageSet SetOf(const Museum& museum, const std::filesystem::path& folder,
               const std::vector<Shot>& shots) {
  ImageSet set;
  set.folder = folder;
  set.source = folder / "images.csv";
  for (const Shot& shot : shots) {
    ImageRecord record = shot.record;
    record.pose = PoseOf(shot.stand);
    record.pose->cam_in_world += RoomOrigin(museum.rooms, shot.room);
    set.images.push_back(std::move(record));
  }
  return set;
}

void SaveSet(const ImageSet& set) {
  SaveCalibration(kCamera, set.folder / "calibration.yaml");
  SaveImageSet(set);
}

void MakeFolder(const std::filesystem::path& folder) {
  auto parent = std::filesystem::absolute(folder).parent_path();
  if (!folder.has_filename()) parent = parent.parent_path();  // "museum/"
  if (!std::filesystem::is_directory(parent)) {
    throw ToolError(folder.string() + ": cannot write: the folder " + parent.string() +
                    " does not exist");
  }
  std::error_code error;
  std::filesystem::create_directory(folder, error);
  if (!std::filesystem::is_directory(folder)) {
    throw ToolError(folder.string() + ": cannot make the folder: " + error.message());
  }
  std::filesystem::remove(folder / "images.csv", error);  // an older set ends here
}

}  // namespace
}  // namespace simulation

void SimulateMuseum(const SimulateOptions& options, const Progress& progress) {
  using namespace simulation;
  if (options.images_per_view < 2 || options.images_per_view > kDistances) {
    throw ToolError("images of a view must be 2 to 20");
  }
  const std::filesystem::path distractors = options.out / "distractors";
  MakeFolder(options.out);
  MakeFolder(distractors);
  cv::setNumThreads(1);  // each image takes one thread, so that all cores have one
  const Museum museum(options.seed);
  std::vector<Shot> shots;
  std::vector<Shot> others;
  const bool whole = options.images_per_view == kDistances;
  for (int r = 0; r < static_cast<int>(museum.rooms.size()); ++r) {
    if (r < museum.locations) {
      AddLocationShots(museum.rooms[r], r, options, shots);
    } else {
      AddDistractors(museum.rooms[r], r, whole ? kDistractorsPerRoom : 1, options, others);
    }
  }
  if (whole) AddWalk(museum.rooms, museum.locations, options, shots);
  const Renderer renderer(kCamera);
  const int own = static_cast<int>(shots.size());
  ParallelFor(
      own + static_cast<int>(others.size()), options.jobs,
      [&](int i) {
        const bool location = i < own;
        RenderShot(museum, renderer, options, location ? options.out : distractors,
                   location ? shots[i] : others[i - own]);
      },
      progress);
  SaveSet(SetOf(museum, distractors, others));
  const ImageSet set = SetOf(museum, options.out, shots);
  SaveControlPoints(set, options.out / "control.csv");
  SaveSet(set);
}

}  // namespace viewfix
