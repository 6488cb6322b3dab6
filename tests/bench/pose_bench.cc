// SPDX-License-Identifier: BSD-3-Clause
// Time of a frame's pose from 2D-3D matches, beside OpenCV's:
// pose/viewfix/MATCHESxPERCENT_TRUE and pose/opencv_solvepnpransac/... on the same problems.
// The counter `solved` is the share of frames within 10 cm and 0.03 rad of the truth. Then the
// adjustment of one pose: adjust/viewfix/MATCHES and adjust/ceres/... from the same start, with the
// share of poses that end within 1 mm and 1 mrad of Ceres' exact minimum.
#include <benchmark/benchmark.h>

#include <opencv2/calib3d.hpp>
#include <string>

#include "engine/pose/absolute_pose.h"
#include "tests/engine/pose/ceres_pose.h"
#include "tests/engine/pose/pose_problem.h"

namespace viewfix {
namespace {

constexpr int kFrames = 50;
constexpr double kMaxErrorPx = 5;

std::vector<PoseProblem> Frames(int num_matches, int percent_true) {
  const Camera camera{CameraModel::kPinhole, 640, 480, 520, 520, 319.5, 239.5, {}};
  std::mt19937 random(1);
  std::vector<PoseProblem> frames;
  const PoseProblemOptions options{.num_matches = num_matches, .share_true = percent_true / 100.0};
  for (int i = 0; i < kFrames; ++i) frames.push_back(MakePoseProblem(camera, options, random));
  return frames;
}

bool IsSolved(const Rigid3& pose, const PoseProblem& frame) {
  const auto error = PoseError(pose, frame.cam_from_world);
  return error.head<3>().norm() < 0.1 && error.tail<3>().norm() < 0.03;
}

template <typename Solve>
void Run(benchmark::State& state, int num_matches, int percent_true, const Solve& solve) {
  const std::vector<PoseProblem> frames = Frames(num_matches, percent_true);
  int solved = 0;
  int total = 0;
  for ([[maybe_unused]] auto _ : state) {
    Rigid3 pose;
    const PoseProblem& frame = frames[total++ % kFrames];
    solved += solve(frame, pose) && IsSolved(pose, frame);
  }
  state.counters["solved"] = static_cast<double>(solved) / total;
}

void BM_Viewfix(benchmark::State& state, int num_matches, int percent_true) {
  auto estimator = AbsolutePoseEstimator::Create({});
  Run(state, num_matches, percent_true, [&](const PoseProblem& frame, Rigid3& pose) {
    const AbsolutePose found = estimator->Estimate(frame.camera, frame.matches);
    pose = found.pose.cam_from_world;
    return found.found;
  });
}

void BM_OpenCv(benchmark::State& state, int num_matches, int percent_true) {
  Run(state, num_matches, percent_true, [](const PoseProblem& frame, Rigid3& pose) {
    std::vector<cv::Point3d> points;
    std::vector<cv::Point2d> pixels;
    for (const PoseMatch& match : frame.matches) {
      points.emplace_back(match.point_in_world.x(), match.point_in_world.y(),
                          match.point_in_world.z());
      pixels.emplace_back(match.pixel.x(), match.pixel.y());
    }
    const Camera& c = frame.camera;
    cv::Mat k = (cv::Mat_<double>(3, 3) << c.fx, 0, c.cx, 0, c.fy, c.cy, 0, 0, 1);
    cv::Mat rotation, translation, inliers, matrix;
    cv::UsacParams params;
    params.threshold = kMaxErrorPx;
    params.confidence = 0.999;
    params.maxIterations = 20000;
    params.sampler = cv::SAMPLING_UNIFORM;
    params.score = cv::SCORE_METHOD_MSAC;
    params.loMethod = cv::LOCAL_OPTIM_INNER_LO;
    if (!cv::solvePnPRansac(points, pixels, k, cv::noArray(), rotation, translation, inliers,
                            params)) {
      return false;
    }
    cv::Rodrigues(rotation, matrix);
    Eigen::Matrix3d r;
    for (int i = 0; i < 9; ++i) r(i / 3, i % 3) = matrix.at<double>(i / 3, i % 3);
    pose.rotation = Eigen::Quaterniond(r);
    for (int i = 0; i < 3; ++i) pose.translation[i] = translation.at<double>(i);
    return true;
  });
}

// Solve: (problem, start) to a pose.
template <typename Solve>
void Adjust(benchmark::State& state, int num_matches, const Solve& solve) {
  const std::vector<PoseProblem> frames = Frames(num_matches, 90);
  std::mt19937 random(2);
  std::vector<Rigid3> starts, minima;
  for (const PoseProblem& frame : frames) {
    starts.push_back(Disturbed(frame.cam_from_world, 0.05, 0.01, random));
    minima.push_back(SolveWithCeres(frame, starts.back(), {}, 1e-14).cam_from_world);
  }
  int solved = 0;
  int total = 0;
  for ([[maybe_unused]] auto _ : state) {
    const int i = total++ % kFrames;
    solved += PoseError(solve(frames[i], starts[i]), minima[i]).norm() < 1e-3;
  }
  state.counters["solved"] = static_cast<double>(solved) / total;
}

void BM_AdjustViewfix(benchmark::State& state, int num_matches) {
  Adjust(state, num_matches, [](const PoseProblem& frame, const Rigid3& start) {
    return RefinePose(frame.camera, frame.matches, {}, start, {}).cam_from_world;
  });
}

void BM_AdjustCeres(benchmark::State& state, int num_matches) {
  const double tolerance = ceres::Solver::Options().function_tolerance;
  Adjust(state, num_matches, [tolerance](const PoseProblem& frame, const Rigid3& start) {
    return SolveWithCeres(frame, start, {}, tolerance).cam_from_world;
  });
}

const int kRegistered = [] {
  for (const auto& [matches, percent] :
       {std::pair(150, 70), std::pair(600, 70), std::pair(600, 30), std::pair(600, 15)}) {
    const std::string problem = std::to_string(matches) + "x" + std::to_string(percent);
    benchmark::RegisterBenchmark(("pose/viewfix/" + problem).c_str(), BM_Viewfix, matches, percent)
        ->Unit(benchmark::kMillisecond);
    benchmark::RegisterBenchmark(("pose/opencv_solvepnpransac/" + problem).c_str(), BM_OpenCv,
                                 matches, percent)
        ->Unit(benchmark::kMillisecond);
  }
  for (const int matches : {50, 150, 600}) {
    const std::string problem = std::to_string(matches);
    benchmark::RegisterBenchmark(("adjust/viewfix/" + problem).c_str(), BM_AdjustViewfix, matches)
        ->Unit(benchmark::kMillisecond);
    benchmark::RegisterBenchmark(("adjust/ceres/" + problem).c_str(), BM_AdjustCeres, matches)
        ->Unit(benchmark::kMillisecond);
  }
  return 0;
}();

}  // namespace
}  // namespace viewfix

BENCHMARK_MAIN();
