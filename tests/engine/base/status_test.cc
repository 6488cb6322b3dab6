// SPDX-License-Identifier: BSD-3-Clause
#include "engine/base/status.h"

#include <gtest/gtest.h>

#include <string>

namespace viewfix {
namespace {

TEST(Status, DefaultIsOk) { EXPECT_TRUE(Status().ok()); }

TEST(Status, CarriesTextAndDetail) {
  const Status status(StatusCode::kCorrupt, "footer too short", "site.vfx");
  EXPECT_FALSE(status.ok());
  EXPECT_EQ(status.code(), StatusCode::kCorrupt);
  EXPECT_STREQ(status.text(), "footer too short");
  EXPECT_EQ(status.detail(), "site.vfx");
}

TEST(Status, LongDetailKeepsItsEnd) {
  std::string path(1000, 'd');
  path += "/name.jpg";
  const Status status(StatusCode::kIo, "cannot read", path);
  EXPECT_EQ(status.detail().size(), Status::kDetailCapacity);
  EXPECT_TRUE(status.detail().ends_with("/name.jpg"));
}

TEST(Result, HoldsValueOrStatus) {
  const Result<int> value(7);
  ASSERT_TRUE(value.ok());
  EXPECT_EQ(*value, 7);
  EXPECT_TRUE(value.status().ok());
  const Result<int> error(Status(StatusCode::kNotFound, "no such word"));
  EXPECT_FALSE(error.ok());
  EXPECT_EQ(error.status().code(), StatusCode::kNotFound);
}

}  // namespace
}  // namespace viewfix
