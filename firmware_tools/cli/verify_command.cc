// SPDX-License-Identifier: BSD-3-Clause
#include <CLI/CLI.hpp>
#include <cstdio>
#include <memory>
#include <string>

#include "firmware_tools/cli/commands.h"
#include "firmware_tools/dataset/image_set.h"
#include "firmware_tools/dataset/tool_file.h"
#include "platform/file.h"
#include "platform/store/minisign.h"

namespace viewfix {
namespace {

struct VerifyFlags {
  std::string file;
  std::string key;
  std::string signature;
};

[[noreturn]] void Refuse(const std::string& path, const Status& status) {
  throw ToolError(path + ": " + Describe(status));
}

void RunVerify(const VerifyFlags& flags) {
  const std::string path = flags.signature.empty() ? flags.file + ".minisig" : flags.signature;
  const Result<PublicKey> key = ParsePublicKey(ReadTextFile(flags.key));
  if (!key.ok()) Refuse(flags.key, key.status());
  const Result<Signature> signature = ParseSignature(ReadTextFile(path));
  if (!signature.ok()) Refuse(path, signature.status());
  const auto bytes = ReadFile(flags.file);
  if (!bytes.ok()) throw ToolError(Describe(bytes.status()));
  if (const Status status = VerifyContent(*signature, *key, *bytes); !status.ok()) {
    Refuse(flags.file, status);
  }
  std::printf("%s: signed by %s: %s\n", flags.file.c_str(), KeyIdText(key->id).c_str(),
              signature->trusted_comment.c_str());
}

}  // namespace

void AddVerify(CLI::App& app) {
  auto flags = std::make_shared<VerifyFlags>();
  CLI::App* command = app.add_subcommand("verify",
                                         "whether a file is as its signer signed it\n"
                                         "Example: viewfix verify museum.vfx --key museum.pub\n"
                                         "The same as: minisign -V -m museum.vfx -p museum.pub");
  command->add_option("file", flags->file, "the model, or any file")->required();
  command->add_option("--key", flags->key, "the signer's public key")->required();
  command->add_option("--signature", flags->signature, "default: the file's name with .minisig");
  command->callback([flags] { RunVerify(*flags); });
}

}  // namespace viewfix
