// SPDX-License-Identifier: BSD-3-Clause
#include "firmware_tools/experiment/spectral.h"

#include <Eigen/Eigenvalues>
#include <Eigen/QR>
#include <Eigen/SVD>
#include <algorithm>
#include <cmath>
#include <functional>
#include <vector>

namespace viewfix {
namespace {

struct ThinSvd {
  Eigen::MatrixXd u;
  Eigen::VectorXd s;
  Eigen::MatrixXd v;
};

// Of a tall matrix by way of its triangular factor: a weight matrix has many rows, few columns.
ThinSvd Decompose(const Eigen::MatrixXd& x) {
  if (x.rows() <= x.cols()) {
    const Eigen::JacobiSVD<Eigen::MatrixXd> svd(x, Eigen::ComputeThinU | Eigen::ComputeThinV);
    return {svd.matrixU(), svd.singularValues(), svd.matrixV()};
  }
  const Eigen::HouseholderQR<Eigen::MatrixXd> qr(x);
  const Eigen::MatrixXd r = qr.matrixQR().topRows(x.cols()).triangularView<Eigen::Upper>();
  const Eigen::JacobiSVD<Eigen::MatrixXd> svd(r, Eigen::ComputeThinU | Eigen::ComputeThinV);
  Eigen::MatrixXd u = Eigen::MatrixXd::Zero(x.rows(), x.cols());
  u.topRows(x.cols()) = svd.matrixU();
  u.applyOnTheLeft(qr.householderQ());
  return {u, svd.singularValues(), svd.matrixV()};
}

Eigen::VectorXd Spend(const Eigen::VectorXd& s, double eta, double inverse_nu) {
  return (s.array() * inverse_nu - eta).max(0.0).min(1.0);
}

}  // namespace

void SoftThreshold(double threshold, Eigen::Ref<Eigen::MatrixXd> x) {
  x = (x.array().sign() * (x.array().abs() - threshold).max(0.0)).matrix();
}

Eigen::VectorXd ProjectToSimplex(const Eigen::VectorXd& x, double radius) {
  if (x.sum() <= radius) return x;
  std::vector<double> sorted(x.data(), x.data() + x.size());
  std::sort(sorted.begin(), sorted.end(), std::greater<>());
  double sum = 0;
  double threshold = 0;
  for (std::size_t i = 0; i < sorted.size(); ++i) {
    sum += sorted[i];
    const double candidate = (sum - radius) / static_cast<double>(i + 1);
    if (candidate > sorted[i]) break;
    threshold = candidate;
  }
  return (x.array() - threshold).max(0.0);
}

Eigen::MatrixXd ProjectToTraceBall(const Eigen::MatrixXd& x, double radius) {
  const ThinSvd svd = Decompose(x);
  if (svd.s.sum() <= radius) return x;
  return svd.u * ProjectToSimplex(svd.s, radius).asDiagonal() * svd.v.transpose();
}

double TraceNorm(const Eigen::MatrixXd& x) { return Decompose(x).s.sum(); }

Eigen::VectorXd SpendBudget(const Eigen::VectorXd& s, double eta, double budget) {
  const double largest = s.maxCoeff();
  const Eigen::Index n = s.size();
  if (largest <= 0) return Eigen::VectorXd::Constant(n, budget / static_cast<double>(n));
  // Numbers this far below the largest are zeros that were rounded.
  const Eigen::VectorXd clean = (s.array() > 1e-14 * largest).select(s, 0.0);
  const auto positive = static_cast<double>((clean.array() > 0).count());
  if (positive <= budget) {
    const auto zeros = static_cast<double>(n) - positive;
    const double rest = zeros > 0 ? (budget - positive) / zeros : 0;
    return (clean.array() > 0).select(Eigen::VectorXd::Ones(n), rest);
  }
  double low = 0;
  double high = (eta + 1) * 1e14 / largest;  // spends 1 on each positive one
  for (int i = 0; i < 200; ++i) {
    const double middle = low > 0 ? std::sqrt(low * high) : high * 1e-20;
    (Spend(clean, eta, middle).sum() < budget ? low : high) = middle;
  }
  return Spend(clean, eta, high);
}

ClusterPenalty EvaluateClusterPenalty(const Eigen::MatrixXd& w, double eta, double k) {
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(w.transpose() * w);
  const Eigen::MatrixXd& v = eigen.eigenvectors();
  const Eigen::VectorXd s = eigen.eigenvalues().cwiseMax(0.0).cwiseSqrt();
  const Eigen::VectorXd m = SpendBudget(s, eta, k);
  const Eigen::VectorXd inverse = (m.array() + eta).inverse();
  ClusterPenalty penalty;
  penalty.value = (s.array().square() * inverse.array()).sum();
  penalty.gradient = 2.0 * (w * (v * inverse.asDiagonal() * v.transpose()));
  penalty.m = v * m.asDiagonal() * v.transpose();
  return penalty;
}

StructurePenalty EvaluateStructurePenalty(const Eigen::MatrixXd& w, double eta, double h) {
  const ThinSvd svd = Decompose(w);
  StructurePenalty penalty;
  const auto rank = static_cast<double>(svd.s.size());
  penalty.m = SpendBudget(svd.s, eta, std::min(h, rank));
  const Eigen::VectorXd shrunk = svd.s.array() / (penalty.m.array() + eta);
  penalty.value = shrunk.dot(svd.s);
  penalty.gradient = 2.0 * (svd.u * shrunk.asDiagonal() * svd.v.transpose());
  penalty.u = svd.u;
  return penalty;
}

}  // namespace viewfix
