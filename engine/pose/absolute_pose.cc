// SPDX-License-Identifier: BSD-3-Clause
#include "engine/pose/absolute_pose.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>
#include <vector>

#include "engine/pose/p3p.h"
#include "engine/pose/reprojection.h"

namespace viewfix {
namespace {

using Eigen::Vector3d;

constexpr int kSampleSize = 3;
constexpr int kMaxCapacity = 65536;
// Local optimization: rounds, steps each, and how much wider its first net is, squared.
constexpr int kLocalRounds = 2;
constexpr int kLocalSteps = 3;
constexpr double kWideNet = 4;
constexpr int kFinalRounds = 3;
// The sequential test gives up a pose once it is this much likelier to be wrong than right:
// it loses one good pose in a hundred and looks at some hundred matches of a bad one.
constexpr double kGiveUpRatio = 100;
constexpr double kLeastRatio = 1e-200;
// What it believes before it has seen a pose. Below 0.06, 7 % inliers are found more often,
// and frames without a pose take in proportion longer.
constexpr double kFirstInlierShare = 0.06;
constexpr double kFirstChanceShare = 0.012;

// splitmix64: small, fast, the same everywhere.
class Random {
 public:
  explicit Random(std::uint64_t seed) : state_(seed) {}
  // Uniform in 0..n-1, n < 2^32.
  int Below(int n) {
    state_ += 0x9E3779B97F4A7C15U;
    std::uint64_t z = state_;
    z = (z ^ (z >> 30)) * 0xBF58476D1CE4E5B9U;
    z = (z ^ (z >> 27)) * 0x94D049BB133111EBU;
    z ^= z >> 31;
    return static_cast<int>(((z >> 32) * static_cast<std::uint64_t>(n)) >> 32);
  }

 private:
  std::uint64_t state_;
};

using Sample = std::array<int, kSampleSize>;

Sample DrawUniform(Random& random, int n) {
  Sample sample{};
  for (int i = 0; i < kSampleSize;) {
    sample[i] = random.Below(n);
    if (std::find(sample.begin(), sample.begin() + i, sample[i]) == sample.begin() + i) ++i;
  }
  return sample;
}

// PROSAC, [2]: draws from the first matches, whose number grows so that after `horizon` draws
// all have been drawn from as often as by uniform sampling.
class TrustingSampler {
 public:
  TrustingSampler(int num_matches, int horizon) : num_matches_(num_matches) {
    expected_ = horizon;
    for (int i = 0; i < kSampleSize; ++i) {
      expected_ *= static_cast<double>(kSampleSize - i) / (num_matches - i);
    }
  }

  Sample Draw(Random& random) {
    ++draws_;
    if (draws_ > growth_at_ && size_ < num_matches_) {
      const double next = expected_ * (size_ + 1) / (size_ + 1 - kSampleSize);
      growth_at_ += std::max(1, static_cast<int>(next - expected_ + 0.999999));
      expected_ = next;
      ++size_;
    }
    if (size_ == num_matches_ || size_ == kSampleSize) return DrawUniform(random, size_);
    // The newest match with two before it.
    Sample sample = DrawUniform(random, size_ - 1);
    sample[0] = size_ - 1;
    return sample;
  }

 private:
  int num_matches_;
  int size_ = kSampleSize;
  int draws_ = 0;
  int growth_at_ = 1;
  double expected_;
};

double Power(double base, int exponent) {
  double result = 1;
  for (; exponent > 0; exponent >>= 1) {
    if (exponent & 1) result *= base;
    base *= base;
  }
  return result;
}

// A match made ready for scoring: a point that a pose puts at d in the camera is off by
// by_ray * d / (bearing . d) sigmas, to first order about the key point's ray.
struct ScoredMatch {
  Vector3d point_in_world;
  Vector3d bearing;
  Eigen::Matrix<double, 2, 3> by_ray;
  int match_idx;
};

// A hypothesis in the form that scoring reads.
struct Hypothesis {
  explicit Hypothesis(const Rigid3& cam_from_world)
      : rotation(cam_from_world.rotation.toRotationMatrix()),
        translation(cam_from_world.translation) {}
  Eigen::Matrix3d rotation;
  Vector3d translation;
};

// Squared error in sigma^2; huge behind the camera.
double SquaredError(const ScoredMatch& match, const Hypothesis& pose) {
  const Vector3d d = pose.rotation * match.point_in_world + pose.translation;
  const double depth = match.bearing.dot(d);
  if (!(depth > 0)) return 1e30;
  return (match.by_ray * d).squaredNorm() / (depth * depth);
}

}  // namespace

struct AbsolutePoseEstimator::State {
  explicit State(const AbsolutePoseOptions& o)
      : options(o),
        scored(o.capacity),
        place(o.capacity),
        mask(o.capacity),
        local_options(o.refiner) {
    local_options.max_iterations = std::min(kLocalSteps, o.refiner.max_iterations);
    local_options.refine_focal = false;
  }

