// SPDX-License-Identifier: BSD-3-Clause
#include "firmware_tools/flash/signing.h"

#include <gmock/gmock.h>
#include <unistd.h>

#include <filesystem>
#include <string>

#include "firmware_tools/dataset/image_set.h"
#include "firmware_tools/dataset/tool_file.h"
#include "tests/firmware_tools/cli/viewfix_program.h"
#include "tests/testing/temp_folder.h"
#include "tests/testing/tiny_model.h"

namespace viewfix {
namespace {

using testing::HasSubstr;

constexpr PasswordCost kCheap = {32768, 16 << 20};
const std::vector<std::uint8_t> kBytes = {'m', 'o', 'd', 'e', 'l'};

PublicKey ReadPublic(const std::string& text) {
  const Result<PublicKey> key = ParsePublicKey(text);
  EXPECT_TRUE(key.ok());
  return *key;
}

TEST(SigningTest, ASignatureIsOfThisFileKeyAndComment) {
  const SecretKey secret = GenerateKey();
  const PublicKey key = ReadPublic(PublicKeyText(PublicKeyOf(secret)));
  EXPECT_EQ(key.id, secret.id);
  const std::string text = SignatureText(kBytes, secret, ClaimText({"museum", 7}));
  EXPECT_EQ(text, SignatureText(kBytes, secret, ClaimText({"museum", 7})));
  const Result<Signature> signature = ParseSignature(text);
  ASSERT_TRUE(signature.ok());
  EXPECT_TRUE(VerifyContent(*signature, key, kBytes).ok());
  EXPECT_TRUE(VerifyHash(*signature, key, HashContent(kBytes)).ok());
  const Result<ModelClaim> claim = ParseClaim(signature->trusted_comment);
  ASSERT_TRUE(claim.ok());
  EXPECT_EQ(claim->site, "museum");
  EXPECT_EQ(claim->version, 7U);

  std::vector<std::uint8_t> other = kBytes;
  other[0] ^= 1;
  EXPECT_STREQ(VerifyContent(*signature, key, other).text(),
               "the signature does not match the file");
  Signature forged = *signature;
  forged.trusted_comment = ClaimText({"museum", 8});
  EXPECT_STREQ(VerifyContent(forged, key, kBytes).text(),
               "the signature's trusted comment was changed");
  EXPECT_STREQ(VerifyContent(*signature, PublicKeyOf(GenerateKey()), kBytes).text(),
               "signed by another key");
}

// Whatever bit of the two files is flipped: refused, or a comment that nothing depends on.
TEST(SigningTest, AFlippedBitIsRefused) {
  const SecretKey secret = GenerateKey();
  const PublicKey key = PublicKeyOf(secret);
  const std::string text = SignatureText(kBytes, secret, ClaimText({"museum", 7}));
  const std::size_t begin = text.find('\n') + 1;
  for (std::size_t i = begin; i < text.size(); ++i) {
    for (int bit = 0; bit < 8; ++bit) {
      std::string changed = text;
      changed[i] = static_cast<char>(changed[i] ^ (1 << bit));
      const Result<Signature> signature = ParseSignature(changed);
      if (!signature.ok()) continue;
      const bool same = signature->signature == ParseSignature(text)->signature &&
                        signature->trusted_comment == ParseSignature(text)->trusted_comment &&
                        signature->comment_signature == ParseSignature(text)->comment_signature &&
                        signature->id == secret.id && signature->prehashed;
      EXPECT_EQ(VerifyContent(*signature, key, kBytes).ok(), same) << i << " bit " << bit;
    }
  }
}

TEST(SigningTest, TruncatedFilesAreRefused) {
  const SecretKey secret = GenerateKey();
  const std::string signature = SignatureText(kBytes, secret, "comment");
  for (std::size_t size = 0; size + 1 < signature.size(); ++size) {
    EXPECT_FALSE(ParseSignature(signature.substr(0, size)).ok()) << size;
  }
  const std::string key = PublicKeyText(PublicKeyOf(secret));
  for (std::size_t size = 0; size + 1 < key.size(); ++size) {
    EXPECT_FALSE(ParsePublicKey(key.substr(0, size)).ok()) << size;
  }
  const std::string file = SecretKeyText(secret, "");
  for (std::size_t size = 0; size + 1 < file.size(); ++size) {
    EXPECT_THROW(ReadSecretKey(file.substr(0, size), ""), ToolError) << size;
  }
}

TEST(SigningTest, ASecretKeyNeedsItsPassword) {
  const SecretKey secret = GenerateKey();
  const std::string locked = SecretKeyText(secret, "open sesame", kCheap);
  EXPECT_TRUE(NeedsPassword(locked));
  EXPECT_EQ(ReadSecretKey(locked, "open sesame").key, secret.key);
  EXPECT_THROW(ReadSecretKey(locked, "open"), ToolError);
  const std::string open = SecretKeyText(secret, "");
  EXPECT_FALSE(NeedsPassword(open));
  EXPECT_EQ(ReadSecretKey(open, "").key, secret.key);
}

TEST(SigningTest, AClaimNamesASiteAndAVersion) {
  EXPECT_TRUE(ParseClaim("timestamp:1\tversion:3\tsite:a.b-c_9\tmore").ok());
  for (const char* comment :
       {"", "site:museum", "version:3", "site:\tversion:3", "site:a b\tversion:3",
        "site:-a\tversion:3", "site:../a\tversion:3", "site:a\tversion:-3", "site:a\tversion:3x",
        "site:a\tversion:99999999999999999999"}) {
    EXPECT_FALSE(ParseClaim(comment).ok()) << comment;
  }
}

TEST(SigningTest, KeyIdsReadAsTheyAreWritten) {
  const SecretKey key = GenerateKey();
  EXPECT_EQ(*ParseKeyId(KeyIdText(key.id)), key.id);
  for (const char* text : {"", "12", "0123456789ABCDEG", "0123456789ABCDEF0"}) {
    EXPECT_FALSE(ParseKeyId(text).ok()) << text;
  }
}

class SigningCommandTest : public testing::Test {
 protected:
  void SetUp() override { model_ = folder_.Write("site.vfx", TinyModel()); }

