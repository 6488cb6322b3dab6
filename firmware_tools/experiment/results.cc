// SPDX-License-Identifier: BSD-3-Clause
#include "firmware_tools/experiment/results.h"

#include <algorithm>
#include <cstdio>
#include <functional>
#include <nlohmann/json.hpp>
#include <numeric>
#include <random>

namespace viewfix {
namespace {

using Json = nlohmann::ordered_json;
using Right = std::vector<std::vector<bool>>;  // [splits][images]

constexpr int kResamples = 2000;

double Mean(const std::vector<bool>& values) {
  double sum = 0;
  for (const bool value : values) sum += value ? 1 : 0;
  return sum / static_cast<double>(values.size());
}

double ResampledMean(const std::vector<bool>& values, std::mt19937_64& random) {
  double sum = 0;
  for (std::size_t i = 0; i < values.size(); ++i) sum += values[random() % values.size()] ? 1 : 0;
  return sum / static_cast<double>(values.size());
}

// Whether each test image that counts is right.
Right Judge(const ExperimentResult& result, const MethodResult& method,
            const std::function<bool(const Truth&)>& counts,
            const std::function<bool(const Truth&, const Answer&)>& is_right) {
  Right right(result.truths.size());
  for (std::size_t s = 0; s < result.truths.size(); ++s) {
    for (std::size_t i = 0; i < result.truths[s].size(); ++i) {
      const Truth& truth = result.truths[s][i];
      if (counts(truth)) right[s].push_back(is_right(truth, method.answers[s][i]));
    }
  }
  return right;
}

bool LocationRight(const Truth& truth, const Answer& answer) {
  return truth.location == answer.location;
}
bool ViewRight(const Truth& truth, const Answer& answer) { return truth.view == answer.view; }

Json ShareAsJson(const Right& right) {
  std::size_t images = 0;
  for (const auto& split : right) images += split.size();
  if (images == 0) return nullptr;
  const Share share = BootstrapShare(right);
  Json by_split = Json::array();
  for (const auto& split : right) by_split.push_back(split.empty() ? Json() : Json(Mean(split)));
  return {
      {"mean", share.mean}, {"ci95", {share.ci95.low, share.ci95.high}}, {"by_split", by_split}};
}

Json SelectionsAsJson(const MethodResult& method) {
  Json rows = Json::array();
  for (const Selection& selection : method.selections) {
    Json row = Json::object();
    for (std::size_t p = 0; p < selection.values.size(); ++p) {
      row[method.parameter_names[p]] = selection.values[p];
    }
    rows.push_back(row);
  }
  return rows;
}

// Test images of all splits: how often a location (row) was taken for another (column); the last
// column: for none.
Json ConfusionAsJson(const ExperimentResult& result, const MethodResult& method) {
  const std::size_t n = result.locations.size();
  std::vector<std::vector<int>> confusion(n, std::vector<int>(n + 1, 0));
  for (std::size_t s = 0; s < result.truths.size(); ++s) {
    for (std::size_t i = 0; i < result.truths[s].size(); ++i) {
      const int answer = method.answers[s][i].location;
      ++confusion[result.truths[s][i].location][answer < 0 ? n : static_cast<std::size_t>(answer)];
    }
  }
  return confusion;
}

// Table 1 of the paper, and the same of locations.
Json ByLocationAsJson(const ExperimentResult& result, const MethodResult& method) {
  Json rows = Json::array();
  for (int l = 0; l < static_cast<int>(result.locations.size()); ++l) {
    const auto here = [l](const Truth& truth) { return truth.location == l; };
    const auto view_here = [l](const Truth& truth) {
      return truth.location == l && truth.view >= 0;
    };
    rows.push_back(
        {{"name", result.locations[l]},
         {"location", ShareAsJson(Judge(result, method, here, LocationRight))},
         {"view",
          method.tells_views ? ShareAsJson(Judge(result, method, view_here, ViewRight)) : Json()}});
  }
  return rows;
}

Json NameOf(const std::vector<std::string>& names, int index) {
  return index < 0 ? Json() : Json(names[index]);
}

// Of the shown location and the two whose models score highest for its test images.
std::vector<int> ShownModels(const ScoreTable& table, std::size_t num_locations) {
  std::vector<double> sum(num_locations, 0.0);
  for (const ScoreTable::Row& row : table.rows) {
    std::vector<double> best(num_locations, -1e30);
    for (std::size_t c = 0; c < row.scores.size(); ++c) {
      double& so_far = best[table.column_location[c]];
      so_far = std::max(so_far, double{row.scores[c]});
    }
    for (std::size_t l = 0; l < num_locations; ++l) sum[l] += best[l];
  }
  sum[table.location] = 1e300;
  std::vector<int> order(num_locations);
  std::iota(order.begin(), order.end(), 0);
  std::stable_sort(order.begin(), order.end(), [&](int a, int b) { return sum[a] > sum[b]; });
  order.resize(std::min<std::size_t>(3, num_locations));
  return order;
}

// Whether the image's own location and view score highest of all that there are.
bool IsHighestOfOwn(const ScoreTable& table, const ScoreTable::Row& row) {
  const auto highest = std::max_element(row.scores.begin(), row.scores.end());
  if (highest == row.scores.end()) return false;
  const auto c = static_cast<std::size_t>(highest - row.scores.begin());
  return row.view >= 0 && table.column_location[c] == table.location &&
         table.column_view[c] == row.view;
}

// Fig. 4a of the paper.
Json ScoresAsJson(const ImageSet& set, const ExperimentResult& result) {
  const ScoreTable& table = result.scores;
  if (table.location < 0) return nullptr;
  Json json;
  json["location"] = result.locations[table.location];
  json["columns"] = Json::array();
  std::vector<std::size_t> kept;
  for (const int l : ShownModels(table, result.locations.size())) {
    for (std::size_t c = 0; c < table.column_location.size(); ++c) {
      if (table.column_location[c] != l) continue;
      kept.push_back(c);
      json["columns"].push_back({{"location", result.locations[l]},
                                 {"view", NameOf(result.views, table.column_view[c])}});
    }
  }
  json["rows"] = Json::array();
  int right_highest = 0;
  for (const ScoreTable::Row& row : table.rows) {
    Json scores = Json::array();
    for (const std::size_t c : kept) scores.push_back(row.scores[c]);
    right_highest += IsHighestOfOwn(table, row) ? 1 : 0;
    json["rows"].push_back({{"image", set.images[row.image_idx].path},
                            {"view", NameOf(result.views, row.view)},
                            {"scores", scores}});
  }
  json["right_cell_highest"] = right_highest;
  return json;
}

// What the paper says of its own 90 test images (method.md, section 3). Its Fig. 5 gives no
// numbers; its text, that MTL-SparseTrace ties in location and all three rivals lose in view.
Json PaperFigures() {
  Json paper;
  paper["location"] = {{"multitask_svm", 0.978},
                       {"svm_view_left", 0.667},
                       {"svm_view_middle", 0.689},
                       {"svm_view_right", 0.611},
                       {"mtl_sparse_trace", 0.978}};
  paper["view"]["multitask_svm"] = 0.956;
  // The locations of the built-in museum, which are named after the paper's.
  paper["view_by_location"] = {{"cafe", 1},         {"hallway", 7 / 9.0},      {"stairs", 1},
                               {"lobby", 1},        {"show_window_1", 1},      {"book_shelf", 1},
                               {"video_room", 1},   {"special_room", 7 / 9.0}, {"exhibit", 1},
                               {"show_window_2", 1}};
  paper["location_errors"] = {{"images", 2}, {"between", {"show_window_1", "show_window_2"}}};
  paper["right_cell_highest"] = {{"images", 9}, {"of", 9}};
  // For its 90 test images, "the average elapsed time".
  paper["elapsed_ms"] = {
      {"multitask_svm", 0.35}, {"svm_one_vs_rest", 12.6}, {"nearest_neighbour", 62}};
  paper["times_ours"] = {{"svm_one_vs_rest", 36}, {"nearest_neighbour", 177}};
  return paper;
}

Json IntervalAsJson(const Interval& interval) { return {interval.low, interval.high}; }

void AddCost(const PredictionCost& cost, const PredictionCost& ours, Json& json) {
  json["ms_per_prediction"] = cost.time.ms;
  json["ms_ci95"] = IntervalAsJson(cost.time.ms_ci95);
  json["times_ours"] = cost.time.times_first;
  json["times_ours_ci95"] = IntervalAsJson(cost.time.times_first_ci95);
  json["multiply_adds_per_prediction"] = cost.multiply_adds;
  json["multiply_adds_times_ours"] =
      ours.multiply_adds > 0 ? Json(cost.multiply_adds / ours.multiply_adds) : Json();
}

Json MethodAsJson(const ExperimentResult& result, const MethodResult& method) {
  const auto all = [](const Truth&) { return true; };
  const auto with_view = [](const Truth& truth) { return truth.view >= 0; };
  Json json;
  json["name"] = method.name;
  json["location"] = ShareAsJson(Judge(result, method, all, LocationRight));
  json["view"] =
      method.tells_views ? ShareAsJson(Judge(result, method, with_view, ViewRight)) : Json();
  AddCost(method.cost, result.methods.front().cost, json);
  if (method.own_view >= 0) {
    const auto own = [&](const Truth& truth) { return truth.view == method.own_view; };
    json["location_of_own_view"] = ShareAsJson(Judge(result, method, own, LocationRight));
  }
  json["by_location"] = ByLocationAsJson(result, method);
  json["confusion"] = ConfusionAsJson(result, method);
  json["chosen"] = SelectionsAsJson(method);
  return json;
}

std::string Format(const char* format, auto... values) {
  char text[256];
  std::snprintf(text, sizeof text, format, values...);
  return text;
}

std::string ShareText(const Json& share) {
  if (share.is_null()) return "-";
  return Format("%.1f (%.1f-%.1f)", 100 * share["mean"].get<double>(),
                100 * share["ci95"][0].get<double>(), 100 * share["ci95"][1].get<double>());
}

std::string PaperText(const Json& paper, const std::string& name) {
  return paper.contains(name) ? Format("%.1f", 100 * paper[name].get<double>()) : "-";
}

// Table 2 and Fig. 5 of the paper.
std::string AccuracyText(const Json& figures) {
  const Json& paper = figures["paper"];
  std::string text =
      Format("%-18s %-18s %5s  %-18s %5s\n", "method", "location", "paper", "view", "paper");
  for (const Json& method : figures["methods"]) {
    const auto name = method["name"].get<std::string>();
    text +=
        Format("%-18s %-18s %5s  %-18s %5s\n", name.c_str(), ShareText(method["location"]).c_str(),
               PaperText(paper["location"], name).c_str(), ShareText(method["view"]).c_str(),
               PaperText(paper["view"], name).c_str());
    if (method.contains("location_of_own_view")) {
      text += Format("%-18s %-18s\n", "  of its own view",
                     ShareText(method["location_of_own_view"]).c_str());
    }
  }
  return text;
}

std::string CostText(const std::string& name, const Json& cost, const std::string& paper_times) {
  const Json& us = cost["ms_ci95"];
  const Json& times = cost["times_ours_ci95"];
  const Json& operations = cost["multiply_adds_times_ours"];
  return Format("%-18s %8.2f (%.2f-%.2f)  %7.2f (%.2f-%.2f)  %10.1f %6s\n", name.c_str(),
                1000 * cost["ms_per_prediction"].get<double>(), 1000 * us[0].get<double>(),
                1000 * us[1].get<double>(), cost["times_ours"].get<double>(),
                times[0].get<double>(), times[1].get<double>(),
                operations.is_null() ? 0.0 : operations.get<double>(), paper_times.c_str());
}

// Table 3 of the paper; times and operations as multiples of ours.
std::string CostsText(const Json& figures) {
  const Json& paper = figures["paper"]["times_ours"];
  std::string text = Format("\n%-18s %-22s %-22s %11s %6s\n", "method", "microseconds an image",
                            "times ours", "operations", "paper");
  for (const Json& method : figures["methods"]) {
    const auto name = method["name"].get<std::string>();
    text +=
        CostText(name, method, paper.contains(name) ? std::to_string(paper[name].get<int>()) : "-");
  }
  return text + CostText("  libsvm itself", figures["libsvm_itself"],
                         std::to_string(paper["svm_one_vs_rest"].get<int>()));
}

// Table 1 of the paper, of our method.
std::string ByLocationText(const Json& figures) {
  const Json& paper = figures["paper"]["view_by_location"];
  std::string text = Format("\n%-28s %-18s %-18s %5s\n", "multitask_svm, by location", "location",
                            "view", "paper");
  for (const Json& row : figures["methods"][0]["by_location"]) {
    const auto name = row["name"].get<std::string>();
    text += Format("%-28s %-18s %-18s %5s\n", name.c_str(), ShareText(row["location"]).c_str(),
                   ShareText(row["view"]).c_str(), PaperText(paper, name).c_str());
  }
  return text;
}

std::string NameText(const Json& name) { return name.is_null() ? "-" : name.get<std::string>(); }

// Fig. 4a: a star marks the column of the image's own location and view.
std::string ScoresText(const Json& scores) {
  if (scores.is_null()) return "";
  const auto location = scores["location"].get<std::string>();
  std::string text = "\nscores of test images of " + location + "; columns: ";
  for (const Json& column : scores["columns"]) {
    text += column["location"].get<std::string>() + " " + NameText(column["view"]) + ", ";
  }
  text.replace(text.size() - 2, 2, "\n");
  for (const Json& row : scores["rows"]) {
    text += Format("%-10s", NameText(row["view"]).c_str());
    for (std::size_t c = 0; c < row["scores"].size(); ++c) {
      const Json& column = scores["columns"][c];
      const bool own = column["location"] == scores["location"] && column["view"] == row["view"];
      text += Format(" %7.3f%s", row["scores"][c].get<double>(), own ? "*" : " ");
    }
    text += "\n";
  }
  return text + Format("the right cell is the highest of all: %d of %zu; paper: 9 of 9\n",
                       scores["right_cell_highest"].get<int>(), scores["rows"].size());
}

// Fig. 4b, as a list: a matrix of many locations is mostly zeros.
std::string ConfusionText(const Json& figures) {
  const Json& locations = figures["locations"];
  const Json& confusion = figures["methods"][0]["confusion"];
  std::string text =
      "\nmultitask_svm took, in all splits (paper: 2 of 90, between the show windows)\n";
  for (std::size_t l = 0; l < locations.size(); ++l) {
    for (std::size_t a = 0; a < locations.size(); ++a) {
      const int count = confusion[l][a].get<int>();
      if (a == l || count == 0) continue;
      text += Format("%-28s for %-28s %d times\n", locations[l].get<std::string>().c_str(),
                     locations[a].get<std::string>().c_str(), count);
    }
  }
  return text;
}

}  // namespace

Share BootstrapShare(const Right& all) {
  Right right;
  for (const auto& split : all) {
    if (!split.empty()) right.push_back(split);
  }
  if (right.empty()) return {};
  const auto n = static_cast<double>(right.size());
  Share share;
  for (const auto& split : right) share.mean += Mean(split) / n;
  std::mt19937_64 random(1);
  std::vector<double> means;
  for (int r = 0; r < kResamples; ++r) {
    double mean = 0;
    for (std::size_t s = 0; s < right.size(); ++s) {
      mean += ResampledMean(right[random() % right.size()], random) / n;
    }
    means.push_back(mean);
  }
  share.ci95 = {Quantile(means, 0.025).value_or(0), Quantile(means, 0.975).value_or(0)};
  return share;
}

Json ExperimentAsJson(const ImageSet& set, const ExperimentResult& result,
                      const ExperimentOptions& options) {
  Json json;
  json["schema"] = 1;
  json["splits"] = result.truths.size();
  json["first_split_is_own"] = result.first_split_is_own;
  json["split_draw"] = result.drawn_as_runs ? "runs" : "images";
  json["images"] = result.samples;
  json["images_of_set"] = set.images.size();
  Json tests = Json::array();
  for (const auto& truths : result.truths) tests.push_back(truths.size());
  json["test_images"] = tests;
  json["locations"] = result.locations;
  json["views"] = result.views;
  json["location_source"] = result.location_source;
  json["view_source"] = result.view_source;
  json["words"] = options.num_words;
  json["seed"] = options.seed;
  json["methods"] = Json::array();
  for (const MethodResult& method : result.methods) {
    json["methods"].push_back(MethodAsJson(result, method));
  }
  AddCost(result.libsvm_cost, result.methods.front().cost, json["libsvm_itself"]);
  json["scores"] = ScoresAsJson(set, result);
  json["paper"] = PaperFigures();
  return json;
}

std::string ExperimentAsText(const Json& figures) {
  std::string text = Format("%d images, %zu locations, %d split(s); %% right (95 %% interval)\n\n",
                            figures["images"].get<int>(), figures["locations"].size(),
                            figures["splits"].get<int>());
  return text + AccuracyText(figures) + CostsText(figures) + ByLocationText(figures) +
         ScoresText(figures["scores"]) + ConfusionText(figures);
}

}  // namespace viewfix
