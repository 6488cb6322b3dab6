// SPDX-License-Identifier: BSD-3-Clause
// Time of the scores of one frame, eq. (5): score/viewfix/LOCATIONSxVIEWSxWORDS, beside how long
// this machine takes to read as many bytes (floor_ms); and what the paper compares with, on one
// set of histograms: score/WHO/LOCATIONSxVIEWSxWORDS. And of the keyframes' likeness to the frame:
// keyframes/viewfix/KEYFRAMES, of 500 features each among 2000 words.
#include <benchmark/benchmark.h>

#include <algorithm>
#include <ctime>
#include <limits>
#include <numeric>
#include <opencv2/core/utility.hpp>
#include <opencv2/features2d.hpp>
#include <random>
#include <string>

#include "engine/retrieval/retrieval.h"
#include "engine/scoring/scoring.h"
#include "firmware_tools/experiment/libsvm.h"

namespace viewfix {
namespace {

// Milliseconds to read a megabyte that no cache holds, the least of a few times.
double MillisecondsPerMegabyte() {
  static const double least = [] {
    constexpr std::size_t kWords = std::size_t{1} << 24;
    const std::vector<std::uint64_t> memory(kWords, 1);
    double shortest = std::numeric_limits<double>::infinity();
    for (int i = 0; i < 10; ++i) {
      const std::clock_t start = std::clock();
      benchmark::DoNotOptimize(std::accumulate(memory.begin(), memory.end(), std::uint64_t{0}));
      const double time = 1e3 * static_cast<double>(std::clock() - start) / CLOCKS_PER_SEC;
      shortest = std::min(shortest, time);
    }
    return shortest / (kWords * sizeof(std::uint64_t) / 1e6);
  }();
  return least;
}

struct Tables {
  std::vector<std::uint16_t> location, view;
  std::vector<float> bias, scale;
  std::vector<std::uint8_t> weights;
  ModelScoring model;

