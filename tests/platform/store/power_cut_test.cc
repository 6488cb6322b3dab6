// SPDX-License-Identifier: BSD-3-Clause
// Pulls the plug at every call that an install makes, and sees what the board starts from.
#include <gmock/gmock.h>

#include <cstdio>
#include <functional>
#include <string>
#include <vector>

#include "platform/store/store.h"
#include "tests/platform/store/memory_disk.h"
#include "tests/platform/store/store_site.h"

namespace viewfix {
namespace {

using Unflushed = MemoryDisk::Unflushed;
constexpr Unflushed kAllUnflushed[] = {Unflushed::kLost, Unflushed::kKept, Unflushed::kHalf};

struct Case {
  const char* name;
  bool has_old;
  bool as_patch;
};

class PowerCutTest : public testing::TestWithParam<Case> {
 protected:
  // The disk before: empty, or with the old model, proven.
  void Prepare(MemoryDisk& disk) {
    if (!GetParam().has_old) return;
    Store store(disk, trust_);
    const auto installed = Install(store, OfferOf(old_, key_, {"museum", 1}), Send(old_));
    ASSERT_TRUE(installed.ok()) << installed.status().text();
    ASSERT_TRUE(store.Confirm(*installed).ok());
  }
  Result<StoredModel> InstallNew(MemoryDisk& disk) {
    Store store(disk, trust_);
    return Install(store, OfferOf(new_, key_, {"museum", 2}), sent_);
  }
  // The old model or the new one, whole; or none where there was none.
  void ExpectWhole(MemoryDisk& disk, const std::string& when) {
    Store store(disk, trust_);
    const Result<ModelOfStore> loaded = store.Load();
    if (!loaded.ok()) {
      EXPECT_FALSE(GetParam().has_old) << when << ": " << loaded.status().text();
      return;
    }
    const bool is_old = GetParam().has_old && loaded->bytes == old_;
    EXPECT_TRUE(is_old || loaded->bytes == new_) << when << ": neither";
  }
  // What was cut can be done again.
  void ExpectInstalls(MemoryDisk& disk, const std::string& when) {
    const Result<StoredModel> installed = InstallNew(disk);
    ASSERT_TRUE(installed.ok()) << when << ": " << installed.status().text() << ": "
                                << installed.status().detail();
    Store store(disk, trust_);
    const Result<ModelOfStore> loaded = store.Load();
    ASSERT_TRUE(loaded.ok()) << when;
    EXPECT_TRUE(loaded->bytes == new_) << when;
  }

