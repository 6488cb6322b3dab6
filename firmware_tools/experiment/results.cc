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
  for (const ScoreTable::Row& row : table.rows) {
    Json scores = Json::array();
    for (const std::size_t c : kept) scores.push_back(row.scores[c]);
    json["rows"].push_back({{"image", set.images[row.image_idx].path},
                            {"view", NameOf(result.views, row.view)},
                            {"scores", scores}});
  }
  return json;
}

// What the paper says of its own 90 test images (method.md, section 3).
Json PaperFigures() {
  Json paper;
  paper["location"] = {{"multitask_svm", 0.978},
                       {"svm_view_left", 0.667},
                       {"svm_view_middle", 0.689},
                       {"svm_view_right", 0.611}};
  paper["view"]["multitask_svm"] = 0.956;
  paper["ms_of_90_predictions"] = {
      {"multitask_svm", 0.35}, {"svm_one_vs_rest", 12.6}, {"nearest_neighbour", 62.0}};
  return paper;
}

Json MethodAsJson(const ExperimentResult& result, const MethodResult& method) {
  const auto all = [](const Truth&) { return true; };
  const auto with_view = [](const Truth& truth) { return truth.view >= 0; };
  Json json;
  json["name"] = method.name;
  json["location"] = ShareAsJson(Judge(result, method, all, LocationRight));
  json["view"] =
      method.tells_views ? ShareAsJson(Judge(result, method, with_view, ViewRight)) : Json();
  json["ms_per_prediction"] = method.ms_per_prediction;
  json["multiply_adds_per_prediction"] = method.multiply_adds;
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

// Tables 2 and 3 and Fig. 5 of the paper; times as multiples of ours.
std::string MethodsText(const Json& figures) {
  const Json& paper = figures["paper"];
  const Json& paper_ms = paper["ms_of_90_predictions"];
  const double ours = figures["methods"][0]["ms_per_prediction"].get<double>();
  std::string text = Format("%-18s %-18s %5s  %-18s %5s %9s %7s %6s\n", "method", "location",
                            "paper", "view", "paper", "us/image", "times", "paper");
  for (const Json& method : figures["methods"]) {
    const auto name = method["name"].get<std::string>();
    const double ms = method["ms_per_prediction"].get<double>();
    const std::string times =
        paper_ms.contains(name)
            ? Format("%.0f", paper_ms[name].get<double>() / paper_ms["multitask_svm"].get<double>())
            : "-";
    text +=
        Format("%-18s %-18s %5s  %-18s %5s %9.2f %7.1f %6s\n", name.c_str(),
               ShareText(method["location"]).c_str(), PaperText(paper["location"], name).c_str(),
               ShareText(method["view"]).c_str(), PaperText(paper["view"], name).c_str(), 1000 * ms,
               ours > 0 ? ms / ours : 0.0, times.c_str());
    if (method.contains("location_of_own_view")) {
      text += Format("%-18s %-18s\n", "  of its own view",
                     ShareText(method["location_of_own_view"]).c_str());
    }
  }
  const double libsvm = figures["libsvm_ms_per_prediction"].get<double>();
  return text + Format("%-18s %-18s %5s  %-18s %5s %9.2f %7.1f %6s\n", "  libsvm's own", "", "", "",
                       "", 1000 * libsvm, ours > 0 ? libsvm / ours : 0.0, "36");
}

// Table 1 of the paper, of our method.
std::string ByLocationText(const Json& figures) {
  std::string text = Format("\n%s, by location\n", "multitask_svm");
  for (const Json& row : figures["methods"][0]["by_location"]) {
    text += Format("%-28s location %-18s view %s\n", row["name"].get<std::string>().c_str(),
                   ShareText(row["location"]).c_str(), ShareText(row["view"]).c_str());
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
  return text;
}

// Fig. 4b, as a list: a matrix of many locations is mostly zeros.
std::string ConfusionText(const Json& figures) {
  const Json& locations = figures["locations"];
  const Json& confusion = figures["methods"][0]["confusion"];
  std::string text = "\nmultitask_svm took, in all splits\n";
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
  json["libsvm_ms_per_prediction"] = result.libsvm_ms_per_prediction;
  json["scores"] = ScoresAsJson(set, result);
  json["paper"] = PaperFigures();
  return json;
}

std::string ExperimentAsText(const Json& figures) {
  std::string text = Format("%d images, %zu locations, %d split(s); %% right (95 %% interval)\n\n",
                            figures["images"].get<int>(), figures["locations"].size(),
                            figures["splits"].get<int>());
  return text + MethodsText(figures) + ByLocationText(figures) + ScoresText(figures["scores"]) +
         ConfusionText(figures);
}

}  // namespace viewfix
