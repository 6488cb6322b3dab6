// SPDX-License-Identifier: BSD-3-Clause
// The stages of a frame on one code path, for a model without landmarks:
//
//   frame_path MODEL IMAGE [PATH [REPEAT]]
//
// PATH: 0 the plain one (what ARM runs), 1 AVX2, 2 AVX-512; default: this processor's best. Prints
// milliseconds, the least of REPEAT. Under `valgrind --tool=callgrind`, the instructions of one
// frame are what a repetition more adds.
#include <algorithm>
#include <array>
#include <charconv>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <string_view>
#include <vector>

#include "engine/features/surf.h"
#include "engine/image/resize.h"
#include "engine/matching/place_evidence.h"
#include "engine/retrieval/retrieval.h"
#include "engine/scoring/scoring.h"
#include "firmware_tools/dataset/image_loader.h"
#include "firmware_tools/training/model_localizer.h"
#include "models/model_view.h"
#include "platform/file.h"

namespace viewfix {
namespace {

constexpr std::array kStages = {"shrink", "features", "words", "scores", "keyframes", "details"};

class Frame {
 public:
  Frame(const ModelView& model, CpuPath path)
      : model_(model),
        path_(path),
        shrink_(model.features().max_image_side, path),
        surf_(FeatureOptionsOf(model.features()), path),
        features_(model.features().max_features, model.features().descriptor_dim),
        vocabulary_(model.vocabulary().words, model.vocabulary().dim, path),
        words_(std::size_t(model.features().max_features) * model.vocabulary().words_per_feature),
        builder_(vocabulary_.size(), model.features().max_features,
                 model.vocabulary().words_per_feature, model.scoring().histogram_map),
        histogram_(builder_.MakeHistogram()),
        scores_(model.scoring().num_pairs),
        retrieval_(model.keyframes(), model.scoring().histogram_map, vocabulary_.size(),
                   model.scoring().num_pairs),
        similarities_(model.keyframes().size),
        places_(model.vocabulary().words, model.vocabulary().dim, model.details(),
                model.scoring().num_locations, model.features().max_features, path) {}

  // Keeps each stage's time in `least` where it is less.
  void Run(const ImageView& image, std::array<double, kStages.size()>& least) {
    const int per_feature = model_.vocabulary().words_per_feature;
    std::size_t stage = 0;
    const auto time = [&](const auto& work) {
      const auto start = std::chrono::steady_clock::now();
      work();
      const std::chrono::duration<double, std::milli> ms = std::chrono::steady_clock::now() - start;
      least[stage] = std::min(least[stage], ms.count());
      ++stage;
    };
    ImageView small;
    std::span<std::uint16_t> found;
    time([&] { small = shrink_.ShrinkToSide(image); });
    time([&] {
      if (!surf_.Extract(small, features_).ok()) std::abort();
      found = std::span(words_).first(std::size_t(features_.size()) * per_feature);
    });
    time([&] { vocabulary_.NearestWords(features_.descriptors(), per_feature, found); });
    time([&] {
      builder_.Build(found, histogram_);
      ScorePairs(model_.scoring(), histogram_, scores_, path_);
    });
    time([&] {
      retrieval_.SetQuery(histogram_);
      retrieval_.Similarities(similarities_);
    });
    time(
        [&] { places_.Weigh(features_.descriptors(), features_.keypoints(), found, per_feature); });
  }

 private:
  const ModelView& model_;
  CpuPath path_;
  Shrinker shrink_;
  Surf surf_;
  FeatureSet features_;
  Vocabulary vocabulary_;
  std::vector<std::uint16_t> words_;
  HistogramBuilder builder_;
  Histogram histogram_;
  std::vector<float> scores_;
  Retrieval retrieval_;
  std::vector<float> similarities_;
  PlaceEvidence places_;
};

// -1: it is none.
int NumberOf(std::string_view text) {
  int number = -1;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), number);
  return error == std::errc() && end == text.data() + text.size() ? number : -1;
}

int Main(int argc, char** argv) {
  if (argc < 3) {
    std::fprintf(stderr, "usage: frame_path MODEL IMAGE [PATH [REPEAT]]\n");
    return 2;
  }
  const auto bytes = ReadFile(argv[1]);
  if (!bytes.ok()) {
    std::fprintf(stderr, "%s: %s\n", argv[1], bytes.status().text());
    return 1;
  }
  const auto model = ModelView::Open(*bytes);
  if (!model.ok() || !model->has_details()) {
    std::fprintf(stderr, "%s: %s\n", argv[1],
                 model.ok() ? "a model without details" : model.status().text());
    return 1;
  }
  const YuvImage image = LoadImage(argv[2]);
  const int best = static_cast<int>(BestCpuPath());
  const int path = argc > 3 ? NumberOf(argv[3]) : best;
  const int repeat = argc > 4 ? NumberOf(argv[4]) : 1;
  if (path < 0 || path > best || repeat < 1) {
    std::fprintf(stderr, "PATH is 0..%d here, REPEAT at least 1\n", best);
    return 2;
  }
  Frame frame(*model, static_cast<CpuPath>(path));
  std::array<double, kStages.size()> least;
  least.fill(1e9);
  for (int i = 0; i < repeat; ++i) frame.Run(image.view(), least);
  for (std::size_t s = 0; s < kStages.size(); ++s) std::printf("%s %.2f\n", kStages[s], least[s]);
  return 0;
}

}  // namespace
}  // namespace viewfix

int main(int argc, char** argv) {
  try {
    return viewfix::Main(argc, argv);
  } catch (const viewfix::ToolError& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 1;
  }
}
