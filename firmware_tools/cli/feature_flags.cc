// SPDX-License-Identifier: BSD-3-Clause
#include "firmware_tools/cli/feature_flags.h"

#include <map>
#include <string>

namespace viewfix {

void AddFeatureFlags(CLI::App& command, FeatureOptions& options) {
  static const std::map<std::string, FeatureType> kTypes = [] {
    std::map<std::string, FeatureType> types;
    for (const auto type : {FeatureType::kSurf, FeatureType::kSurfChroma, FeatureType::kColorSurf,
                            FeatureType::kSift}) {
      types.emplace(FeatureTypeName(type), type);
    }
    return types;
  }();
  command
      .add_option_function<std::string>(
          "--features", [&options](const std::string& name) { options.type = kTypes.at(name); },
          "surf; surf-chroma, where `train` makes a map: colours tell look-alike places apart; "
          "color-surf, where it makes none: descriptors see colours; or sift (models for the "
          "laptop only)")
      ->check(CLI::IsMember(kTypes));
  command
      .add_option(
          "--max-features", options.max_features,
          "features an image; for `train` 1500 where it makes a map, 1600 where it has none "
          "to check places by")
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
