// SPDX-License-Identifier: BSD-3-Clause
#include <sys/stat.h>

#include <CLI/CLI.hpp>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <string>

#include "firmware_tools/cli/commands.h"
#include "firmware_tools/cli/password.h"
#include "firmware_tools/cli/terminal.h"
#include "firmware_tools/dataset/image_set.h"
#include "firmware_tools/dataset/tool_file.h"
#include "firmware_tools/flash/signing.h"

namespace viewfix {
namespace {

struct KeygenFlags {
  std::string out;
  bool no_password = false;
};

std::string NewPassword() {
  std::string password = AskPassword("password of the new key");
  if (password.empty()) throw ToolError("an empty password: say --no-password if none is wanted");
  if (AskPassword("the same again") != password) throw ToolError("the two passwords differ");
  return password;
}

// A key that signs is worth more than its file: never replaced, and no one else's to read.
void WriteSecret(const std::string& path, const std::string& text) {
  const mode_t before = umask(077);
  WriteTextFile(path, text);
  umask(before);
}

void RunKeygen(const KeygenFlags& flags) {
  const std::string secret = flags.out + ".key";
  const std::string open = flags.out + ".pub";
  CheckCanWrite(secret);
  for (const std::string& file : {secret, open}) {
    if (std::filesystem::exists(file)) throw ToolError(file + ": is there already");
  }
  const SecretKey key = GenerateKey();
  WriteSecret(secret, SecretKeyText(key, flags.no_password ? "" : NewPassword()));
  WriteTextFile(open, PublicKeyText(PublicKeyOf(key)));
  std::printf("%s: keep it secret; it signs models\n%s: key %s, for boards to trust\n",
              secret.c_str(), open.c_str(), KeyIdText(key.id).c_str());
}

}  // namespace

void AddKeygen(CLI::App& app) {
  auto flags = std::make_shared<KeygenFlags>();
  CLI::App* command =
      app.add_subcommand("keygen",
                         "a pair of keys for signing models, as minisign makes them\n"
                         "Example: viewfix keygen --out museum      (museum.key, museum.pub)");
  command->add_option("--out", flags->out, "the files' name, without .key and .pub")->required();
  command->add_flag("--no-password,-W", flags->no_password,
                    "leave the secret key unencrypted, for machines that sign unattended");
  command->callback([flags] { RunKeygen(*flags); });
}

}  // namespace viewfix
