// SPDX-License-Identifier: BSD-3-Clause
#include "firmware_tools/mapping/two_view.h"

#include <algorithm>
#include <cmath>
#include <memory>
#include <opencv2/calib3d.hpp>
#include <optional>

#include "engine/matching/descriptor_matcher.h"
#include "firmware_tools/mapping/map_bytes.h"

namespace viewfix {
namespace {

constexpr double kDegrees = 180 / 3.14159265358979323846;
// Below this angle between rays the sign of a depth is noise.
constexpr double kMinAngleForDepth = 0.5 / kDegrees;
// USAC has constants in pixels inside: it is given those of a camera of this focal length.
constexpr double kFocal = 500;

struct PreparedFrame {
  std::vector<Eigen::Vector3d> bearings;  // [keypoints]
  std::vector<std::int8_t> signs;         // [keypoints]
};

std::vector<PreparedFrame> PrepareFrames(const MapInput& input) {
  std::vector<PreparedFrame> prepared;
  for (const MapFrame& frame : input.frames) {
    PreparedFrame p{Bearings(input.cameras[frame.camera_idx], *frame.features), {}};
    for (const Keypoint& keypoint : frame.features->keypoints) {
      p.signs.push_back(keypoint.laplacian_sign);
    }
    prepared.push_back(std::move(p));
  }
  return prepared;
}

// One thread's tools.
struct Worker {
  Worker(int max_features, int dim)
      : matcher(max_features, max_features, dim), found(max_features) {}

  DescriptorMatcher matcher;
  std::vector<DescriptorMatch> found;
};

double Angle(const Eigen::Vector3d& a, const Eigen::Vector3d& b) {
  return std::atan2(a.cross(b).norm(), a.dot(b));
}

bool IsInFront(const Rigid3& second_from_first, const Eigen::Vector3d& first,
               const Eigen::Vector3d& second) {
  const Eigen::Vector3d turned = second_from_first.rotation * first;
  if (Angle(turned, second) < kMinAngleForDepth) return true;
  // depth_2 second = depth_1 turned + t, crossed with either ray.
  const Eigen::Vector3d normal = turned.cross(second);
  const Eigen::Vector3d& t = second_from_first.translation;
  return second.cross(t).dot(normal) > 0 && turned.cross(t).dot(normal) > 0;
}

// The motion of the camera between two frames, from matched bearings.
class MotionEstimator {
 public:
  MotionEstimator(const PreparedFrame& first, const PreparedFrame& second,
                  std::span<const FeatureMatch> matches, double max_error)
      : first_(first), second_(second), matches_(matches), max_error_(max_error) {}

  std::optional<Rigid3> Estimate(int seed) const {
    std::vector<cv::Point2d> points1, points2;
    for (const FeatureMatch& match : matches_) {
      const Eigen::Vector3d& a = first_.bearings[match.first_idx];
      const Eigen::Vector3d& b = second_.bearings[match.second_idx];
      points1.emplace_back(kFocal * a.x() / a.z(), kFocal * a.y() / a.z());
      points2.emplace_back(kFocal * b.x() / b.z(), kFocal * b.y() / b.z());
    }
    cv::UsacParams params;
    params.confidence = 0.9999;
    params.maxIterations = 2000;
    params.randomGeneratorState = seed;
    params.score = cv::SCORE_METHOD_MAGSAC;
    params.loMethod = cv::LOCAL_OPTIM_SIGMA;
    params.threshold = max_error_ * kFocal;
    const cv::Matx33d k(kFocal, 0, 0, 0, kFocal, 0, 0, 0, 1);
    const cv::Mat essential = cv::findEssentialMat(points1, points2, k, k, cv::noArray(),
                                                   cv::noArray(), cv::noArray(), params);
    if (essential.rows != 3 || essential.cols != 3) return std::nullopt;
    return BestDecomposition(essential);
  }

  bool Agrees(const Rigid3& motion, const FeatureMatch& match) const {
    const Eigen::Vector3d& a = first_.bearings[match.first_idx];
    const Eigen::Vector3d& b = second_.bearings[match.second_idx];
    return EpipolarError(motion, a, b) <= max_error_ && IsInFront(motion, a, b);
  }

 private:
  // An essential matrix stands for four motions; the right one has most points in front.
  Rigid3 BestDecomposition(const cv::Mat& essential) const {
    cv::Matx33d r[2];
    cv::Vec3d t;
    cv::decomposeEssentialMat(essential, r[0], r[1], t);
    Rigid3 best;
    long best_count = -1;
    for (const cv::Matx33d& rotation : r) {
      for (const double sign : {1.0, -1.0}) {
        using Matrix = Eigen::Matrix<double, 3, 3, Eigen::RowMajor>;
        const Rigid3 motion{
            Eigen::Quaterniond(Eigen::Matrix3d(Eigen::Map<const Matrix>(rotation.val))),
            sign * Eigen::Vector3d(t[0], t[1], t[2])};
        const auto agrees = [&](const FeatureMatch& match) { return Agrees(motion, match); };
        const long count = std::count_if(matches_.begin(), matches_.end(), agrees);
        if (count <= best_count) continue;
        best_count = count;
        best = motion;
      }
    }
    return best;
  }

