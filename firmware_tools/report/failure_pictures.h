// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <nlohmann/json_fwd.hpp>

#include "engine/features/feature_extractor.h"
#include "firmware_tools/dataset/image_set.h"

namespace viewfix {

// The worst failures of an evaluation (`failures` of its figures) for a page, the worst first and
// a dozen at most: {frame, query, guess, right, guess_matches, right_matches}. Pictures are
// {url, width, height}; null: cannot be read. Matches are features of the image and of the keyframe
// that agree with one motion of the camera between them, [x, y, x, y] in shares of each
// picture's width and height; those with the most like descriptors, if there are many.
//   features   how they are found
nlohmann::ordered_json FailurePictures(const ImageSet& set, const FeatureOptions& features,
                                       const nlohmann::ordered_json& figures);

}  // namespace viewfix
