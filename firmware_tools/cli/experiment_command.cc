// SPDX-License-Identifier: BSD-3-Clause
#include <CLI/CLI.hpp>
#include <cstdio>
#include <memory>
#include <nlohmann/json.hpp>

#include "firmware_tools/cli/commands.h"
#include "firmware_tools/cli/feature_flags.h"
#include "firmware_tools/cli/set_flags.h"
#include "firmware_tools/cli/terminal.h"
#include "firmware_tools/dataset/tool_file.h"
#include "firmware_tools/experiment/experiment.h"
#include "firmware_tools/experiment/results.h"
#include "firmware_tools/report/experiment_report.h"
#include "firmware_tools/report/page.h"

namespace viewfix {
namespace {

struct ExperimentFlags {
  std::string set;
  std::string poses;
  std::string json;
  std::string report;
  std::string histogram = "hellinger";
  ExperimentOptions options;
};

void RunExperimentCommand(const ExperimentFlags& flags) {
  ExperimentOptions options = flags.options;
  options.histogram_map = flags.histogram == "l1" ? HistogramMap::kL1 : HistogramMap::kHellinger;
  CheckCanWrite(flags.json);
  if (!flags.report.empty()) {
    CheckLibrary("--report", ChartLibrary(), "Chart.js");
    CheckCanWrite(flags.report);
  }
  const ImageSet set = LoadImageSetWithPoses(flags.set, flags.poses);
  const ExperimentResult result = RunExperiment(set, options, ShowProgress);
  for (const std::string& warning : result.warnings) {
    std::fprintf(stderr, "warning: %s\n", warning.c_str());
  }
  const auto figures = ExperimentAsJson(set, result, options);
  WriteTextFile(flags.json, figures.dump(1) + "\n");
  if (!flags.report.empty()) {
    WriteTextFile(flags.report, ExperimentReportHtml(flags.set, figures));
  }
  std::fputs(ExperimentAsText(figures).c_str(), stdout);
}

}  // namespace

void AddExperiment(CLI::App& app) {
  auto flags = std::make_shared<ExperimentFlags>();
  ExperimentOptions& options = flags->options;
  CLI::App* command =
      app.add_subcommand("experiment",
                         "measure the multi-task SVM against its rivals on a labelled set\n"
                         "Example: viewfix experiment museum --json museum-experiment.json");
  command->add_option("set", flags->set, "folder of an image set, or its CSV")->required();
  command->add_option("--json", flags->json, "write every figure to this file")->required();
  command->add_option("--report", flags->report,
                      "write them as one HTML page that works offline: tables and plots");
  command
      ->add_option("--splits", options.splits,
                   "divisions into training and test images: the set's own first, if it has one, "
                   "then random ones")
      ->check(CLI::Range(1, 1000))
      ->capture_default_str();
  command
      ->add_option("--locations", options.max_locations,
                   "only so many locations, those with the most training images; 0: all")
      ->check(CLI::NonNegativeNumber)
      ->capture_default_str();
  command->add_option("--words", options.num_words, "visual words")
      ->check(CLI::Range(2, 65535))
      ->capture_default_str();
  command->add_option("--histogram", flags->histogram, "hellinger, or l1 as in the paper")
      ->check(CLI::IsMember({"hellinger", "l1"}))
      ->capture_default_str();
  AddPosesFlag(*command, flags->poses);
  AddFeatureFlags(*command, options.features);
  command->add_option("--seed", options.seed, "seed of the splits and the vocabulary")
      ->capture_default_str();
  command->add_option("--jobs", options.jobs, "threads; 0: all cores")
      ->check(CLI::NonNegativeNumber)
      ->capture_default_str();
  command->callback([flags] { RunExperimentCommand(*flags); });
}

}  // namespace viewfix
