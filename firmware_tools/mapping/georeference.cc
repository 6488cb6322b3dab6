// SPDX-License-Identifier: BSD-3-Clause
#include "firmware_tools/mapping/georeference.h"

#include <Eigen/Eigenvalues>
#include <Eigen/SVD>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <functional>
#include <map>
#include <random>
#include <utility>

#include "firmware_tools/dataset/image_set.h"
#include "firmware_tools/dataset/text_fields.h"
#include "firmware_tools/dataset/tool_file.h"
#include "platform/csv.h"

namespace viewfix {
namespace {

namespace fs = std::filesystem;

constexpr double kLeastSpreadRatio = 0.02;  // of the second direction to the first: else a line
constexpr double kLeastSlant = 0.3;         // sine of the angle between a line and up
constexpr double kLeastNoise = 0.002;       // metres: a few points can fit better by chance
constexpr double kMaxCoordinate = 1e9;      // metres
constexpr int kMaxRefits = 10;
constexpr std::size_t kMaxNamed = 3;  // points named in a refusal
// Shares of the cameras' x axes along the two flattest directions: below the first all cameras
// look the same way, above the second they roll.
constexpr double kLeastTurning = 0.03;
constexpr double kMostRolling = 0.3;       // of the turning
constexpr double kLeastUprightness = 0.3;  // mean cosine between up and -y

// Sums over point pairs about their means.
struct Moments {
  Eigen::Vector3d mean_a = Eigen::Vector3d::Zero();
  Eigen::Vector3d mean_b = Eigen::Vector3d::Zero();
  Eigen::Matrix3d scatter_a = Eigen::Matrix3d::Zero();
  Eigen::Matrix3d scatter_b = Eigen::Matrix3d::Zero();
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();  // of b and a
};

Moments MomentsOf(std::span<const Eigen::Vector3d> a, std::span<const Eigen::Vector3d> b) {
  Moments m;
  const auto n = static_cast<double>(a.size());
  for (std::size_t i = 0; i < a.size(); ++i) m.mean_a += a[i] / n, m.mean_b += b[i] / n;
  for (std::size_t i = 0; i < a.size(); ++i) {
    const Eigen::Vector3d from_a = a[i] - m.mean_a, from_b = b[i] - m.mean_b;
    m.scatter_a += from_a * from_a.transpose();
    m.scatter_b += from_b * from_b.transpose();
    m.covariance += from_b * from_a.transpose();
  }
  return m;
}

// Squared spreads, the smallest first.
Eigen::Vector3d SpreadsOf(const Eigen::Matrix3d& scatter) {
  return Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(scatter, Eigen::EigenvaluesOnly)
      .eigenvalues();
}

bool OnALine(const Eigen::Matrix3d& scatter) {
  const Eigen::Vector3d spread = SpreadsOf(scatter);
  return !(spread[1] > kLeastSpreadRatio * kLeastSpreadRatio * spread[2]) || !(spread[2] > 0);
}

Eigen::Matrix3d BestRotation(const Eigen::Matrix3d& covariance) {
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(covariance,
                                              Eigen::ComputeFullU | Eigen::ComputeFullV);
  Eigen::Vector3d sign = Eigen::Vector3d::Ones();
  if (svd.matrixU().determinant() * svd.matrixV().determinant() < 0) sign.z() = -1;
  return svd.matrixU() * sign.asDiagonal() * svd.matrixV().transpose();
}

// The best scale and translation of a rotation b_from_a.
std::optional<Similarity> WithRotation(const Moments& m, const Eigen::Matrix3d& rotation) {
  Similarity b_from_a;
  b_from_a.rotation = Eigen::Quaterniond(rotation).normalized();
  b_from_a.scale = (rotation.transpose() * m.covariance).trace() / m.scatter_a.trace();
  b_from_a.translation = m.mean_b - b_from_a.scale * (b_from_a.rotation * m.mean_a);
  const bool usable = b_from_a.scale > 0 && std::isfinite(b_from_a.scale);
  return usable ? std::optional(b_from_a) : std::nullopt;
}

// Columns: along a line, upwards from it, and across both. Nothing: the line is about upright.
std::optional<Eigen::Matrix3d> FrameOfLine(const Eigen::Vector3d& along,
                                           const Eigen::Vector3d& up) {
  const Eigen::Vector3d off = up - along * along.dot(up);
  if (!(off.norm() > kLeastSlant)) return std::nullopt;
  Eigen::Matrix3d frame;
  frame << along, off.normalized(), along.cross(off).normalized();
  return frame;
}

// For points on a line, or nearly so: which way it runs is theirs to say, how all is turned about
// it the upward direction's.
std::optional<Similarity> FitUpright(std::span<const Eigen::Vector3d> points_in_a,
                                     std::span<const Eigen::Vector3d> points_in_b,
                                     const Eigen::Vector3d& up_in_a) {
  if (points_in_a.size() < 2) return std::nullopt;
  const Moments m = MomentsOf(points_in_a, points_in_b);
  const Eigen::Vector3d along_a =
      Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(m.scatter_a).eigenvectors().col(2);
  const Eigen::Vector3d along_b = m.covariance * along_a;
  if (!(along_b.norm() > 0)) return std::nullopt;
  const auto frame_a = FrameOfLine(along_a, up_in_a);
  const auto frame_b = FrameOfLine(along_b.normalized(), Eigen::Vector3d::UnitZ());
  if (!frame_a || !frame_b) return std::nullopt;
  return WithRotation(m, *frame_b * frame_a->transpose());
}

// Finds the consensus among pairs.
class Fitter {
 public:
  using FitPoints = std::function<std::optional<Similarity>(std::span<const Eigen::Vector3d>,
                                                            std::span<const Eigen::Vector3d>)>;

