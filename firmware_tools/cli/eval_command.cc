// SPDX-License-Identifier: BSD-3-Clause
#include <CLI/CLI.hpp>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>

#include "firmware_tools/cli/commands.h"
#include "firmware_tools/cli/set_flags.h"
#include "firmware_tools/cli/terminal.h"
#include "firmware_tools/dataset/tool_file.h"
#include "firmware_tools/evaluation/evaluate.h"
#include "firmware_tools/report/eval_report.h"
#include "firmware_tools/report/map_page.h"
#include "firmware_tools/report/page.h"

namespace viewfix {
namespace {

struct EvalFlags {
  std::string set;
  std::string poses;
  std::string model;
  std::string split = "test";
  std::string unknown;
  std::string json;
  std::string report;
  std::string map;
  bool sequence = false;
  bool filter = false;
  int window = 0;
};

std::string Percent(const nlohmann::ordered_json& share) {
  if (share.is_null()) return "-";
  char text[16];
  std::snprintf(text, sizeof text, "%.1f %%", 100 * share.get<double>());
  return text;
}

std::string Percents(const nlohmann::ordered_json& shares) {
  std::string text;
  for (const auto& share : shares) text += (text.empty() ? "" : " / ") + Percent(share);
  return text.empty() ? "-" : text;
}

std::string Centimetres(const nlohmann::ordered_json& metres) {
  if (metres.is_null()) return "-";
  char text[32];
  std::snprintf(text, sizeof text, "%.1f cm", 100 * metres.get<double>());
  return text;
}

void PrintPose(const nlohmann::ordered_json& pose) {
  if (pose["labelled"].get<int>() == 0) return;
  std::printf("pose                %s localized; median %s, %s deg; 90 %% within %s\n",
              Percent(pose["localized"]).c_str(), Centimetres(pose["median_translation_m"]).c_str(),
              pose["median_rotation_deg"].is_null()
                  ? "-"
                  : std::to_string(pose["median_rotation_deg"].get<double>()).substr(0, 4).c_str(),
              Centimetres(pose["p90_translation_m"]).c_str());
  std::printf("                    5 cm 5 deg: %s, 10 cm 5 deg: %s, 50 cm 5 deg: %s\n",
              Percent(pose["recall"]["0.05m_5deg"]).c_str(),
              Percent(pose["recall"]["0.1m_5deg"]).c_str(),
              Percent(pose["recall"]["0.5m_5deg"]).c_str());
  if (pose.contains("alignment")) {
    std::printf("map                 %d training images, %s RMSE after alignment\n",
                pose["alignment"]["training_images"].get<int>(),
                Centimetres(pose["alignment"]["rmse_m"]).c_str());
  }
}

void PrintLatency(const nlohmann::ordered_json& ms) {
  if (ms["p50"].is_null()) return;
  std::printf("latency             p50 %.1f ms, p99 %.1f ms (features p50 %.1f ms)\n",
              ms["p50"].get<double>(), ms["p99"].get<double>(),
              ms["stages"]["features"]["p50"].get<double>());
}

void PrintAnswered(const nlohmann::ordered_json& f) {
  const auto& refusal = f["refusal"];
  std::printf("answered            %s, of these wrong %s\n", Percent(refusal["answered"]).c_str(),
              Percent(refusal["wrong_of_answered"]).c_str());
  if (refusal["answered_by_level"].size() > 1) {
    std::printf("answered, by level  %s\n", Percents(refusal["answered_by_level"]).c_str());
  }
}

void PrintSequence(const nlohmann::ordered_json& f) {
  std::printf("\nas a sequence       %s tracked from the frames before\n",
              Percent(f["tracked"]).c_str());
  std::printf("location, by level  %s\n", Percents(f["location"]["by_level"]).c_str());
  PrintPose(f["pose"]);
  PrintAnswered(f);
  PrintLatency(f["latency_ms"]);
}

void PrintFigures(const nlohmann::ordered_json& f) {
  std::printf("images              %d (%d skipped)\n", f["images"].get<int>(),
              f["skipped"].get<int>());
  std::printf("location, by level  %s\n", Percents(f["location"]["by_level"]).c_str());
  std::printf("view                %s\n", Percent(f["view"]["accuracy"]).c_str());
  std::printf("nearest keyframe    %s  (location by histogram alone)\n",
              Percents(f["nearest_keyframe"]["by_level"]).c_str());
  std::printf("score alone         %s  (location by eq. (5) alone)\n",
              Percents(f["score_alone"]["by_level"]).c_str());
  const auto& retrieval = f["retrieval"];
  std::printf(
      "right among best    1: %s, 5: %s, 20: %s\n", Percent(retrieval["recall_at"]["1"]).c_str(),
      Percent(retrieval["recall_at"]["5"]).c_str(), Percent(retrieval["recall_at"]["20"]).c_str());
  std::printf("keyframe <= 1 m/30  %s\n", Percent(retrieval["within_1m_30deg"]).c_str());
  PrintPose(f["pose"]);
  PrintAnswered(f);
  if (!f["unknown"].is_null()) {
    std::printf("unknown places      %s answered\n", Percent(f["unknown"]["localized"]).c_str());
  }
  PrintLatency(f["latency_ms"]);
}

EvaluateOptions OptionsOf(const EvalFlags& flags) {
  using Split = EvaluateOptions::Split;
  EvaluateOptions options;
  options.split = flags.split == "test"    ? Split::kTest
                  : flags.split == "train" ? Split::kTrain
                                           : Split::kAll;
  return options;
}

// The figures of each frame alone; of a sequence, with those beside them.
nlohmann::ordered_json Measure(const EvalFlags& flags, const ImageSet& set, const ModelView& model,
                               const Evaluation* unknown) {
  EvaluateOptions options = OptionsOf(flags);
  const Evaluation alone = Evaluate(set, model, options, ShowProgress("evaluating"));
  for (const std::string& skipped : alone.skipped) {
    std::fprintf(stderr, "warning: skipped %s\n", skipped.c_str());
  }
  auto figures = FiguresAsJson(set, alone, unknown);
  if (!flags.sequence) return figures;
  options.sequence = true;
  options.window = flags.window;
  options.filter = flags.filter;
  const Evaluation sequence = Evaluate(set, model, options, ShowProgress("as a sequence"));
  auto of_sequence = SequenceAsJson(set, sequence, figures);
  of_sequence["filter"] = flags.filter;
  return of_sequence;
}

void CheckPages(const EvalFlags& flags) {
  if (!flags.report.empty()) {
    CheckLibrary("--report", ChartLibrary(), "Chart.js");
    CheckCanWrite(flags.report);
  }
  if (!flags.map.empty()) {
    CheckMapLibraries("--map");
    CheckCanWrite(flags.map);
  }
}

// `file` as a link in `page`: relative, so that the folder of both may move.
std::string LinkFrom(const std::filesystem::path& page, const std::filesystem::path& file) {
  const auto folder = std::filesystem::absolute(page).parent_path();
  const auto relative = std::filesystem::absolute(file).lexically_relative(folder);
  return UrlPath(relative.generic_string());
}

void WritePages(const EvalFlags& flags, const ImageSet& set, const ModelView& model,
                const nlohmann::ordered_json& figures) {
  if (!flags.map.empty()) {
    WriteTextFile(flags.map, MapHtml(flags.model, model, nlohmann::ordered_json::array()));
  }
  if (flags.report.empty()) return;
  ReportTitle title = {flags.set, flags.model, flags.split, {}};
  if (!flags.map.empty()) title.map = LinkFrom(flags.report, flags.map);
  WriteTextFile(flags.report, EvalReportHtml(title, set, model, figures));
}

void RunEval(EvalFlags flags) {
  flags.sequence = flags.sequence || flags.filter;
  if (!flags.json.empty()) CheckCanWrite(flags.json);
  CheckPages(flags);
  const auto bytes = ReadModelFile(flags.model);
  const Result<ModelView> model = ModelView::Open(bytes);
  if (!model.ok()) throw ToolError(flags.model + ": " + model.status().text());
  if (!flags.map.empty()) CheckHasMap(flags.model, *model);
  const ImageSet set = LoadImageSetWithPoses(flags.set, flags.poses);
  std::unique_ptr<Evaluation> unknown;
  if (!flags.unknown.empty()) {
    EvaluateOptions all;
    all.split = EvaluateOptions::Split::kAll;
    unknown = std::make_unique<Evaluation>(
        Evaluate(LoadImageSet(flags.unknown), *model, all, ShowProgress("unknown places")));
  }
  auto figures = Measure(flags, set, *model, unknown.get());
  figures["model_sections"] = SectionsAsJson(*model);
  if (!flags.json.empty()) WriteTextFile(flags.json, figures.dump(1) + "\n");
  WritePages(flags, set, *model, figures);
  PrintFigures(flags.sequence ? figures["frame_alone"] : figures);
  if (flags.sequence) PrintSequence(figures);
}

}  // namespace

void AddEval(CLI::App& app) {
  auto flags = std::make_shared<EvalFlags>();
  CLI::App* command = app.add_subcommand(
      "eval", "measure a model on a set\nExample: viewfix eval museum --model museum.vfx");
  command->add_option("set", flags->set, "folder of an image set, or its CSV")->required();
  command->add_option("--model", flags->model, "the model file")->required();
  command->add_option("--split", flags->split, "which images: test, train or all")
      ->check(CLI::IsMember({"test", "train", "all"}))
      ->capture_default_str();
  command->add_option("--unknown", flags->unknown,
                      "a set of other places: what share of it is answered");
  command->add_flag("--sequence", flags->sequence,
                    "measure also as a moving camera: each frame is first looked for where the "
                    "frames of its capture before it lead");
  command->add_flag("--filter", flags->filter,
                    "as viewfixd does: frames that agree with those before them gain confidence, "
                    "those that contradict them lose it; with it, --sequence is meant too");
  command
      ->add_option("--window", flags->window,
                   "with --sequence: poses adjusted together over so many frames, 3 to 8; 0: "
                   "not")
      ->check(CLI::IsMember({0, 3, 4, 5, 6, 7, 8}))
      ->capture_default_str();
  AddPosesFlag(*command, flags->poses);
  command->add_option("--json", flags->json, "write every figure to this file");
  command->add_option("--report", flags->report,
                      "write it all as one HTML page that works offline: plots, locations, worst "
                      "failures");
  command->add_option("--map", flags->map,
                      "write also the page of viewfix map; the report links to it");
  command->callback([flags] { RunEval(*flags); });
}

}  // namespace viewfix
