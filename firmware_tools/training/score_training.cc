// SPDX-License-Identifier: BSD-3-Clause
#include "firmware_tools/training/score_training.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "engine/scoring/scoring.h"

namespace viewfix {
namespace {

constexpr double kMinusInfinity = -std::numeric_limits<double>::infinity();

// The solver's tolerance inside training: well below what moves a decision.
constexpr double kTrainingGap = 1e-3;

std::vector<int> PairsOf(const Labels& labels, int location) {
  std::vector<int> pairs;
  for (int p = 0; p < labels.num_pairs(); ++p) {
    if (labels.pair_location[p] == location) pairs.push_back(p);
  }
  return pairs;
}

// Whether sample s takes part in the task of pair p, and as what: +1, -1 or 0 (no part).
// `local`: every other location's image is a negative.
int RoleInTask(const Labels& labels, int s, int p, bool other_views_negative, bool local) {
  if (labels.pair[s] == p) return 1;
  if (labels.location[s] == labels.pair_location[p]) return other_views_negative ? -1 : 0;
  const bool same_view = labels.pair_view[labels.pair[s]] == labels.pair_view[p];
  return local || same_view ? -1 : 0;
}

bool SeenElsewhere(const Labels& labels, int pair) {
  for (int p = 0; p < labels.num_pairs(); ++p) {
    if (p != pair && labels.pair_view[p] == labels.pair_view[pair]) return true;
  }
  return false;
}

// The dual variables of one location. A view that no other location has is treated as local:
// it would have no negatives otherwise.
std::vector<DualVariable> MakeVariables(const Labels& labels, const std::vector<int>& pairs,
                                        const std::vector<bool>& used,
                                        const ScoreOptions& options) {
  const int tasks = static_cast<int>(pairs.size());
  std::vector<DualVariable> variables;
  for (int t = 0; t < tasks; ++t) {
    const bool local = !labels.global_views || !SeenElsewhere(labels, pairs[t]);
    const double negative_cost = local ? options.c / tasks : options.c;
    for (int s = 0; s < static_cast<int>(used.size()); ++s) {
      if (!used[s]) continue;
      const int role = RoleInTask(labels, s, pairs[t], options.other_views_negative, local);
      if (role != 0) variables.push_back({s, t, role, role > 0 ? options.c : negative_cost});
    }
  }
  return variables;
}

struct Ranked {
  HeldOut::Prediction prediction;
  double second = kMinusInfinity;
  double best = kMinusInfinity;
};

void Offer(Ranked& ranked, int location, int pair, double score) {
  if (score > ranked.best) {
    ranked.second = ranked.best;
    ranked.best = score;
    ranked.prediction.location = location;
    ranked.prediction.pair = pair;
  } else {
    ranked.second = std::max(ranked.second, score);
  }
}

double LocationScore(const std::vector<double>& task_scores, LocationRule rule) {
  if (rule == LocationRule::kBestPair) {
    return *std::max_element(task_scores.begin(), task_scores.end());
  }
  double sum = 0;
  for (const double score : task_scores) sum += std::isfinite(score) ? score : 0.0;
  return sum;
}

// scores[location][i]: task scores of held-out sample i.
// `similarity` [pairs, samples]: of a pair's most similar keyframe to a sample.
HeldOut Decide(const std::vector<int>& samples, const Eigen::MatrixXd& similarity,
               const std::vector<std::vector<std::vector<double>>>& scores,
               const std::vector<LocationModel>& models, const ScoreOptions& options) {
  HeldOut result;
  result.options = options;
  for (std::size_t i = 0; i < samples.size(); ++i) {
    Ranked ranked;
    for (std::size_t l = 0; l < scores.size(); ++l) {
      std::vector<double> tasks = scores[l][i];
      for (std::size_t t = 0; t < tasks.size(); ++t) {
        tasks[t] += options.keyframe_weight * similarity(models[l].pairs[t], i);
      }
      const auto best = std::max_element(tasks.begin(), tasks.end()) - tasks.begin();
      Offer(ranked, static_cast<int>(l), models[l].pairs[best], LocationScore(tasks, options.rule));
    }
    ranked.prediction.sample = samples[i];
    ranked.prediction.margin = std::isfinite(ranked.second) ? ranked.best - ranked.second : 0.0;
    result.predictions.push_back(ranked.prediction);
  }
  return result;
}

void CountRight(const Labels& labels, HeldOut& result) {
  std::sort(result.predictions.begin(), result.predictions.end(),
            [](const auto& a, const auto& b) { return a.sample < b.sample; });
  double location = 0;
  double view = 0;
  for (const HeldOut::Prediction& p : result.predictions) {
    const int truth = labels.pair[p.sample];
    location += p.location == labels.pair_location[truth] ? 1 : 0;
    view += labels.pair_view[p.pair] == labels.pair_view[truth] ? 1 : 0;
  }
  const double n = std::max<double>(1, static_cast<double>(result.predictions.size()));
  result.location_accuracy = location / n;
  result.view_accuracy = view / n;
}

// Of each pair's most similar keyframe among those `used`, to each of `samples`.
Eigen::MatrixXd BestSimilarities(const Labels& labels, const Eigen::MatrixXf& similarities,
                                 const std::vector<bool>& used, const std::vector<int>& samples) {
  Eigen::MatrixXd best =
      Eigen::MatrixXd::Constant(labels.num_pairs(), samples.size(), double{kNoSimilarity});
  for (std::size_t i = 0; i < samples.size(); ++i) {
    for (std::size_t k = 0; k < used.size(); ++k) {
      double& so_far = best(labels.pair[k], i);
      if (used[k]) so_far = std::max(so_far, double{similarities(k, samples[i])});
    }
  }
  return best;
}

// Held-out scores of one fold under one option, decided by both rules.
std::pair<HeldOut, HeldOut> RunFold(const Labels& labels, const Eigen::MatrixXf& gram,
                                    const Eigen::MatrixXf& similarities,
                                    std::span<const int> fold_of_sample, int fold,
                                    ScoreOptions options, int jobs, const Progress& progress) {
  std::vector<bool> used(fold_of_sample.size());
  std::vector<int> held_out;
  for (int s = 0; s < static_cast<int>(used.size()); ++s) {
    used[s] = fold_of_sample[s] != fold;
    if (!used[s]) held_out.push_back(s);
  }
  const int locations = static_cast<int>(labels.locations.size());
  std::vector<LocationModel> models(locations);
  std::vector<std::vector<std::vector<double>>> scores(locations);
  ParallelFor(
      locations, jobs,
      [&](int l) {
        models[l] = TrainLocation(labels, gram, l, used, options);
        for (const int s : held_out) scores[l].push_back(ScoreSample(models[l], gram, s));
      },
      progress);
  const Eigen::MatrixXd similarity = BestSimilarities(labels, similarities, used, held_out);
  options.rule = LocationRule::kBestPair;
  HeldOut best_pair = Decide(held_out, similarity, scores, models, options);
  options.rule = LocationRule::kSumOfPairs;
  return {std::move(best_pair), Decide(held_out, similarity, scores, models, options)};
}

void Append(HeldOut& all, const HeldOut& fold) {
  all.options = fold.options;
  all.predictions.insert(all.predictions.end(), fold.predictions.begin(), fold.predictions.end());
}

}  // namespace

double Merit(const Labels& labels, const HeldOut& result) {
  return result.location_accuracy + (labels.global_views ? result.view_accuracy : 0.0);
}

LocationModel TrainLocation(const Labels& labels, const Eigen::MatrixXf& gram, int location,
                            const std::vector<bool>& used, const ScoreOptions& options) {
  LocationModel model;
  model.pairs = PairsOf(labels, location);
  model.beta = options.beta;
  const auto variables = MakeVariables(labels, model.pairs, used, options);
  MultitaskSvmOptions solver;
  solver.beta = options.beta;
  solver.relative_gap = kTrainingGap;
  const MultitaskSvmSolution solution =
      SolveMultitaskSvm(gram, gram, variables, static_cast<int>(model.pairs.size()), solver);
  model.bias = solution.bias;
  for (std::size_t i = 0; i < variables.size(); ++i) {
    const DualVariable& v = variables[i];
    if (solution.alpha[i] > 0) {
      model.terms.push_back({v.sample_idx, v.task, solution.alpha[i] * v.label});
    }
  }
  return model;
}

std::vector<DualVariable> LocationVariables(const Labels& labels, const std::vector<int>& pairs,
                                            const std::vector<bool>& used,
                                            const ScoreOptions& options) {
  return MakeVariables(labels, pairs, used, options);
}

std::vector<double> ScoreSample(const LocationModel& model, const Eigen::MatrixXf& gram,
                                int sample) {
  double common = 0;
  std::vector<double> scores(model.pairs.size(), 0.0);
  for (const LocationModel::Term& term : model.terms) {
    const double part = term.coefficient * double{gram(term.sample, sample)};
    common += part;
    scores[term.task] += part / model.beta;
  }
  for (std::size_t t = 0; t < scores.size(); ++t) {
    scores[t] = std::isnan(model.bias[t]) ? kMinusInfinity : scores[t] + common + model.bias[t];
  }
  return scores;
}

ScoreModel TrainScores(const Labels& labels, const Eigen::MatrixXf& gram,
                       std::span<const Histogram> histograms, int num_words,
                       const ScoreOptions& options, int jobs, const Progress& progress) {
  ScoreModel result;
  result.weights = Eigen::MatrixXf::Zero(num_words, labels.num_pairs());
  result.bias.resize(labels.num_pairs());
  const std::vector<bool> used(histograms.size(), true);
  ParallelFor(
      static_cast<int>(labels.locations.size()), jobs,
      [&](int l) {
        const LocationModel model = TrainLocation(labels, gram, l, used, options);
        const int tasks = static_cast<int>(model.pairs.size());
        Eigen::MatrixXd own = Eigen::MatrixXd::Zero(num_words, tasks);
        Eigen::VectorXd common = Eigen::VectorXd::Zero(num_words);
        for (const LocationModel::Term& term : model.terms) {
          const Histogram& h = histograms[term.sample];
          for (int e = 0; e < h.size(); ++e) {
            const double part = term.coefficient * double{h.values[e]};
            common[h.words[e]] += part;
            own(h.words[e], term.task) += part / model.beta;
          }
        }
        for (int t = 0; t < tasks; ++t) {
          const int p = model.pairs[t];
          result.weights.col(p) = (common + own.col(t)).cast<float>();
          result.bias[p] = static_cast<float>(model.bias[t]);
        }
      },
      progress);
  return result;
}

std::vector<int> HeldOutBlocks(const Labels& labels, int folds) {
  std::vector<std::vector<int>> samples_of(labels.num_pairs());
  for (int s = 0; s < static_cast<int>(labels.pair.size()); ++s) {
    samples_of[labels.pair[s]].push_back(s);
  }
  std::vector<int> fold(labels.pair.size(), -1);
  for (int p = 0; p < labels.num_pairs(); ++p) {
    const int n = static_cast<int>(samples_of[p].size());
    if (n < 2) continue;
    for (int i = 0; i < n; ++i) {
      // Small pairs start at different folds, so that the folds stay of a size.
      fold[samples_of[p][i]] = n >= folds ? i * folds / n : (p + i) % folds;
    }
  }
  return fold;
}

std::vector<HeldOut> CrossValidate(const Labels& labels, const Eigen::MatrixXf& gram,
                                   const Eigen::MatrixXf& similarities,
                                   std::span<const int> fold_of_sample, int folds,
                                   std::span<const ScoreOptions> candidates, int jobs,
                                   const Progress& progress) {
  const int locations = static_cast<int>(labels.locations.size());
  const int total = static_cast<int>(candidates.size()) * folds * locations;
  int finished = 0;
  std::vector<HeldOut> results;
  for (const ScoreOptions& candidate : candidates) {
    HeldOut best_pair;
    HeldOut sum;
    for (int f = 0; f < folds; ++f) {
      const Progress part = [&](int done, int) {
        if (progress) progress(finished + done, total);
      };
      const auto [by_best, by_sum] =
          RunFold(labels, gram, similarities, fold_of_sample, f, candidate, jobs, part);
      finished += locations;
      Append(best_pair, by_best);
      Append(sum, by_sum);
    }
    CountRight(labels, best_pair);
    CountRight(labels, sum);
    results.push_back(Merit(labels, sum) > Merit(labels, best_pair) ? sum : best_pair);
  }
  return results;
}

}  // namespace viewfix
