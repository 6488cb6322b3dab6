// SPDX-License-Identifier: BSD-3-Clause
// Time of features, words and matches beside their peers, one thread, on the same photographs:
// STAGE/WHO[/PARAMETERS], milliseconds. $VIEWFIX_BENCH_IMAGES holds files of photographs, one a
// line (tests/bench/run.sh sets it); without it the images are drawn.
#include <benchmark/benchmark.h>

#include <algorithm>
#include <cstdlib>
#include <functional>
#include <opencv2/core/utility.hpp>
#include <opencv2/features2d.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <random>
#include <sstream>
#include <string>
#include <vector>

#include "engine/features/surf.h"
#include "engine/features/surf_descriptor.h"
#include "engine/matching/descriptor_matcher.h"
#include "engine/vocabulary/vocabulary.h"
#include "tests/bench/feature_study.h"

namespace viewfix {
namespace {

constexpr int kFeatures = 800;

std::vector<cv::Mat> LoadImages() {
  std::vector<cv::Mat> images;
  const char* const list = std::getenv("VIEWFIX_BENCH_IMAGES");
  std::istringstream files(list == nullptr ? "" : list);
  for (std::string file; std::getline(files, file);) {
    const cv::Mat image = cv::imread(file, cv::IMREAD_GRAYSCALE);
    if (!image.empty()) images.push_back(image);
  }
  for (unsigned seed = 1; images.size() < 2; ++seed) {
    images.push_back(RenderStudyImage(1280, 960, seed));
  }
  return images;
}

// All photographs, stretched to one size.
std::vector<cv::Mat> Images(int width, int height) {
  static const std::vector<cv::Mat> loaded = LoadImages();
  std::vector<cv::Mat> images;
  for (const cv::Mat& image : loaded) {
    cv::resize(image, images.emplace_back(), cv::Size(width, height), 0, 0, cv::INTER_AREA);
  }
  return images;
}

ImageView View(const cv::Mat& image) {
  return {image.data, image.cols, image.rows, static_cast<int>(image.step)};
}

FeatureOptions Options(int side) {
  FeatureOptions options;
  options.max_image_side = side;
  options.max_features = kFeatures;
  return options;
}

// One image an iteration, in turn.
using Work = std::function<void(const cv::Mat&)>;
void RunOverImages(benchmark::State& state, const std::vector<cv::Mat>& images, const Work& work) {
  std::size_t i = 0;
  for ([[maybe_unused]] auto _ : state) work(images[i++ % images.size()]);
}

void FeaturesViewfix(benchmark::State& state, int width, int height) {
  Surf surf(Options(std::max(width, height)));
  FeatureSet features(kFeatures, kSurfDim);
  RunOverImages(state, Images(width, height), [&](const cv::Mat& image) {
    benchmark::DoNotOptimize(surf.Extract(View(image), features).ok());
  });
  // Least work of any fast-Hessian: 4 corners of 8 boxes a response, filtered once a layer
  // and pixel (octaves share), and 8 corners of 689 samples a feature.
  const double responses = double(width) * height * (6 + 3 / 4.0 + 3 / 16.0 + 1 / 64.0);
  state.counters["floor_Mreads"] = (responses * 32 + kFeatures * 689.0 * 8) / 1e6;
}

void FeaturesOpenCv(benchmark::State& state, const cv::Ptr<cv::Feature2D>& method) {
  std::vector<cv::KeyPoint> keypoints;
  cv::Mat descriptors;
  RunOverImages(state, Images(640, 480), [&](const cv::Mat& image) {
    method->detectAndCompute(image, cv::noArray(), keypoints, descriptors);
  });
}

void FeaturesDlib(benchmark::State& state) {
  const auto method = MakeDlibSurf(2);
  RunOverImages(state, Images(640, 480), [&](const cv::Mat& image) {
    benchmark::DoNotOptimize(method->Extract(image, kFeatures).keypoints.data());
  });
}

std::vector<std::int8_t> Descriptors(const cv::Mat& image) {
  Surf surf(Options(640));
  FeatureSet features(kFeatures, kSurfDim);
  benchmark::DoNotOptimize(surf.Extract(View(image), features).ok());
  return {features.descriptors().begin(), features.descriptors().end()};
}

// Words that lie like descriptors do: `count` from the photographs with noise.
std::vector<std::int8_t> Words(int count) {
  std::mt19937 random(1);
  std::vector<std::int8_t> pool;
  for (const cv::Mat& image : Images(640, 480)) {
    const auto descriptors = Descriptors(image);
    pool.insert(pool.end(), descriptors.begin(), descriptors.end());
  }
  std::vector<std::int8_t> words;
  while (words.size() < std::size_t(count) * kSurfDim) {
    const std::size_t begin = random() % (pool.size() / kSurfDim) * kSurfDim;
    for (int d = 0; d < kSurfDim; ++d) {
      const int value = pool[begin + d] + static_cast<int>(random() % 9) - 4;
      words.push_back(static_cast<std::int8_t>(std::clamp(value, -127, 127)));
    }
  }
  return words;
}

cv::Mat AsFloats(const std::vector<std::int8_t>& bytes) {
  const cv::Mat rows(static_cast<int>(bytes.size()) / kSurfDim, kSurfDim, CV_8S,
                     const_cast<std::int8_t*>(bytes.data()));
  cv::Mat floats;
  rows.convertTo(floats, CV_32F);
  return floats;
}

void WordsViewfix(benchmark::State& state, int count) {
  const Vocabulary vocabulary(Words(count), kSurfDim);
  const auto descriptors = Descriptors(Images(640, 480).front());
  std::vector<std::uint16_t> words(descriptors.size() / kSurfDim * 3);
  for ([[maybe_unused]] auto _ : state) {
    vocabulary.NearestWords(descriptors, 3, words);
    benchmark::DoNotOptimize(words.data());
  }
  const double products = double(count) * double(descriptors.size());
  state.counters["Gproducts/s"] =
      benchmark::Counter(products / 1e9, benchmark::Counter::kIsIterationInvariantRate);
}

// What cv::BOWImgDescriptorExtractor does with descriptors given to it.
void WordsOpenCv(benchmark::State& state, int count) {
  cv::BOWImgDescriptorExtractor extractor(cv::BFMatcher::create(cv::NORM_L2));
  extractor.setVocabulary(AsFloats(Words(count)));
  const cv::Mat descriptors = AsFloats(Descriptors(Images(640, 480).front()));
  cv::Mat histogram;
  for ([[maybe_unused]] auto _ : state) extractor.compute(descriptors, histogram);
}

void MatchViewfix(benchmark::State& state) {
  const std::vector<cv::Mat> images = Images(640, 480);
  const auto queries = Descriptors(images[0]);
  const auto candidates = Descriptors(images[1]);
  DescriptorMatcher matcher(kFeatures, kFeatures, kSurfDim);
  std::vector<DescriptorMatch> matches(kFeatures);
  for ([[maybe_unused]] auto _ : state) {
    benchmark::DoNotOptimize(matcher.Match({queries}, {candidates}, {}, matches).ok());
  }
}

// What a frame costs as landmarks grow in number.
void MatchLandmarks(benchmark::State& state, int landmarks) {
  const auto queries = Descriptors(Images(640, 480).front());
  const auto candidates = Words(landmarks);
  DescriptorMatcher matcher(kFeatures, landmarks, kSurfDim);
  std::vector<DescriptorMatch> matches(kFeatures);
  for ([[maybe_unused]] auto _ : state) {
    benchmark::DoNotOptimize(matcher.Match({queries}, {candidates}, {}, matches).ok());
  }
}

void MatchOpenCv(benchmark::State& state) {
  const std::vector<cv::Mat> images = Images(640, 480);
  const cv::Mat queries = AsFloats(Descriptors(images[0]));
  const cv::Mat candidates = AsFloats(Descriptors(images[1]));
  const cv::BFMatcher matcher(cv::NORM_L2);
  std::vector<std::vector<cv::DMatch>> matches;
  for ([[maybe_unused]] auto _ : state) matcher.knnMatch(queries, candidates, matches, 2);
}

template <typename Function, typename... Args>
void Register(const std::string& name, Function function, Args... args) {
  benchmark::RegisterBenchmark(name.c_str(), function, args...)->Unit(benchmark::kMillisecond);
}

void RegisterAll() {
  for (const auto& [width, height] : {std::pair(320, 240), {640, 480}, {960, 720}, {1280, 960}}) {
    Register("features/viewfix/" + std::to_string(width) + "x" + std::to_string(height),
             FeaturesViewfix, width, height);
  }
  Register("features/opencv_orb_1000/640x480", FeaturesOpenCv,
           cv::Ptr<cv::Feature2D>(cv::ORB::create(1000)));
  Register("features/opencv_sift/640x480", FeaturesOpenCv,
           cv::Ptr<cv::Feature2D>(cv::SIFT::create(kFeatures)));
  Register("features/dlib_surf/640x480", FeaturesDlib);
  for (const int count : {500, 2000, 8000, 50000}) {
    Register("words/viewfix/" + std::to_string(count), WordsViewfix, count);
  }
  for (const int count : {500, 2000}) {
    Register("words/opencv_bow/" + std::to_string(count), WordsOpenCv, count);
  }
  Register("match/viewfix/800x800", MatchViewfix);
  for (const int landmarks : {3200, 12800}) {
    Register("match/viewfix/800x" + std::to_string(landmarks), MatchLandmarks, landmarks);
  }
  Register("match/opencv_bfmatcher/800x800", MatchOpenCv);
}

}  // namespace
}  // namespace viewfix

int main(int argc, char** argv) {
  cv::setNumThreads(1);
  viewfix::RegisterAll();
  benchmark::Initialize(&argc, argv);
  if (benchmark::ReportUnrecognizedArguments(argc, argv)) return 1;
  benchmark::RunSpecifiedBenchmarks();
  benchmark::Shutdown();
  return 0;
}
