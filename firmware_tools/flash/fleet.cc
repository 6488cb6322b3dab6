// SPDX-License-Identifier: BSD-3-Clause
#include "firmware_tools/flash/fleet.h"

#include <chrono>
#include <mutex>
#include <set>
#include <sstream>
#include <thread>

#include "firmware_tools/common/parallel.h"
#include "firmware_tools/dataset/image_set.h"
#include "firmware_tools/dataset/tool_file.h"
#include "firmware_tools/flash/flash_client.h"

namespace viewfix {
namespace {

BoardReport WorkOn(const BoardAddress& board, const FleetOptions& options,
                   const std::function<std::string(const BoardAddress&)>& work) {
  BoardReport report;
  report.address = board;
  while (!report.done) {
    ++report.tries;
    try {
      report.text = work(board);
      report.done = true;
    } catch (const LinkBroke& broke) {
      report.text = broke.what();
      if (report.tries > options.retries) break;
      std::this_thread::sleep_for(std::chrono::duration<double>(options.pause_s * report.tries));
    } catch (const std::exception& error) {
      report.text = error.what();
      break;
    }
  }
  return report;
}

}  // namespace

std::vector<BoardAddress> ReadBoards(const std::string& path) {
  std::istringstream lines(ReadTextFile(path));
  std::vector<BoardAddress> boards;
  std::set<std::string> seen;
  int number = 0;
  for (std::string line; std::getline(lines, line);) {
    ++number;
    line = line.substr(0, line.find('#'));
    std::string word;
    std::string more;
    std::istringstream words(line);
    if (!(words >> word)) continue;
    const std::string where = path + " (line " + std::to_string(number) + "): ";
    if (words >> more) throw ToolError(where + "one address a line");
    if (!seen.insert(word).second) throw ToolError(where + word + " again");
    try {
      boards.push_back(ParseAddress(word));
    } catch (const ToolError& error) {
      throw ToolError(where + error.what());
    }
  }
  if (boards.empty()) throw ToolError(path + ": names no board");
  return boards;
}

std::vector<BoardReport> ForEachBoard(const std::vector<BoardAddress>& boards,
                                      const FleetOptions& options,
                                      const std::function<std::string(const BoardAddress&)>& work,
                                      const std::function<void(const BoardReport&)>& report) {
  std::vector<BoardReport> reports(boards.size());
  std::mutex one_at_a_time;
  ParallelFor(static_cast<int>(boards.size()), options.jobs, [&](int i) {
    reports[i] = WorkOn(boards[i], options, work);
    const std::scoped_lock lock(one_at_a_time);
    report(reports[i]);
  });
  return reports;
}

}  // namespace viewfix
