// SPDX-License-Identifier: BSD-3-Clause
#include "firmware_tools/training/kmeans.h"

#include <algorithm>
#include <array>
#include <atomic>
#include <limits>
#include <random>
#include <string>

#include "engine/vocabulary/vocabulary.h"
#include "firmware_tools/dataset/image_set.h"

namespace viewfix {
namespace {

constexpr std::size_t kMinUsed = 500'000;
constexpr std::size_t kUsedPerWord = 64;
// Descriptors that k-means++ draws from: it reads all of them for every word.
constexpr std::size_t kSeedsPerWord = 8;
constexpr std::size_t kSeedTrials = 3;
// A fall of the inertia by less than this share ends the iterations.
constexpr double kMinImprovement = 1e-3;
constexpr std::size_t kChunk = 1024;

using Descriptors = std::span<const std::int8_t>;

void CheckArguments(Descriptors descriptors, int dim, const KMeansOptions& options) {
  if (dim < 1 || dim > 128 || descriptors.size() % dim != 0) {
    throw ToolError("visual words: descriptors of " + std::to_string(dim) + " dimensions");
  }
  if (options.num_words < 2 || options.num_words > std::numeric_limits<std::uint16_t>::max()) {
    throw ToolError("visual words: " + std::to_string(options.num_words) +
                    " asked for, 2 to 65535 are possible");
  }
  if (options.max_iterations < 1) throw ToolError("visual words: no iteration asked for");
  const std::size_t count = descriptors.size() / dim;
  if (count < static_cast<std::size_t>(options.num_words)) {
    throw ToolError("visual words: " + std::to_string(options.num_words) + " asked for, but the " +
                    "photographs gave " + std::to_string(count) + " descriptors only");
  }
}

// The remainder and not a distribution of <random>, which each library computes its own way.
std::uint64_t Below(std::uint64_t n, std::mt19937_64& random) { return random() % n; }

// `wanted` descriptors in their order, all equally likely (Knuth, algorithm S).
std::vector<std::int8_t> Draw(Descriptors descriptors, int dim, std::size_t wanted,
                              std::mt19937_64& random) {
  const std::size_t count = descriptors.size() / dim;
  wanted = std::min(wanted, count);
  std::vector<std::int8_t> drawn;
  drawn.reserve(wanted * dim);
  for (std::size_t i = 0; i < count; ++i) {
    const std::size_t missing = wanted - drawn.size() / dim;
    if (Below(count - i, random) >= missing) continue;
    const auto begin = descriptors.begin() + i * dim;
    drawn.insert(drawn.end(), begin, begin + dim);
  }
  return drawn;
}

std::int32_t SquaredDistance(const std::int8_t* a, const std::int8_t* b, int dim) {
  std::int32_t sum = 0;
  for (int i = 0; i < dim; ++i) {
    const auto difference = static_cast<std::int16_t>(a[i] - b[i]);
    sum += std::int32_t{difference} * difference;
  }
  return sum;
}

// The first i for which the sum of weights up to i exceeds `target`.
std::size_t FindCumulated(const std::vector<std::int32_t>& weights, std::uint64_t target) {
  std::size_t i = 0;
  for (; i + 1 < weights.size(); ++i) {
    if (target < static_cast<std::uint64_t>(weights[i])) break;
    target -= weights[i];
  }
  return i;
}

int NumChunks(std::size_t count) { return static_cast<int>((count + kChunk - 1) / kChunk); }

// Draws words among descriptors by greedy k-means++: candidates are drawn with the
// probability of their squared distance to the words so far; the best of a few is taken.
class Seeding {
 public:
  Seeding(Descriptors descriptors, int dim, int jobs)
      : descriptors_(descriptors),
        dim_(dim),
        jobs_(jobs),
        distance2_(descriptors.size() / dim, kFar) {}

  std::vector<std::int8_t> Run(int num_words, std::mt19937_64& random) {
    Take(Below(distance2_.size(), random));
    for (int w = 1; w < num_words; ++w) Take(BestOf(DrawCandidates(random)));
    return std::move(words_);
  }

 private:
  using Candidates = std::array<std::size_t, kSeedTrials>;
  // Keeps the sums of distances below 2^63 for 2^32 descriptors.
  static constexpr std::int32_t kFar = std::numeric_limits<std::int32_t>::max();

  // To the words so far and descriptor `candidate`.
  std::int32_t DistanceWith(std::size_t i, std::size_t candidate) const {
    return std::min(distance2_[i], SquaredDistance(&descriptors_[i * dim_],
                                                   &descriptors_[candidate * dim_], dim_));
  }

  void Take(std::size_t chosen) {
    const auto begin = descriptors_.begin() + chosen * dim_;
    words_.insert(words_.end(), begin, begin + dim_);
    total_ = 0;
    for (std::size_t i = 0; i < distance2_.size(); ++i) {
      distance2_[i] = DistanceWith(i, chosen);
      total_ += distance2_[i];
    }
  }

  Candidates DrawCandidates(std::mt19937_64& random) const {
    Candidates candidates;
    for (std::size_t& candidate : candidates) {
      candidate = total_ > 0 ? FindCumulated(distance2_, Below(total_, random))
                             : Below(distance2_.size(), random);
    }
    return candidates;
  }

  std::size_t BestOf(const Candidates& candidates) const {
    std::array<std::atomic<std::uint64_t>, kSeedTrials> totals = {};
    ParallelFor(NumChunks(distance2_.size()), jobs_, [&](int chunk) {
      const std::size_t end = std::min((chunk + 1) * kChunk, distance2_.size());
      for (std::size_t c = 0; c < candidates.size(); ++c) {
        std::uint64_t total = 0;
        for (std::size_t i = chunk * kChunk; i < end; ++i) total += DistanceWith(i, candidates[c]);
        totals[c] += total;
      }
    });
    return candidates[std::min_element(totals.begin(), totals.end()) - totals.begin()];
  }

