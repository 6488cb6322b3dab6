// SPDX-License-Identifier: BSD-3-Clause
#include <gmock/gmock.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <cstdlib>
#include <filesystem>
#include <random>
#include <vector>

#include "platform/clock.h"
#include "platform/daemon/health.h"
#include "platform/daemon/model_holder.h"
#include "platform/daemon/notify.h"
#include "platform/daemon/scene_change.h"
#include "platform/log.h"
#include "tests/testing/temp_folder.h"
#include "tests/testing/tiny_model.h"

namespace viewfix {
namespace {

using testing::HasSubstr;

constexpr std::int64_t kSecondNs = 1'000'000'000;

// --- LimitedLog

TEST(LimitedLogTest, ABurstThenOneASecond) {
  LimitedLog log(/*limited=*/true);
  std::uint64_t held = 0;
  int passed = 0;
  for (int i = 0; i < 1000; ++i) passed += log.Admit(100 * kSecondNs, held) ? 1 : 0;
  EXPECT_EQ(passed, LimitedLog::kBurst);
  EXPECT_TRUE(log.Admit(101 * kSecondNs, held));
  EXPECT_EQ(held, 1000U - LimitedLog::kBurst);
  EXPECT_FALSE(log.Admit(101 * kSecondNs, held));
}

TEST(LimitedLogTest, WithoutALimitAllPass) {
  LimitedLog log(/*limited=*/false);
  std::uint64_t held = 0;
  for (int i = 0; i < 1000; ++i) EXPECT_TRUE(log.Admit(kSecondNs, held));
}

// --- SceneChange

std::vector<std::uint8_t> Noisy(int level, std::uint32_t seed, std::size_t size) {
  std::mt19937 random(seed);
  std::vector<std::uint8_t> pixels(size);
  for (auto& pixel : pixels) pixel = static_cast<std::uint8_t>(level + int(random() % 17) - 8);
  return pixels;
}

TEST(SceneChangeTest, NoiseIsNoChangeAndAPersonIs) {
  constexpr int kWidth = 640, kHeight = 480;
  const auto view = [](const std::vector<std::uint8_t>& pixels) {
    return ImageView{pixels.data(), kWidth, kHeight, kWidth};
  };
  SceneChange scene;
  const auto first = Noisy(120, 1, kWidth * kHeight);
  EXPECT_TRUE(scene.Differs(view(first)));  // no reference yet
  scene.SetReference(view(first));
  for (std::uint32_t seed = 2; seed < 20; ++seed) {
    EXPECT_FALSE(scene.Differs(view(Noisy(120, seed, kWidth * kHeight))));
  }
  auto person = Noisy(120, 3, kWidth * kHeight);
  for (int y = 200; y < 300; ++y) {
    for (int x = 300; x < 360; ++x) person[y * kWidth + x] = 40;
  }
  EXPECT_TRUE(scene.Differs(view(person)));
}

TEST(SceneChangeTest, TakesAnySize) {
  const std::vector<std::uint8_t> pixels(64 * 64, 7);
  for (const auto& [width, height] : {std::pair(1, 1), {3, 64}, {64, 3}, {31, 23}}) {
    SceneChange scene;
    const ImageView view = {pixels.data(), width, height, 64};
    scene.SetReference(view);
    EXPECT_FALSE(scene.Differs(view));
    EXPECT_TRUE(scene.Differs({pixels.data(), width + 1, height, 64}));
  }
}

// --- ModelHolder

TEST(ModelHolderTest, ABadModelLeavesTheGoodOneInUse) {
  const TempFolder folder;
  ModelHolder holder;
  const ModelSettings settings = {.model_path = folder / "site.vfx"};
  EXPECT_EQ(holder.Load(settings).code(), StatusCode::kNotFound);
  EXPECT_EQ(holder.Current(), nullptr);
  folder.Write("site.vfx", TinyModel());
  ASSERT_TRUE(holder.Load(settings).ok());
  const auto first = holder.Current();
  ASSERT_NE(first, nullptr);
  folder.Write("site.vfx", "damaged");
  EXPECT_FALSE(holder.Load(settings).ok());
  EXPECT_EQ(holder.Current(), first);
}

TEST(ModelHolderTest, AnotherFileIsSeenOnceItIsWritten) {
  const TempFolder folder;
  ModelHolder holder;
  folder.Write("one.vfx", TinyModel());
  folder.Write("two.vfx", TinyModel());
  std::filesystem::create_symlink(folder / "one.vfx", folder / "site.vfx");
  const ModelSettings settings = {.model_path = folder / "site.vfx"};
  ASSERT_TRUE(holder.Load(settings).ok());
  EXPECT_FALSE(holder.FileChanged());
  EXPECT_FALSE(holder.FileChanged());
  // The link leads elsewhere.
  std::filesystem::remove(folder / "site.vfx");
  EXPECT_FALSE(holder.FileChanged());
  EXPECT_FALSE(holder.FileChanged());
  std::filesystem::create_symlink(folder / "two.vfx", folder / "site.vfx");
  EXPECT_FALSE(holder.FileChanged());  // it may still be being written
  EXPECT_TRUE(holder.FileChanged());
  ASSERT_TRUE(holder.Load(settings).ok());
  EXPECT_FALSE(holder.FileChanged());
}

// --- Notifier

class NotifierTest : public testing::Test {
 protected:
  void TearDown() override {
    for (const char* name : {"NOTIFY_SOCKET", "WATCHDOG_USEC", "WATCHDOG_PID"}) ::unsetenv(name);
    if (fd_ >= 0) ::close(fd_);
  }
  // A datagram socket at this address, a leading '@' meaning an abstract one.
  void Listen(std::string address) {
    ::setenv("NOTIFY_SOCKET", address.c_str(), 1);
    sockaddr_un own = {};
    own.sun_family = AF_UNIX;
    if (address[0] == '@') address[0] = '\0';
    std::copy(address.begin(), address.end(), own.sun_path);
    fd_ = ::socket(AF_UNIX, SOCK_DGRAM | SOCK_NONBLOCK, 0);
    const auto size = static_cast<socklen_t>(offsetof(sockaddr_un, sun_path) + address.size());
    ASSERT_EQ(::bind(fd_, reinterpret_cast<sockaddr*>(&own), size), 0);
  }
  std::string Received() const {
    char text[256];
    const ssize_t size = ::recv(fd_, text, sizeof text, 0);
    return size < 0 ? std::string("nothing") : std::string(text, static_cast<std::size_t>(size));
  }

