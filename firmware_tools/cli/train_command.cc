// SPDX-License-Identifier: BSD-3-Clause
#include <CLI/CLI.hpp>
#include <algorithm>
#include <charconv>
#include <cstdio>
#include <memory>
#include <sstream>
#include <vector>

#include "firmware_tools/cli/commands.h"
#include "firmware_tools/cli/feature_flags.h"
#include "firmware_tools/cli/set_flags.h"
#include "firmware_tools/cli/terminal.h"
#include "firmware_tools/evaluation/check_set.h"
#include "firmware_tools/mapping/site_map.h"
#include "firmware_tools/training/trainer.h"
#include "platform/file.h"

namespace viewfix {
namespace {

struct TrainFlags {
  std::string set;
  std::string poses;
  std::string out;
  std::string views = "auto";
  std::string map = "auto";
  std::string work;
  std::string base;
  std::string control;
  std::string tags;
  std::string floorplan;
  std::string floorplan_align;
  std::string histogram = "hellinger";
  std::string negatives = "auto";
  double c = 0;
  double beta = 0;
  bool features_given = false;
  bool max_features_given = false;
  double max_wrong = 0;  // percent; 0: not given
  double details_mb = static_cast<double>(DetailOptions().max_bytes) / 1e6;
  TrainOptions options;
};

// CLI::Range takes what is not a number, too.
CLI::Validator NumberIn(double least, double most) {
  const auto check = [=](const std::string& text) {
    double value = 0;
    const bool valid = CLI::detail::lexical_cast(text, value) && value >= least && value <= most;
    if (valid) return std::string();
    std::ostringstream error;
    error << "takes a number from " << least << " to " << most << ", not '" << text << "'";
    return error.str();
  };
  return {check, "", ""};
}

std::string DefaultShares() {
  const TrainOptions options;
  std::ostringstream text;
  text << 100 * options.details.wrong_share << " where details tell places apart, "
       << 100 * options.wrong_share << " by scores alone, "
       << 100 * options.pose_confidence.wrong_share << " of poses";
  return text.str();
}

void ApplyViews(const std::string& text, LabelOptions& labels) {
  using Views = LabelOptions::Views;
  if (text == "auto" || text == "labels") {
    labels.views = text == "auto" ? Views::kAuto : Views::kLabels;
    return;
  }
  labels.views = Views::kCount;
  const auto [end, error] =
      std::from_chars(text.data(), text.data() + text.size(), labels.view_count);
  const bool whole = error == std::errc() && end == text.data() + text.size();
  if (!whole || labels.view_count < 1 || labels.view_count > 64) {
    throw CLI::ValidationError("--views", "takes auto, labels, or a number from 1 to 64");
  }
}

TrainOptions OptionsOf(const TrainFlags& flags) {
  TrainOptions options = flags.options;
  ApplyViews(flags.views, options.labels);
  options.histogram_map = flags.histogram == "l1" ? HistogramMap::kL1 : HistogramMap::kHellinger;
  options.map.source = flags.map == "none"     ? MapSource::kNone
                       : flags.map == "colmap" ? MapSource::kColmap
                                               : MapSource::kPoses;
  options.map.work_folder = flags.work.empty() ? flags.out + ".map" : flags.work;
  options.map.controls = ReadSiteControls(flags.control, flags.tags);
  if (!flags.floorplan.empty()) {
    options.floor_plan = ReadFloorPlan(flags.floorplan, flags.floorplan_align);
    std::fprintf(stderr, "%s: %d x %d pixels, its points %.3f m off\n", flags.floorplan.c_str(),
                 options.floor_plan->width, options.floor_plan->height,
                 options.floor_plan->rms_metres);
  }
  if (!flags.work.empty() || options.map.source == MapSource::kColmap) {
    options.cache = std::make_shared<StageCache>(options.map.work_folder / "stages");
    options.map.cache = options.cache.get();
  }
  options.map.seed = static_cast<int>(options.seed % 1000000);
  options.map.jobs = options.jobs;
  options.model_map.jobs = options.jobs;
  options.details.jobs = options.jobs;
  options.details.max_bytes = static_cast<std::size_t>(flags.details_mb * 1e6);
  if (flags.c > 0) options.c = flags.c;
  if (flags.beta > 0) options.beta = flags.beta;
  if (flags.negatives != "auto") options.other_views_negative = flags.negatives == "all";
  if (!flags.base.empty()) {
    const auto file = ReadModelFile(flags.base);
    TakeFrozenOptions(std::make_shared<BaseModel>(ReadBaseModel(file, flags.base)), options);
  }
  if (flags.max_wrong > 0) {
    const double share = flags.max_wrong / 100;
    options.wrong_share = share;
    options.details.wrong_share = share;
    options.pose_confidence.wrong_share = share;
  }
  return options;
}

// A map under given poses, where it is asked for by name, has to come about.
void CheckPosesAskedFor(const TrainFlags& flags, const ImageSet& set) {
  if (flags.map != "poses") return;
  std::vector<int> with_pose;
  bool with_camera = false;
  for (int i = 0; i < static_cast<int>(set.images.size()); ++i) {
    if (!set.images[i].pose || set.images[i].is_test) continue;
    with_pose.push_back(i);
    with_camera = with_camera || set.images[i].camera_idx >= 0;
  }
  if (with_pose.empty()) {
    throw ToolError(set.source.string() +
                    ": --map poses needs poses (columns tx,ty,tz,qx,qy,qz,qw, or --poses)");
  }
  if (with_camera) return;
  throw ToolError(set.source.string() + ": " + MissingCalibration(set, with_pose));
}

// What `viewfix check` would say of labels and appearance, and what was skipped.
void PrintWarnings(const ImageSet& set, const Preparation& prepared, int jobs) {
  std::vector<Finding> findings = CheckLabels(set);
  const std::vector<Finding> more = CheckAppearance(set, prepared, jobs, ShowProgress);
  findings.insert(findings.end(), more.begin(), more.end());
  for (const std::string& note : prepared.site.notes) std::fprintf(stderr, "%s\n", note.c_str());
  for (const std::string& warning : prepared.warnings) {
    std::fprintf(stderr, "warning: %s\n", warning.c_str());
  }
  for (const Finding& finding : findings) {
    if (finding.severity == Severity::kNote) continue;
    std::fprintf(stderr, "%s: %s\n", SeverityName(finding.severity), finding.text.c_str());
  }
}

std::string Listed(const std::vector<std::string>& names) {
  std::string text;
  for (const std::string& name : names) text += (text.empty() ? "" : ", ") + name;
  return text.empty() ? "none" : text;
}

void PrintBase(const TrainFlags& flags, const BaseReport& report) {
  if (flags.base.empty()) return;
  std::printf("kept from %s: %zu locations; trained anew: %s; gone: %s\n", flags.base.c_str(),
              report.kept.size(), Listed(report.trained).c_str(), Listed(report.removed).c_str());
  if (report.kept.empty()) {
    std::fprintf(stderr, "warning: no location is the base's: nothing of it could be kept\n");
  }
  if (report.frame_grew) {
    std::fprintf(stderr,
                 "warning: the map reaches beyond the base's: the positions of all landmarks are "
                 "rounded anew\n");
  }
}

void PrintSummary(const TrainFlags& flags, const TrainResult& result, std::size_t bytes) {
  std::printf("%s: %zu locations, %zu views of them, %zu keyframes, %zu words, %.2f MB\n",
              flags.out.c_str(), result.model.locations.size(), result.model.pair_location.size(),
              result.model.keyframe_pair.size(),
              result.model.words.size() / result.model.features.descriptor_dim,
              static_cast<double>(bytes) / 1e6);
  PrintBase(flags, result.base);
  const HeldOut& chosen = result.chosen;
  std::printf("held-out blocks: location right %.1f %%, view right %.1f %%  (C %g, beta %g)\n",
              100 * chosen.location_accuracy, 100 * chosen.view_accuracy, chosen.options.c,
              chosen.options.beta);
  if (result.details_held_out.empty()) {
    if (flags.details_mb > 0 && result.model.landmark_position.empty()) {
      std::fprintf(stderr,
                   "warning: no details are kept, as none fit into %g MB (--details) or the images "
                   "are too few: places that look alike will be taken for each other\n",
                   flags.details_mb);
    }
    return;
  }
  const auto right = std::count_if(result.details_held_out.begin(), result.details_held_out.end(),
                                   [](const Outcome& o) { return o.right; });
  const Answered known = AnsweredOf(result.details_held_out, result.model.confidence);
  const Answered hidden = AnsweredOf(result.details_elsewhere, result.model.confidence);
  std::printf(
      "held-out frames, by details: location right %.1f %%; answered %.1f %%, of these wrong "
      "%.1f %%; %.1f %% where their location is hidden\n",
      100.0 * static_cast<double>(right) / static_cast<double>(result.details_held_out.size()),
      100 * known.share, 100 * known.wrong, 100 * hidden.share);
}

void PrintKept(const StageCache& cache) {
  for (const std::string& line : cache.Report()) std::fprintf(stderr, "%s\n", line.c_str());
  if (const std::string failure = cache.failure(); !failure.empty()) {
    std::fprintf(stderr, "warning: not all was kept for the next run: %s\n", failure.c_str());
  }
}

bool HasMap(const ImageSet& set, MapSource source) {
  return source == MapSource::kColmap ||
         (source == MapSource::kPoses &&
          std::any_of(set.images.begin(), set.images.end(), [](const ImageRecord& image) {
            return image.pose && image.camera_idx >= 0 && !image.is_test;
          }));
}

// As many as a map from photographs takes anyway: a frame that was taken far from all photographs
// shows few landmarks, and more features find more of them (ARCHITECTURE.md, 123).
constexpr int kFeaturesWithMap = 1500;
// Where no landmarks will tell places apart, details do, of as many features as there is time for,
// and with their colours. IE Tower's training split, four of five folds, area right: 87.2 % with
// 800, 88.9 % with 1600.
constexpr int kFeaturesWithoutMap = 1600;

void ChooseFeatures(const TrainFlags& flags, bool map, FeatureOptions& features) {
  if (!flags.features_given) {
    features.type = map ? FeatureType::kSurfChroma : FeatureType::kColorSurf;
  }
  if (!flags.max_features_given) {
    features.max_features = map ? kFeaturesWithMap : kFeaturesWithoutMap;
  }
}

void RunTrain(const TrainFlags& flags) {
  TrainOptions options = OptionsOf(flags);
  CheckCanWrite(flags.out);
  const ImageSet set = LoadImageSetWithPoses(flags.set, flags.poses);
  CheckPosesAskedFor(flags, set);
  const bool map = HasMap(set, options.map.source);
  if (!options.base && (map || options.details.max_bytes > 0)) {
    ChooseFeatures(flags, map, options.features);
  }
  const Preparation prepared = Prepare(set, options, ShowProgress);
  if (options.cache) PrintKept(*options.cache);
  PrintWarnings(set, prepared, options.jobs);
  const TrainResult result = Train(set, prepared, options, ShowProgress);
  const auto bytes = WriteModel(result.model);
  if (!bytes.ok()) throw ToolError(flags.out + ": " + bytes.status().text());
  const Status status = WriteFileAtomically(flags.out, *bytes);
  if (!status.ok()) {
    throw ToolError(std::string(status.text()) + ": " + std::string(status.detail()));
  }
  if (options.floor_plan && !result.model.metric) {
    std::fprintf(stderr, "warning: the map is not in metres: nothing can be shown on %s\n",
                 flags.floorplan.c_str());
  }
  PrintSummary(flags, result, bytes->size());
  if (options.cache) options.cache->RemoveUnused();
}

}  // namespace

void AddTrain(CLI::App& app) {
  auto flags = std::make_shared<TrainFlags>();
  CLI::App* command = app.add_subcommand(
      "train", "make a model from an image set\nExample: viewfix train museum --out museum.vfx");
  command->add_option("set", flags->set, "folder of an image set, or its CSV")->required();
  command->add_option("--out", flags->out, "the model file to write")->required();
  CLI::Option* base = command->add_option(
      "--base", flags->base,
      "an older model of the set: what it says of unchanged locations is kept to the bit, its\n"
      "features, vocabulary and map's frame are taken; what flash --base then sends is small");
  command->add_option("--words", flags->options.num_words, "visual words")
      ->check(CLI::Range(2, 65535))
      ->capture_default_str();
  command->add_option("--views", flags->views, "auto, labels, or how many a location has")
      ->capture_default_str();
  command
      ->add_option("--map", flags->map,
                   "landmarks and poses: poses (those of the set), colmap (structure from motion), "
                   "none; auto: poses where given")
      ->check(CLI::IsMember({"auto", "colmap", "poses", "none"}))
      ->capture_default_str();
  command
      ->add_option("--pose-sigma", flags->options.map.pose_sigma,
                   "how far the set's poses may be off, in its units: they are adjusted together "
                   "with the landmarks; 0: they stay as they are")
      ->check(NumberIn(0, 1000))
      ->capture_default_str();
  command->add_option(
      "--work", flags->work,
      "folder that is kept: a second run, after photographs were added, takes from\n"
      "it what did not change; for COLMAP's files too. Default with --map colmap:\n"
      "the model's name with .map; else nothing is kept");
  command->add_option("--control", flags->control,
                      "CSV name,x,y,z: where on the site, in metres, some images' cameras stood");
  command->add_option("--tags", flags->tags,
                      "CSV of printed AprilTags or ArUco markers in the images: family,id and "
                      "size_m,tx,ty,tz,qx,qy,qz,qw or x0,y0,z0,...,x3,y3,z3");
  CLI::Option* align = command->add_option(
      "--floorplan-align", flags->floorplan_align,
      "CSV px,py,x,y of two points or more: pixels of the floor plan, and the site's metres");
  CLI::Option* plan = command->add_option("--floorplan", flags->floorplan,
                                          "the site's plan, a PNG or JPEG: goes into the model");
  plan->needs(align);
  align->needs(plan);
  command
      ->add_option("--landmarks", flags->options.model_map.landmarks_per_keyframe,
                   "landmarks that each keyframe keeps, about")
      ->check(CLI::Range(16, 8192))
      ->capture_default_str();
  command
      ->add_option(
          "--details", flags->details_mb,
          "MB of the model, at most, for what tells look-alike places apart where there are "
          "no landmarks; 0: none")
      ->check(NumberIn(0, 1000))
      ->capture_default_str();
  command
      ->add_option(
          "--max-wrong", flags->max_wrong,
          "percent of the answers that may name a wrong location, by held-out photographs, "
          "for all that the model answers by (of poses, more than chance explains): the fewer, "
          "the fewer frames are answered; if not given " +
              DefaultShares() + ". What is more likely wrong than right is never answered")
      ->check(NumberIn(0.01, 50));
  command->add_option("--histogram", flags->histogram, "hellinger, or l1 as in the paper")
      ->check(CLI::IsMember({"hellinger", "l1"}))
      ->capture_default_str();
  command->add_option("--cost", flags->c, "C of the SVM; chosen on held-out blocks if not given")
      ->check(CLI::PositiveNumber);
  command->add_option("--beta", flags->beta, "beta of the SVM; chosen likewise")
      ->check(CLI::PositiveNumber);
  command
      ->add_option("--negatives", flags->negatives,
                   "of a view: others (other locations), all (also this location's other views), "
                   "auto (chosen likewise)")
      ->check(CLI::IsMember({"auto", "others", "all"}))
      ->capture_default_str();
  AddPosesFlag(*command, flags->poses);
  AddFeatureFlags(*command, flags->options.features);
  command
      ->add_option("--map-features", flags->options.map_features,
                   "features an image for a map from photographs alone (--map colmap), "
                   "where more than --max-features")
      ->check(CLI::Range(16, 8192))
      ->capture_default_str();
  command->add_option("--seed", flags->options.seed, "seed of the vocabulary")
      ->capture_default_str();
  command->add_option("--jobs", flags->options.jobs, "threads; 0: all cores")
      ->check(CLI::NonNegativeNumber)
      ->capture_default_str();
  for (const char* frozen : {"--words", "--histogram", "--cost", "--beta", "--negatives",
                             "--features", "--max-features", "--max-side", "--upright"}) {
    base->excludes(command->get_option(frozen));
  }
  command->callback([flags, command] {
    flags->features_given = command->count("--features") > 0;
    flags->max_features_given = command->count("--max-features") > 0;
    RunTrain(*flags);
  });
}

}  // namespace viewfix
