// SPDX-License-Identifier: BSD-3-Clause
// `viewfix experiment` as a user runs it.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <map>
#include <nlohmann/json.hpp>

#include "tests/firmware_tools/cli/viewfix_program.h"
#include "tests/testing/small_site.h"

namespace viewfix {
namespace {

using ::testing::HasSubstr;

class ExperimentCommandTest : public ::testing::Test {
 protected:
  ProgramRun Run(const std::string& set, std::vector<std::string> more = {}) {
    std::vector<std::string> arguments = {"experiment", set,  "--json",         Json(),
                                          "--words",    "20", "--max-features", "100",
                                          "--splits",   "2"};
    arguments.insert(arguments.end(), more.begin(), more.end());
    return Viewfix(arguments);
  }
  std::string Json() const { return folder_ / "figures.json"; }
  nlohmann::json Figures() const { return nlohmann::json::parse(std::ifstream(Json())); }
  // The figures without times.
  nlohmann::json Timeless() const {
    nlohmann::json figures = Figures();
    WithoutTimes(figures["libsvm_itself"]);
    for (auto& method : figures["methods"]) WithoutTimes(method);
    return figures;
  }
  static void WithoutTimes(nlohmann::json& cost) {
    for (const char* name : {"ms_per_prediction", "ms_ci95", "times_ours", "times_ours_ci95"}) {
      ASSERT_EQ(cost.erase(name), 1U) << name;
    }
  }

  TempFolder folder_;
};

TEST_F(ExperimentCommandTest, MeasuresEveryMethod) {
  const std::string site = WriteSmallSite(folder_, "site", 6);
  const ProgramRun run = Run(site);
  ASSERT_EQ(run.exit_code, 0) << run.err;
  EXPECT_THAT(run.out, HasSubstr("mtl_sparse_trace"));
  const nlohmann::json figures = Figures();
  EXPECT_EQ(figures["splits"], 2);
  std::map<std::string, nlohmann::json> methods;
  for (const auto& method : figures["methods"]) methods[method["name"]] = method;
  for (const char* name :
       {"multitask_svm", "svm_view_left", "svm_view_right", "svm_independent", "svm_pooled",
        "svm_one_vs_rest", "nearest_neighbour", "mtl_sparse_trace", "mtl_cmtl", "mtl_caso"}) {
    ASSERT_TRUE(methods.count(name)) << name;
    const auto& location = methods[name]["location"];
    EXPECT_LE(location["ci95"][0], location["mean"]) << name;
    EXPECT_GE(location["ci95"][1], location["mean"]) << name;
    EXPECT_GT(methods[name]["ms_per_prediction"], 0) << name;
    EXPECT_LE(methods[name]["ms_ci95"][0], methods[name]["ms_per_prediction"]) << name;
    EXPECT_GE(methods[name]["ms_ci95"][1], methods[name]["ms_per_prediction"]) << name;
  }
  EXPECT_GE(methods["multitask_svm"]["location"]["mean"], 0.8);
  EXPECT_TRUE(methods["svm_view_left"]["view"].is_null());
  EXPECT_TRUE(methods["svm_view_left"].contains("location_of_own_view"));
  EXPECT_GT(methods["nearest_neighbour"]["multiply_adds_times_ours"], 1);
  EXPECT_EQ(methods["multitask_svm"]["times_ours"], 1);
  EXPECT_EQ(figures["scores"]["rows"].size(), 2U);
  EXPECT_LE(figures["scores"]["right_cell_highest"], 2);
  EXPECT_EQ(figures["scores"]["columns"].size(), 6U);
}

TEST_F(ExperimentCommandTest, IsTheSameWithAnyNumberOfThreads) {
  const std::string site = WriteSmallSite(folder_, "site", 6);
  ASSERT_EQ(Run(site, {"--jobs", "1"}).exit_code, 0);
  const nlohmann::json one = Timeless();
  ASSERT_EQ(Run(site, {"--jobs", "3"}).exit_code, 0);
  EXPECT_EQ(one, Timeless());
}

TEST_F(ExperimentCommandTest, RefusalsNameTheSet) {
  folder_.Write("one/images.csv", std::string_view("path,location\na.jpg,lobby\nb.jpg,lobby\n"));
  const ProgramRun run = Run(folder_ / "one");
  EXPECT_EQ(run.exit_code, 1);
  EXPECT_THAT(LastLine(run), HasSubstr("images.csv"));
  EXPECT_FALSE(std::filesystem::exists(Json()));
  EXPECT_EQ(Run(folder_ / "none").exit_code, 1);
  EXPECT_EQ(Viewfix({"experiment", "set"}).exit_code, 2);
  EXPECT_EQ(Run(folder_ / "one", {"--splits", "0"}).exit_code, 2);
}

}  // namespace
}  // namespace viewfix
