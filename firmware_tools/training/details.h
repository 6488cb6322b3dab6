// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "firmware_tools/training/confidence.h"
#include "firmware_tools/training/feature_store.h"
#include "models/model_writer.h"

namespace viewfix {

// How the details of a model are made (engine/matching/place_evidence.h).
struct DetailOptions {
  // Room for them in the model, bytes; 0: none. 5 MB leave a model of 74 areas under 8.
  std::size_t max_bytes = 5'000'000;
  // Features of one location that are closer than this (descriptors' length is 127) are one detail.
  // Held-out frames of the IE Tower's training split: 1.3 details in place of 2.7 features cost
  // nothing. Grows in steps until the details fit their room.
  double merge_distance = 45;
  // Bytes a descriptor; where they do not divide its dimension, there are no details. The same
  // frames: 8 as good as whole descriptors; 4 find as many places, but are less sure.
  int parts = 8;
  // Frames held out at a time: each folds-th of a location.
  int folds = 5;
  // Share of the answers that may be wrong, by held-out frames. These lie farther from the images
  // that are left than a frame of the same walk from all of them, so that fewer will be: with each
  // fifth of the IE Tower's training images put aside, 0.02 made 0.8 % of the answers to those
  // wrong (2 of 253).
  double wrong_share = 0.02;
  int jobs = 0;  // 0: all cores
};

// The images that details are made of: [samples], the last ones by sample.
struct DetailSource {
  const FeatureStore& features;
  std::span<const int> image_idxs;
  std::span<const int> locations;  // of each sample
  int num_locations = 0;
  std::span<const std::int8_t> words;          // [words, dim] of the vocabulary
  int words_per_feature = 1;                   // of frames
  std::span<const std::int8_t> codebook = {};  // to code them by; empty: made of them
};

struct TrainedDetails {
  ModelData::DetailsData table;  // empty: too few features, or none asked for
  // Each frame as if it had not been in the set, one of `folds` of a location's, while those
  // around it were; locations of one image are left out.
  std::vector<Outcome> held_out;
};

// The same inputs give the same bytes, whatever `jobs` is.
TrainedDetails TrainDetails(const DetailSource& source, const DetailOptions& options,
                            const Progress& progress);

}  // namespace viewfix