  const TestKey key_{1};
  const Trust trust_ = TrustIn(key_);
  const std::vector<std::uint8_t> old_ = NumberedModel(1);
  const std::vector<std::uint8_t> new_ = NumberedModel(2);
  const Sent sent_ = GetParam().as_patch ? Send(new_, old_) : Send(new_);
};

TEST_P(PowerCutTest, LeavesTheOldModelOrTheNewOne) {
  int cut_points = 0;
  int found = 0;
  for (bool reached = true; reached;) {
    MemoryDisk disk;
    Prepare(disk);
    disk.FailAt(cut_points + 1, true);
    static_cast<void>(InstallNew(disk));
    reached = disk.failed();
    if (!reached) break;
    ++cut_points;
    for (const Unflushed bytes : kAllUnflushed) {
      for (int names = 0; names <= disk.unflushed_names(); ++names) {
        const auto after = disk.AfterPowerCut(bytes, names);
        const std::string when =
            "call " + std::to_string(cut_points) + ", " + std::to_string(names) + " names";
        ExpectWhole(*after, when);
        ++found;
        // A transfer that lost its middle is refused once, then sent anew.
        if (!InstallNew(*after).ok()) ExpectInstalls(*after, when);
        if (HasFailure()) return;
      }
    }
  }
  std::printf("power cuts, %s: %d calls cut, %d disks found, all whole\n", GetParam().name,
              cut_points, found);
  EXPECT_GT(cut_points, 20);
}

// The same calls, each failing once while the process goes on (a full disk, a bad block).
TEST_P(PowerCutTest, ACallThatFailsIsAnErrorAndNoMore) {
  int calls = 0;
  int errors = 0;
  while (true) {
    MemoryDisk disk;
    Prepare(disk);
    disk.FailAt(calls + 1, false);
    const bool installed = InstallNew(disk).ok();
    if (!disk.failed()) break;
    ++calls;
    errors += installed ? 0 : 1;
    disk.FailAt(0, false);
    const std::string when = "call " + std::to_string(calls);
    ExpectWhole(disk, when);
    if (!InstallNew(disk).ok()) ExpectInstalls(disk, when);
    if (HasFailure()) return;
  }
  std::printf("failing calls, %s: %d, %d of them errors, all whole\n", GetParam().name, calls,
              errors);
  EXPECT_GT(errors, 15);
}

// Once the laptop was told "installed", no power cut takes it back; on a disk that only says that
// it flushes it would, and the old model would still be whole.
TEST_P(PowerCutTest, WhatWasInstalledStays) {
  for (const bool lies : {false, true}) {
    MemoryDisk disk;
    Prepare(disk);
    if (lies) disk.Lie();
    ASSERT_TRUE(InstallNew(disk).ok());
    int lost = 0;
    for (const Unflushed bytes : kAllUnflushed) {
      for (int names = 0; names <= disk.unflushed_names(); ++names) {
        const auto after = disk.AfterPowerCut(bytes, names);
        ExpectWhole(*after, lies ? "a disk that lies" : "a good disk");
        const Result<ModelOfStore> loaded = Store(*after, trust_).Load();
        lost += loaded.ok() && loaded->bytes == new_ ? 0 : 1;
      }
    }
    EXPECT_EQ(lost > 0, lies);
  }
}

// What the daemon and the administrator do with a store that has two models.
TEST_P(PowerCutTest, StartsConfirmsRollbacksAndGcLeaveWholeModels) {
  using Action = std::function<void(Store&)>;
  const std::vector<Action> actions = {
      [](Store& store) { static_cast<void>(store.CountStart(store.State()->current)); },
      [](Store& store) { static_cast<void>(store.Confirm(store.State()->current)); },
      [](Store& store) { static_cast<void>(store.Rollback()); },
      [](Store& store) { static_cast<void>(store.Gc(2)); }};
  int cut_points = 0;
  for (const Action& action : actions) {
    for (int call = 1;; ++call) {
      MemoryDisk disk;
      Prepare(disk);
      ASSERT_TRUE(InstallNew(disk).ok());
      // Some actions ask for the state themselves first, which must not fail.
      const int asked = [&] {
        disk.FailAt(0, false);
        static_cast<void>(Store(disk, trust_).State());
        return disk.calls();
      }();
      disk.FailAt(asked + call, true);
      Store store(disk, trust_);
      action(store);
      if (!disk.failed()) break;
      ++cut_points;
      for (const Unflushed bytes : kAllUnflushed) {
        for (int names = 0; names <= disk.unflushed_names(); ++names) {
          ExpectWhole(*disk.AfterPowerCut(bytes, names), "call " + std::to_string(call));
        }
      }
      if (HasFailure()) return;
    }
  }
  std::printf("power cuts of the rest, %s: %d calls cut, all whole\n", GetParam().name, cut_points);
  EXPECT_GT(cut_points, 20);
}

INSTANTIATE_TEST_SUITE_P(Installs, PowerCutTest,
                         testing::Values(Case{"first", false, false}, Case{"second", true, false},
                                         Case{"patch", true, true}),
                         [](const auto& param) { return std::string(param.param.name); });

// Two installs behind it: the newest pointer, and both, cut to every length.
class TruncationTest : public testing::Test {
 protected:
  void SetUp() override {
    Store store(disk_, trust_);
    ASSERT_TRUE(Install(store, OfferOf(old_, key_, {"museum", 1}), Send(old_)).ok());
    ASSERT_TRUE(store.Confirm(store.State()->current).ok());
    ASSERT_TRUE(Install(store, OfferOf(new_, key_, {"museum", 2}), Send(new_)).ok());
    newest_ = "pointer-" + std::to_string(store.State()->generation % 2);
    older_ = "pointer-" + std::to_string((store.State()->generation + 1) % 2);
  }
  std::unique_ptr<MemoryDisk> Copy() const { return disk_.AfterPowerCut(Unflushed::kKept, 0); }
  std::vector<std::uint8_t> Loaded(MemoryDisk& disk) const {
    Store store(disk, trust_);
    const Result<ModelOfStore> loaded = store.Load();
    return loaded.ok() ? loaded->bytes : std::vector<std::uint8_t>();
  }

  const TestKey key_{1};
  const Trust trust_ = TrustIn(key_);
  const std::vector<std::uint8_t> old_ = NumberedModel(1);
  const std::vector<std::uint8_t> new_ = NumberedModel(2);
  MemoryDisk disk_;
  std::string newest_;
  std::string older_;
};

TEST_F(TruncationTest, OfThePointerLeavesTheOtherOne) {
  const std::size_t size = disk_.Bytes(newest_).size();
  for (std::size_t left = 0; left <= size; ++left) {
    const auto disk = Copy();
    disk->Bytes(newest_).resize(left);
    EXPECT_EQ(Loaded(*disk), left == size ? new_ : old_) << left;
    disk->Bytes(older_).resize(std::min(left, disk->Bytes(older_).size() - 1));
    EXPECT_EQ(Loaded(*disk), new_) << left << ": both cut, so the newest version";
    if (HasFailure()) return;
  }
  std::printf("pointer cut at %zu lengths, and both: all whole\n", size + 1);
}

TEST_F(TruncationTest, OfASlotLeavesTheOtherModel) {
  constexpr std::size_t kBlock = 4096;
  int cut_points = 0;
  for (const auto& [slot, other] : {std::pair(&new_, &old_), std::pair(&old_, &new_)}) {
    Store store(disk_, trust_);
    const Result<StoreState> state = store.State();
    ASSERT_TRUE(state.ok());
    const std::string id = slot == &new_ ? state->current.id : state->previous.id;
    for (std::size_t left = 0; left < slot->size(); left += kBlock) {
      const auto disk = Copy();
      disk->Bytes(id + ".vfx").resize(left);
      EXPECT_EQ(Loaded(*disk), slot == &new_ ? *other : new_) << left;
      ++cut_points;
    }
  }
  std::printf("slots cut at %d blocks of 4 KiB: all whole\n", cut_points);
}

TEST_F(TruncationTest, OfASignatureLeavesTheOtherModel) {
  Store store(disk_, trust_);
  const std::string name = store.State()->current.id + ".minisig";
  for (std::size_t left = 0; left + 1 < disk_.Bytes(name).size(); ++left) {
    const auto disk = Copy();
    disk->Bytes(name).resize(left);
    EXPECT_EQ(Loaded(*disk), old_) << left;
  }
}

}  // namespace
}  // namespace viewfix
