// SPDX-License-Identifier: BSD-3-Clause
#include "firmware_tools/training/kmeans.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <limits>
#include <random>
#include <set>

#include "firmware_tools/dataset/image_set.h"

namespace viewfix {
namespace {

using Bytes = std::vector<std::int8_t>;

Bytes RandomBytes(std::size_t count, int low, int high, std::uint64_t seed) {
  std::mt19937_64 random(seed);
  Bytes bytes(count);
  for (std::int8_t& byte : bytes) {
    byte = static_cast<std::int8_t>(low + static_cast<int>(random() % (high - low + 1)));
  }
  return bytes;
}

std::int64_t SquaredDistance(const std::int8_t* a, const std::int8_t* b, int dim) {
  std::int64_t sum = 0;
  for (int i = 0; i < dim; ++i) sum += (a[i] - b[i]) * (a[i] - b[i]);
  return sum;
}

// The lowest index of the nearest word, and the distance to it.
std::pair<int, std::int64_t> Nearest(const std::int8_t* descriptor, const Bytes& words, int dim) {
  std::pair<int, std::int64_t> nearest = {-1, std::numeric_limits<std::int64_t>::max()};
  for (int w = 0; w < static_cast<int>(words.size()) / dim; ++w) {
    const std::int64_t distance2 = SquaredDistance(descriptor, &words[std::size_t(w) * dim], dim);
    if (distance2 < nearest.second) nearest = {w, distance2};
  }
  return nearest;
}

std::int64_t Inertia(const Bytes& descriptors, const Bytes& words, int dim) {
  std::int64_t inertia = 0;
  for (std::size_t i = 0; i < descriptors.size(); i += dim) {
    inertia += Nearest(&descriptors[i], words, dim).second;
  }
  return inertia;
}

std::set<Bytes> Rows(const Bytes& bytes, int dim) {
  std::set<Bytes> rows;
  for (auto begin = bytes.begin(); begin != bytes.end(); begin += dim) {
    rows.insert(Bytes(begin, begin + dim));
  }
  return rows;
}

KMeansOptions Options(int num_words, int jobs = 1) {
  KMeansOptions options;
  options.num_words = num_words;
  options.jobs = jobs;
  return options;
}

TEST(KMeans, RecoversSeparateClusters) {
  for (const int dim : {16, 64, 128}) {
    const Bytes centres = RandomBytes(std::size_t(20) * dim, -90, 90, 3);
    const Bytes noise = RandomBytes(std::size_t(3000) * dim, -3, 3, 4);
    Bytes descriptors = noise;
    for (std::size_t i = 0; i < 3000; ++i) {
      for (int d = 0; d < dim; ++d) {
        descriptors[i * dim + d] =
            static_cast<std::int8_t>(centres[i % 20 * dim + d] + noise[i * dim + d]);
      }
    }
    const auto result = ClusterDescriptors(descriptors, dim, Options(20));
    ASSERT_EQ(result.words.size(), std::size_t(20) * dim);
    std::set<int> found;
    for (int c = 0; c < 20; ++c) {
      const auto [word, distance2] = Nearest(&centres[std::size_t(c) * dim], result.words, dim);
      EXPECT_LE(distance2, dim);  // the mean of 150 draws from -3..3, rounded
      found.insert(word);
    }
    EXPECT_EQ(found.size(), 20u);
  }
}

TEST(KMeans, InertiaNeverRisesAndIsTheBruteForceOne) {
  const int dim = 8;
  const Bytes descriptors = RandomBytes(std::size_t(4000) * dim, -50, 50, 5);
  KMeansOptions options = Options(40);
  Bytes words;
  for (int iterations = 1; iterations < 12; ++iterations) {
    options.max_iterations = iterations;
    const auto result = ClusterDescriptors(descriptors, dim, options);
    ASSERT_EQ(result.inertia.size(), static_cast<std::size_t>(iterations));
    EXPECT_TRUE(std::is_sorted(result.inertia.rbegin(), result.inertia.rend()));
    // The words after so many iterations are what the next one starts from.
    if (!words.empty()) {
      EXPECT_EQ(result.inertia.back(), Inertia(descriptors, words, dim));
    }
    words = result.words;
  }
}

TEST(KMeans, DoesNotDependOnThreadsButOnTheSeed) {
  const Bytes descriptors = RandomBytes(std::size_t(5000) * 16, -50, 50, 6);
  const auto one = ClusterDescriptors(descriptors, 16, Options(30, 1));
  for (const int jobs : {0, 2, 3, 7}) {
    const auto other = ClusterDescriptors(descriptors, 16, Options(30, jobs));
    EXPECT_EQ(one.words, other.words);
    EXPECT_EQ(one.inertia, other.inertia);
  }
  KMeansOptions options = Options(30);
  options.seed = 2;
  EXPECT_NE(one.words, ClusterDescriptors(descriptors, 16, options).words);
}

TEST(KMeans, EqualDescriptorsEnd) {
  const Bytes descriptors(std::size_t(1000) * 64, 17);
  const auto result = ClusterDescriptors(descriptors, 64, Options(10));
  EXPECT_EQ(result.words, Bytes(std::size_t(10) * 64, 17));
  EXPECT_EQ(result.inertia.back(), 0);
}

TEST(KMeans, FewDistinctDescriptorsAreAllFound) {
  const Bytes distinct = RandomBytes(std::size_t(12) * 16, -100, 100, 7);
  Bytes descriptors;
  for (int i = 0; i < 50; ++i)
    descriptors.insert(descriptors.end(), distinct.begin(), distinct.end());
  for (const int num_words : {12, 20}) {
    const auto result = ClusterDescriptors(descriptors, 16, Options(num_words));
    EXPECT_EQ(Rows(result.words, 16), Rows(distinct, 16));
  }
}

TEST(KMeans, AsManyWordsAsDescriptorsAreTheDescriptors) {
  const Bytes descriptors = RandomBytes(std::size_t(50) * 16, -100, 100, 8);
  const auto result = ClusterDescriptors(descriptors, 16, Options(50));
  EXPECT_EQ(Rows(result.words, 16), Rows(descriptors, 16));
}

// Almost all seeds fall on the heap; the rare far group must still get its word.
TEST(KMeans, OutliersAttractUnusedWords) {
  Bytes descriptors(std::size_t(2000) * 4, 0);
  for (int i = 0; i < 4; ++i) {
    descriptors[i] = 100;
    descriptors[4 + i] = -100;
  }
  const auto result = ClusterDescriptors(descriptors, 4, Options(3));
  EXPECT_EQ(result.inertia.back(), 0);
}

TEST(KMeans, ReportsProgressToTheEnd) {
  const Bytes descriptors = RandomBytes(std::size_t(500) * 8, -50, 50, 9);
  int last = -1;
  int end = 0;
  ClusterDescriptors(descriptors, 8, Options(5), [&](int done, int total) {
    EXPECT_GT(done, last);
    last = done;
    end = total;
  });
  EXPECT_EQ(last, end);
}

TEST(KMeans, RefusesWhatCannotBe) {
  const Bytes descriptors = RandomBytes(std::size_t(40) * 8, -50, 50, 10);
  EXPECT_NO_THROW(ClusterDescriptors(descriptors, 8, Options(40)));
  EXPECT_THROW(ClusterDescriptors(descriptors, 8, Options(41)), ToolError);
  EXPECT_THROW(ClusterDescriptors({}, 8, Options(2)), ToolError);
  EXPECT_THROW(ClusterDescriptors(descriptors, 7, Options(2)), ToolError);
  EXPECT_THROW(ClusterDescriptors(descriptors, 0, Options(2)), ToolError);
  EXPECT_THROW(ClusterDescriptors(descriptors, 160, Options(2)), ToolError);
  EXPECT_THROW(ClusterDescriptors(descriptors, 8, Options(1)), ToolError);
  EXPECT_THROW(ClusterDescriptors(descriptors, 8, Options(70000)), ToolError);
  KMeansOptions options = Options(5);
  options.max_iterations = 0;
  EXPECT_THROW(ClusterDescriptors(descriptors, 8, options), ToolError);
}

}  // namespace
}  // namespace viewfix
