// SPDX-License-Identifier: BSD-3-Clause
#include <CLI/CLI.hpp>
#include <cstdio>
#include <memory>

#include "firmware_tools/cli/commands.h"
#include "firmware_tools/cli/terminal.h"
#include "firmware_tools/simulation/museum.h"

namespace viewfix {

void AddSimulate(CLI::App& app) {
  auto options = std::make_shared<SimulateOptions>();
  auto preset = std::make_shared<std::string>("museum");
  CLI::App* command = app.add_subcommand(
      "simulate",
      "render the built-in museum as an image set\nExample: viewfix simulate --out museum");
  command->add_option("--out", options->out, "folder to write")->required();
  command->add_option("--preset", *preset, "what to render")
      ->check(CLI::IsMember({"museum"}))
      ->capture_default_str();
  command->add_option("--seed", options->seed, "another seed, another building")
      ->capture_default_str();
  command
      ->add_option("--images-per-view", options->images_per_view,
                   "images of each location and view; below 20 also no walk")
      ->check(CLI::Range(2, 20))
      ->capture_default_str();
  command->add_option("--jobs", options->jobs, "threads; 0: all cores")
      ->check(CLI::NonNegativeNumber)
      ->capture_default_str();
  command->callback([options, preset] {
    SimulateMuseum(*options, ShowProgress("rendering"));
    std::printf("%s: the museum, seed %llu\n", options->out.c_str(),
                static_cast<unsigned long long>(options->seed));
  });
}

}  // namespace viewfix