  Tables(int locations, int views, int words) {
    std::mt19937 random(1);
    const int pairs = locations * views;
    for (int p = 0; p < pairs; ++p) {
      location.push_back(static_cast<std::uint16_t>(p / views));
      view.push_back(static_cast<std::uint16_t>(p % views));
    }
    bias.assign(pairs, 0.1F);
    scale.assign(pairs, 0.01F);
    weights.resize(std::size_t(words) * PackedWeights(pairs));
    for (std::uint8_t& both : weights) both = static_cast<std::uint8_t>(random());
    model.num_locations = locations;
    model.num_views = views;
    model.num_pairs = pairs;
    model.pair_location = location;
    model.pair_view = view;
    model.bias = bias;
    model.weight_scale = scale;
    model.weights = weights;
  }
};

// The histogram of a frame of 800 features with three words each that fall at random.
Histogram FrameHistogram(int words, unsigned seed = 2) {
  std::mt19937 random(seed);
  std::vector<std::uint16_t> found(800 * 3);
  for (auto& word : found) word = static_cast<std::uint16_t>(random() % words);
  Histogram histogram;
  HistogramBuilder(words, 800, 3, HistogramMap::kHellinger).Build(found, histogram);
  return histogram;
}

void BM_Score(benchmark::State& state, int locations, int views, int words) {
  const Tables tables(locations, views, words);
  const Histogram histogram = FrameHistogram(words);
  std::vector<float> pairs(tables.model.num_pairs);
  std::vector<float> scores(tables.model.num_locations);
  for ([[maybe_unused]] auto _ : state) {
    ScorePairs(tables.model, histogram, pairs);
    ScoreLocations(tables.model, pairs, scores);
    benchmark::DoNotOptimize(scores.data());
  }
  const double megabytes = double(histogram.size()) * PackedWeights(tables.model.num_pairs) / 1e6;
  state.counters["MB"] = megabytes;
  state.counters["floor_ms"] = megabytes * MillisecondsPerMegabyte();
}

// The paper's set: ten locations, three views, 17 images of each.
constexpr int kLocations = 10, kImagesOfLocation = 3 * 17, kWords = 500;

std::vector<Histogram> TrainingHistograms() {
  std::vector<Histogram> histograms;
  for (int i = 0; i < kLocations * kImagesOfLocation; ++i) {
    histograms.push_back(FrameHistogram(kWords, 100 + i));
  }
  return histograms;
}

// One against the rest, by libsvm's own prediction.
void BM_Libsvm(benchmark::State& state) {
  const std::vector<Histogram> histograms = TrainingHistograms();
  std::vector<int> locations;
  for (std::size_t i = 0; i < histograms.size(); ++i) {
    locations.push_back(static_cast<int>(i) / kImagesOfLocation);
  }
  const auto predictor = TrainLibsvmOneVsRest(histograms, locations, kLocations, 10);
  const Histogram frame = FrameHistogram(kWords);
  for ([[maybe_unused]] auto _ : state) benchmark::DoNotOptimize(predictor->Predict(frame));
}

cv::Mat DenseRows(const std::vector<Histogram>& histograms) {
  cv::Mat rows = cv::Mat::zeros(static_cast<int>(histograms.size()), kWords, CV_32F);
  for (int i = 0; i < rows.rows; ++i) {
    const Histogram& h = histograms[i];
    for (int e = 0; e < h.size(); ++e) rows.at<float>(i, h.words[e]) = h.values[e];
  }
  return rows;
}

// The nearest training histogram, by exhaustive search.
void BM_NearestNeighbour(benchmark::State& state) {
  const cv::Mat training = DenseRows(TrainingHistograms());
  const cv::Mat frame = DenseRows({FrameHistogram(kWords)});
  const cv::BFMatcher matcher(cv::NORM_L2);
  std::vector<cv::DMatch> nearest;
  for ([[maybe_unused]] auto _ : state) matcher.match(frame, training, nearest);
}

// Every third word or so, of 2000, once.
void BM_Keyframes(benchmark::State& state, int keyframes) {
  constexpr int kAll = 2000, kOfKeyframe = 500;
  std::mt19937 random(3);
  std::vector<std::uint8_t> words;
  std::vector<std::uint32_t> begin = {0};
  for (int k = 0; k < keyframes; ++k) {
    for (int i = 0; i < kOfKeyframe; ++i) {
      words.push_back(static_cast<std::uint8_t>(random() % 4 * (kMaxKeyframeCount + 1) + 1));
    }
    begin.push_back(static_cast<std::uint32_t>(words.size()));
  }
  const std::vector<std::uint16_t> pair(keyframes, 0);
  ModelKeyframes model;
  model.size = keyframes;
  model.pair = pair;
  model.word_begin = begin;
  model.words = words;
  Retrieval retrieval(model, HistogramMap::kHellinger, kAll, 1);
  retrieval.SetQuery(FrameHistogram(kAll));
  std::vector<float> similarities(keyframes);
  for ([[maybe_unused]] auto _ : state) {
    retrieval.Similarities(similarities);
    benchmark::DoNotOptimize(similarities.data());
  }
}

const int kRegistered = [] {
  for (const auto& [locations, views, words] :
       {std::tuple(10, 3, 500), std::tuple(74, 4, 8000), std::tuple(100, 3, 2000),
        std::tuple(1000, 3, 2000), std::tuple(10000, 3, 2000)}) {
    const std::string name = "score/viewfix/" + std::to_string(locations) + "x" +
                             std::to_string(views) + "x" + std::to_string(words);
    benchmark::RegisterBenchmark(name.c_str(), BM_Score, locations, views, words)
        ->Unit(benchmark::kMicrosecond);
  }
  benchmark::RegisterBenchmark("score/libsvm/10x3x500", BM_Libsvm)->Unit(benchmark::kMicrosecond);
  benchmark::RegisterBenchmark("score/opencv_bfmatcher/10x3x500", BM_NearestNeighbour)
      ->Unit(benchmark::kMicrosecond);
  for (const int keyframes : {100, 1000, 10000}) {
    const std::string name = "keyframes/viewfix/" + std::to_string(keyframes);
    benchmark::RegisterBenchmark(name.c_str(), BM_Keyframes, keyframes)
        ->Unit(benchmark::kMicrosecond);
  }
  return 0;
}();

}  // namespace
}  // namespace viewfix

int main(int argc, char** argv) {
  cv::setNumThreads(1);
  benchmark::Initialize(&argc, argv);
  if (benchmark::ReportUnrecognizedArguments(argc, argv)) return 1;
  benchmark::RunSpecifiedBenchmarks();
  benchmark::Shutdown();
  return 0;
}
