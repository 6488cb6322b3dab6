// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <memory>

#include "engine/features/feature_extractor.h"

namespace viewfix {

// OpenCV's SIFT behind the interface of the board's features, to compare accuracy
// with: laptop only, neither deterministic across processors nor free of
// allocations. Key points spread by the same grid as SURF's; 128 dimensions; each
// byte is the square root of the L1-normalized value (R. Arandjelovic, A.
// Zisserman, Three things everyone should know, CVPR 2012), times 127; laplacian_sign
// is 0. options.threshold is not used: the contrast threshold is fixed.
// With options.upright, all orientations are (1, 0). Throws ToolError if the options
// are invalid or not of type kSift.
std::unique_ptr<FeatureExtractor> CreateSiftExtractor(const FeatureOptions& options);

}  // namespace viewfix
