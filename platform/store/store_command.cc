// SPDX-License-Identifier: BSD-3-Clause
#include "platform/store/store_command.h"

#include <getopt.h>
#include <unistd.h>

#include <algorithm>
#include <csignal>
#include <cstdio>
#include <string>
#include <vector>

#include "models/model_view.h"
#include "platform/file.h"
#include "platform/publish/json_line.h"
#include "platform/store/flash_server.h"
#include "platform/store/serial_link.h"
#include "platform/store/store.h"

namespace viewfix {
namespace {

constexpr const char* kHelp =
    R"(viewfixd store: the board's models, one current and the last good one behind it.

  viewfixd store status [--json]
  viewfixd store install FILE [--signature FILE] [--allow older,other-site]
  viewfixd store receive             a flash on stdin and stdout, from `viewfix flash`
  viewfixd store serial DEVICE       flashes over a serial line, one after another; does not end
  viewfixd store confirm | rollback | gc
  viewfixd store trust KEY.pub       from now on models that this key signed are taken
  viewfixd store revoke KEY_ID       from now on they are not

  --store DIR      where models are (default /var/lib/viewfix)
  --trust DIR      whom this board trusts (default /etc/viewfix/trust): *.pub, public keys; revoked,
                   ids of keys; site, the name of the site; development, there: unsigned models too
  --keep N         models that stay, 2 (the default) to 16
  --signature FILE default: the model's name with .minisig
  --baud N         of a serial line, 9600 to 921600 (default 115200)
  --allow WHAT     take an older model, or another site's

Exit codes: 0 done; 1 failed, with one line on stderr; 2 wrong usage.

Example: viewfixd store install site.vfx --store /var/lib/viewfix
)";

struct StoreArguments {
  std::string store = kDefaultStore;
  std::string trust = kDefaultTrust;
  std::string signature;
  std::string verb;
  std::string operand;
  int keep = 2;
  int baud = 115200;
  bool json = false;
  bool help = false;
  bool allow_older = false;
  bool allow_other_site = false;
  std::string error;
};

enum Flag : int { kStore = 1, kTrust, kKeep, kSignature, kAllow, kBaud, kJson, kHelpFlag };

constexpr option kFlags[] = {
    {"store", required_argument, nullptr, kStore},
    {"trust", required_argument, nullptr, kTrust},
    {"keep", required_argument, nullptr, kKeep},
    {"signature", required_argument, nullptr, kSignature},
    {"allow", required_argument, nullptr, kAllow},
    {"baud", required_argument, nullptr, kBaud},
    {"json", no_argument, nullptr, kJson},
    {"help", no_argument, nullptr, kHelpFlag},
    {},
};

bool TakeAllowed(std::string_view list, StoreArguments& arguments) {
  while (!list.empty()) {
    const std::size_t comma = list.find(',');
    const std::string_view word = list.substr(0, comma);
    list.remove_prefix(comma == std::string_view::npos ? list.size() : comma + 1);
    if (word == "older") {
      arguments.allow_older = true;
    } else if (word == "other-site") {
      arguments.allow_other_site = true;
    } else {
      return false;
    }
  }
  return true;
}

std::string Take(int flag, const std::string& value, StoreArguments& arguments) {
  std::uint64_t number = 0;
  switch (flag) {
    case kStore:
      arguments.store = value;
      return value.empty() ? "--store needs a folder" : "";
    case kTrust:
      arguments.trust = value;
      return value.empty() ? "--trust needs a folder" : "";
    case kKeep:
      if (!ParseNumber(value, number) || number < 2 || number > 16) {
        return "--keep " + value + ": not 2 to 16";
      }
      arguments.keep = static_cast<int>(number);
      return {};
    case kBaud:
      if (!ParseNumber(value, number) || number < 9600 || number > 921600) {
        return "--baud " + value + ": not 9600 to 921600";
      }
      arguments.baud = static_cast<int>(number);
      return {};
    case kSignature:
      arguments.signature = value;
      return {};
    case kAllow:
      return TakeAllowed(value, arguments) ? "" : "--allow " + value + ": not older or other-site";
    case kJson:
      arguments.json = true;
      return {};
    default:
      arguments.help = true;
      return {};
  }
}

// The verb and what it wants behind it.
std::string CheckVerb(StoreArguments& arguments, int operands) {
  const std::string& verb = arguments.verb;
  for (const char* known : {"status", "receive", "confirm", "rollback", "gc"}) {
    if (verb == known) return operands == 0 ? "" : "store " + verb + " takes no file";
  }
  for (const char* known : {"install", "serial", "trust", "revoke"}) {
    if (verb == known) return operands == 1 ? "" : "store " + verb + " takes one argument";
  }
  return verb.empty() ? "store: what to do is missing" : "store " + verb + ": unknown";
}

StoreArguments Parse(int argc, char** argv) {
  StoreArguments arguments;
  opterr = 0;
  int flag = 0;
  while ((flag = getopt_long(argc, argv, ":", kFlags, nullptr)) != -1) {
    const std::string given = argv[optind - 1];
    if (flag == ':') arguments.error = given + " needs a value";
    if (flag == '?') arguments.error = "unknown option " + given;
    if (arguments.error.empty()) {
      arguments.error = Take(flag, optarg == nullptr ? "" : optarg, arguments);
    }
    if (!arguments.error.empty() || arguments.help) return arguments;
  }
  if (optind < argc) arguments.verb = argv[optind];
  if (optind + 1 < argc) arguments.operand = argv[optind + 1];
  arguments.error = CheckVerb(arguments, std::max(0, argc - optind - 1));
  return arguments;
}

int Fail(const Status& status) {
  std::string line = std::string("viewfixd: ") + status.text();
  if (!status.detail().empty()) line.append(": ").append(status.detail());
  std::replace_if(
      line.begin(), line.end(), [](unsigned char c) { return c < 0x20; }, '?');
  std::fprintf(stderr, "%s\n", line.c_str());
  return 1;
}

// What the signature of a stored model claims; an empty site: nothing.
ModelClaim ClaimOf(FileOps& files, const StoredModel& model) {
  if (model.empty()) return {};
  const auto text = ReadStoreText(files, model.id + ".minisig", kMaxSignatureBytes);
  if (!text.ok()) return {};
  const Result<Signature> signature = ParseSignature(*text);
  if (!signature.ok()) return {};
  const Result<ModelClaim> claim = ParseClaim(signature->trusted_comment);
  return claim.ok() ? *claim : ModelClaim();
}

void AddModel(JsonLine& line, FileOps& files, const StoredModel& model) {
  if (model.empty()) return line.Raw("null");
  const ModelClaim claim = ClaimOf(files, model);
  line.Raw("{\"model\":");
  line.String(model.id);
  line.Raw(",\"site\":");
  if (claim.site.empty()) {
    line.Raw("null,\"version\":null}");
    return;
  }
  line.String(claim.site);
  line.Raw(",\"version\":");
  line.Integer(static_cast<std::int64_t>(claim.version));
  line.Raw("}");
}

void PrintJson(FileOps& files, const StoreState& state, const std::string& faults) {
  JsonLine line;
  line.Clear();
  line.Raw("{\"schema\":1,\"current\":");
  AddModel(line, files, state.current);
  line.Raw(",\"previous\":");
  AddModel(line, files, state.previous);
  line.Raw(state.confirmed ? ",\"confirmed\":true" : ",\"confirmed\":false");
  line.Raw(",\"unconfirmed_starts\":");
  line.Integer(state.starts);
  line.Raw(",\"rejected\":");
  state.rejected.empty() ? line.Raw("null") : line.String(state.rejected);
  line.Raw(",\"fault\":");
  faults.empty() ? line.Raw("null") : line.String(faults);
  line.Raw("}");
  std::printf("%.*s\n", static_cast<int>(line.text().size()), line.text().data());
}

void PrintModel(FileOps& files, const char* name, const StoredModel& model, const char* remark) {
  if (model.empty()) {
    std::printf("%-9s none\n", name);
    return;
  }
  const ModelClaim claim = ClaimOf(files, model);
  if (claim.site.empty()) {
    std::printf("%-9s %s, unsigned%s\n", name, model.id.c_str(), remark);
  } else {
    std::printf("%-9s %s, site %s, version %llu%s\n", name, model.id.c_str(), claim.site.c_str(),
                static_cast<unsigned long long>(claim.version), remark);
  }
}

int PrintStatus(const StoreArguments& arguments, FileOps& files, Store& store) {
  const Result<StoreState> state = store.State();
  const bool none = !state.ok() && state.status().code() == StatusCode::kNotFound;
  if (!state.ok() && !none) return Fail(state.status());
  const StoreState said = none ? StoreState() : *state;
  // Reads all of it, as the daemon will when it starts next; a rollback is left to the daemon.
  std::string fault;
  if (!said.current.empty()) {
    if (const Status status = store.Check(said.current); !status.ok()) {
      fault = std::string(status.text()) + ": " + std::string(status.detail());
    }
  }
  if (arguments.json) {
    PrintJson(files, said, fault);
    return fault.empty() ? 0 : 1;
  }
  const std::string trial =
      " (on trial, " + std::to_string(said.starts) + " starts that received frames)";
  PrintModel(files, "current", said.current, said.confirmed ? " (confirmed)" : trial.c_str());
  PrintModel(files, "previous", said.previous, "");
  if (!said.rejected.empty()) std::printf("rejected  %s\n", said.rejected.c_str());
  if (fault.empty()) return 0;
  std::fprintf(stderr, "viewfixd: %s\n", fault.c_str());
  return 1;
}

// A file that is here already, by the same way as one that comes over a link.
int Install(const StoreArguments& arguments, Store& store) {
  const auto bytes = ReadFile(arguments.operand);
  if (!bytes.ok()) return Fail(bytes.status());
  ModelOffer offer;
  offer.size = bytes->size();
  offer.hash = HashContent(*bytes);
  offer.allow_older = arguments.allow_older;
  offer.allow_other_site = arguments.allow_other_site;
  const std::string path =
      arguments.signature.empty() ? arguments.operand + ".minisig" : arguments.signature;
  const auto signature = ReadFile(path);
  if (signature.ok()) {
    offer.signature.assign(signature->begin(), signature->end());
  } else if (!arguments.signature.empty() || signature.status().code() != StatusCode::kNotFound) {
    return Fail(signature.status());
  }
  if (Status status = store.CheckOffer(offer); !status.ok()) {
    return Fail(AboutFile(arguments.operand, status));
  }
  const Transfer transfer{Encoding::kRaw, offer.size, HashTransfer(*bytes)};
  Result<StoreFile> part = store.OpenPart(transfer);
  if (!part.ok()) return Fail(part.status());
  const Result<std::uint64_t> done = part->Size();
  if (!done.ok()) return Fail(done.status());
  if (Status status = part->Write(std::span(*bytes).subspan(static_cast<std::size_t>(*done)));
      !status.ok()) {
    return Fail(status);
  }
  if (Status status = part->Finish(); !status.ok()) return Fail(status);
  const Result<StoredModel> installed = store.Commit(offer, transfer, arguments.keep);
  if (!installed.ok()) return Fail(AboutFile(arguments.operand, installed.status()));
  std::printf("installed %s\n", installed->id.c_str());
  return 0;
}

int Confirm(Store& store) {
  const Result<StoreState> state = store.State();
  if (!state.ok()) return Fail(state.status());
  const Status status = store.Confirm(state->current);
  return status.ok() ? 0 : Fail(status);
}

int Rollback(Store& store) {
  const Result<StoredModel> back = store.Rollback();
  if (!back.ok()) return Fail(back.status());
  std::printf("current %s\n", back->id.c_str());
  return 0;
}

int CollectGarbage(Store& store, int keep) {
  const Result<int> removed = store.Gc(keep);
  if (!removed.ok()) return Fail(removed.status());
  std::printf("%d files removed\n", *removed);
  return 0;
}

int TrustKey(const StoreArguments& arguments) {
  const auto bytes = ReadFile(arguments.operand);
  if (!bytes.ok()) return Fail(bytes.status());
  const Status status = AddKey(arguments.trust, {bytes->begin(), bytes->end()});
  return status.ok() ? 0 : Fail(AboutFile(arguments.operand, status));
}

int Revoke(const StoreArguments& arguments) {
  const Result<KeyId> id = ParseKeyId(arguments.operand);
  if (!id.ok()) return Fail(id.status());
  const Status status = RevokeKey(arguments.trust, *id);
  return status.ok() ? 0 : Fail(status);
}

// Trust is read for each flash anew: a key that was revoked meanwhile counts no more.
int ServeSerial(const StoreArguments& arguments, FileOps& files) {
  auto link = SerialLink::Open(arguments.operand, arguments.baud, SerialLink::Side::kBoard);
  if (!link.ok()) return Fail(link.status());
  while (true) {
    if (Status status = (*link)->Accept(); !status.ok()) return Fail(status);
    const Result<Trust> trust = ReadTrust(arguments.trust);
    if (!trust.ok()) return Fail(trust.status());
    Store store(files, *trust);
    const Status status = ServeFlash(**link, store, {arguments.keep, arguments.trust});
    if (!status.ok()) Fail(status);
  }
}

int Run(const StoreArguments& arguments) {
  if (arguments.verb == "trust") return TrustKey(arguments);
  if (arguments.verb == "revoke") return Revoke(arguments);
  const Result<Trust> trust = ReadTrust(arguments.trust);
  if (!trust.ok()) return Fail(trust.status());
  const bool makes =
      arguments.verb == "install" || arguments.verb == "receive" || arguments.verb == "serial";
  const auto files = OpenFolder(arguments.store, makes);
  if (!files.ok()) return Fail(files.status());
  Store store(**files, *trust);
  if (arguments.verb == "serial") return ServeSerial(arguments, **files);
  if (arguments.verb == "status") return PrintStatus(arguments, **files, store);
  if (arguments.verb == "install") return Install(arguments, store);
  if (arguments.verb == "confirm") return Confirm(store);
  if (arguments.verb == "rollback") return Rollback(store);
  if (arguments.verb == "gc") return CollectGarbage(store, arguments.keep);
  std::signal(SIGPIPE, SIG_IGN);
  PipeStream stream(STDIN_FILENO, STDOUT_FILENO);
  const Status status = ServeFlash(stream, store, {arguments.keep, arguments.trust});
  return status.ok() ? 0 : Fail(status);
}

}  // namespace

int RunStoreCommand(int argc, char** argv) {
  const StoreArguments arguments = Parse(argc, argv);
  if (arguments.help) {
    std::fputs(kHelp, stdout);
    return 0;
  }
  if (!arguments.error.empty()) {
    std::fprintf(stderr, "viewfixd: %s (see viewfixd store --help)\n", arguments.error.c_str());
    return 2;
  }
  return Run(arguments);
}

}  // namespace viewfix