  int fd_ = -1;
};

TEST_F(NotifierTest, WritesToAPathAndToAnAbstractAddress) {
  const TempFolder folder;
  const std::string abstract = "@viewfix-test-" + std::to_string(::getpid());
  for (const std::string& address : {folder / "notify", abstract}) {
    Listen(address);
    Notifier().Send("READY=1\nSTATUS=well");
    EXPECT_EQ(Received(), "READY=1\nSTATUS=well");
    ::close(fd_);
  }
}

TEST_F(NotifierTest, WithoutAServiceManagerNothingHappens) {
  Notifier().Send("READY=1");
  EXPECT_EQ(Notifier().watchdog_ns(), 0);
  ::setenv("NOTIFY_SOCKET", std::string(300, '/').c_str(), 1);
  Notifier().Send("READY=1");
  ::setenv("NOTIFY_SOCKET", "/nobody/listens", 1);
  Notifier().Send("READY=1");
}

TEST_F(NotifierTest, TheWatchdogIsOfThisProcess) {
  Listen("@viewfix-test-w" + std::to_string(::getpid()));
  ::setenv("WATCHDOG_USEC", "10000000", 1);
  EXPECT_EQ(Notifier().watchdog_ns(), 10 * kSecondNs);
  ::setenv("WATCHDOG_PID", "1", 1);
  EXPECT_EQ(Notifier().watchdog_ns(), 0);
  ::setenv("WATCHDOG_PID", std::to_string(::getpid()).c_str(), 1);
  EXPECT_EQ(Notifier().watchdog_ns(), 10 * kSecondNs);
  ::setenv("WATCHDOG_USEC", "soon", 1);
  EXPECT_EQ(Notifier().watchdog_ns(), 0);
}

// --- Health

TEST(HealthTest, AFrameThatStaysStarvesTheWatchdog) {
  Health health;
  const std::int64_t now_ns = MonotonicNs();
  health.Beat(Health::kCapture);
  health.Beat(Health::kLocalize);
  EXPECT_EQ(health.Stuck(now_ns + kSecondNs), "");
  health.BeginFrame();
  EXPECT_EQ(health.Stuck(now_ns + kSecondNs), "");
  EXPECT_THAT(health.Stuck(now_ns + 3 * kSecondNs), HasSubstr("Localize"));
  health.EndFrame();
  EXPECT_EQ(health.Stuck(now_ns + 3 * kSecondNs), "");
  EXPECT_THAT(health.Stuck(now_ns + 12 * kSecondNs), HasSubstr("capture"));
  health.Retire(Health::kCapture);
  EXPECT_THAT(health.Stuck(now_ns + 12 * kSecondNs), HasSubstr("localize"));
}

TEST(HealthTest, CameraAndModelAreStates) {
  Health health;
  EXPECT_EQ(health.State(), "no_model");
  health.SetModel("0123456789abcdef", "");
  EXPECT_EQ(health.State(), "no_camera");
  health.SetCamera({true, "640x480 GREY"}, {});
  EXPECT_EQ(health.State(), "ok");
  EXPECT_THAT(health.StatusLine(), HasSubstr("640x480 GREY"));
  EXPECT_THAT(health.Json({}), HasSubstr("\"state\":\"ok\""));
  EXPECT_THAT(health.Metrics({}), HasSubstr("\nviewfix_up 1\n"));
  health.SetCamera({false, "unplugged"}, {});
  EXPECT_THAT(health.Metrics({}), HasSubstr("\nviewfix_camera_present 0\n"));
}

}  // namespace
}  // namespace viewfix
