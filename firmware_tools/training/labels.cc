// SPDX-License-Identifier: BSD-3-Clause
#include "firmware_tools/training/labels.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>
#include <map>
#include <numbers>
#include <set>

namespace viewfix {
namespace {

bool AnyLocation(const ImageSet& set) {
  return std::any_of(set.images.begin(), set.images.end(),
                     [](const ImageRecord& image) { return !image.location.empty(); });
}

std::string Numbered(const char* prefix, int number) {
  char text[32];
  std::snprintf(text, sizeof text, "%s%02d", prefix, number);
  return text;
}

// The direction that cameras call up, on average: people hold them upright. Headings are
// angles about it.
Eigen::Vector3d MeanUp(const ImageSet& set, std::span<const int> image_idxs) {
  Eigen::Vector3d up = Eigen::Vector3d::Zero();
  for (const int i : image_idxs) {
    if (set.images[i].pose) up -= set.images[i].pose->world_from_cam * Eigen::Vector3d::UnitY();
  }
  return up.norm() > 1e-9 ? Eigen::Vector3d(up.normalized()) : Eigen::Vector3d::UnitZ();
}

// Two axes that span the floor: `first` is the world axis that lies flattest.
struct Floor {
  Eigen::Vector3d first, second;

  explicit Floor(const Eigen::Vector3d& up) {
    Eigen::Index flattest = 0;
    up.cwiseAbs().minCoeff(&flattest);
    first = Eigen::Vector3d::Unit(flattest);
    first = (first - first.dot(up) * up).normalized();
    second = up.cross(first);
  }
  double Heading(const Pose& pose) const {
    const Eigen::Vector3d forward = pose.world_from_cam * Eigen::Vector3d::UnitZ();
    return std::atan2(forward.dot(second), forward.dot(first));
  }
};

// Sector of a heading: sectors of equal width, the first centred on the floor's first axis.
int Sector(double heading, int sectors) {
  const double turn = heading / (2 * std::numbers::pi) + 1.0 + 0.5 / sectors;
  return static_cast<int>(std::floor(turn * sectors)) % sectors;
}

// Squares of the floor, cell_size wide, named by their column and row; storeys of 3 m.
std::vector<std::string> CellNames(const ImageSet& set, std::span<const int> image_idxs,
                                   double cell_size) {
  const Eigen::Vector3d up = MeanUp(set, image_idxs);
  const Floor floor(up);
  std::vector<std::string> names;
  std::vector<Eigen::Vector3d> positions;
  Eigen::Vector3d low = Eigen::Vector3d::Constant(std::numeric_limits<double>::max());
  for (const int i : image_idxs) {
    const Eigen::Vector3d& p = set.images[i].pose->cam_in_world;
    positions.emplace_back(p.dot(floor.first), p.dot(floor.second), p.dot(up));
    low = low.cwiseMin(positions.back());
  }
  for (const Eigen::Vector3d& p : positions) {
    const Eigen::Vector3d cell =
        ((p - low).array() / Eigen::Array3d(cell_size, cell_size, 3.0)).floor();
    names.push_back(Numbered("storey", static_cast<int>(cell.z())) + "/" +
                    Numbered("cell_", static_cast<int>(cell.x())) +
                    Numbered("_", static_cast<int>(cell.y())));
  }
  return names;
}

std::vector<std::string> HeadingNames(const ImageSet& set, std::span<const int> image_idxs,
                                      int sectors) {
  const Floor floor(MeanUp(set, image_idxs));
  std::vector<std::string> names;
  for (const int i : image_idxs) {
    const int sector = Sector(floor.Heading(*set.images[i].pose), sectors);
    names.push_back(Numbered("heading", 360 * sector / sectors));
  }
  return names;
}

// Runs of each location's images, in capture order.
std::vector<std::string> RunNames(const ImageSet& set, std::span<const int> image_idxs,
                                  const std::vector<std::string>& locations,
                                  const Eigen::MatrixXf& gram, const LabelOptions& options) {
  std::map<std::string, std::vector<int>> samples_of;
  for (int s = 0; s < static_cast<int>(image_idxs.size()); ++s) {
    samples_of[locations[s]].push_back(s);
  }
  std::vector<std::string> names(image_idxs.size());
  for (auto& [location, samples] : samples_of) {
    std::stable_sort(samples.begin(), samples.end(), [&](int a, int b) {
      return set.images[image_idxs[a]].capture < set.images[image_idxs[b]].capture;
    });
    const int n = static_cast<int>(samples.size());
    const int wanted = options.views == LabelOptions::Views::kCount
                           ? options.view_count
                           : (n + options.images_per_view / 2) / options.images_per_view;
    const std::vector<int> run = CutIntoRuns(gram, samples, std::clamp(wanted, 1, n));
    for (int i = 0; i < n; ++i) names[samples[i]] = Numbered("part", run[i] + 1);
  }
  return names;
}

std::vector<std::string> Distinct(const std::vector<std::string>& names) {
  const std::set<std::string> distinct(names.begin(), names.end());
  return {distinct.begin(), distinct.end()};
}

int IndexOf(const std::vector<std::string>& sorted, const std::string& name) {
  return static_cast<int>(std::lower_bound(sorted.begin(), sorted.end(), name) - sorted.begin());
}

void Number(const std::vector<std::string>& location_names,
            const std::vector<std::string>& view_names, Labels& labels) {
  labels.locations = Distinct(location_names);
  labels.views = Distinct(view_names);
  std::map<std::pair<int, int>, int> pairs;  // (location, view) -> index, in order
  std::vector<std::pair<int, int>> of_sample;
  for (std::size_t s = 0; s < location_names.size(); ++s) {
    of_sample.emplace_back(IndexOf(labels.locations, location_names[s]),
                           IndexOf(labels.views, view_names[s]));
    pairs[of_sample.back()] = 0;
  }
  for (auto& [pair, index] : pairs) {
    index = labels.num_pairs();
    labels.pair_location.push_back(pair.first);
    labels.pair_view.push_back(pair.second);
  }
  for (const auto& pair : of_sample) {
    labels.location.push_back(pair.first);
    labels.pair.push_back(pairs[pair]);
  }
}

std::vector<std::string> LocationNames(const ImageSet& set, std::span<const int> image_idxs,
                                       const LabelOptions& options, Labels& labels) {
  if (AnyLocation(set)) {
    labels.location_source = "labels";
    std::vector<std::string> names;
    for (const int i : image_idxs) names.push_back(set.images[i].location);
    return names;
  }
  labels.location_source = "cells";
  return CellNames(set, image_idxs, options.cell_size);
}

std::vector<std::string> ViewNames(const ImageSet& set, std::span<const int> image_idxs,
                                   const std::vector<std::string>& locations,
                                   const Eigen::MatrixXf& gram, const LabelOptions& options,
                                   Labels& labels) {
  const auto all = [&](auto&& predicate) {
    return std::all_of(image_idxs.begin(), image_idxs.end(),
                       [&](int i) { return predicate(set.images[i]); });
  };
  const bool labelled = all([](const ImageRecord& image) { return !image.view.empty(); });
  using Views = LabelOptions::Views;
  if (options.views == Views::kLabels && !labelled) {
    throw ToolError(set.source.string() +
                    ": --views labels needs a view for every image that has a location");
  }
  labels.global_views = true;
  if (labelled && options.views != Views::kCount) {
    labels.view_source = "labels";
    std::vector<std::string> names;
    for (const int i : image_idxs) names.push_back(set.images[i].view);
    return names;
  }
  if (all([](const ImageRecord& image) { return image.pose.has_value(); })) {
    labels.view_source = "headings";
    return HeadingNames(
        set, image_idxs,
        options.views == Views::kCount ? options.view_count : options.heading_sectors);
  }
  labels.global_views = false;
  labels.view_source = "order";
  return RunNames(set, image_idxs, locations, gram, options);
}

}  // namespace

bool HasPlace(const ImageSet& set, const ImageRecord& image) {
  return !image.location.empty() || (image.pose.has_value() && !AnyLocation(set));
}

double CellSizeOf(const ImageSet& set, int images_per_cell) {
  double walked = 0;
  int posed = 0;
  const ImageRecord* before = nullptr;
  for (const ImageRecord& image : set.images) {
    if (!image.pose) continue;
    if (before != nullptr && before->capture == image.capture) {
      walked += (image.pose->cam_in_world - before->pose->cam_in_world).norm();
    }
    before = &image;
    ++posed;
  }
  return std::max(1e-6, walked * images_per_cell / std::max(1, posed));
}

Labels MakeLabels(const ImageSet& set, std::span<const int> image_idxs, const Eigen::MatrixXf& gram,
                  const LabelOptions& options) {
  if (image_idxs.empty()) {
    throw ToolError(set.source.string() +
                    ": no locations: add a `location` column (or folders <location>/<view>/), or "
                    "poses (tx,ty,tz,qx,qy,qz,qw) to make them from");
  }
  Labels labels;
  labels.image_idxs.assign(image_idxs.begin(), image_idxs.end());
  const auto locations = LocationNames(set, image_idxs, options, labels);
  const auto views = ViewNames(set, image_idxs, locations, gram, options, labels);
  Number(locations, views, labels);
  return labels;
}

std::vector<int> CutIntoRuns(const Eigen::MatrixXf& gram, std::span<const int> order, int k) {
  const int n = static_cast<int>(order.size());
  // block(i, j): sum of gram over order[i..j) squared, from two-dimensional prefix sums.
  Eigen::MatrixXd prefix = Eigen::MatrixXd::Zero(n + 1, n + 1);
  for (int i = 0; i < n; ++i) {
    for (int j = 0; j < n; ++j) {
      prefix(i + 1, j + 1) =
          prefix(i, j + 1) + prefix(i + 1, j) - prefix(i, j) + double{gram(order[i], order[j])};
    }
  }
  const auto scatter = [&](int i, int j) {  // less the sum of |x|^2, the same for every cut
    return -(prefix(j, j) - prefix(i, j) - prefix(j, i) + prefix(i, i)) / (j - i);
  };
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  Eigen::MatrixXd cost = Eigen::MatrixXd::Constant(k + 1, n + 1, kInfinity);
  Eigen::MatrixXi cut = Eigen::MatrixXi::Zero(k + 1, n + 1);
  cost(0, 0) = 0;
  for (int r = 1; r <= k; ++r) {
    for (int j = r; j <= n; ++j) {
      for (int i = r - 1; i < j; ++i) {
        const double total = cost(r - 1, i) + scatter(i, j);
        if (total < cost(r, j)) {
          cost(r, j) = total;
          cut(r, j) = i;
        }
      }
    }
  }
  std::vector<int> run(n);
  for (int r = k, end = n; r >= 1; end = cut(r, end), --r) {
    std::fill(run.begin() + cut(r, end), run.begin() + end, r - 1);
  }
  return run;
}

}  // namespace viewfix
