// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <span>
#include <string>
#include <vector>

#include "firmware_tools/dataset/image_set.h"

namespace viewfix {

// How images are divided into locations and views (the tasks of the method).
struct LabelOptions {
  enum class Views { kAuto, kLabels, kCount };
  Views views = Views::kAuto;
  int view_count = 0;       // kCount: views of every location, 1..64
  int images_per_view = 4;  // automatic views by order: about this many images each
  int heading_sectors = 4;  // automatic views where poses are known
  double cell_size = 1.5;   // metres: locations made from poses where none are named
};

// The samples of a training: images with a location and a view each. Names ascend; a pair
// is a (location, view) that has images; pairs ascend by (location, view).
struct Labels {
  std::vector<int> image_idxs;  // [samples] into ImageSet::images, ascending
  std::vector<int> location;    // [samples] into locations
  std::vector<int> pair;        // [samples] into pair_location
  std::vector<std::string> locations;
  std::vector<std::string> views;
  std::vector<int> pair_location;
  std::vector<int> pair_view;
  // Views mean the same direction everywhere (named by hand, or headings); else they are
  // parts of one location, and tasks are local to it (method.md, section 1).
  bool global_views = false;
  // Where each came from, for the record: "labels", "headings", "order", "cells".
  std::string location_source;
  std::string view_source;

  int num_pairs() const { return static_cast<int>(pair_location.size()); }
};

// True where `image` can be a sample: it has a location, or, where the set names no
// location at all, a pose to make one from.
bool HasPlace(const ImageSet& set, const ImageRecord& image);

// Side of cells that hold `images_per_cell` of the posed images each, on average, where these
// stand along a walk of one cell's width.
double CellSizeOf(const ImageSet& set, int images_per_cell);

// Labels of the images `image_idxs` (ascending).
//   gram [n, n] dot products of their histograms: automatic views by order are cut where
//   appearance changes
// Throws ToolError naming the set: neither locations nor poses; views asked for by label
// but not given.
Labels MakeLabels(const ImageSet& set, std::span<const int> image_idxs, const Eigen::MatrixXf& gram,
                  const LabelOptions& options);

// Cuts a sequence of n images into k contiguous runs with the least sum of squared
// distances to the runs' means (exact, dynamic programming over eq. sum |x|^2 - |sum x|^2/m).
//   order [n] rows of gram, in walking order. Returns the run of each, [n] in 0..k-1.
std::vector<int> CutIntoRuns(const Eigen::MatrixXf& gram, std::span<const int> order, int k);

}  // namespace viewfix
