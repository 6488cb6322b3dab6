// SPDX-License-Identifier: BSD-3-Clause
#include "engine/pose/window_adjuster.h"

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include "engine/pose/reprojection.h"

namespace viewfix {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;
using Vector6d = Eigen::Matrix<double, 6, 1>;
using Matrix6d = Eigen::Matrix<double, 6, 6>;

constexpr int kFrameSize = 6;
constexpr int kMaxSize = WindowAdjuster::kMaxFrames * kFrameSize;
// Three frames in a row share a term.
constexpr int kBand = 3 * kFrameSize;
constexpr int kMinMatches = 3;
constexpr double kFirstDamping = 1e-4;
constexpr double kMaxDamping = 1e8;
constexpr double kConverged = 1e-6;  // of the cost, in sigma^2

// A symmetric matrix whose elements lie within kBand of the diagonal, and its Cholesky factor.
class BandedSystem {
 public:
  explicit BandedSystem(int size) : size_(size) {
    for (int i = 0; i < size; ++i) rows_[i].fill(0);
    gradient.setZero();
  }

  // Element (row, col), col <= row < col + kBand.
  double& At(int row, int col) { return rows_[row][row - col]; }
  double At(int row, int col) const { return rows_[row][row - col]; }

  // Adds a block's lower triangle, its first row and column at `at`.
  template <int N>
  void Add(int at, const Eigen::Matrix<double, N, N>& block) {
    for (int row = 0; row < N; ++row) {
      for (int col = 0; col <= row; ++col) At(at + row, at + col) += block(row, col);
    }
  }

  void Damp(double factor) {
    for (int i = 0; i < size_; ++i) rows_[i][0] *= 1 + factor;
  }

  // Replaces the matrix by L of L L'. False: not positive definite.
  bool Factorize() {
    for (int row = 0; row < size_; ++row) {
      const int first = std::max(0, row - kBand + 1);
      for (int col = first; col <= row; ++col) {
        double sum = At(row, col);
        for (int k = std::max(first, col - kBand + 1); k < col; ++k) sum -= At(row, k) * At(col, k);
        if (row != col) {
          At(row, col) = sum / At(col, col);
        } else if (sum > 1e-13 * At(row, row)) {
          At(row, row) = std::sqrt(sum);
        } else {
          return false;
        }
      }
    }
    return true;
  }

  // Of the factor: the solution x of L L' x = b, in place.
  template <typename Vector>
  void Solve(Vector& b) const {
    for (int row = 0; row < size_; ++row) {
      for (int k = std::max(0, row - kBand + 1); k < row; ++k) b[row] -= At(row, k) * b[k];
      b[row] /= At(row, row);
    }
    for (int row = size_ - 1; row >= 0; --row) {
      for (int k = row + 1; k < std::min(size_, row + kBand); ++k) b[row] -= At(k, row) * b[k];
      b[row] /= At(row, row);
    }
  }

  int size() const { return size_; }
  Eigen::Matrix<double, kMaxSize, 1> gradient;

 private:
  int size_;
  std::array<std::array<double, kBand>, kMaxSize> rows_;
};

Matrix3d Skew(const Vector3d& v) {
  Matrix3d m;
  m << 0, -v.z(), v.y(), v.z(), 0, -v.x(), -v.y(), v.x(), 0;
  return m;
}

// The rotation from one frame to the next as twice its Rodrigues vector, which is the rotation
// vector to second order: v = 2 xyz / w. Jacobians by left rotation vectors of both.
struct Turn {
  Turn(const Eigen::Quaterniond& from, const Eigen::Quaterniond& to) {
    const Eigen::Quaterniond q = to * from.conjugate();
    // Half a turn between two frames is no motion to go on with: kept finite.
    const double w = std::abs(q.w()) > 1e-3 ? q.w() : 1e-3;
    const Vector3d a = q.vec() / w;
    v = 2 * a;
    const Matrix3d symmetric = Matrix3d::Identity() + a * a.transpose();
    by_to = symmetric - Skew(a);
    by_from = -(symmetric + Skew(a));
  }
  Vector3d v;
  Matrix3d by_from, by_to;
};

// What departs from steady motion over three frames, in sigmas: centres, then rotations.
struct MotionTerm {
  Vector6d residual;
  Eigen::Matrix<double, 6, kBand> jacobian;
};

}  // namespace

struct WindowAdjuster::State {
  struct Frame {
    double time_s = 0;
    Camera camera;
    std::vector<PoseMatch> matches;
    int num_matches = 0;
    CameraState pose;

    std::span<const PoseMatch> used() const { return std::span(matches).first(num_matches); }
  };
  using Poses = std::array<CameraState, kMaxFrames>;

