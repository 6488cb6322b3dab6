// SPDX-License-Identifier: BSD-3-Clause
#include "platform/store/store.h"

#include <fcntl.h>
#include <gmock/gmock.h>
#include <sys/stat.h>
#include <unistd.h>

#include <filesystem>
#include <utility>

#include "platform/file.h"
#include "platform/store/store_session.h"
#include "tests/platform/store/memory_disk.h"
#include "tests/platform/store/store_site.h"
#include "tests/testing/temp_folder.h"

namespace viewfix {
namespace {

using testing::HasSubstr;
using testing::SizeIs;

std::string Said(const Status& status) {
  return std::string(status.text()) + ": " + std::string(status.detail());
}

class StoreTest : public testing::Test {
 protected:
  Result<StoredModel> Put(const std::vector<std::uint8_t>& model, const ModelClaim& claim,
                          bool allow_older = false, bool allow_other_site = false) {
    ModelOffer offer = OfferOf(model, key_, claim);
    offer.allow_older = allow_older;
    offer.allow_other_site = allow_other_site;
    Store store(disk_, trust_);
    return Install(store, offer, Send(model));
  }
  std::string Refusal(const std::vector<std::uint8_t>& model, const ModelOffer& offer) {
    const std::vector<std::string> before = disk_.Names();
    Store store(disk_, trust_);
    const auto installed = Install(store, offer, Send(model));
    EXPECT_FALSE(installed.ok());
    EXPECT_EQ(disk_.Names(), before) << "something was written";
    return installed.ok() ? "" : Said(installed.status());
  }
  StoreState State() {
    const Result<StoreState> state = Store(disk_, trust_).State();
    EXPECT_TRUE(state.ok());
    return *state;
  }
  std::unique_ptr<StoreSession> Session() {
    auto session = StoreSession::Start(disk_, trust_);
    EXPECT_TRUE(session.ok()) << Said(session.status());
    return session.ok() ? std::move(*session) : nullptr;
  }

