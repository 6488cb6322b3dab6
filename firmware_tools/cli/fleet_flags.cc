// SPDX-License-Identifier: BSD-3-Clause
#include "firmware_tools/cli/fleet_flags.h"

#include <CLI/CLI.hpp>
#include <csignal>
#include <cstdio>
#include <mutex>
#include <nlohmann/json.hpp>

#include "firmware_tools/dataset/image_set.h"

namespace viewfix {
namespace {

using Json = nlohmann::ordered_json;

void PrintReport(const FleetFlags& flags, const BoardReport& report) {
  if (flags.json) {
    const Json event = {{"board", report.address.text},
                        {"state", report.done ? "done" : "failed"},
                        {"tries", report.tries},
                        {"text", report.text}};
    PrintJsonEvent(event.dump(-1, ' ', false, Json::error_handler_t::replace));
  } else {
    std::printf("%s: %s%s\n", report.address.text.c_str(),
                report.done ? "" : "FAILED: ", report.text.c_str());
    std::fflush(stdout);
  }
}

}  // namespace

void AddFleetFlags(CLI::App& command, FleetFlags& flags) {
  command
      .add_option("--to", flags.to,
                  "ssh://[user@]host[:port][/store], dir:STORE (a mounted card) or "
                  "serial:/dev/ttyACM0; may be repeated")
      ->allow_extra_args(false);
  command.add_option("--boards", flags.boards, "a file of such addresses, one a line");
  command.add_option("--trust", flags.link.trust,
                     "the board's folder of trusted keys; default: /etc/viewfix/trust, on a card "
                     "the card's, of another folder its trust/");
  command.add_option("--board-program", flags.link.program, "viewfixd on the board")
      ->capture_default_str();
  command.add_option("--baud", flags.link.baud, "of a serial line")->capture_default_str();
  command.add_option("--jobs", flags.fleet.jobs, "boards at a time")
      ->check(CLI::Range(1, 256))
      ->capture_default_str();
  command.add_option("--retries", flags.fleet.retries, "of a board whose link broke")
      ->check(CLI::Range(0, 100))
      ->capture_default_str();
  command.add_flag("--json", flags.json, "progress and results as JSON lines");
}

std::vector<BoardAddress> BoardsOf(const FleetFlags& flags) {
  std::vector<BoardAddress> boards;
  for (const std::string& text : flags.to) boards.push_back(ParseAddress(text));
  if (!flags.boards.empty()) {
    const std::vector<BoardAddress> more = ReadBoards(flags.boards);
    boards.insert(boards.end(), more.begin(), more.end());
  }
  if (boards.empty()) throw CLI::ValidationError("--to", "or --boards is required");
  return boards;
}

void PrintJsonEvent(const std::string& line) {
  static std::mutex one_at_a_time;
  const std::scoped_lock lock(one_at_a_time);
  std::printf("%s\n", line.c_str());
  std::fflush(stdout);
}

void RunOnBoards(const FleetFlags& flags, const std::vector<BoardAddress>& boards,
                 const std::function<std::string(const BoardAddress&)>& work) {
  std::signal(SIGPIPE, SIG_IGN);  // a link that breaks is an error like others
  const auto reports = ForEachBoard(boards, flags.fleet, work,
                                    [&](const BoardReport& report) { PrintReport(flags, report); });
  std::size_t failed = 0;
  std::string names;
  for (const BoardReport& report : reports) {
    if (report.done) continue;
    ++failed;
    names += (names.empty() ? "" : ", ") + report.address.text;
  }
  if (flags.json) {
    const Json event = {{"state", "summary"}, {"boards", reports.size()}, {"failed", failed}};
    PrintJsonEvent(event.dump());
  } else if (reports.size() > 1) {
    std::printf("%zu of %zu boards done\n", reports.size() - failed, reports.size());
  }
  if (failed > 0) {
    throw ToolError(std::to_string(failed) + " of " + std::to_string(reports.size()) +
                    " boards failed: " + names);
  }
}

}  // namespace viewfix
