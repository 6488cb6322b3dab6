// SPDX-License-Identifier: BSD-3-Clause
#include <CLI/CLI.hpp>
#include <cstdio>
#include <memory>
#include <string>

#include "firmware_tools/cli/commands.h"
#include "firmware_tools/cli/password.h"
#include "firmware_tools/dataset/image_set.h"
#include "firmware_tools/dataset/tool_file.h"
#include "firmware_tools/flash/signing.h"
#include "models/model_view.h"

namespace viewfix {
namespace {

struct SignFlags {
  std::string model;
  std::string key;
  std::string out;
  ModelClaim claim;
};

SecretKey LoadKey(const std::string& path) {
  const std::string text = ReadTextFile(path);
  try {
    const bool locked = NeedsPassword(text);
    return ReadSecretKey(text, locked ? AskPassword("password of " + path) : "");
  } catch (const ToolError& error) {
    throw ToolError(path + ": " + error.what());
  }
}

void RunSign(const SignFlags& flags) {
  if (!ValidSiteName(flags.claim.site)) {
    throw CLI::ValidationError("--site", "takes 1 to 64 letters, digits, '.', '_' or '-'");
  }
  const auto bytes = ReadModelFile(flags.model);
  // What a board would refuse is not worth a signature.
  const Result<ModelView> model = ModelView::Open(bytes);
  if (!model.ok()) throw ToolError(flags.model + ": " + model.status().text());
  const std::string out = flags.out.empty() ? flags.model + ".minisig" : flags.out;
  const SecretKey key = LoadKey(flags.key);
  WriteTextFile(out, SignatureText(bytes, key, ClaimText(flags.claim)));
  std::printf("%s: site %s, version %llu, key %s\n", out.c_str(), flags.claim.site.c_str(),
              static_cast<unsigned long long>(flags.claim.version), KeyIdText(key.id).c_str());
}

}  // namespace

void AddSign(CLI::App& app) {
  auto flags = std::make_shared<SignFlags>();
  CLI::App* command = app.add_subcommand(
      "sign",
      "sign a model, so that boards take it\n"
      "Example: viewfix sign museum.vfx --key museum.key --site museum --version 2\n"
      "A board takes only models of its site, and of a version above those it had.");
  command->add_option("model", flags->model, "the model file")->required();
  command->add_option("--key", flags->key, "the secret key, from viewfix keygen or minisign -G")
      ->required();
  command->add_option("--site", flags->claim.site, "the site that the model is of")->required();
  command->add_option("--version", flags->claim.version, "grows with each release of the site")
      ->required();
  command->add_option("--out", flags->out, "default: the model's name with .minisig");
  command->callback([flags] { RunSign(*flags); });
}

}  // namespace viewfix
