// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <span>
#include <vector>

#include "firmware_tools/training/confidence.h"
#include "firmware_tools/training/feature_store.h"
#include "models/model_writer.h"

namespace viewfix {

// How the details of a model are made (engine/matching/place_evidence.h).
struct DetailOptions {
  // Room for them in the model, bytes; 0: none. 6.06 MB leave a model of 74 areas under 7.
  std::size_t max_bytes = 6'060'000;
  // Features of one location that are closer than this (descriptors' length is 127) are one detail.
  // Grows until the details fit their room.
  double merge_distance = 45;
  // Features closer than this to each other in so many locations are one common detail, which says
  // nothing but that a feature is none of a place's own. Held-out frames of the IE Tower's
  // training split: 767 000 details become 678 000, with as many frames right.
  double common_distance = 35;
  int common_locations = 4;
  // Bytes of a code; 0: the most of 8, 6, 5 and 4 with which the details fit their room without
  // being merged more than 5 further, since shorter codes then cost less. The same frames, area
  // right: whole descriptors 90.0 %, 16 bytes the same, 8 bytes 89.5 (89.4 without turning
  // descriptors first).
  int parts = 0;
  // Frames held out at a time: each folds-th of a location.
  int folds = 5;
  // Share, 0..1, of the answers that may be wrong, by held-out frames. With a fifth of the IE
  // Tower's images put aside in four ways, 0.01 made 1.3 % of the answers to those wrong (16 of
  // 1197), 0.007 0.9 % (11 of 1169).
  double wrong_share = 0.007;
  // What a frame of a location that is hidden counts for, where one of a known location counts one,
  // when the weight of close details is chosen; and what share of all frames is wrong, at least,
  // for the confidence.
  double hidden_weight = 0.1;
  int jobs = 0;  // 0: all cores
};

// The images that details are made of: [samples].
struct DetailSource {
  const FeatureStore& features;
  std::span<const int> image_idxs;
  std::span<const int> locations;  // of each sample
  int num_locations = 0;
  std::span<const std::int8_t> words;   // [words, dim] of the vocabulary
  int words_per_feature = 1;            // of frames
  const Eigen::MatrixXf& similarities;  // [samples as keyframes, samples as frames]
  // To turn and to code descriptors by; empty: made of them.
  std::span<const std::int8_t> rotation = {};
  std::span<const std::int8_t> codebook = {};
};

struct TrainedDetails {
  ModelData::DetailsData table;  // no codes: too few features, or none asked for
  // Each frame as if it had not been in the set, one of `folds` of a location's, while those
  // around it were; locations of one image are left out. Margins with what close details add.
  std::vector<Outcome> held_out;
  // The same frames as if their locations were hidden: every answer would be wrong.
  std::vector<Outcome> elsewhere;
};

// The same inputs give the same bytes, whatever `jobs` is.
TrainedDetails TrainDetails(const DetailSource& source, const DetailOptions& options,
                            const Progress& progress);

// What their leads are worth, limited to options.wrong_share. Where hardly a held-out frame is
// wrong, nothing would say which leads are too small: hidden frames stand for the wrong ones that
// are missing.
ModelConfidence FitDetailConfidence(const TrainedDetails& details, const DetailOptions& options);

}  // namespace viewfix
