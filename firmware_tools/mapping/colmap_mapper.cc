// SPDX-License-Identifier: BSD-3-Clause
#include "firmware_tools/mapping/colmap_mapper.h"

#include <algorithm>
#include <map>
#include <set>
#include <span>
#include <unordered_map>

#include "firmware_tools/common/content_hash.h"
#include "firmware_tools/common/logged_program.h"
#include "firmware_tools/dataset/tool_file.h"
#include "firmware_tools/mapping/colmap_database.h"
#include "firmware_tools/mapping/colmap_model.h"
#include "firmware_tools/mapping/map_bytes.h"

namespace viewfix {
namespace {

namespace fs = std::filesystem;

// Rays this wide give good depth; wider brings no more.
constexpr double kWideAngleDeg = 12;
constexpr double kLeastAngleDeg = 2;
// How far from its epipolar line a match may lie that agrees with a map; of an image of 640
// pixels a side. Maps as COLMAP leaves them are off by a few pixels here and there.
constexpr double kAgreePx = 3;
// Frames no further apart in order are neighbours, not a loop.
constexpr int kNeighbours = 8;
constexpr std::string_view kNoModel = "failed to create sparse model";  // COLMAP's words

// Whether a kept folder was made of the same input.
std::string FingerprintOf(const MapInput& input, std::span<const VerifiedPair> pairs,
                          const ColmapOptions& options) {
  ContentHash hash;
  hash.Add(options.seed);
  hash.Add(options.refine_focal);
  for (const Camera& camera : input.cameras) HashCamera(camera, hash);
  for (const MapFrame& frame : input.frames) {
    hash.AddText(frame.name);
    hash.Add(frame.camera_idx);
    hash.Add(frame.features->keypoints.size());
    for (const Keypoint& keypoint : frame.features->keypoints) {
      hash.Add(keypoint.x);
      hash.Add(keypoint.y);
    }
  }
  for (const VerifiedPair& pair : pairs) {
    hash.Add(pair.frames.first_idx);
    hash.Add(pair.frames.second_idx);
    hash.Add(pair.matches.size());
    for (const FeatureMatch& match : pair.matches) {
      hash.Add(match.first_idx);
      hash.Add(match.second_idx);
    }
  }
  return Hex(hash.Result()) + "\n";
}

int CountFrames(const MapInput& input) {
  return static_cast<int>(
      std::count_if(input.frames.begin(), input.frames.end(),
                    [](const MapFrame& frame) { return !frame.features->keypoints.empty(); }));
}

// The folder that COLMAP works in: what stands in it is complete, or is made again.
class WorkFolder {
 public:
  WorkFolder(const MapInput& input, std::span<const VerifiedPair> pairs,
             const ColmapOptions& options, int jobs)
      : input_(input), options_(options), jobs_(jobs), folder_(options.work_folder) {
    MakeFolder(folder_);
    const std::string fingerprint = FingerprintOf(input, pairs, options);
    const fs::path stamp = folder_ / "input.txt";
    if (fs::exists(stamp) && ReadTextFile(stamp) == fingerprint) return;
    fs::remove(stamp);
    fs::remove_all(folder_ / "models");
    MakeDatabase(pairs);
    WriteTextFile(stamp, fingerprint);
  }

  // None: COLMAP could not begin with this pair.
  std::optional<Reconstruction> Map(const FramePair& initial, const Progress& progress) {
    const std::string name = std::to_string(ColmapId(initial.first_idx)) + "_" +
                             std::to_string(ColmapId(initial.second_idx));
    const fs::path folder = folder_ / "models" / name;
    if (!fs::exists(folder / "complete")) {
      fs::remove_all(folder);
      MakeFolder(folder);
      RunMapper(initial, folder, progress);
      WriteTextFile(folder / "complete", "");
    }
    if (!FindColmapModel(folder / "0")) return std::nullopt;
    return ReadColmapModel(folder / "0");
  }

 private:
  static void MakeFolder(const fs::path& folder) {
    std::error_code error;
    fs::create_directories(folder, error);
    if (error) throw ToolError(folder.string() + ": " + error.message());
  }

  fs::path Log() const { return folder_ / "colmap.log"; }

  void MakeDatabase(std::span<const VerifiedPair> pairs) {
    const fs::path database = folder_ / "database.db";
    fs::remove(database);
    RunLogged({options_.program, "database_creator", "--database_path", database.string()}, Log());
    WriteColmapDatabase(input_, pairs, database);
  }

  void RunMapper(const FramePair& initial, const fs::path& folder, const Progress& progress) {
    const std::vector<std::pair<std::string, std::string>> settings = {
        {"init_image_id1", std::to_string(ColmapId(initial.first_idx))},
        {"init_image_id2", std::to_string(ColmapId(initial.second_idx))},
        {"init_min_tri_angle", "1.5"},
        {"init_min_num_inliers", "30"},
        {"multiple_models", "0"},  // else it begins with this pair for ever
        {"extract_colors", "0"},
        {"min_model_size", "3"},
        {"num_threads", std::to_string(Workers(jobs_))},
        {"ba_refine_focal_length", options_.refine_focal ? "1" : "0"},
        {"ba_refine_extra_params", "0"},
        // Fewer and shorter global adjustments: the last word is our own.
        {"ba_global_images_ratio", "1.2"},
        {"ba_global_points_ratio", "1.2"},
        {"ba_global_max_num_iterations", "20"},
        {"ba_global_max_refinements", "2"},
    };
    std::vector<std::string> command = {options_.program, "mapper", "--random_seed",
                                        std::to_string(options_.seed)};
    const auto add = [&](const std::string& name, const std::string& value) {
      command.push_back("--" + name);
      command.push_back(value);
    };
    add("database_path", (folder_ / "database.db").string());
    add("image_path", folder_.string());
    add("output_path", folder.string());
    for (const auto& [name, value] : settings) add("Mapper." + name, value);
    try {
      RunLogged(command, Log(), RegisteredFrames(progress));
    } catch (const ToolError& error) {
      // That is how it ends where the initial pair was no good: another may be.
      if (std::string_view(error.what()).find(kNoModel) == std::string_view::npos) throw;
    }
  }

