// SPDX-License-Identifier: BSD-3-Clause
#include "firmware_tools/evaluation/check_pixels.h"

#include <algorithm>
#include <functional>
#include <map>

#include "engine/image/resize.h"
#include "firmware_tools/dataset/image_loader.h"
#include "firmware_tools/evaluation/check_text.h"

namespace viewfix {
namespace {

// Of a location's images: a few bad ones are only noted.
constexpr double kManyShare = 0.2;

std::uint64_t FingerprintOf(const YuvImage& image) {
  std::uint64_t hash = 0xCBF29CE484222325U;  // FNV-1a
  const auto add = [&](std::uint64_t value) { hash = (hash ^ value) * 0x100000001B3U; };
  add(static_cast<std::uint64_t>(image.width));
  for (const std::uint8_t pixel : image.pixels) add(pixel);
  return hash;
}

std::string PlaceName(const std::string& location) {
  return location.empty() ? "images without a location" : location;
}

// A kind of bad picture, and what to do about it.
struct Fault {
  const char* kind;
  const char* are;
  const char* advice;
};

// One finding for each location that has images with the fault.
std::vector<Finding> ByLocation(const ImageSet& set, const Fault& fault,
                                const std::function<bool(int)>& has_fault) {
  std::map<std::string, int> images_of;
  std::map<std::string, std::vector<std::string>> bad_of;
  for (int i = 0; i < static_cast<int>(set.images.size()); ++i) {
    const ImageRecord& image = set.images[i];
    ++images_of[image.location];
    if (has_fault(i)) bad_of[image.location].push_back(image.path);
  }
  std::vector<Finding> findings;
  for (const auto& [location, bad] : bad_of) {
    const int images = images_of[location];
    const bool many = static_cast<double>(bad.size()) > kManyShare * images;
    findings.push_back({many ? Severity::kWarning : Severity::kNote,
                        fault.kind,
                        Text(PlaceName(location), ": ", bad.size(), " of ", images, " images ",
                             fault.are, ": ", fault.advice, " (", FirstFew(bad), ")"),
                        bad,
                        {location}});
  }
  return findings;
}

void Append(std::vector<Finding> more, std::vector<Finding>& findings) {
  std::move(more.begin(), more.end(), std::back_inserter(findings));
}

Finding Duplicate(const ImageRecord& a, const ImageRecord& b) {
  const std::string both = Text(a.path, " and ", b.path, " are the same picture");
  if (a.location != b.location) {
    return {Severity::kError,
            "duplicate_other_location",
            Text(both, ", labelled ", PlaceName(a.location), " and ", PlaceName(b.location),
                 ": one label is wrong"),
            {a.path, b.path},
            {a.location, b.location}};
  }
  if (a.is_test != b.is_test) {
    return {Severity::kWarning,
            "duplicate_in_test",
            Text(both, ", one for training and one for testing: the test is no test"),
            {a.path, b.path},
            {a.location}};
  }
  return {Severity::kNote, "duplicate", both + ": one is enough", {a.path, b.path}, {a.location}};
}

}  // namespace

std::vector<ImagePixels> ReadPixels(const ImageSet& set, int max_image_side, int jobs,
                                    const Progress& progress) {
  std::vector<ImagePixels> all(set.images.size());
  std::vector<Shrinker> shrinkers(Workers(jobs), Shrinker(max_image_side));
  const auto read = [&](int i, int worker) {
    try {
      const YuvImage image = LoadImage(set.FullPath(set.images[i]));
      all[i].quality = MeasureQuality(shrinkers[worker].ShrinkToSide(image.view()));
      all[i].fingerprint = FingerprintOf(image);
    } catch (const ToolError& error) {
      all[i].unreadable = error.what();
    }
  };
  ParallelForWorkers(static_cast<int>(all.size()), jobs, read, progress);
  return all;
}

std::vector<Finding> CheckPixels(const ImageSet& set, const std::vector<ImagePixels>& pixels) {
  std::vector<Finding> findings;
  for (std::size_t i = 0; i < pixels.size(); ++i) {
    if (pixels[i].unreadable.empty()) continue;
    const ImageRecord& image = set.images[i];
    findings.push_back(
        {Severity::kWarning, "unreadable", pixels[i].unreadable, {image.path}, {image.location}});
  }
  const auto add = [&](const Fault& fault, auto has_fault) {
    Append(ByLocation(
               set, fault,
               [&](int i) { return pixels[i].unreadable.empty() && has_fault(pixels[i].quality); }),
           findings);
  };
  add({"blurred", "are blurred", "hold the camera still, move slowly, or add light"},
      [](const ImageQuality& q) { return q.blurred(); });
  add({"dark", "are mostly black", "add light, or a longer exposure"},
      [](const ImageQuality& q) { return q.dark(); });
  add({"overexposed", "are burnt out", "lower the exposure, or turn away from the window"},
      [](const ImageQuality& q) { return q.overexposed(); });
  return findings;
}

std::vector<Finding> CheckDuplicates(const ImageSet& set, const std::vector<ImagePixels>& pixels) {
  std::vector<Finding> findings;
  std::map<std::uint64_t, std::size_t> first;
  for (std::size_t i = 0; i < pixels.size(); ++i) {
    if (!pixels[i].unreadable.empty()) continue;
    const auto [other, is_new] = first.emplace(pixels[i].fingerprint, i);
    if (!is_new) findings.push_back(Duplicate(set.images[other->second], set.images[i]));
  }
  return findings;
}

std::vector<Finding> CheckFeatureless(const ImageSet& set, const FeatureStore& features,
                                      const std::vector<ImagePixels>& pixels) {
  std::vector<bool> featureless(set.images.size());
  for (const FeatureStore::Failure& failure : features.failures) {
    featureless[failure.image_idx] = pixels[failure.image_idx].unreadable.empty();
  }
  return ByLocation(set,
                    {"no_features", "show too little to recognize",
                     "step back from plain walls, and see that there is light"},
                    [&](int i) { return featureless[i]; });
}

}  // namespace viewfix