  Descriptors descriptors_;
  int dim_;
  int jobs_;
  std::vector<std::int32_t> distance2_;  // to the nearest word so far
  std::uint64_t total_ = 0;
  std::vector<std::int8_t> words_;
};

// Sums over the descriptors of each word.
struct Sums {
  Sums(int num_words, int dim) : sum(std::size_t(num_words) * dim), count(num_words) {}

  void Add(Descriptors descriptor, int word) {
    std::int32_t* target = &sum[word * descriptor.size()];
    for (std::size_t i = 0; i < descriptor.size(); ++i) target[i] += descriptor[i];
    ++count[word];
  }
  void Add(const Sums& other) {
    for (std::size_t i = 0; i < sum.size(); ++i) sum[i] += other.sum[i];
    for (std::size_t i = 0; i < count.size(); ++i) count[i] += other.count[i];
    inertia += other.inertia;
  }

  std::vector<std::int32_t> sum;  // [num_words, dim]: 2^31 holds 2^24 descriptors
  std::vector<std::int32_t> count;
  std::int64_t inertia = 0;
};

// Assigns each descriptor to its nearest word. Whole numbers: the threads' order is nothing.
Sums Assign(Descriptors descriptors, int dim, Descriptors words, int jobs,
            std::vector<std::int32_t>& distance2) {
  const Vocabulary vocabulary(words, dim);
  std::vector<Sums> sums(Workers(jobs), Sums(vocabulary.size(), dim));
  const auto assign_chunk = [&](int chunk, int worker) {
    const std::size_t begin = chunk * kChunk;
    const std::size_t end = std::min(begin + kChunk, distance2.size());
    std::vector<std::uint16_t> nearest(end - begin);
    vocabulary.NearestWords(descriptors.subspan(begin * dim, nearest.size() * dim), 1, nearest);
    for (std::size_t i = begin; i < end; ++i) {
      const Descriptors descriptor = descriptors.subspan(i * dim, dim);
      const std::uint16_t word = nearest[i - begin];
      sums[worker].Add(descriptor, word);
      distance2[i] = SquaredDistance(descriptor.data(), &words[std::size_t{word} * dim], dim);
      sums[worker].inertia += distance2[i];
    }
  };
  ParallelForWorkers(NumChunks(distance2.size()), jobs, assign_chunk);
  for (std::size_t w = 1; w < sums.size(); ++w) sums[0].Add(sums[w]);
  return std::move(sums[0]);
}

std::int8_t RoundedMean(std::int32_t sum, std::int32_t count) {
  const std::int32_t half = sum >= 0 ? count / 2 : -(count / 2);
  return static_cast<std::int8_t>((sum + half) / count);
}

// Indices of the `wanted` greatest distances, the lower index first among equals.
std::vector<int> Farthest(const std::vector<std::int32_t>& distance2, std::size_t wanted) {
  std::vector<int> order(distance2.size());
  for (std::size_t i = 0; i < order.size(); ++i) order[i] = static_cast<int>(i);
  std::partial_sort(order.begin(), order.begin() + wanted, order.end(), [&](int a, int b) {
    return distance2[a] != distance2[b] ? distance2[a] > distance2[b] : a < b;
  });
  order.resize(wanted);
  return order;
}

void MoveWords(const Sums& sums, Descriptors descriptors, int dim,
               const std::vector<std::int32_t>& distance2, std::vector<std::int8_t>& words) {
  std::vector<std::size_t> unused;
  for (std::size_t w = 0; w < sums.count.size(); ++w) {
    if (sums.count[w] == 0) unused.push_back(w);
    for (int i = 0; i < dim && sums.count[w] > 0; ++i) {
      words[w * dim + i] = RoundedMean(sums.sum[w * dim + i], sums.count[w]);
    }
  }
  if (unused.empty()) return;
  const std::vector<int> farthest = Farthest(distance2, unused.size());
  for (std::size_t u = 0; u < unused.size(); ++u) {
    std::copy_n(descriptors.begin() + std::size_t(farthest[u]) * dim, dim,
                words.begin() + unused[u] * dim);
  }
}

bool StillFalls(const std::vector<std::int64_t>& inertia) {
  if (inertia.size() < 2) return inertia.back() > 0;
  const std::int64_t fall = inertia[inertia.size() - 2] - inertia.back();
  return static_cast<double>(fall) > kMinImprovement * static_cast<double>(inertia.back());
}

}  // namespace

KMeansResult ClusterDescriptors(std::span<const std::int8_t> descriptors, int dim,
                                const KMeansOptions& options, const Progress& progress) {
  CheckArguments(descriptors, dim, options);
  std::mt19937_64 random(options.seed);
  const std::size_t num_words = options.num_words;
  const auto used = Draw(descriptors, dim, std::max(kMinUsed, kUsedPerWord * num_words), random);
  const auto seeds = Draw(used, dim, kSeedsPerWord * num_words, random);
  KMeansResult result;
  result.words = Seeding(seeds, dim, options.jobs).Run(options.num_words, random);
  std::vector<std::int32_t> distance2(used.size() / dim);
  for (int iteration = 0; iteration < options.max_iterations; ++iteration) {
    if (progress) progress(iteration, options.max_iterations);
    const Sums sums = Assign(used, dim, result.words, options.jobs, distance2);
    result.inertia.push_back(sums.inertia);
    if (!StillFalls(result.inertia)) break;
    MoveWords(sums, used, dim, distance2, result.words);
  }
  if (progress) progress(options.max_iterations, options.max_iterations);
  return result;
}

}  // namespace viewfix