  const PreparedFrame& first_;
  const PreparedFrame& second_;
  std::span<const FeatureMatch> matches_;
  double max_error_;
};

class PairVerifier {
 public:
  PairVerifier(const MapInput& input, const TwoViewOptions& options)
      : input_(input), options_(options), prepared_(PrepareFrames(input)) {}

  // No matches: the pair is refused.
  VerifiedPair Verify(const FramePair& frames, Worker& worker) const {
    VerifiedPair pair{frames, {}, {}, 0};
    const std::vector<FeatureMatch> tentative = MatchPair(frames, worker);
    if (static_cast<int>(tentative.size()) < options_.min_inliers) return pair;
    const bool known = IsKnown(frames);
    const MotionEstimator estimator(prepared_[frames.first_idx], prepared_[frames.second_idx],
                                    tentative, MaxError(frames, known));
    const auto motion = known ? GivenMotion(frames) : estimator.Estimate(options_.seed);
    if (!motion) return pair;
    pair.second_from_first = *motion;
    const auto agrees = [&](const FeatureMatch& match) { return estimator.Agrees(*motion, match); };
    std::copy_if(tentative.begin(), tentative.end(), std::back_inserter(pair.matches), agrees);
    if (static_cast<int>(pair.matches.size()) < options_.min_inliers) pair.matches.clear();
    pair.median_angle_deg = MedianAngleDeg(pair);
    return pair;
  }

 private:
  bool IsKnown(const FramePair& frames) const {
    return input_.frames[frames.first_idx].cam_from_world &&
           input_.frames[frames.second_idx].cam_from_world;
  }

  std::optional<Rigid3> GivenMotion(const FramePair& frames) const {
    return *input_.frames[frames.second_idx].cam_from_world *
           Inverse(*input_.frames[frames.first_idx].cam_from_world);
  }

  // Radians, from pixels at the mean of both cameras.
  double MaxError(const FramePair& frames, bool known) const {
    double radians = 0;
    for (const int idx : {frames.first_idx, frames.second_idx}) {
      const Camera& camera = input_.cameras[input_.frames[idx].camera_idx];
      radians += PixelsPerNominal(camera) / (camera.fx + camera.fy);
    }
    return radians * (known ? options_.max_error_known_px : options_.max_error_px);
  }

  DescriptorSet Descriptors(int frame_idx) const {
    return {input_.frames[frame_idx].features->descriptors, prepared_[frame_idx].signs};
  }

  std::vector<FeatureMatch> MatchPair(const FramePair& frames, Worker& worker) const {
    const MatchOptions options{.max_ratio = options_.max_ratio, .mutual = true};
    const Result<int> count = worker.matcher.Match(
        Descriptors(frames.first_idx), Descriptors(frames.second_idx), options, worker.found);
    if (!count.ok()) throw ToolError(std::string("matching: ") + count.status().text());
    std::vector<FeatureMatch> matches;
    for (int i = 0; i < *count; ++i) {
      const DescriptorMatch& found = worker.found[i];
      const FeatureMatch match{found.query_idx, found.candidate_idx, found.distance2};
      if (HasRays(frames, match)) matches.push_back(match);
    }
    return matches;
  }

  bool HasRays(const FramePair& frames, const FeatureMatch& match) const {
    return prepared_[frames.first_idx].bearings[match.first_idx].z() > 0 &&
           prepared_[frames.second_idx].bearings[match.second_idx].z() > 0;
  }

  double MedianAngleDeg(const VerifiedPair& pair) const {
    if (pair.matches.empty()) return 0;
    std::vector<double> angles;
    for (const FeatureMatch& match : pair.matches) {
      angles.push_back(Angle(pair.second_from_first.rotation *
                                 prepared_[pair.frames.first_idx].bearings[match.first_idx],
                             prepared_[pair.frames.second_idx].bearings[match.second_idx]));
    }
    const auto middle = angles.begin() + angles.size() / 2;
    std::nth_element(angles.begin(), middle, angles.end());
    return *middle * kDegrees;
  }

  const MapInput& input_;
  const TwoViewOptions& options_;
  std::vector<PreparedFrame> prepared_;  // [frames]
};

// Rises whenever the same frames and options would give something else, or the file below changes.
constexpr int kKeptVersion = 1;

// Of all of a frame that a pair asks for.
Hash256 DigestOf(const MapFrame& frame, const Camera& camera) {
  ContentHash hash;
  for (const Keypoint& k : frame.features->keypoints) {
    hash.Add(k.x);
    hash.Add(k.y);
    hash.Add(k.laplacian_sign);
  }
  hash.AddAll(std::span<const std::int8_t>(frame.features->descriptors));
  HashCamera(camera, hash);
  hash.Add(frame.cam_from_world.has_value());
  HashPose(frame.cam_from_world.value_or(Rigid3()), hash);
  return hash.Result();
}

Hash256 KeyOf(const Hash256& first, const Hash256& second, const TwoViewOptions& options) {
  ContentHash key;
  key.AddText("pair");
  key.Add(kKeptVersion);
  key.AddText(cv::getVersionString());  // it finds the motion
  key.Add(options.max_ratio);
  key.Add(options.max_error_px);
  key.Add(options.max_error_known_px);
  key.Add(options.min_inliers);
  key.Add(options.seed);
  key.AddAll(std::span<const std::uint8_t>(first));
  key.AddAll(std::span<const std::uint8_t>(second));
  return key.Result();
}

// Of a VerifiedPair in a file, whose frames are known.
struct Codec {
  const MapInput& input;
  FramePair frames;

