// SPDX-License-Identifier: BSD-3-Clause
// Time of the scores of one frame, eq. (5): score/viewfix/LOCATIONSxVIEWSxWORDS.
#include <benchmark/benchmark.h>

#include <random>
#include <string>

#include "engine/scoring/scoring.h"

namespace viewfix {
namespace {

struct Tables {
  std::vector<std::uint16_t> location, view;
  std::vector<float> bias, scale;
  std::vector<std::int8_t> weights;
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
    for (int i = 0; i < words * pairs; ++i) {
      weights.push_back(static_cast<std::int8_t>(static_cast<int>(random() % 255) - 127));
    }
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
Histogram FrameHistogram(int words) {
  std::mt19937 random(2);
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
}

const int kRegistered = [] {
  for (const auto& [locations, views, words] : {std::tuple(10, 3, 500), std::tuple(74, 4, 8000),
                                                std::tuple(100, 3, 2000),
                                                std::tuple(1000, 3, 2000),
                                                std::tuple(10000, 3, 2000)}) {
    const std::string name = "score/viewfix/" + std::to_string(locations) + "x" +
                             std::to_string(views) + "x" + std::to_string(words);
    benchmark::RegisterBenchmark(name.c_str(), BM_Score, locations, views, words)
        ->Unit(benchmark::kMicrosecond);
  }
  return 0;
}();

}  // namespace
}  // namespace viewfix

BENCHMARK_MAIN();
