// SPDX-License-Identifier: BSD-3-Clause
#include <CLI/CLI.hpp>
#include <memory>
#include <string>

#include "firmware_tools/cli/commands.h"
#include "firmware_tools/cli/fleet_flags.h"
#include "firmware_tools/dataset/image_set.h"
#include "firmware_tools/dataset/tool_file.h"
#include "firmware_tools/flash/flash_client.h"
#include "platform/camera/calibration.h"

namespace viewfix {
namespace {

struct ProvisionFlags {
  std::vector<std::string> keys;
  std::vector<std::string> revoke;
  std::string site;
  std::string configuration;
  std::string calibration;
  FleetFlags fleet;
};

// What a board would refuse is refused here, before any board has half of it.
std::vector<ProvisionFile> FilesOf(const ProvisionFlags& flags) {
  std::vector<ProvisionFile> files;
  for (const std::string& path : flags.keys) {
    files.push_back({"key", ReadTextFile(path)});
    const Result<PublicKey> key = ParsePublicKey(files.back().text);
    if (!key.ok()) throw ToolError(path + ": " + Describe(key.status()));
  }
  for (const std::string& id : flags.revoke) {
    const Result<KeyId> known = ParseKeyId(id);
    if (!known.ok()) throw ToolError("--revoke: " + Describe(known.status()));
    files.push_back({"revoke", id});
  }
  if (!flags.site.empty()) {
    if (!ValidSiteName(flags.site)) throw ToolError("--site " + flags.site + ": no site's name");
    files.push_back({"site", flags.site});
  }
  if (!flags.configuration.empty()) {
    files.push_back({"configuration", ReadTextFile(flags.configuration)});
  }
  if (!flags.calibration.empty()) {
    const auto read = ReadCalibration(flags.calibration);
    if (!read.ok()) throw ToolError(Describe(read.status()));
    files.push_back({"calibration", ReadTextFile(flags.calibration)});
  }
  if (files.empty()) throw CLI::ValidationError("provision", "nothing to bring: see --help");
  return files;
}

void RunProvision(const ProvisionFlags& flags) {
  const std::vector<BoardAddress> boards = BoardsOf(flags.fleet);
  const std::vector<ProvisionFile> files = FilesOf(flags);
  RunOnBoards(flags.fleet, boards, [&](const BoardAddress& board) {
    const auto link = OpenLink(board, flags.fleet.link);
    ProvisionBoard(*link, files);
    return std::string("provisioned");
  });
}

}  // namespace

void AddProvision(CLI::App& app) {
  auto flags = std::make_shared<ProvisionFlags>();
  CLI::App* command = app.add_subcommand(
      "provision",
      "what a new board needs before its first model: whom to trust, its site, its camera\n"
      "Example: viewfix provision --key museum.pub --site museum --to ssh://root@hall-cam\n"
      "Goes to /etc/viewfix, which only the board's administrator may write.");
  command->add_option("--key", flags->keys, "a public key to trust from now on; may be repeated")
      ->allow_extra_args(false);
  command->add_option("--revoke", flags->revoke, "id of a key not to trust any more")
      ->allow_extra_args(false);
  command->add_option("--site", flags->site, "the site whose models the board takes");
  command->add_option("--config", flags->configuration, "becomes viewfixd.toml");
  command->add_option("--calibration", flags->calibration, "becomes calibration.yaml");
  AddFleetFlags(*command, flags->fleet);
  command->callback([flags] { RunProvision(*flags); });
}

}  // namespace viewfix