  Fitter(std::span<const ControlPair> pairs, const GeoreferenceOptions& options, FitPoints fit)
      : options_(options), fit_(std::move(fit)) {
    for (const ControlPair& pair : pairs) {
      in_map_.push_back(pair.point_in_map);
      in_site_.push_back(pair.point_in_site);
    }
  }

  // Nothing: no three pairs can be fitted.
  std::optional<Similarity> Fit() {
    const std::size_t n = in_map_.size();
    const auto count = static_cast<double>(n);
    const double triples = count * (count - 1) * (count - 2) / 6;
    if (triples <= options_.max_trials) {
      for (std::size_t i = 0; i < n; ++i)
        for (std::size_t j = i + 1; j < n; ++j)
          for (std::size_t k = j + 1; k < n; ++k) Try({i, j, k});
    } else {
      TryRandomTriples(n);
    }
    if (best_) Refit();
    return best_;
  }

 private:
  double Residual(const Similarity& site_from_map, std::size_t i) const {
    return (site_from_map * in_map_[i] - in_site_[i]).norm();
  }

  void TryRandomTriples(std::size_t n) {
    std::mt19937_64 random(options_.seed);
    for (int trial = 0; trial < options_.max_trials; ++trial) {
      const std::array<std::size_t, 3> triple = {random() % n, random() % n, random() % n};
      if (triple[0] == triple[1] || triple[0] == triple[2] || triple[1] == triple[2]) continue;
      Try(triple);
    }
  }

  std::optional<Similarity> FitTo(std::span<const std::size_t> chosen) const {
    std::vector<Eigen::Vector3d> a, b;
    for (const std::size_t i : chosen) {
      a.push_back(in_map_[i]);
      b.push_back(in_site_[i]);
    }
    return fit_(a, b);
  }

  // Truncated squares: an outlier costs the same however far off it is.
  double Cost(const Similarity& site_from_map) const {
    double cost = 0;
    for (std::size_t i = 0; i < in_map_.size(); ++i) {
      const double residual = std::min(Residual(site_from_map, i), options_.max_residual);
      cost += residual * residual;
    }
    return cost;
  }

  void Try(const std::array<std::size_t, 3>& triple) {
    const std::optional<Similarity> fit = FitTo(triple);
    if (!fit) return;
    const double cost = Cost(*fit);
    if (best_ && cost >= best_cost_) return;
    best_ = fit;
    best_cost_ = cost;
  }

  void Refit() {
    for (int round = 0; round < kMaxRefits; ++round) {
      std::vector<std::size_t> inliers;
      for (std::size_t i = 0; i < in_map_.size(); ++i) {
        if (Residual(*best_, i) <= options_.max_residual) inliers.push_back(i);
      }
      const std::optional<Similarity> fit = FitTo(inliers);
      if (!fit || Cost(*fit) >= best_cost_) return;
      best_cost_ = Cost(*fit);
      best_ = fit;
    }
  }