  void Save(const VerifiedPair& pair, ByteWriter& writer) const {
    writer.Add(pair.median_angle_deg);
    SavePose(pair.second_from_first, writer);
    writer.Add(std::uint64_t{pair.matches.size()});
    for (const FeatureMatch& match : pair.matches) {
      writer.Add(match.first_idx);
      writer.Add(match.second_idx);
      writer.Add(match.distance2);
    }
  }

  bool Load(ByteReader& reader, VerifiedPair& pair) const {
    pair.frames = frames;
    pair.median_angle_deg = reader.Take<double>();
    LoadPose(reader, pair.second_from_first);
    const auto count = reader.Take<std::uint64_t>();
    if (!reader.Has(count, 3 * sizeof(int))) return false;
    pair.matches.resize(count);
    for (FeatureMatch& match : pair.matches) {
      match.first_idx = reader.Take<int>();
      match.second_idx = reader.Take<int>();
      match.distance2 = reader.Take<std::int32_t>();
      if (!IsKeypoint(frames.first_idx, match.first_idx) ||
          !IsKeypoint(frames.second_idx, match.second_idx)) {
        return false;
      }
    }
    return true;
  }

 private:
  bool IsKeypoint(int frame_idx, int idx) const {
    return idx >= 0 && idx < static_cast<int>(input.frames[frame_idx].features->keypoints.size());
  }
};

// PairVerifier::Verify(), or what it gave before.
class CachedVerifier {
 public:
  CachedVerifier(const MapInput& input, const TwoViewOptions& options, StageCache* cache)
      : input_(input), options_(options), verifier_(input, options), cache_(cache) {
    if (cache_ == nullptr) return;
    for (const MapFrame& frame : input.frames) {
      digests_.push_back(DigestOf(frame, input.cameras[frame.camera_idx]));
    }
  }

  VerifiedPair Verify(const FramePair& frames, Worker& worker) const {
    const auto compute = [&] { return verifier_.Verify(frames, worker); };
    if (cache_ == nullptr) return compute();
    return cache_->Recall("pairs",
                          KeyOf(digests_[frames.first_idx], digests_[frames.second_idx], options_),
                          Codec{input_, frames}, compute);
  }

 private:
  const MapInput& input_;
  const TwoViewOptions& options_;
  PairVerifier verifier_;
  StageCache* cache_;
  std::vector<Hash256> digests_;  // [frames]; empty: nothing is kept
};

}  // namespace

double EpipolarError(const Rigid3& second_from_first, const Eigen::Vector3d& first,
                     const Eigen::Vector3d& second) {
  const Eigen::Vector3d& t = second_from_first.translation;
  const Eigen::Vector3d turned = second_from_first.rotation * first;
  const Eigen::Vector3d line_in_second = t.cross(turned);
  const Eigen::Vector3d line_in_turned = second.cross(t);
  const double error = second.dot(line_in_second);
  const double gradient2 =
      line_in_second.cross(second).squaredNorm() + line_in_turned.cross(turned).squaredNorm();
  return gradient2 > 0 ? std::abs(error) / std::sqrt(gradient2) : 0;
}

std::vector<VerifiedPair> VerifyPairs(const MapInput& input, std::span<const FramePair> pairs,
                                      const TwoViewOptions& options, int jobs,
                                      const Progress& progress, StageCache* cache) {
  std::size_t max_features = 1;
  int dim = 1;
  for (const MapFrame& frame : input.frames) {
    if (frame.features->keypoints.empty()) continue;
    max_features = std::max(max_features, frame.features->keypoints.size());
    dim = static_cast<int>(frame.features->descriptors.size() / frame.features->keypoints.size());
  }
  std::vector<std::unique_ptr<Worker>> workers(Workers(jobs));
  for (auto& worker : workers) {
    worker = std::make_unique<Worker>(static_cast<int>(max_features), dim);
  }
  const CachedVerifier verifier(input, options, cache);
  std::vector<VerifiedPair> verified(pairs.size());
  const auto verify = [&](int i, int worker) {
    verified[i] = verifier.Verify(pairs[i], *workers[worker]);
  };
  ParallelForWorkers(static_cast<int>(pairs.size()), jobs, verify, progress);
  std::erase_if(verified, [](const VerifiedPair& pair) { return pair.matches.empty(); });
  return verified;
}

}  // namespace viewfix