  AbsolutePose Estimate();
  void Prepare();
  void Shuffle(Random& random);
  bool IsSettled(int uniform_draws) const;
  void TrySample(const Sample& sample);
  double ScoreWithTest(const Hypothesis& pose);
  double ScoreAll(const Rigid3& cam_from_world, double max_squared, int* num_inliers) const;
  void SelectInliers(const Rigid3& cam_from_world, double max_squared);
  void OptimizeLocally(Rigid3 cam_from_world);
  void Keep(const Rigid3& cam_from_world, double score, int num_inliers);
  AbsolutePose Finish();
  int SelectExactInliers(const RefinedPose& pose, double& score);

  double max_squared() const { return options.max_error_sigma * options.max_error_sigma; }

  AbsolutePoseOptions options;
  Camera camera;
  std::span<const PoseMatch> matches;
  // Those of the matches that can be scored, shuffled: the sequential test wants no order.
  std::vector<ScoredMatch> scored;
  int num_scored = 0;
  std::vector<int> place;  // rank among the usable matches -> index into `scored`
  std::vector<std::uint8_t> mask;
  PoseRefinerOptions local_options;

  Rigid3 best;
  double best_score = 0;
  int best_inliers = 0;
  // Shares that the sequential test believes in: inliers of a right pose, chance inliers of a
  // wrong one, measured on those given up.
  double inlier_share = 0;
  double chance_share = 0;
  std::int64_t given_up_seen = 0;
  std::int64_t given_up_inliers = 0;
};

void AbsolutePoseEstimator::State::Prepare() {
  num_scored = 0;
  for (std::size_t i = 0; i < matches.size(); ++i) {
    const PoseMatch& match = matches[i];
    ScoredMatch& ready = scored[num_scored];
    Eigen::Vector2d pixel;
    const bool usable = match.sigma_px > 0 && match.sigma_px < 1e15 &&
                        match.point_in_world.allFinite() &&
                        camera.Unproject(match.pixel, ready.bearing) &&
                        camera.Project(ready.bearing, pixel, &ready.by_ray);
    if (!usable) continue;
    ready.by_ray /= match.sigma_px;
    ready.point_in_world = match.point_in_world;
    ready.match_idx = static_cast<int>(i);
    ++num_scored;
  }
}

void AbsolutePoseEstimator::State::Shuffle(Random& random) {
  for (int i = num_scored - 1; i > 0; --i) std::swap(scored[i], scored[random.Below(i + 1)]);
  for (int i = 0; i < num_scored; ++i) place[i] = i;
  std::sort(place.begin(), place.begin() + num_scored,
            [this](int a, int b) { return scored[a].match_idx < scored[b].match_idx; });
}

// Whether enough uniform samples have been drawn for the inliers found.
bool AbsolutePoseEstimator::State::IsSettled(int uniform_draws) const {
  const double share = static_cast<double>(best_inliers) / num_scored;
  const double failure = Power(1 - share * share * share, uniform_draws);
  return failure < options.max_failure_probability;
}

// MSAC score of a pose, or -1 once it is too unlikely to be right or cannot be the best.
double AbsolutePoseEstimator::State::ScoreWithTest(const Hypothesis& pose) {
  const double limit = max_squared();
  const double inverse_limit = 1 / limit;
  const double inlier_factor = chance_share / inlier_share;
  const double outlier_factor = (1 - chance_share) / (1 - inlier_share);
  double ratio = 1;
  double score = 0;
  int inliers = 0;
  for (int i = 0; i < num_scored; ++i) {
    const double squared = SquaredError(scored[i], pose);
    if (squared < limit) {
      score += 1 - squared * inverse_limit;
      ++inliers;
      ratio = std::max(ratio * inlier_factor, kLeastRatio);
    } else {
      ratio *= outlier_factor;
    }
    if (ratio > kGiveUpRatio || score + (num_scored - 1 - i) <= best_score) {
      given_up_seen += i + 1;
      given_up_inliers += inliers;
      return -1;
    }
  }
  return score;
}

double AbsolutePoseEstimator::State::ScoreAll(const Rigid3& cam_from_world, double limit,
                                              int* num_inliers) const {
  const Hypothesis pose(cam_from_world);
  double score = 0;
  int inliers = 0;
  for (int i = 0; i < num_scored; ++i) {
    const double squared = SquaredError(scored[i], pose);
    if (!(squared < limit)) continue;
    score += 1 - squared / limit;
    ++inliers;
  }
  *num_inliers = inliers;
  return score;
}

void AbsolutePoseEstimator::State::SelectInliers(const Rigid3& cam_from_world, double limit) {
  std::fill_n(mask.begin(), matches.size(), std::uint8_t{0});
  const Hypothesis pose(cam_from_world);
  for (int i = 0; i < num_scored; ++i) {
    if (SquaredError(scored[i], pose) < limit) mask[scored[i].match_idx] = 1;
  }
}

void AbsolutePoseEstimator::State::Keep(const Rigid3& cam_from_world, double score,
                                        int num_inliers) {
  best = cam_from_world;
  best_score = score;
  best_inliers = num_inliers;
  const double share = static_cast<double>(num_inliers) / num_scored;
  inlier_share = std::clamp(share, 0.02, 0.95);
}

void AbsolutePoseEstimator::State::OptimizeLocally(Rigid3 pose) {
  for (int round = 0; round < kLocalRounds; ++round) {
    SelectInliers(pose, max_squared() * (round == 0 ? kWideNet : 1));
    const RefinedPose refined =
        RefinePose(camera, matches, std::span(mask).first(matches.size()), pose, local_options);
    if (!refined.found) return;
    pose = refined.cam_from_world;
    int inliers = 0;
    const double score = ScoreAll(pose, max_squared(), &inliers);
    if (score > best_score) Keep(pose, score, inliers);
  }
}

void AbsolutePoseEstimator::State::TrySample(const Sample& sample) {
  std::array<Vector3d, kSampleSize> bearings, points;
  for (int i = 0; i < kSampleSize; ++i) {
    const ScoredMatch& match = scored[place[sample[i]]];
    bearings[i] = match.bearing;
    points[i] = match.point_in_world;
  }
  std::array<Rigid3, kMaxP3pSolutions> solutions;
  const int count = SolveP3p(bearings, points, solutions);
  for (int i = 0; i < count; ++i) {
    const double score = ScoreWithTest(Hypothesis(solutions[i]));
    if (score <= best_score) continue;
    int inliers = 0;
    ScoreAll(solutions[i], max_squared(), &inliers);
    Keep(solutions[i], score, inliers);
    OptimizeLocally(solutions[i]);
  }
  if (given_up_seen > 1000) {
    const double share = static_cast<double>(given_up_inliers) / static_cast<double>(given_up_seen);
    chance_share = std::clamp(share, 0.002, 0.5 * inlier_share);
  }
  chance_share = std::min(chance_share, 0.5 * inlier_share);
}

// Inliers by the exact camera model, into `mask`.
int AbsolutePoseEstimator::State::SelectExactInliers(const RefinedPose& pose, double& score) {
  const CameraState state = CameraState::From(pose.cam_from_world, pose.focal_factor);
  const Eigen::Matrix3d rotation = pose.cam_from_world.rotation.toRotationMatrix();
  int inliers = 0;
  score = 0;
  for (std::size_t i = 0; i < matches.size(); ++i) {
    Eigen::Vector2d residual = Eigen::Vector2d::Zero();
    mask[i] = 0;
    if (!Reproject<6>(camera, state, rotation, matches[i], residual, nullptr)) continue;
    const double squared = residual.squaredNorm();
    if (!(squared < max_squared())) continue;
    mask[i] = 1;
    score += 1 - squared / max_squared();
    ++inliers;
  }
  return inliers;
}

AbsolutePose AbsolutePoseEstimator::State::Finish() {
  AbsolutePose result;
  SelectInliers(best, max_squared());
  result.pose.cam_from_world = best;
  for (int round = 0; round < kFinalRounds; ++round) {
    result.pose = RefinePose(camera, matches, std::span(mask).first(matches.size()),
                             result.pose.cam_from_world, options.refiner);
    if (!result.pose.found) break;
    result.num_inliers = SelectExactInliers(result.pose, result.score);
  }
  result.found = result.pose.found && result.num_inliers >= options.min_inliers;
  result.pose.found = result.found;
  return result;
}

AbsolutePose AbsolutePoseEstimator::State::Estimate() {
  Prepare();
  std::fill_n(mask.begin(), matches.size(), std::uint8_t{0});
  if (num_scored < std::max(kSampleSize + 1, options.min_inliers)) return {};

  Random random(options.seed);
  Shuffle(random);
  best_score = 0;
  best_inliers = 0;
  inlier_share = kFirstInlierShare;
  chance_share = kFirstChanceShare;
  given_up_seen = 0;
  given_up_inliers = 0;
  TrustingSampler trusting(num_scored, options.max_iterations / 2);
  int iteration = 0;
  while (iteration < options.max_iterations) {
    const bool uniform = iteration % 2 == 1;
    TrySample(uniform ? DrawUniform(random, num_scored) : trusting.Draw(random));
    ++iteration;
    if (iteration >= options.min_iterations && IsSettled(iteration / 2)) break;
  }
  AbsolutePose result;
  if (best_inliers > kSampleSize) result = Finish();
  result.num_iterations = iteration;
  if (!result.found) std::fill_n(mask.begin(), matches.size(), std::uint8_t{0});
  return result;
}

Status AbsolutePoseOptions::Validate() const {
  const auto bad = [](const char* text) { return Status(StatusCode::kInvalidArgument, text); };
  if (capacity < kSampleSize || capacity > kMaxCapacity) return bad("capacity is not 3..65536");
  if (!(max_error_sigma > 0) || !(max_error_sigma < 1e6)) return bad("max_error_sigma is not > 0");
  if (min_inliers <= kSampleSize) return bad("min_inliers is below 4");
  if (min_iterations < 1 || max_iterations < min_iterations || max_iterations > 10'000'000) {
    return bad("iterations are not 1 <= min <= max <= 10^7");
  }
  if (!(max_failure_probability > 0) || !(max_failure_probability < 1)) {
    return bad("max_failure_probability is not between 0 and 1");
  }
  return refiner.Validate();
}

AbsolutePoseEstimator::AbsolutePoseEstimator(std::unique_ptr<State> state)
    : state_(std::move(state)) {}
AbsolutePoseEstimator::AbsolutePoseEstimator(AbsolutePoseEstimator&&) noexcept = default;
AbsolutePoseEstimator& AbsolutePoseEstimator::operator=(AbsolutePoseEstimator&&) noexcept = default;
AbsolutePoseEstimator::~AbsolutePoseEstimator() = default;

Result<AbsolutePoseEstimator> AbsolutePoseEstimator::Create(const AbsolutePoseOptions& options) {
  if (const Status status = options.Validate(); !status.ok()) return status;
  return AbsolutePoseEstimator(std::make_unique<State>(options));
}

AbsolutePose AbsolutePoseEstimator::Estimate(const Camera& camera,
                                             std::span<const PoseMatch> matches) {
  state_->camera = camera;
  state_->matches = matches.first(std::min(matches.size(), state_->scored.size()));
  return state_->Estimate();
}

std::span<const std::uint8_t> AbsolutePoseEstimator::inliers() const {
  return std::span(state_->mask).first(state_->matches.size());
}

}  // namespace viewfix
