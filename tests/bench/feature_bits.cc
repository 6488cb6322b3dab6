// SPDX-License-Identifier: BSD-3-Clause
// Which bits the features of images are made of, to compare two builds:
//
//   feature_bits [--side PIXELS] [--features N] [--repeat N] [--path N] IMAGE...
//
// --path takes another code path than this processor's best: 0 the plain one, 1 AVX2, 2 AVX-512.
// Prints a line an image: the hash of all key points and descriptors, their number, the
// image's name. With --repeat, the least time of N extractions goes to stderr at the end, as
// the mean over all images.
#include <algorithm>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <exception>
#include <filesystem>
#include <limits>
#include <string>
#include <vector>

#include "engine/features/surf.h"
#include "engine/image/resize.h"
#include "firmware_tools/dataset/image_loader.h"

namespace viewfix {
namespace {

// FNV-1a.
class Hash {
 public:
  template <typename T>
  void Add(const T& value) {
    unsigned char bytes[sizeof(T)];
    std::memcpy(bytes, &value, sizeof(T));
    for (const unsigned char byte : bytes) sum_ = (sum_ ^ byte) * 1099511628211ULL;
  }
  unsigned long long sum() const { return sum_; }

 private:
  unsigned long long sum_ = 14695981039346656037ULL;
};

unsigned long long HashOf(const FeatureSet& features) {
  Hash hash;
  for (const Keypoint& keypoint : features.keypoints()) {
    hash.Add(keypoint.x);
    hash.Add(keypoint.y);
    hash.Add(keypoint.sigma);
    hash.Add(keypoint.cos_angle);
    hash.Add(keypoint.sin_angle);
    hash.Add(keypoint.response);
    hash.Add(keypoint.laplacian_sign);
  }
  for (const std::int8_t value : features.descriptors()) hash.Add(value);
  return hash.sum();
}

struct Arguments {
  FeatureOptions options;
  CpuPath path = BestCpuPath();
  int repeat = 1;
  std::vector<std::filesystem::path> files;
};

Arguments ReadArguments(int argc, char** argv) {
  Arguments arguments;
  for (int i = 1; i < argc; ++i) {
    const std::string argument = argv[i];
    const int value = i + 1 < argc ? std::atoi(argv[i + 1]) : 0;
    if (argument == "--side") {
      arguments.options.max_image_side = value;
    } else if (argument == "--features") {
      arguments.options.max_features = value;
    } else if (argument == "--path") {
      const auto paths = CpuPathsHere();
      arguments.path = paths[std::clamp(value, 0, static_cast<int>(paths.size()) - 1)];
    } else if (argument == "--repeat") {
      arguments.repeat = std::max(1, value);
    } else {
      arguments.files.emplace_back(argument);
      continue;
    }
    ++i;
  }
  return arguments;
}

double ExtractOften(FeatureExtractor& extractor, const ImageView& image, int repeat,
                    FeatureSet& features) {
  double least_ms = std::numeric_limits<double>::infinity();
  for (int i = 0; i < repeat; ++i) {
    const auto start = std::chrono::steady_clock::now();
    if (const Status status = extractor.Extract(image, features); !status.ok()) {
      std::fprintf(stderr, "%s\n", status.text());
      std::exit(1);
    }
    const std::chrono::duration<double, std::milli> time = std::chrono::steady_clock::now() - start;
    least_ms = std::min(least_ms, time.count());
  }
  return least_ms;
}

int Run(const Arguments& arguments) {
  if (const Status status = arguments.options.Validate(); !status.ok()) {
    std::fprintf(stderr, "%s\n", status.text());
    return 1;
  }
  Surf extractor(arguments.options, arguments.path);
  FeatureSet features(arguments.options.max_features, extractor.descriptor_dim());
  Shrinker shrinker(arguments.options.max_image_side);
  double sum_ms = 0;
  for (const std::filesystem::path& file : arguments.files) {
    const YuvImage image = LoadImage(file);
    const ImageView shrunk = shrinker.ShrinkToSide(image.view());
    sum_ms += ExtractOften(extractor, shrunk, arguments.repeat, features);
    std::printf("%016llx %5d %s\n", HashOf(features), features.size(),
                file.filename().string().c_str());
  }
  if (arguments.repeat > 1 && !arguments.files.empty()) {
    std::fprintf(stderr, "%.3f ms an image\n", sum_ms / double(arguments.files.size()));
  }
  return 0;
}

}  // namespace
}  // namespace viewfix

int main(int argc, char** argv) {
  try {
    return viewfix::Run(viewfix::ReadArguments(argc, argv));
  } catch (const std::exception& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 1;
  }
}
