// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <vector>

namespace CLI {
class App;
}

namespace viewfix {

// Each adds one subcommand with its options; the command runs when the line is parsed.
// Commands throw ToolError.
void AddSimulate(CLI::App& app);
void AddCheck(CLI::App& app);
void AddTrain(CLI::App& app);
void AddEval(CLI::App& app);
void AddInspect(CLI::App& app);
void AddExperiment(CLI::App& app);
void AddExport(CLI::App& app);
void AddMap(CLI::App& app);
void AddCalibrate(CLI::App& app);
void AddKeygen(CLI::App& app);
void AddSign(CLI::App& app);
void AddVerify(CLI::App& app);
void AddFlash(CLI::App& app);
void AddProvision(CLI::App& app);

// A model file in memory. Throws ToolError naming the file.
std::vector<unsigned char> ReadModelFile(const std::string& path);

}  // namespace viewfix
