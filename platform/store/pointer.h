// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "engine/base/status.h"
#include "platform/store/minisign.h"

namespace viewfix {

// A model in the store. `id` is that of ModelView::short_hash(): how fixes name it.
struct StoredModel {
  std::string id;
  ContentHash hash{};
  bool empty() const { return id.empty(); }
  friend bool operator==(const StoredModel&, const StoredModel&) = default;
};

// What the pointer says.
struct StoreState {
  std::uint64_t generation = 0;  // grows with each change
  StoredModel current;           // empty: none yet
  StoredModel previous;          // what a rollback goes back to; or empty
  bool confirmed = false;        // the current one has proven itself
  int starts = 0;                // unconfirmed starts of it that received frames
  std::string rejected;          // id of the model that was last rolled back from, or empty
  // The newest version that each site's models had: older ones are refused.
  std::vector<ModelClaim> newest;

  const ModelClaim* NewestOf(std::string_view site) const;
};

inline constexpr std::size_t kMaxPointerBytes = 16384;
inline constexpr std::size_t kMaxSites = 64;

// Lines of words, the last of them a checksum of the others.
std::string PointerText(const StoreState& state);
// kCorrupt: not what PointerText() writes, to the last byte.
Result<StoreState> ParsePointer(std::string_view text);

}  // namespace viewfix
