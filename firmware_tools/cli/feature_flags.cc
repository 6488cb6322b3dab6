// SPDX-License-Identifier: BSD-3-Clause
#include "firmware_tools/cli/feature_flags.h"

#include <map>
#include <string>

namespace viewfix {

void AddFeatureFlags(CLI::App& command, FeatureOptions& options) {
  static const std::map<std::string, FeatureType> kTypes = {{"surf", FeatureType::kSurf},
                                                            {"color-surf", FeatureType::kColorSurf},
                                                            {"sift", FeatureType::kSift}};
  command
      .add_option(
          "--features", options.type,
          "surf; color-surf, where `train` has no map to check places by: sees colours, too; "
          "or sift (models for the laptop only)")
      ->transform(CLI::CheckedTransformer(kTypes));
  command
      .add_option("--max-features", options.max_features,
                  "features an image; where `train` has no map to check places by, 1600")
      ->check(CLI::Range(16, 8192))
      ->capture_default_str();
  command
      .add_option("--max-side", options.max_image_side,
                  "larger images are shrunk to this longest side, pixels")
      ->check(CLI::Range(64, 4096))
      ->capture_default_str();
  command.add_flag("--upright", options.upright, "no orientation: for cameras that never roll");
}

}  // namespace viewfix