  explicit State(const WindowAdjusterOptions& o) : options(o) {
    for (int i = 0; i < o.max_frames; ++i) frames[i].matches.resize(o.capacity);
  }

  void Append(double time_s, const Camera& camera, std::span<const PoseMatch> matches,
              const Rigid3& cam_from_world);
  MotionTerm Motion(const Poses& poses, int last) const;
  double CostOf(const Poses& poses) const;
  double Build(const Poses& poses, BandedSystem& system) const;
  Poses Moved(const Poses& poses, const BandedSystem& damped) const;
  bool Adjust();
  bool CovarianceOfLast(Matrix6d& covariance) const;

  Poses poses() const {
    Poses all;
    for (int i = 0; i < count; ++i) all[i] = frames[i].pose;
    return all;
  }

  WindowAdjusterOptions options;
  std::array<Frame, kMaxFrames> frames;  // oldest first
  int count = 0;
};

void WindowAdjuster::State::Append(double time_s, const Camera& camera,
                                   std::span<const PoseMatch> matches,
                                   const Rigid3& cam_from_world) {
  if (count > 0) {
    const double gap_s = time_s - frames[count - 1].time_s;
    if (!(gap_s > 0) || !(gap_s <= options.max_gap_s)) count = 0;
  }
  if (count == options.max_frames) {
    // The oldest frame's memory serves the newest.
    std::rotate(frames.begin(), frames.begin() + 1, frames.begin() + count);
    --count;
  }
  Frame& frame = frames[count++];
  frame.time_s = time_s;
  frame.camera = camera;
  frame.num_matches = static_cast<int>(std::min(matches.size(), frame.matches.size()));
  std::copy_n(matches.begin(), frame.num_matches, frame.matches.begin());
  frame.pose = CameraState::From(cam_from_world);
}

// Of the frames last - 2, last - 1 and last.
MotionTerm WindowAdjuster::State::Motion(const Poses& poses, int last) const {
  const CameraState &p1 = poses[last - 2], &p2 = poses[last - 1], &p3 = poses[last];
  const double t21 = frames[last - 1].time_s - frames[last - 2].time_s;
  const double t32 = frames[last].time_s - frames[last - 1].time_s;
  const double pace = t32 / t21;
  const double time_squared = 0.5 * t32 * (t32 + t21);
  const double weight = 1 / (options.acceleration_sigma * time_squared);
  const double turn_weight = 1 / (options.angular_acceleration_sigma * time_squared);
  const Turn before(p1.world_from_cam, p2.world_from_cam);
  const Turn after(p2.world_from_cam, p3.world_from_cam);

  MotionTerm term;
  term.residual << weight * ((p3.centre_in_world - p2.centre_in_world) -
                             pace * (p2.centre_in_world - p1.centre_in_world)),
      turn_weight * (after.v - pace * before.v);
  term.jacobian.setZero();
  term.jacobian.block<3, 3>(0, 0) = pace * weight * Matrix3d::Identity();
  term.jacobian.block<3, 3>(0, 6) = -(1 + pace) * weight * Matrix3d::Identity();
  term.jacobian.block<3, 3>(0, 12) = weight * Matrix3d::Identity();
  term.jacobian.block<3, 3>(3, 3) = -pace * turn_weight * before.by_from;
  term.jacobian.block<3, 3>(3, 9) = turn_weight * (after.by_from - pace * before.by_to);
  term.jacobian.block<3, 3>(3, 15) = turn_weight * after.by_to;
  return term;
}

double WindowAdjuster::State::CostOf(const Poses& poses) const {
  double cost = 0;
  for (int i = 0; i < count; ++i) {
    const Frame& frame = frames[i];
    cost += ReprojectionCost(frame.camera, poses[i], frame.used(), {}, options.huber_sigma);
    if (i >= 2) cost += Motion(poses, i).residual.squaredNorm();
  }
  return cost;
}

// The normal equations about the poses; returns their cost.
double WindowAdjuster::State::Build(const Poses& poses, BandedSystem& system) const {
  double cost = 0;
  for (int i = 0; i < count; ++i) {
    const Frame& frame = frames[i];
    const auto sum = BuildNormalEquations<kFrameSize>(frame.camera, poses[i], frame.used(), {},
                                                      options.huber_sigma);
    cost += sum.cost;
    system.Add<kFrameSize>(i * kFrameSize, sum.information);
    system.gradient.segment<kFrameSize>(i * kFrameSize) += sum.gradient;
    if (i < 2) continue;
    const MotionTerm term = Motion(poses, i);
    const int at = (i - 2) * kFrameSize;
    cost += term.residual.squaredNorm();
    const auto transposed = term.jacobian.transpose();
    system.Add<kBand>(at, transposed.lazyProduct(term.jacobian));
    system.gradient.segment<kBand>(at) += transposed.lazyProduct(term.residual);
  }
  return cost;
}

