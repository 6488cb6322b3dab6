// SPDX-License-Identifier: BSD-3-Clause
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <atomic>
#include <chrono>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>

#include "firmware_tools/cli/commands.h"
#include "firmware_tools/cli/fleet_flags.h"
#include "firmware_tools/cli/terminal.h"
#include "firmware_tools/dataset/image_set.h"
#include "firmware_tools/dataset/tool_file.h"
#include "firmware_tools/flash/flash_client.h"
#include "models/model_view.h"
#include "platform/store/flash_server.h"

namespace viewfix {
namespace {

using Json = nlohmann::ordered_json;
using Clock = std::chrono::steady_clock;

struct FlashFlags {
  std::string model;
  std::string signature;
  std::vector<std::string> bases;
  std::vector<std::string> allow;
  FleetFlags fleet;
};

FlashJob JobOf(const FlashFlags& flags) {
  FlashJob job;
  job.model = ReadModelFile(flags.model);
  const Result<ModelView> model = ModelView::Open(job.model);
  if (!model.ok()) throw ToolError(flags.model + ": " + model.status().text());
  const std::string path = flags.signature.empty() ? flags.model + ".minisig" : flags.signature;
  if (!flags.signature.empty() || std::filesystem::exists(path)) job.signature = ReadTextFile(path);
  for (const std::string& base : flags.bases) job.bases.push_back(ReadModelFile(base));
  for (const std::string& what : flags.allow) {
    job.allow_older |= what == "older";
    job.allow_other_site |= what == "other-site";
  }
  return job;
}

// How far a board is: JSON lines, or, of one board alone, a bar.
FlashProgress ProgressOf(const FlashFlags& flags, const BoardAddress& board, bool alone) {
  if (flags.fleet.json) {
    auto shown = std::make_shared<Clock::time_point>();
    return [shown, name = board.text](std::uint64_t sent, std::uint64_t total) {
      if (sent != total && Clock::now() - *shown < std::chrono::milliseconds(200)) return;
      *shown = Clock::now();
      const Json event = {{"board", name}, {"state", "sending"}, {"sent", sent}, {"total", total}};
      PrintJsonEvent(event.dump(-1, ' ', false, Json::error_handler_t::replace));
    };
  }
  if (!alone) return {};
  const Progress bar = ShowProgress("flashing, kB");
  return [bar](std::uint64_t sent, std::uint64_t total) {
    bar(static_cast<int>(sent / 1000), static_cast<int>(total / 1000));
  };
}

std::string Summary(const FlashOutcome& outcome, double seconds) {
  char text[160];
  std::snprintf(text, sizeof text, "model %s, %.1f kB sent (%s)%s in %.2f s",
                outcome.model_id.c_str(), static_cast<double>(outcome.bytes_sent) / 1000,
                EncodingName(outcome.encoding).c_str(), outcome.resumed_at > 0 ? ", resumed," : "",
                seconds);
  return text;
}

void RunFlash(const FlashFlags& flags) {
  const std::vector<BoardAddress> boards = BoardsOf(flags.fleet);
  const FlashJob job = JobOf(flags);
  RunOnBoards(flags.fleet, boards, [&](const BoardAddress& board) {
    const Clock::time_point begin = Clock::now();
    const auto link = OpenLink(board, flags.fleet.link);
    const FlashOutcome outcome =
        FlashBoard(*link, job, ProgressOf(flags, board, boards.size() == 1));
    return Summary(outcome, std::chrono::duration<double>(Clock::now() - begin).count());
  });
}

}  // namespace

void AddFlash(CLI::App& app) {
  auto flags = std::make_shared<FlashFlags>();
  CLI::App* command = app.add_subcommand(
      "flash",
      "bring a model onto boards, so that a pulled plug leaves the old model or the new one\n"
      "Example: viewfix flash site.vfx --to ssh://pi@hall-cam\n"
      "         viewfix flash site.vfx --boards boards.txt --base yesterday.vfx\n"
      "Over ssh it runs `viewfixd store receive` on the board. A transfer that was cut goes on "
      "where\n"
      "it stopped; only what differs from a model of --base is sent to boards that have it.");
  command->add_option("model", flags->model, "the model file")->required();
  command->add_option("--signature", flags->signature, "default: the model's name with .minisig");
  command->add_option("--base", flags->bases, "a model that boards may have; may be repeated")
      ->allow_extra_args(false);
  command
      ->add_option("--allow", flags->allow,
                   "older: a version below what the board had; other-site: another site's model")
      ->delimiter(',')
      ->allow_extra_args(false)
      ->check(CLI::IsMember({"older", "other-site"}));
  AddFleetFlags(*command, flags->fleet);
  command->callback([flags] { RunFlash(*flags); });
}

}  // namespace viewfix
