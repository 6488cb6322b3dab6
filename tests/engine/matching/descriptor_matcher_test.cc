// SPDX-License-Identifier: BSD-3-Clause
#include "engine/matching/descriptor_matcher.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <random>

namespace viewfix {
namespace {

std::vector<std::int8_t> RandomBytes(int count, int lowest, int highest, unsigned seed) {
  std::mt19937 random(seed);
  std::vector<std::int8_t> bytes(count);
  for (std::int8_t& b : bytes) {
    b = static_cast<std::int8_t>(lowest + static_cast<int>(random() % (highest - lowest + 1)));
  }
  return bytes;
}

// Few different values, so that equal distances occur.
struct Problem {
  Problem(int n, int m, int dim_in, unsigned seed)
      : dim(dim_in),
        queries(RandomBytes(n * dim, -128, 127, seed)),
        candidates(RandomBytes(m * dim, -128, 127, seed + 1)),
        query_signs(RandomBytes(n, -1, 1, seed + 2)),
        candidate_signs(RandomBytes(m, -1, 1, seed + 3)) {
    for (int i = 0; i < m / 4 * dim; ++i) candidates[candidates.size() - 1 - i] = candidates[i];
  }
  DescriptorSet query_set(bool signs) const {
    return {queries,
            signs ? std::span<const std::int8_t>(query_signs) : std::span<const std::int8_t>()};
  }
  DescriptorSet candidate_set(bool signs) const {
    return {candidates,
            signs ? std::span<const std::int8_t>(candidate_signs) : std::span<const std::int8_t>()};
  }

  int dim;
  std::vector<std::int8_t> queries, candidates, query_signs, candidate_signs;
};

NearestTwo BruteForce(const DescriptorSet& queries, int q, const DescriptorSet& candidates,
                      int dim) {
  NearestTwo nearest;
  for (int c = 0; c < static_cast<int>(candidates.descriptors.size()) / dim; ++c) {
    if (!queries.signs.empty() && !candidates.signs.empty() &&
        queries.signs[q] != candidates.signs[c]) {
      continue;
    }
    std::int32_t distance2 = 0;
    for (int i = 0; i < dim; ++i) {
      const int d = queries.descriptors[q * dim + i] - candidates.descriptors[c * dim + i];
      distance2 += d * d;
    }
    if (distance2 < nearest.distance2) {
      nearest = {c, distance2, nearest.distance2};
    } else {
      nearest.second_distance2 = std::min(nearest.second_distance2, distance2);
    }
  }
  return nearest;
}

class FindNearest : public ::testing::TestWithParam<std::tuple<int, bool>> {};  // dim, signs

TEST_P(FindNearest, AgreesWithBruteForce) {
  const auto [dim, signs] = GetParam();
  for (const auto& [n, m] : {std::pair{0, 5}, {1, 0}, {1, 1}, {3, 2}, {37, 61}, {64, 9}}) {
    const Problem problem(n, m, dim, n * 100 + m);
    DescriptorMatcher matcher(64, 61, dim);
    std::vector<NearestTwo> nearest(n);
    ASSERT_TRUE(
        matcher.FindNearest(problem.query_set(signs), problem.candidate_set(signs), nearest).ok());
    for (int q = 0; q < n; ++q) {
      const NearestTwo expected =
          BruteForce(problem.query_set(signs), q, problem.candidate_set(signs), dim);
      EXPECT_EQ(nearest[q].candidate_idx, expected.candidate_idx);
      EXPECT_EQ(nearest[q].distance2, expected.distance2);
      EXPECT_EQ(nearest[q].second_distance2, expected.second_distance2);
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Dimensions, FindNearest,
                         ::testing::Combine(::testing::Values(1, 7, 64, 128), ::testing::Bool()));

class Match : public ::testing::TestWithParam<std::tuple<float, bool>> {};  // ratio, mutual

TEST_P(Match, KeepsWhatBruteForceKeeps) {
  const auto [ratio, mutual] = GetParam();
  const Problem problem(60, 50, 7, 5);
  const DescriptorSet queries = problem.query_set(true);
  const DescriptorSet candidates = problem.candidate_set(true);
  std::vector<std::pair<int, int>> expected;
  for (int q = 0; q < 60; ++q) {
    const NearestTwo nearest = BruteForce(queries, q, candidates, 7);
    if (nearest.candidate_idx < 0) continue;
    if (std::sqrt(double(nearest.distance2)) >
        ratio * std::sqrt(double(nearest.second_distance2))) {
      continue;
    }
    const int back = BruteForce(candidates, nearest.candidate_idx, queries, 7).candidate_idx;
    if (!mutual || back == q) expected.emplace_back(q, nearest.candidate_idx);
  }
  DescriptorMatcher matcher(60, 60, 7);
  std::vector<DescriptorMatch> matches(60);
  const Result<int> count = matcher.Match(queries, candidates, {ratio, mutual}, matches);
  ASSERT_TRUE(count.ok());
  std::vector<std::pair<int, int>> found;
  for (int i = 0; i < *count; ++i) {
    found.emplace_back(matches[i].query_idx, matches[i].candidate_idx);
  }
  EXPECT_EQ(found, expected);
}

INSTANTIATE_TEST_SUITE_P(Options, Match,
                         ::testing::Combine(::testing::Values(0.7F, 0.9F, 1.0F),
                                            ::testing::Bool()));

TEST(DescriptorMatcher, RefusesWhatItWasNotMadeFor) {
  const Problem problem(4, 4, 8, 1);
  DescriptorMatcher matcher(3, 4, 8);
  std::vector<NearestTwo> nearest(4);
  std::vector<DescriptorMatch> matches(4);
  EXPECT_EQ(
      matcher.FindNearest(problem.query_set(false), problem.candidate_set(false), nearest).code(),
      StatusCode::kResourceExhausted);
  EXPECT_EQ(matcher.Match(problem.query_set(false), problem.candidate_set(false), {}, matches)
                .status()
                .code(),
            StatusCode::kResourceExhausted);
  DescriptorSet broken = problem.candidate_set(false);
  broken.descriptors = broken.descriptors.first(9);
  EXPECT_EQ(matcher.FindNearest(broken, broken, nearest).code(), StatusCode::kInvalidArgument);
  EXPECT_FALSE(MatchOptions{.max_ratio = 1.5F}.Validate().ok());
}

}  // namespace
}  // namespace viewfix