// The poses after the step that the factorized system says.
WindowAdjuster::State::Poses WindowAdjuster::State::Moved(const Poses& poses,
                                                          const BandedSystem& damped) const {
  auto step = damped.gradient;
  damped.Solve(step);
  Poses moved = poses;
  for (int i = 0; i < count; ++i) {
    moved[i] = poses[i].MovedBy(-step.segment<kFrameSize>(i * kFrameSize));
  }
  return moved;
}

bool WindowAdjuster::State::Adjust() {
  Poses current = poses();
  double damping = kFirstDamping;
  for (int i = 0; i < options.max_iterations; ++i) {
    BandedSystem system(count * kFrameSize);
    const double cost = Build(current, system);
    if (!std::isfinite(cost)) return false;
    bool improved = false;
    double gain = 0;
    for (; !improved && damping < kMaxDamping; damping *= improved ? 0.1 : 10) {
      BandedSystem damped = system;
      damped.Damp(damping);
      if (!damped.Factorize()) continue;
      const Poses moved = Moved(current, damped);
      gain = cost - CostOf(moved);
      improved = gain >= 0;
      if (improved) current = moved;
    }
    if (!improved || gain < kConverged) break;
  }
  for (int i = 0; i < count; ++i) frames[i].pose = current[i];
  return true;
}

bool WindowAdjuster::State::CovarianceOfLast(Matrix6d& covariance) const {
  BandedSystem system(count * kFrameSize);
  Build(poses(), system);
  if (!system.Factorize()) return false;
  const int at = system.size() - kFrameSize;
  for (int col = 0; col < kFrameSize; ++col) {
    Eigen::Matrix<double, kMaxSize, 1> unit = Eigen::Matrix<double, kMaxSize, 1>::Zero();
    unit[at + col] = 1;
    system.Solve(unit);
    covariance.col(col) = unit.segment<kFrameSize>(at);
  }
  covariance = (0.5 * (covariance + covariance.transpose())).eval();
  return covariance.allFinite();
}

Status WindowAdjusterOptions::Validate() const {
  const auto bad = [](const char* text) { return Status(StatusCode::kInvalidArgument, text); };
  if (max_frames < 3 || max_frames > WindowAdjuster::kMaxFrames)
    return bad("max_frames is not 3..8");
  if (capacity < kMinMatches || capacity > 65536) return bad("capacity is not 3..65536");
  if (!(acceleration_sigma > 0) || !(angular_acceleration_sigma > 0) || !(huber_sigma > 0)) {
    return bad("a sigma of the window is not positive");
  }
  if (!(max_gap_s > 0)) return bad("max_gap_s is not positive");
  if (max_iterations < 1 || max_iterations > 100) return bad("max_iterations is not 1..100");
  return {};
}

WindowAdjuster::WindowAdjuster(std::unique_ptr<State> state) : state_(std::move(state)) {}
WindowAdjuster::WindowAdjuster(WindowAdjuster&&) noexcept = default;
WindowAdjuster& WindowAdjuster::operator=(WindowAdjuster&&) noexcept = default;
WindowAdjuster::~WindowAdjuster() = default;

Result<WindowAdjuster> WindowAdjuster::Create(const WindowAdjusterOptions& options) {
  if (const Status status = options.Validate(); !status.ok()) return status;
  return WindowAdjuster(std::make_unique<State>(options));
}

AdjustedPose WindowAdjuster::Push(double time_s, const Camera& camera,
                                  std::span<const PoseMatch> matches,
                                  const Rigid3& cam_from_world) {
  State& state = *state_;
  state.Append(time_s, camera, matches, cam_from_world);
  const State::Frame& last = state.frames[state.count - 1];
  const auto seen = BuildNormalEquations<kFrameSize>(camera, last.pose, last.used(), {},
                                                     state.options.huber_sigma);
  AdjustedPose adjusted;
  adjusted.found = std::isfinite(time_s) && seen.num_seen >= kMinMatches && state.Adjust() &&
                   state.CovarianceOfLast(adjusted.covariance);
  if (!adjusted.found) {
    Clear();
    return {};
  }
  adjusted.cam_from_world = last.pose.cam_from_world();
  return adjusted;
}

void WindowAdjuster::Clear() { state_->count = 0; }

int WindowAdjuster::num_frames() const { return state_->count; }

Rigid3 WindowAdjuster::cam_from_world(int frame_idx) const {
  return state_->frames[frame_idx].pose.cam_from_world();
}

}  // namespace viewfix
