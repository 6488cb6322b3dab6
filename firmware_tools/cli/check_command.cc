// SPDX-License-Identifier: BSD-3-Clause
#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstdio>
#include <memory>
#include <nlohmann/json.hpp>

#include "firmware_tools/cli/commands.h"
#include "firmware_tools/cli/feature_flags.h"
#include "firmware_tools/cli/terminal.h"
#include "firmware_tools/dataset/tool_file.h"
#include "firmware_tools/evaluation/check_set.h"

namespace viewfix {
namespace {

struct CheckFlags {
  std::string set;
  std::string json;
  TrainOptions options;
};

void PrintRecall(const CheckReport& report) {
  if (report.recall.empty()) return;
  std::printf("\nRecall to expect, from blocks of neighbouring images held out:\n");
  for (const ExpectedRecall& row : report.recall) {
    if (row.held_out == 0) continue;
    std::printf("  %-36s %-12s %3d of %3d%s%s\n", row.location.c_str(), row.view.c_str(), row.right,
                row.held_out, row.mostly_taken_for.empty() ? "" : ", else mostly ",
                row.mostly_taken_for.c_str());
  }
  std::printf("  all: %.1f %% of the held-out images at the right location\n",
              100 * report.expected_location_accuracy);
}

void PrintReport(const CheckReport& report) {
  int errors = 0;
  for (const Finding& finding : report.findings) {
    std::printf("%-8s %s\n", SeverityName(finding.severity), finding.text.c_str());
    errors += finding.severity == Severity::kError ? 1 : 0;
  }
  PrintRecall(report);
  std::printf("\n%zu findings, %d of them errors\n", report.findings.size(), errors);
}

void RunCheck(const CheckFlags& flags) {
  if (!flags.json.empty()) CheckCanWrite(flags.json);
  const ImageSet set = LoadImageSet(flags.set);
  const CheckReport report = CheckImageSet(set, flags.options, ShowProgress);
  if (!flags.json.empty()) WriteTextFile(flags.json, ToJson(report).dump(1) + "\n");
  PrintReport(report);
}

}  // namespace

void AddCheck(CLI::App& app) {
  auto flags = std::make_shared<CheckFlags>();
  CLI::App* command = app.add_subcommand(
      "check",
      "what is wrong or thin in an image set, before training\nExample: viewfix check museum");
  command->add_option("set", flags->set, "folder of an image set, or its CSV")->required();
  command->add_option("--json", flags->json, "write the findings to this file");
  AddFeatureFlags(*command, flags->options.features);
  command->add_option("--jobs", flags->options.jobs, "threads; 0: all cores")
      ->check(CLI::NonNegativeNumber)
      ->capture_default_str();
  command->callback([flags] { RunCheck(*flags); });
}

}  // namespace viewfix