  std::string Key(const std::string& name) const {
    EXPECT_EQ(Viewfix({"keygen", "--no-password", "--out", folder_ / name}).exit_code, 0);
    return folder_ / name;
  }
  ProgramRun Sign(const std::string& key) const {
    return Viewfix({"sign", model_, "--key", key + ".key", "--site", "museum", "--version", "2"});
  }

  TempFolder folder_;
  std::string model_;
};

TEST_F(SigningCommandTest, SignsAndVerifies) {
  const std::string key = Key("a");
  EXPECT_EQ(Sign(key).exit_code, 0);
  const ProgramRun good = Viewfix({"verify", model_, "--key", key + ".pub"});
  EXPECT_EQ(good.exit_code, 0) << good.err;
  EXPECT_THAT(good.out, HasSubstr("site:museum\tversion:2"));
  const ProgramRun wrong = Viewfix({"verify", model_, "--key", Key("b") + ".pub"});
  EXPECT_EQ(wrong.exit_code, 1);
  EXPECT_THAT(wrong.err, HasSubstr("signed by another key"));
  folder_.Write("site.vfx", std::string("changed"));
  EXPECT_EQ(Viewfix({"verify", model_, "--key", key + ".pub"}).exit_code, 1);
  EXPECT_EQ(Sign(key).exit_code, 1) << "no model any more";
}

TEST_F(SigningCommandTest, AKeyIsNeitherReplacedNorForOthersToRead) {
  const std::string key = Key("a");
  const auto before = ReadTextFile(key + ".key");
  EXPECT_EQ(Viewfix({"keygen", "-W", "--out", key}).exit_code, 1);
  EXPECT_EQ(ReadTextFile(key + ".key"), before);
  using std::filesystem::perms;
  EXPECT_EQ(std::filesystem::status(key + ".key").permissions(),
            perms::owner_read | perms::owner_write);
}

// Against the program that defines the format.
class MinisignTest : public SigningCommandTest {
 protected:
  void SetUp() override {
    SigningCommandTest::SetUp();
    program_ = "/usr/bin/minisign";
    if (access(program_.c_str(), X_OK) != 0) GTEST_SKIP() << "minisign is not installed";
  }
  // Through a shell, for what it reads from stdin.
  ProgramRun Shell(const std::string& line) const { return RunProgram({"/bin/sh", "-c", line}); }

