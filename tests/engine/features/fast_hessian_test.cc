// SPDX-License-Identifier: BSD-3-Clause
#include "engine/features/fast_hessian.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "tests/engine/image/test_image.h"

namespace viewfix {
namespace {

int Mirrored(const TestImage& image, int x, int y) {
  const auto fold = [](int i, int size) {
    return i < 0 ? -1 - i : i >= size ? 2 * size - 1 - i : i;
  };
  return image.At(fold(x, image.width), fold(y, image.height));
}

// Figure 2 of the paper, weight by weight: the filters as matrices.
double DirectResponse(const TestImage& image, int x, int y, int lobe) {
  const int reach = (3 * lobe - 1) / 2;
  double xx = 0;
  double yy = 0;
  double xy = 0;
  for (int dy = -reach; dy <= reach; ++dy) {
    for (int dx = -reach; dx <= reach; ++dx) {
      const int pixel = Mirrored(image, x + dx, y + dy);
      const auto strip = [&](int along, int across) {
        if (std::abs(across) > lobe - 1) return 0;
        return std::abs(along) <= (lobe - 1) / 2 ? -2 : 1;
      };
      xx += strip(dx, dy) * pixel;
      yy += strip(dy, dx) * pixel;
      const bool diagonal = dx != 0 && dy != 0 && std::abs(dx) <= lobe && std::abs(dy) <= lobe;
      if (diagonal) xy += ((dx > 0) == (dy > 0) ? 1 : -1) * pixel;
    }
  }
  const double unit = 1 / (255.0 * 9 * lobe * lobe);
  return (xx * yy - 0.81 * xy * xy) * unit * unit;
}

TEST(FastHessian, ResponsesEqualTheFiltersAppliedDirectly) {
  const TestImage image = NoiseImage(70, 50, 1);
  IntegralImage integral(70, FastHessian::kReach);
  integral.Compute(image.View());
  FastHessian detector(70);
  for (const int lobe : {3, 5, 9, 13}) {
    for (const int step : {1, 2, 4}) {
      std::vector<float> responses(80);  // whole vectors
      for (const int y : {0, 7, 25, 49}) {
        detector.ResponseRow(integral, y, lobe, step, 70 / step, responses.data());
        for (int i = 0; i < 70 / step; ++i) {
          ASSERT_NEAR(responses[i], DirectResponse(image, i * step, y, lobe), 1e-6)
              << lobe << " " << step << " " << i << " " << y;
        }
      }
    }
  }
}

std::vector<Keypoint> Detect(const TestImage& image, float threshold, int max_features = 2000) {
  const int side = std::max(image.width, image.height);
  IntegralImage integral(side, FastHessian::kReach);
  integral.Compute(image.View());
  GridSelector selector(side, max_features);
  selector.Start(image.width, image.height);
  FastHessian(side).Detect(integral, threshold, selector);
  FeatureSet features(max_features, 1);
  selector.Select(features);
  return {features.keypoints().begin(), features.keypoints().end()};
}

TestImage BlobImage(int size, double x0, double y0, double sigma, double height) {
  TestImage image(size, size);
  for (int y = 0; y < size; ++y) {
    for (int x = 0; x < size; ++x) {
      const double r2 = (x - x0) * (x - x0) + (y - y0) * (y - y0);
      image.At(x, y) = static_cast<std::uint8_t>(
          std::lround(128 + height * std::exp(-r2 / (2 * sigma * sigma))));
    }
  }
  return image;
}

TEST(FastHessian, FindsABlobAtItsCentreAndScale) {
  // True Gaussian filters would find a blob at its own sigma, boxes find about 3/4 of it.
  for (const double sigma : {2.5, 3.3, 4.7, 6.0, 9.0, 13.0}) {
    for (const double fraction : {0.0, 0.3, 0.5}) {
      const double x0 = 100 + fraction;
      const double y0 = 99 - fraction / 2;
      const auto found = Detect(BlobImage(200, x0, y0, sigma, 100), 1e-3F);
      ASSERT_FALSE(found.empty()) << sigma;
      const Keypoint best =
          *std::ranges::max_element(found, {}, [](const Keypoint& k) { return k.response; });
      EXPECT_NEAR(best.x, x0, 0.1 + 0.02 * sigma) << sigma;
      EXPECT_NEAR(best.y, y0, 0.1 + 0.02 * sigma) << sigma;
      EXPECT_NEAR(best.sigma / sigma, 0.73, 0.07) << sigma;
      EXPECT_EQ(best.laplacian_sign, -1);
    }
  }
}

TEST(FastHessian, TellsDarkBlobsFromLightOnes) {
  const auto dark = Detect(BlobImage(100, 50, 50, 4, -100), 1e-3F);
  ASSERT_FALSE(dark.empty());
  for (const Keypoint& keypoint : dark) EXPECT_EQ(keypoint.laplacian_sign, 1);
}

TEST(FastHessian, FindsNothingOnPlainOrSlopingGrey) {
  TestImage image(120, 90);
  EXPECT_TRUE(Detect(image, 0).empty());
  for (int y = 0; y < 90; ++y) {
    for (int x = 0; x < 120; ++x) image.At(x, y) = static_cast<std::uint8_t>(x + y);
  }
  EXPECT_TRUE(Detect(image, 1e-5F).empty());
}

TEST(FastHessian, EachPointIsAboveTheThreshold) {
  const TestImage image = BarsImage(200, 150, 3);
  const auto many = Detect(image, 1e-5F);
  const auto few = Detect(image, 1e-2F);
  EXPECT_GT(many.size(), few.size());
  EXPECT_GT(few.size(), 0U);
  for (const Keypoint& keypoint : few)
    EXPECT_GT(keypoint.response, 1e-2F * std::pow(keypoint.sigma, 0.25F));
}

// What is left out on the way could not have been among the chosen.
TEST(FastHessian, FindsTheBestOfAll) {
  for (const int seed : {5, 6, 7}) {
    const TestImage image = seed == 7 ? NoiseImage(240, 200, seed) : BarsImage(240, 200, seed);
    GridSelector selector(240, 100);
    selector.Start(image.width, image.height);
    for (const Keypoint& keypoint : Detect(image, 1e-5F, 8192)) selector.Add(keypoint);
    FeatureSet expected(100, 1);
    selector.Select(expected);
    EXPECT_EQ(expected.size(), 100);
    const auto same = [](const Keypoint& a, const Keypoint& b) {
      return a.x == b.x && a.y == b.y && a.sigma == b.sigma && a.response == b.response;
    };
    EXPECT_TRUE(std::ranges::equal(Detect(image, 1e-5F, 100), expected.keypoints(), same)) << seed;
  }
}

TEST(FastHessian, FindsPointsNearTheEdges) {
  const auto found = Detect(BarsImage(200, 200, 4), 1e-4F);
  const auto near_edge = [](const Keypoint& k) {
    return std::min({k.x, k.y, 199 - k.x, 199 - k.y}) < 6;
  };
  EXPECT_GE(std::ranges::count_if(found, near_edge), 10);
}

}  // namespace
}  // namespace viewfix
