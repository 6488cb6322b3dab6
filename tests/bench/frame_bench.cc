// SPDX-License-Identifier: BSD-3-Clause
// Time of whole frames, pixels to fix, one thread, and of the first one after a start:
// frame/viewfix and open/viewfix. $VIEWFIX_BENCH_MODEL is a model, $VIEWFIX_BENCH_IMAGES holds
// files of photographs, one a line (tests/bench/run.sh sets both). Counters are milliseconds of
// this thread's processor time: median and 99 % of the frames' least times, and the stages'
// medians.
#include <benchmark/benchmark.h>

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <fstream>
#include <iterator>
#include <sstream>
#include <stdexcept>
#include <string>
#include <vector>

#include "engine/localizer.h"
#include "firmware_tools/dataset/image_loader.h"
#include "models/model_view.h"

namespace viewfix {
namespace {

std::int64_t ThreadTimeNs() {
  timespec time;
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &time);
  return std::int64_t{time.tv_sec} * 1'000'000'000 + time.tv_nsec;
}

std::string Variable(const char* name) {
  const char* const value = std::getenv(name);
  return value == nullptr ? "" : value;
}

// As 64-bit numbers, for a model's alignment.
const std::vector<std::uint64_t>& ModelFile() {
  static const std::vector<std::uint64_t> file = [] {
    std::ifstream stream(Variable("VIEWFIX_BENCH_MODEL"), std::ios::binary);
    std::string bytes{std::istreambuf_iterator<char>(stream), {}};
    bytes.resize(bytes.size() / sizeof(std::uint64_t) * sizeof(std::uint64_t));
    std::vector<std::uint64_t> words(bytes.size() / sizeof(std::uint64_t));
    std::copy(bytes.begin(), bytes.end(), reinterpret_cast<char*>(words.data()));
    return words;
  }();
  return file;
}

ModelView OpenModel() {
  const std::vector<std::uint64_t>& file = ModelFile();
  const auto model = ModelView::Open(
      {reinterpret_cast<const std::uint8_t*>(file.data()), file.size() * sizeof(std::uint64_t)});
  if (!model.ok())
    throw std::runtime_error(std::string("VIEWFIX_BENCH_MODEL: ") + model.status().text());
  return *model;
}

Localizer MakeLocalizer(const ModelView& model) {
  LocalizerOptions options;
  options.now_ns = ThreadTimeNs;
  auto localizer = Localizer::Create(model, options);
  if (!localizer.ok()) throw std::runtime_error(localizer.status().text());
  return std::move(*localizer);
}

std::vector<YuvImage> Photographs() {
  std::vector<YuvImage> images;
  std::istringstream files(Variable("VIEWFIX_BENCH_IMAGES"));
  for (std::string file; std::getline(files, file);) {
    images.push_back(LoadImage(file));
  }
  if (images.empty()) throw std::runtime_error("VIEWFIX_BENCH_IMAGES: none");
  return images;
}

StageTimes Localize(Localizer& localizer, const YuvImage& image) {
  const auto fix = localizer.Localize(image.view());
  if (!fix.ok()) throw std::runtime_error(fix.status().text());
  return fix->ms;
}

double Quantile(std::vector<float> values, double share) {
  std::sort(values.begin(), values.end());
  return values[static_cast<std::size_t>(share * static_cast<double>(values.size() - 1) + 0.5)];
}

void BM_Frame(benchmark::State& state) {
  const ModelView model = OpenModel();
  Localizer localizer = MakeLocalizer(model);
  const std::vector<YuvImage> images = Photographs();
  std::vector<StageTimes> least;
  for (const YuvImage& image : images) least.push_back(Localize(localizer, image));
  std::size_t i = 0;
  for ([[maybe_unused]] auto _ : state) {
    const StageTimes ms = Localize(localizer, images[i]);
    if (ms.total < least[i].total) least[i] = ms;
    i = (i + 1) % images.size();
  }
  const auto quantile = [&](float StageTimes::*stage, double share) {
    std::vector<float> values;
    for (const StageTimes& ms : least) values.push_back(ms.*stage);
    return Quantile(values, share);
  };
  state.counters["p50"] = quantile(&StageTimes::total, 0.5);
  state.counters["p99"] = quantile(&StageTimes::total, 0.99);
  state.counters["features"] = quantile(&StageTimes::features, 0.5);
  state.counters["score"] = quantile(&StageTimes::score, 0.5);
  state.counters["verify"] = quantile(&StageTimes::verify, 0.5);
  state.counters["pose"] = quantile(&StageTimes::pose, 0.5);
}
BENCHMARK(BM_Frame)->Name("frame/viewfix")->Unit(benchmark::kMillisecond)->MinTime(2);

// From a model's bytes in memory to the first fix.
void BM_Open(benchmark::State& state) {
  const YuvImage image = Photographs().front();
  ModelFile();
  for ([[maybe_unused]] auto _ : state) {
    const ModelView model = OpenModel();
    Localizer localizer = MakeLocalizer(model);
    benchmark::DoNotOptimize(Localize(localizer, image));
  }
}
BENCHMARK(BM_Open)->Name("open/viewfix")->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace viewfix

int main(int argc, char** argv) {
  benchmark::Initialize(&argc, argv);
  if (benchmark::ReportUnrecognizedArguments(argc, argv)) return 1;
  try {
    benchmark::RunSpecifiedBenchmarks();
  } catch (const std::exception& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 1;
  }
  benchmark::Shutdown();
  return 0;
}