  std::string program_;
};

TEST_F(MinisignTest, VerifiesOurSignature) {
  const std::string key = Key("a");
  ASSERT_EQ(Sign(key).exit_code, 0);
  const ProgramRun run = RunProgram({program_, "-V", "-m", model_, "-p", key + ".pub"});
  EXPECT_EQ(run.exit_code, 0) << run.err;
  EXPECT_THAT(run.out, HasSubstr("Trusted comment: site:museum\tversion:2"));
}

TEST_F(MinisignTest, ItsSignaturesAndKeysAreOurs) {
  const std::string key = folder_ / "m";
  ASSERT_EQ(RunProgram({program_, "-G", "-W", "-p", key + ".pub", "-s", key + ".key"}).exit_code,
            0);
  for (const char* old_format : {"", "-l"}) {
    const ProgramRun signing = Shell(program_ + " -S " + old_format + " -m " + model_ + " -s " +
                                     key + ".key -t 'site:museum\tversion:3' < /dev/null");
    ASSERT_EQ(signing.exit_code, 0) << signing.err;
    const ProgramRun run = Viewfix({"verify", model_, "--key", key + ".pub"});
    EXPECT_EQ(run.exit_code, 0) << run.err;
    EXPECT_THAT(run.out, HasSubstr("version:3"));
  }
  EXPECT_EQ(Sign(key).exit_code, 0) << "its secret key signs for us";
  const ProgramRun with_ours =
      Shell(program_ + " -S -m " + model_ + " -s " + Key("ours") + ".key < /dev/null");
  EXPECT_EQ(with_ours.exit_code, 0) << with_ours.err;
  EXPECT_EQ(Viewfix({"verify", model_, "--key", folder_ / "ours.pub"}).exit_code, 0);
  EXPECT_EQ(Sign(key).exit_code, 0);
  EXPECT_EQ(RunProgram({program_, "-V", "-m", model_, "-p", key + ".pub"}).exit_code, 0);
}

// With a password each program reads the other's secret key.
TEST_F(MinisignTest, SharesEncryptedSecretKeys) {
  const SecretKey secret = GenerateKey();
  const std::string ours = folder_.Write("ours.key", SecretKeyText(secret, "sesame", kCheap));
  const std::string pub = folder_.Write("ours.pub", PublicKeyText(PublicKeyOf(secret)));
  const ProgramRun signing =
      Shell("echo sesame | " + program_ + " -S -m " + model_ + " -s " + ours);
  ASSERT_EQ(signing.exit_code, 0) << signing.err;
  EXPECT_EQ(Viewfix({"verify", model_, "--key", pub}).exit_code, 0);
  const ProgramRun again = Shell("echo sesame | " VIEWFIX " sign " + model_ + " --key " + ours +
                                 " --site museum --version 4");
  EXPECT_EQ(again.exit_code, 0) << again.err;
  const ProgramRun wrong = Shell("echo open | " VIEWFIX " sign " + model_ + " --key " + ours +
                                 " --site museum --version 4");
  EXPECT_EQ(wrong.exit_code, 1);
  EXPECT_THAT(wrong.err, HasSubstr("ours.key: wrong password"));

  const std::string theirs = folder_ / "theirs";
  const ProgramRun making = Shell("printf 'sesame\\nsesame\\n' | " + program_ + " -G -p " + theirs +
                                  ".pub -s " + theirs + ".key");
  if (making.exit_code != 0)
    GTEST_SKIP() << "minisign has not the memory for a key: " << making.err;
  const ProgramRun run = Shell("echo sesame | " VIEWFIX " sign " + model_ + " --key " + theirs +
                               ".key --site museum --version 5");
  EXPECT_EQ(run.exit_code, 0) << run.err;
  EXPECT_EQ(RunProgram({program_, "-V", "-m", model_, "-p", theirs + ".pub"}).exit_code, 0);
}

}  // namespace
}  // namespace viewfix