  // COLMAP prints "Registering image #12 (7)": the number registered, this one counted.
  std::function<void(const std::string&)> RegisteredFrames(const Progress& progress) const {
    const int total = CountFrames(input_);
    return [progress, total, text = std::string()](const std::string& added) mutable {
      text += added;
      const std::size_t end = text.rfind('\n');
      if (end == std::string::npos || !progress) return;
      int registered = 0;
      const std::size_t at = text.rfind("Registering image #", end);
      const std::size_t open = at == std::string::npos ? at : text.find('(', at);
      if (open != std::string::npos) registered = std::atoi(text.c_str() + open + 1);
      progress(std::clamp(registered, 0, total - 1), total);
    };
  }

  const MapInput& input_;
  const ColmapOptions& options_;
  int jobs_;
  fs::path folder_;
};

// Few frames missing, and loops that close.
bool IsBetter(const ColmapTrial& a, const ColmapTrial& b, int num_frames) {
  const auto cost = [&](const ColmapTrial& trial) {
    return double(num_frames - trial.registered) / num_frames + 10 * trial.open_share;
  };
  return cost(a) < cost(b);
}

}  // namespace

std::vector<FramePair> ChooseInitialPairs(std::span<const VerifiedPair> pairs, int max_pairs) {
  std::vector<std::pair<double, FramePair>> ranked;
  for (const VerifiedPair& pair : pairs) {
    if (pair.median_angle_deg < kLeastAngleDeg) continue;
    const double angle = std::min(pair.median_angle_deg, kWideAngleDeg);
    ranked.emplace_back(-double(pair.matches.size()) * angle, pair.frames);
  }
  std::sort(ranked.begin(), ranked.end());
  std::vector<FramePair> chosen;
  std::set<int> used;
  for (const auto& [rank, frames] : ranked) {
    if (static_cast<int>(chosen.size()) == max_pairs) break;
    if (used.contains(frames.first_idx) || used.contains(frames.second_idx)) continue;
    used.insert({frames.first_idx, frames.second_idx});
    chosen.push_back(frames);
  }
  return chosen;
}

double OpenLoopShare(const MapInput& input, std::span<const VerifiedPair> pairs,
                     const Reconstruction& map) {
  std::unordered_map<std::string, const MapImage*> by_name;
  for (const MapImage& image : map.images) by_name[image.name] = &image;
  std::vector<const MapImage*> images(input.frames.size(), nullptr);
  std::vector<std::vector<Eigen::Vector3d>> bearings(input.frames.size());
  for (std::size_t f = 0; f < images.size(); ++f) {
    const auto found = by_name.find(input.frames[f].name);
    if (found == by_name.end()) continue;
    images[f] = found->second;
    bearings[f] = Bearings(map.cameras[images[f]->camera_idx], *input.frames[f].features);
  }
  const CaptureOrder order(input);
  std::size_t asked = 0, open = 0;
  for (const VerifiedPair& pair : pairs) {
    const int first = pair.frames.first_idx;
    const int second = pair.frames.second_idx;
    if (!images[first] || !images[second]) continue;
    if (!order.AreApart(first, second, kNeighbours)) continue;
    const Rigid3 second_from_first =
        images[second]->cam_from_world * Inverse(images[first]->cam_from_world);
    const Camera& camera = map.cameras[images[first]->camera_idx];
    const double max_error = kAgreePx * PixelsPerNominal(camera) / camera.fx;
    open += std::count_if(pair.matches.begin(), pair.matches.end(), [&](const FeatureMatch& match) {
      return EpipolarError(second_from_first, bearings[first][match.first_idx],
                           bearings[second][match.second_idx]) > max_error;
    });
    asked += pair.matches.size();
  }
  return asked > 0 ? double(open) / double(asked) : 0;
}

std::optional<ColmapTrial> RunColmapMapper(const MapInput& input,
                                           std::span<const VerifiedPair> pairs,
                                           const ColmapOptions& options, int jobs,
                                           const Progress& progress) {
  WorkFolder work(input, pairs, options, jobs);
  const int num_frames = CountFrames(input);
  std::optional<ColmapTrial> best;
  for (const FramePair& initial : ChooseInitialPairs(pairs, options.max_trials)) {
    auto map = work.Map(initial, progress);
    if (!map) continue;
    ColmapTrial trial{initial, std::move(*map), 0, 0};
    trial.registered = static_cast<int>(trial.map.images.size());
    trial.open_share = OpenLoopShare(input, pairs, trial.map);
    const bool good = trial.registered >= options.min_registered * num_frames &&
                      trial.open_share <= options.max_open;
    if (!best || IsBetter(trial, *best, num_frames)) best = std::move(trial);
    if (good) break;
  }
  if (progress) progress(num_frames, num_frames);
  return best;
}

}  // namespace viewfix