  const TestKey key_{1};
  Trust trust_ = TrustIn(key_);
  MemoryDisk disk_;
  const std::vector<std::uint8_t> first_ = NumberedModel(1);
  const std::vector<std::uint8_t> second_ = NumberedModel(2);
};

TEST_F(StoreTest, InstallsLoadsAndNamesModelsAsFixesDo) {
  const auto installed = Put(first_, {"museum", 1});
  ASSERT_TRUE(installed.ok()) << Said(installed.status());
  const auto hash = ModelView::Open(first_)->short_hash();
  EXPECT_EQ(installed->id, std::string(hash.data(), hash.size()));
  Store store(disk_, trust_);
  const Result<ModelOfStore> loaded = store.Load();
  ASSERT_TRUE(loaded.ok());
  EXPECT_EQ(loaded->bytes, first_);
  EXPECT_EQ(loaded->note, "");
  EXPECT_FALSE(State().confirmed);
  EXPECT_THAT(disk_.Names(), SizeIs(3)) << "model, signature and pointer";
}

TEST_F(StoreTest, PatchesAndTransfersThatWereCutGiveTheSameModel) {
  ASSERT_TRUE(Put(first_, {"museum", 1}).ok());
  const Sent patch = Send(second_, first_);
  EXPECT_LT(patch.bytes.size(), second_.size() / 10);
  Store store(disk_, trust_);
  const ModelOffer offer = OfferOf(second_, key_, {"museum", 2});
  {
    Result<StoreFile> part = store.OpenPart(patch.transfer);
    ASSERT_TRUE(part.ok());
    ASSERT_TRUE(part->Write(std::span(patch.bytes).first(100)).ok());
  }
  EXPECT_EQ(*store.PartSize(patch.transfer), 100U);
  const auto installed = Install(store, offer, patch);
  ASSERT_TRUE(installed.ok()) << Said(installed.status());
  EXPECT_EQ(store.Load()->bytes, second_);
}

TEST_F(StoreTest, RefusesBeforeAnythingIsWritten) {
  ASSERT_TRUE(Put(first_, {"museum", 5}).ok());
  const TestKey stranger(2);
  EXPECT_THAT(Refusal(second_, OfferOf(second_, stranger, {"museum", 6})),
              HasSubstr("a key that this board does not trust"));
  ModelOffer offer = OfferOf(second_, key_, {"museum", 6});
  offer.signature.clear();
  EXPECT_THAT(Refusal(second_, offer), HasSubstr("not signed"));
  offer = OfferOf(first_, key_, {"museum", 6});
  offer.hash = HashContent(second_);
  EXPECT_THAT(Refusal(second_, offer), HasSubstr("does not match"));
  EXPECT_THAT(Refusal(second_, OfferOf(second_, key_, {"museum", 4})), HasSubstr("an older model"));
  EXPECT_THAT(Refusal(second_, OfferOf(second_, key_, {"museum", 5})),
              HasSubstr("another of the same version"));
  EXPECT_THAT(Refusal(second_, OfferOf(second_, key_, {"gallery", 6})),
              HasSubstr("another site: gallery, while this board is at museum"));
  offer = OfferOf(second_, key_, {"museum", 6});
  offer.size = std::uint64_t{10} << 30;
  EXPECT_THAT(Refusal(second_, offer), HasSubstr("no model has this size"));
  trust_.revoked = {key_.open().id};
  EXPECT_THAT(Refusal(second_, OfferOf(second_, key_, {"museum", 6})), HasSubstr("revoked key"));
}

TEST_F(StoreTest, OverridesTakeOlderModelsAndOtherSites) {
  ASSERT_TRUE(Put(first_, {"museum", 5}).ok());
  EXPECT_TRUE(Put(second_, {"museum", 4}, true, false).ok());
  EXPECT_TRUE(Put(first_, {"gallery", 1}, false, true).ok());
  EXPECT_EQ(State().NewestOf("museum")->version, 5U) << "what was seen is not forgotten";
}

TEST_F(StoreTest, TheAdministratorsSiteIsTheBoards) {
  trust_.site = "gallery";
  EXPECT_FALSE(Put(first_, {"museum", 1}).ok());
  EXPECT_TRUE(Put(first_, {"gallery", 1}).ok());
}

TEST_F(StoreTest, DevelopmentTakesUnsignedModels) {
  trust_ = Trust();
  trust_.development = true;
  ModelOffer offer = OfferOf(first_, key_, {"museum", 1});
  offer.signature.clear();
  Store store(disk_, trust_);
  ASSERT_TRUE(Install(store, offer, Send(first_)).ok());
  EXPECT_EQ(store.Load()->bytes, first_);
  trust_.development = false;
  EXPECT_STREQ(store.Load().status().text(), "the model is not signed")
      << "no longer in development";
}

TEST_F(StoreTest, WhatIsNoModelIsRefusedAfterItsSignature) {
  ASSERT_TRUE(Put(first_, {"museum", 1}).ok());
  std::vector<std::uint8_t> broken = second_;
  broken[broken.size() / 2] ^= 1;
  EXPECT_THAT(Said(Put(broken, {"museum", 2}).status()), HasSubstr("damaged"));
  Store store(disk_, trust_);
  EXPECT_EQ(store.Load()->bytes, first_);
  EXPECT_EQ(State().NewestOf("museum")->version, 1U);
}

TEST_F(StoreTest, AKeyThatIsRevokedTakesItsModelsAlong) {
  ASSERT_TRUE(Put(first_, {"museum", 1}).ok());
  const TestKey next(2);
  trust_.keys.push_back(next.open());
  Store store(disk_, trust_);
  ASSERT_TRUE(Install(store, OfferOf(second_, next, {"museum", 2}), Send(second_)).ok());
  trust_.revoked = {next.open().id};
  EXPECT_EQ(store.Load()->bytes, first_);
  EXPECT_THAT(store.Load()->note, HasSubstr("revoked key"));
  // The same model, signed anew by the key that is still good.
  ASSERT_TRUE(Install(store, OfferOf(second_, key_, {"museum", 3}), Send(second_)).ok());
  EXPECT_EQ(store.Load()->bytes, second_);
}

TEST_F(StoreTest, KeepsTheCurrentAndTheLastGoodModel) {
  for (int version = 1; version <= 5; ++version) {
    ASSERT_TRUE(Put(NumberedModel(version), {"museum", std::uint64_t(version)}).ok());
    ASSERT_TRUE(Store(disk_, trust_).Confirm(State().current).ok());
  }
  Store store(disk_, trust_);
  EXPECT_THAT(*store.Models(), SizeIs(2));
  ASSERT_TRUE(store.Rollback().ok());
  EXPECT_EQ(store.Load()->bytes, NumberedModel(4));
}

TEST_F(StoreTest, GcTakesWhatWasLeftOver) {
  ASSERT_TRUE(Put(first_, {"museum", 1}).ok());
  Store store(disk_, trust_);
  ASSERT_TRUE(store.OpenPart(Send(second_).transfer).ok());
  ASSERT_TRUE(ReplaceStoreText(disk_, "0123456789abcdef.minisig", "of no model").ok());
  EXPECT_EQ(*store.Gc(2), 2);
  EXPECT_EQ(store.Load()->bytes, first_);
}

TEST_F(StoreTest, PointersReadAsTheyAreWrittenAndNotOtherwise) {
  StoreState state;
  state.generation = 12;
  state.current = {"0123456789abcdef", HashContent(first_)};
  state.starts = 2;
  state.rejected = "fedcba9876543210";
  state.newest = {{"museum", 5}, {"gallery", 1}};
  const std::string text = PointerText(state);
  const Result<StoreState> read = ParsePointer(text);
  ASSERT_TRUE(read.ok());
  EXPECT_EQ(PointerText(*read), text);
  for (std::size_t i = 0; i < text.size(); ++i) {
    std::string changed = text;
    changed[i] = static_cast<char>(changed[i] ^ 1);
    EXPECT_FALSE(ParsePointer(changed).ok()) << i;
  }
}

// The daemon's part.
TEST_F(StoreTest, FramesConfirmAModel) {
  ASSERT_TRUE(Put(first_, {"museum", 1}).ok());
  const auto session = Session();
  for (int i = 0; i < StoreSession::kFramesToConfirm; ++i) {
    EXPECT_FALSE(State().confirmed) << i;
    ASSERT_TRUE(session->FrameReceived().ok());
    EXPECT_EQ(State().starts, 1) << "counted once";
    ASSERT_TRUE(session->FrameProcessed().ok());
  }
  EXPECT_TRUE(State().confirmed);
  const std::uint64_t generation = State().generation;
  const auto again = Session();
  ASSERT_TRUE(again->FrameReceived().ok());
  EXPECT_EQ(State().generation, generation) << "a confirmed model costs no more writes";
}

TEST_F(StoreTest, ThreeUnprovenStartsRollBack) {
  ASSERT_TRUE(Put(first_, {"museum", 1}).ok());
  ASSERT_TRUE(Store(disk_, trust_).Confirm(State().current).ok());
  ASSERT_TRUE(Put(second_, {"museum", 2}).ok());
  for (int start = 0; start < 3; ++start) {
    const auto session = Session();
    EXPECT_EQ(session->model().bytes, second_) << start;
    ASSERT_TRUE(session->FrameReceived().ok());
  }
  const auto session = Session();
  EXPECT_EQ(session->model().bytes, first_);
  EXPECT_THAT(session->model().note, HasSubstr("rolled back"));
  EXPECT_EQ(Session()->model().note, "");
  EXPECT_EQ(State().rejected, State().previous.id);
}

TEST_F(StoreTest, StartsWithoutFramesProveNothing) {
  ASSERT_TRUE(Put(first_, {"museum", 1}).ok());
  ASSERT_TRUE(Store(disk_, trust_).Confirm(State().current).ok());
  ASSERT_TRUE(Put(second_, {"museum", 2}).ok());
  for (int start = 0; start < 20; ++start) EXPECT_EQ(Session()->model().bytes, second_);
  EXPECT_EQ(State().starts, 0);
  EXPECT_FALSE(State().confirmed);
}

TEST_F(StoreTest, ARunningSessionSeesTheNextModel) {
  ASSERT_TRUE(Put(first_, {"museum", 1}).ok());
  const auto session = Session();
  ASSERT_TRUE(session->FrameReceived().ok());
  EXPECT_FALSE(session->Changed()) << "a start that was counted is no change";
  ASSERT_TRUE(Put(second_, {"museum", 2}).ok());
  EXPECT_TRUE(session->Changed());
  ASSERT_TRUE(session->Reload().ok());
  EXPECT_EQ(session->model().bytes, second_);
  EXPECT_FALSE(session->Changed());
}

TEST_F(StoreTest, AHundredFramesThroughAModelConfirmIt) {
  ASSERT_TRUE(Put(first_, {"museum", 1}).ok());
  const auto session = Session();
  ASSERT_TRUE(session->FrameReceived().ok());
  for (int frame = 0; frame < 20; ++frame) ASSERT_TRUE(session->FrameProcessed().ok());
  ASSERT_TRUE(Put(second_, {"museum", 2}).ok());
  ASSERT_TRUE(session->Reload().ok());
  ASSERT_TRUE(session->FrameReceived().ok());
  for (int frame = 0; frame < 99; ++frame) ASSERT_TRUE(session->FrameProcessed().ok());
  EXPECT_FALSE(State().confirmed) << "those of the model before do not count";
  ASSERT_TRUE(session->FrameProcessed().ok());
  EXPECT_TRUE(State().confirmed);
}

TEST_F(StoreTest, AStoreThatCannotBeWrittenStillLocalizes) {
  ASSERT_TRUE(Put(first_, {"museum", 1}).ok());
  const auto session = Session();
  disk_.FailAt(1, true);
  EXPECT_FALSE(session->FrameReceived().ok());
  EXPECT_TRUE(session->FrameReceived().ok()) << "told once";
  EXPECT_EQ(session->model().bytes, first_);
}

// On a real disk: what a folder may hold that is no plain file.
class HostileFolderTest : public testing::Test {
 protected:
  void SetUp() override {
    auto files = OpenFolder(folder_ / "store", true);
    ASSERT_TRUE(files.ok());
    files_ = std::move(*files);
    Store store(*files_, trust_);
    ASSERT_TRUE(Install(store, OfferOf(first_, key_, {"museum", 1}), Send(first_)).ok());
    ASSERT_TRUE(store.Confirm(store.State()->current).ok());
    ASSERT_TRUE(Install(store, OfferOf(second_, key_, {"museum", 2}), Send(second_)).ok());
    current_ = folder_ / ("store/" + store.State()->current.id + ".vfx");
  }
  Result<ModelOfStore> Load() { return Store(*files_, trust_).Load(); }