  GeoreferenceOptions options_;
  FitPoints fit_;
  std::vector<Eigen::Vector3d> in_map_, in_site_;
  std::optional<Similarity> best_;
  double best_cost_ = 0;
};

std::string ResidualText(const ControlResidual& residual) {
  char metres[32];
  std::snprintf(metres, sizeof metres, " %.2f m", residual.metres);
  return residual.name + metres;
}

std::string WorstPoints(std::vector<ControlResidual> residuals) {
  std::sort(residuals.begin(), residuals.end(), [](const auto& a, const auto& b) {
    return std::tie(b.metres, a.name) < std::tie(a.metres, b.name);
  });
  residuals.resize(std::min(residuals.size(), kMaxNamed));
  std::string text;
  for (const ControlResidual& residual : residuals) {
    text.append(text.empty() ? "" : ", ").append(ResidualText(residual));
  }
  return text;
}

double Median(const std::vector<ControlResidual>& residuals) {
  std::vector<double> metres;
  for (const ControlResidual& residual : residuals) metres.push_back(residual.metres);
  std::nth_element(metres.begin(), metres.begin() + std::ptrdiff_t(metres.size() / 2),
                   metres.end());
  return metres[metres.size() / 2];
}

void RefuseBadFit(const Georeference& fit, const GeoreferenceOptions& options) {
  const auto inliers = std::count_if(fit.residuals.begin(), fit.residuals.end(),
                                     [](const ControlResidual& r) { return r.is_inlier; });
  const double share = static_cast<double>(inliers) / static_cast<double>(fit.residuals.size());
  char text[160];
  if (inliers < 3 || share < options.min_inlier_share) {
    std::snprintf(text, sizeof text,
                  "control points do not fit the map: only %d of %zu within %.2f m; worst: ",
                  static_cast<int>(inliers), fit.residuals.size(), options.max_residual);
    throw ToolError(text + WorstPoints(fit.residuals));
  }
  if (fit.median_metres > options.max_median) {
    std::snprintf(text, sizeof text,
                  "control points do not fit the map: median %.2f m, more than %.2f m; worst: ",
                  fit.median_metres, options.max_median);
    throw ToolError(text + WorstPoints(fit.residuals));
  }
}

std::string NamesOf(std::span<const ControlPair> pairs) {
  std::string names;
  for (std::size_t i = 0; i < std::min(pairs.size(), kMaxNamed); ++i) {
    names.append(i == 0 ? "" : ", ").append(pairs[i].name);
  }
  return names.append(pairs.size() > kMaxNamed ? ", ..." : "");
}

Georeference Measure(std::span<const ControlPair> pairs, const Similarity& site_from_map,
                     const GeoreferenceOptions& options) {
  Georeference result;
  result.site_from_map = site_from_map;
  for (const ControlPair& pair : pairs) {
    const double metres = (site_from_map * pair.point_in_map - pair.point_in_site).norm();
    result.residuals.push_back({pair.name, metres, metres <= options.max_residual});
  }
  result.median_metres = Median(result.residuals);
  return result;
}

// How well the points that fit tell the rotation about the line that they are nearest to, radians:
// their noise over their distances from it. 0: too few of them to tell.
double RollSigma(std::span<const ControlPair> pairs, const Georeference& fit) {
  std::vector<Eigen::Vector3d> in_site;
  double sum2 = 0;
  for (std::size_t i = 0; i < pairs.size(); ++i) {
    if (!fit.residuals[i].is_inlier) continue;
    in_site.push_back(pairs[i].point_in_site);
    sum2 += fit.residuals[i].metres * fit.residuals[i].metres;
  }
  if (in_site.size() < 3) return 0;
  const double freedom = 3.0 * static_cast<double>(in_site.size()) - 7;
  const double noise = std::max(std::sqrt(sum2 / freedom), kLeastNoise);
  const Eigen::Vector3d spread = SpreadsOf(MomentsOf(in_site, in_site).scatter_a);
  return noise / std::sqrt(spread[0] + spread[1]);
}

Similarity FitUprightOrRefuse(std::span<const ControlPair> pairs, const Gravity& gravity,
                              const GeoreferenceOptions& options) {
  std::string cause = gravity.cause;
  if (gravity.up_in_map) {
    const auto fit = Fitter(pairs, options, [&](const auto& a, const auto& b) {
                       return FitUpright(a, b, *gravity.up_in_map);
                     }).Fit();
    if (fit) return *fit;
    cause = "the line stands about upright";
  }
  throw ToolError("the control points lie nearly on a line, " + NamesOf(pairs) +
                  ", and the cameras do not tell how the map is turned about it: " + cause +
                  "; a point well beside the line would");
}

Eigen::Vector3d AxisInMap(const MapImage& image, const Eigen::Vector3d& axis_in_cam) {
  return image.cam_from_world.rotation.conjugate() * axis_in_cam;
}

}  // namespace

double CoordinateOf(const CsvTable::Row& row, int column, const fs::path& file) {
  const std::string where = file.string() + " line " + std::to_string(row.line);
  const std::string& cell = row.cells[column];
  TextFields fields(file, cell);
  if (!fields.NextLine()) throw ToolError(where + ": an empty coordinate");
  double value = 0;
  try {
    value = fields.Number("coordinate");
  } catch (const ToolError&) {  // its line would be the cell's
    throw ToolError(where + ": not a number: " + cell.substr(0, 40));
  }
  if (!fields.AtLineEnd() || std::abs(value) > kMaxCoordinate) {
    throw ToolError(where + ": not a coordinate: " + cell.substr(0, 40));
  }
  return value;
}

Similarity Inverse(const Similarity& b_from_a) {
  Similarity a_from_b;
  a_from_b.scale = 1 / b_from_a.scale;
  a_from_b.rotation = b_from_a.rotation.conjugate();
  a_from_b.translation = -a_from_b.scale * (a_from_b.rotation * b_from_a.translation);
  return a_from_b;
}

std::optional<Similarity> FitSimilarity(std::span<const Eigen::Vector3d> points_in_a,
                                        std::span<const Eigen::Vector3d> points_in_b) {
  if (points_in_a.size() < 3 || points_in_b.size() != points_in_a.size()) return std::nullopt;
  const Moments m = MomentsOf(points_in_a, points_in_b);
  if (OnALine(m.scatter_a) || OnALine(m.scatter_b)) return std::nullopt;
  return WithRotation(m, BestRotation(m.covariance));
}

std::vector<ControlPoint> ReadControlFile(const fs::path& file) {
  const Result<CsvTable> table = ParseCsv(ReadTextFile(file));
  if (!table.ok()) throw ToolError(file.string() + ": " + Describe(table.status()));
  std::array<int, 4> columns;
  constexpr const char* kNames[] = {"name", "x", "y", "z"};
  for (int i = 0; i < 4; ++i) {
    columns[i] = table->Column(kNames[i]);
    if (columns[i] < 0) throw ToolError(file.string() + ": no column called " + kNames[i]);
  }
  std::vector<ControlPoint> controls;
  std::map<std::string, int> line_by_name;
  for (const CsvTable::Row& row : table->rows) {
    ControlPoint& control = controls.emplace_back();
    control.name = row.cells[columns[0]];
    for (int i = 0; i < 3; ++i) control.point_in_site[i] = CoordinateOf(row, columns[i + 1], file);
    const auto [first, is_new] = line_by_name.try_emplace(control.name, row.line);
    if (is_new && !control.name.empty()) continue;
    throw ToolError(
        file.string() + " line " + std::to_string(row.line) + ": " +
        (is_new ? "no name"
                : control.name + " stands in line " + std::to_string(first->second) + " too"));
  }
  return controls;
}

std::vector<ControlPair> PairWithCameras(const Reconstruction& map,
                                         std::span<const ControlPoint> controls) {
  std::array<std::map<std::string, int>, 3> image_by_key;  // by path, file name, stem
  for (int i = 0; i < static_cast<int>(map.images.size()); ++i) {
    const fs::path path = fs::path(map.images[i].name).lexically_normal();
    const std::string keys[] = {path.generic_string(), path.filename().string(),
                                path.stem().string()};
    for (int k = 0; k < 3; ++k) {
      const auto [found, is_new] = image_by_key[k].try_emplace(keys[k], i);
      if (!is_new) found->second = -1;
    }
  }
  std::vector<ControlPair> pairs;
  for (const ControlPoint& control : controls) {
    const std::string name = fs::path(control.name).lexically_normal().generic_string();
    for (const auto& images : image_by_key) {
      const auto found = images.find(name);
      if (found == images.end()) continue;
      if (found->second < 0) break;
      const Eigen::Vector3d centre = Inverse(map.images[found->second].cam_from_world).translation;
      pairs.push_back({control.name, centre, control.point_in_site});
      break;
    }
  }
  return pairs;
}

Georeference FitGeoreference(std::span<const ControlPair> pairs, const Gravity& gravity,
                             const GeoreferenceOptions& options) {
  if (pairs.size() < 3) {
    throw ToolError("three control points are needed, and the map has " +
                    std::to_string(pairs.size()) + (pairs.empty() ? "" : ": ") + NamesOf(pairs));
  }
  const std::optional<Similarity> fit = Fitter(pairs, options, FitSimilarity).Fit();
  Georeference result;
  if (fit) result = Measure(pairs, *fit, options);
  // Without cameras that tell, what does not fit anyhow is not called a line.
  if (fit && !gravity.up_in_map) RefuseBadFit(result, options);
  if (!fit || RollSigma(pairs, result) > options.max_roll_sigma) {
    result = Measure(pairs, FitUprightOrRefuse(pairs, gravity, options), options);
    result.upright_by_cameras = true;
  }
  RefuseBadFit(result, options);
  return result;
}

std::string DescribeResiduals(const Georeference& georeference) {
  std::string text;
  for (const ControlResidual& residual : georeference.residuals) {
    text.append(text.empty() ? "" : ", ").append(ResidualText(residual));
    if (!residual.is_inlier) text += " (left out)";
  }
  return text;
}

Gravity EstimateGravity(const Reconstruction& map) {
  if (map.images.size() < 3) return {std::nullopt, "fewer than three images"};
  Eigen::Matrix3d scatter = Eigen::Matrix3d::Zero();
  Eigen::Vector3d against_y = Eigen::Vector3d::Zero();
  for (const MapImage& image : map.images) {
    const Eigen::Vector3d right = AxisInMap(image, Eigen::Vector3d::UnitX());
    scatter += right * right.transpose();
    against_y -= AxisInMap(image, Eigen::Vector3d::UnitY());
  }
  const auto count = static_cast<double>(map.images.size());
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver(scatter / count);
  const Eigen::Vector3d share = solver.eigenvalues();
  if (share[1] < kLeastTurning) return {std::nullopt, "all cameras look in about one direction"};
  if (share[0] > kMostRolling * share[1]) return {std::nullopt, "the cameras roll too much"};
  const Eigen::Vector3d up = solver.eigenvectors().col(0);
  const double uprightness = up.dot(against_y) / count;
  if (std::abs(uprightness) < kLeastUprightness) {
    return {std::nullopt, "the cameras look too steeply up or down"};
  }
  return {uprightness > 0 ? up : Eigen::Vector3d(-up), {}};
}

Similarity LevelFromMap(const Eigen::Vector3d& up_in_map) {
  Similarity level_from_map;
  level_from_map.rotation =
      Eigen::Quaterniond::FromTwoVectors(up_in_map, Eigen::Vector3d::UnitZ()).normalized();
  return level_from_map;
}

bool IsUpsideDown(const Reconstruction& map, const Similarity& site_from_map) {
  const Gravity gravity = EstimateGravity(map);
  return gravity.up_in_map && (site_from_map.rotation * *gravity.up_in_map).z() < 0;
}

void Transform(Reconstruction& map, const Similarity& new_from_old) {
  for (MapPoint& point : map.points) point.position = new_from_old * point.position;
  for (MapImage& image : map.images) {
    const Rigid3 old_from_cam = Inverse(image.cam_from_world);
    image.cam_from_world = Inverse({(new_from_old.rotation * old_from_cam.rotation).normalized(),
                                    new_from_old * old_from_cam.translation});
  }
}

}  // namespace viewfix
