// SPDX-License-Identifier: BSD-3-Clause
#include "platform/store/pointer.h"

#include <algorithm>
#include <charconv>

namespace viewfix {
namespace {

constexpr std::string_view kMagic = "viewfix-store 1";

// The first 32 bytes of the hash, as digits.
std::string Checksum(std::string_view text) {
  const std::vector<std::uint8_t> bytes(text.begin(), text.end());
  return HashText(HashContent(bytes)).substr(0, 64);
}

std::string ModelLine(std::string_view name, const StoredModel& model) {
  std::string line(name);
  if (model.empty()) return line.append(" none\n");
  return line.append(" ").append(model.id).append(" ").append(HashText(model.hash)).append("\n");
}

bool IsId(std::string_view text) {
  return text.size() == 16 && text.find_first_not_of("0123456789abcdef") == std::string_view::npos;
}

// Reads "name word word\n" lines in their order.
class LineReader {
 public:
  explicit LineReader(std::string_view text) : text_(text) {}

  // The rest of the next line if it starts with `name` and a space; else empty, and a fault.
  std::string_view Take(std::string_view name) {
    if (!Next(name)) {
      good_ = false;
      return {};
    }
    const std::size_t end = text_.find('\n');
    const std::string_view rest = text_.substr(name.size() + 1, end - name.size() - 1);
    text_.remove_prefix(end + 1);
    return rest;
  }
  bool Next(std::string_view name) const {
    return text_.starts_with(name) && text_.substr(name.size()).starts_with(' ') &&
           text_.find('\n') != std::string_view::npos;
  }
  std::uint64_t Number(std::string_view word) {
    std::uint64_t value = 0;
    const auto read = std::from_chars(word.data(), word.data() + word.size(), value);
    good_ = good_ && read.ec == std::errc() && read.ptr == word.data() + word.size();
    return value;
  }
  StoredModel Model(std::string_view words) {
    if (words == "none") return {};
    const std::size_t space = words.find(' ');
    StoredModel model{std::string(words.substr(0, space)), {}};
    const auto hash = ParseHash(space == std::string_view::npos ? "" : words.substr(space + 1));
    good_ = good_ && hash.ok() && IsId(model.id);
    if (hash.ok()) model.hash = *hash;
    return model;
  }
  ModelClaim Claim(std::string_view words) {
    const std::size_t space = std::min(words.find(' '), words.size());
    ModelClaim claim{std::string(words.substr(0, space)), 0};
    claim.version = Number(words.substr(std::min(space + 1, words.size())));
    good_ = good_ && ValidSiteName(claim.site);
    return claim;
  }
  bool good() const { return good_ && text_.empty(); }

 private:
  std::string_view text_;
  bool good_ = true;
};

}  // namespace

const ModelClaim* StoreState::NewestOf(std::string_view site) const {
  for (const ModelClaim& claim : newest) {
    if (claim.site == site) return &claim;
  }
  return nullptr;
}

std::string PointerText(const StoreState& state) {
  std::string text(kMagic);
  text += "\ngeneration " + std::to_string(state.generation) + "\n";
  text += ModelLine("current", state.current);
  text += ModelLine("previous", state.previous);
  text += std::string("state ") + (state.confirmed ? "confirmed" : "trial") + "\n";
  text += "starts " + std::to_string(state.starts) + "\n";
  text += "rejected " + (state.rejected.empty() ? "none" : state.rejected) + "\n";
  for (const ModelClaim& claim : state.newest) {
    text += "newest " + claim.site + " " + std::to_string(claim.version) + "\n";
  }
  return text + "checksum " + Checksum(text) + "\n";
}

Result<StoreState> ParsePointer(std::string_view text) {
  const Status fault(StatusCode::kCorrupt, "the store's pointer is damaged");
  constexpr std::size_t kChecksumLine = 9 + 64 + 1;
  if (text.size() < kChecksumLine || text.size() > kMaxPointerBytes) return fault;
  const std::string_view body = text.substr(0, text.size() - kChecksumLine);
  if (text.substr(body.size()) != "checksum " + Checksum(body) + "\n") return fault;
  if (!body.starts_with(kMagic) || !body.substr(kMagic.size()).starts_with('\n')) {
    return Status(StatusCode::kUnsupported, "the store's pointer is of a newer program");
  }
  LineReader lines(body.substr(kMagic.size() + 1));
  StoreState state;
  state.generation = lines.Number(lines.Take("generation"));
  state.current = lines.Model(lines.Take("current"));
  state.previous = lines.Model(lines.Take("previous"));
  const std::string_view confirmed = lines.Take("state");
  state.confirmed = confirmed == "confirmed";
  state.starts =
      static_cast<int>(std::min<std::uint64_t>(lines.Number(lines.Take("starts")), 1000));
  const std::string_view rejected = lines.Take("rejected");
  if (rejected != "none") state.rejected = rejected;
  while (lines.Next("newest")) state.newest.push_back(lines.Claim(lines.Take("newest")));
  if (!lines.good() || state.newest.size() > kMaxSites) return fault;
  return state;
}

}  // namespace viewfix