  const TestKey key_{1};
  const Trust trust_ = TrustIn(key_);
  TempFolder folder_;
  std::unique_ptr<FileOps> files_;
  const std::vector<std::uint8_t> first_ = NumberedModel(1);
  const std::vector<std::uint8_t> second_ = NumberedModel(2);
  std::string current_;
};

TEST_F(HostileFolderTest, LinksAreNotFollowed) {
  const std::string elsewhere = folder_.Write("elsewhere.vfx", second_);
  std::filesystem::remove(current_);
  std::filesystem::create_symlink(elsewhere, current_);
  ASSERT_TRUE(Load().ok());
  EXPECT_EQ(Load()->bytes, first_);
  EXPECT_THAT(Load()->note, HasSubstr("a link, or not a plain file"));
  std::filesystem::remove(current_);
  std::filesystem::create_hard_link(elsewhere, current_);
  EXPECT_EQ(Load()->bytes, first_);
  for (const char* pointer : {"store/pointer-0", "store/pointer-1"}) {
    std::filesystem::remove(folder_ / pointer);
    std::filesystem::create_symlink("/dev/zero", folder_ / pointer);
  }
  EXPECT_THAT(Said(Load().status()), HasSubstr("a link, or not a plain file"));
}

TEST_F(HostileFolderTest, APipeDoesNotHang) {
  std::filesystem::remove(current_);
  ASSERT_EQ(mkfifo(current_.c_str(), 0600), 0);
  EXPECT_EQ(Load()->bytes, first_);
}

TEST_F(HostileFolderTest, AHugeFileIsRefusedBeforeItIsRead) {
  ASSERT_EQ(truncate(current_.c_str(), off_t{10} << 30), 0);
  EXPECT_THAT(Load()->note, HasSubstr("file too large"));
  EXPECT_EQ(Load()->bytes, first_);
}

// A header that promises 10 GB, signed as it is by a trusted key.
TEST_F(HostileFolderTest, AHugePromiseIsRefusedBeforeAllocation) {
  std::vector<std::uint8_t> promising = NumberedModel(3);
  promising[18] = promising[19] = promising[20] = 0xFF;
  Store store(*files_, trust_);
  const auto installed = Install(store, OfferOf(promising, key_, {"museum", 3}), Send(promising));
  EXPECT_THAT(Said(installed.status()), HasSubstr("model is truncated"));
  // And compressed: the frame says 10 GB, the offer what a model may be.
  Sent sent = Send(promising, first_);
  sent.bytes = {0x28, 0xB5, 0x2F, 0xFD, 0xE0, 0, 0, 0, 0x80, 2, 0, 0, 0, 1, 0, 0};
  sent.transfer.size = sent.bytes.size();
  sent.transfer.hash = HashTransfer(sent.bytes);
  EXPECT_THAT(Said(Install(store, OfferOf(promising, key_, {"museum", 3}), sent).status()),
              HasSubstr("the compressed model is damaged"));
  EXPECT_EQ(Load()->bytes, second_);
}

TEST_F(HostileFolderTest, IsSharedByAGroupWhateverTheUmask) {
  const mode_t before = umask(077);
  auto files = OpenFolder(folder_ / "shared", true);
  ASSERT_TRUE(files.ok());
  Store store(**files, trust_);
  ASSERT_TRUE(Install(store, OfferOf(first_, key_, {"museum", 1}), Send(first_)).ok());
  umask(before);
  struct stat info = {};
  ASSERT_EQ(stat((folder_ / "shared").c_str(), &info), 0);
  EXPECT_EQ(info.st_mode & 07777, 02775U);
  for (const auto& entry : std::filesystem::directory_iterator(folder_ / "shared")) {
    ASSERT_EQ(stat(entry.path().c_str(), &info), 0);
    EXPECT_EQ(info.st_mode & 0777, 0664U) << entry.path();
  }
}

class TrustTest : public testing::Test {
 protected:
  const std::string Path() const { return folder_ / "trust"; }
  TempFolder folder_;
};

TEST_F(TrustTest, KeysComeAndGo) {
  EXPECT_THAT(ReadTrust(Path())->keys, SizeIs(0)) << "no folder: nobody";
  const TestKey first(1);
  const TestKey second(2);
  ASSERT_TRUE(AddKey(Path(), first.OpenText()).ok());
  EXPECT_THAT(Said(RevokeKey(Path(), first.open().id)), HasSubstr("the last trusted key"));
  ASSERT_TRUE(AddKey(Path(), second.OpenText()).ok());
  EXPECT_THAT(ReadTrust(Path())->keys, SizeIs(2));
  ASSERT_TRUE(RevokeKey(Path(), first.open().id).ok());
  ASSERT_THAT(ReadTrust(Path())->keys, SizeIs(1));
  EXPECT_EQ(ReadTrust(Path())->keys[0].id, second.open().id);
  EXPECT_THAT(Said(AddKey(Path(), first.OpenText())), HasSubstr("was revoked"));
}

TEST_F(TrustTest, FilesThatSayNothingAreErrors) {
  ASSERT_TRUE(SetSite(Path(), "museum").ok());
  EXPECT_EQ(ReadTrust(Path())->site, "museum");
  EXPECT_FALSE(SetSite(Path(), "../museum").ok());
  folder_.Write("trust/broken.pub", std::string("no key"));
  EXPECT_THAT(Said(ReadTrust(Path()).status()), HasSubstr("broken.pub"));
  folder_.Write("trust/broken.pub", TestKey(1).OpenText());
  folder_.Write("trust/revoked", std::string("not an id\n"));
  EXPECT_THAT(Said(ReadTrust(Path()).status()), HasSubstr("revoked: not an id"));
}

}  // namespace
}  // namespace viewfix
