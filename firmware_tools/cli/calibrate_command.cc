// SPDX-License-Identifier: BSD-3-Clause
#include <CLI/CLI.hpp>
#include <cstdio>
#include <memory>

#include "firmware_tools/cli/commands.h"
#include "firmware_tools/cli/terminal.h"
#include "firmware_tools/dataset/calibration_file.h"
#include "firmware_tools/dataset/camera_calibration.h"

namespace viewfix {
namespace {

struct CalibrateFlags {
  std::string source;
  std::string out;
  std::string print_board;
  std::string model = "brown";
  CharucoSpec spec;
};

void PrintResult(const CalibrateFlags& flags, const CameraCalibration& result) {
  for (const CalibratedView& view : result.views) {
    if (view.is_used) {
      std::printf("%-40s %3d corners  %.3f px\n", view.name.c_str(), view.corners, view.rms_px);
    } else {
      std::printf("%-40s %3d corners  not used\n", view.name.c_str(), view.corners);
    }
  }
  const Calibration& c = result.calibration;
  std::printf(
      "%s: %d x %d, fx %.2f, fy %.2f, cx %.2f, cy %.2f, residual %.3f px, %.0f %% of the "
      "picture covered\n",
      flags.out.c_str(), c.width, c.height, c.fx, c.fy, c.cx, c.cy, result.rms_px,
      100 * result.coverage);
}

void RunCalibrate(const CalibrateFlags& flags) {
  if (!flags.print_board.empty()) {
    PrintBoard(flags.spec, flags.print_board);
    std::printf("%s: print it, glue it onto something flat, and photograph it from all sides\n",
                flags.print_board.c_str());
  }
  if (flags.source.empty()) return;
  CheckCanWrite(flags.out);
  const BoardViews boards = FindBoards(flags.source, flags.spec, ShowProgress("finding boards"));
  const CameraModel model =
      flags.model == "fisheye" ? CameraModel::kKannalaBrandt : CameraModel::kBrownConrady;
  const CameraCalibration result = CalibrateCamera(boards, flags.spec, model);
  SaveCalibration(result.calibration, flags.out);
  PrintResult(flags, result);
}

void CheckUsage(const CalibrateFlags& flags) {
  if (flags.source.empty() && flags.print_board.empty()) {
    throw CLI::ValidationError("calibrate", "needs photographs or a video, or --print-board");
  }
  if (!flags.source.empty() && flags.out.empty()) {
    throw CLI::ValidationError("--out", "is required");
  }
}

}  // namespace

void AddCalibrate(CLI::App& app) {
  auto flags = std::make_shared<CalibrateFlags>();
  CLI::App* command =
      app.add_subcommand("calibrate",
                         "a camera's calibration from photographs or a video of a printed board\n"
                         "Example: viewfix calibrate --print-board board.svg\n"
                         "         viewfix calibrate photos/ --out calibration.yaml");
  command->add_option("source", flags->source,
                      "folder of photographs, an image set's CSV, or a video");
  command->add_option("--out", flags->out, "the calibration file to write");
  command->add_option("--print-board", flags->print_board, "write the board: a .svg or .png file");
  command->add_option("--model", flags->model, "brown, or fisheye for very wide lenses")
      ->check(CLI::IsMember({"brown", "fisheye"}))
      ->capture_default_str();
  command->add_option("--squares-x", flags->spec.squares_x, "of the board, along its long side")
      ->check(CLI::Range(3, 20))
      ->capture_default_str();
  command->add_option("--squares-y", flags->spec.squares_y, "of the board, along its short side")
      ->check(CLI::Range(3, 20))
      ->capture_default_str();
  command->add_option("--square-mm", flags->spec.square_mm, "side of a square in print")
      ->check(CLI::Range(1.0, 1000.0))
      ->capture_default_str();
  command->callback([flags] {
    CheckUsage(*flags);
    RunCalibrate(*flags);
  });
}

}  // namespace viewfix
