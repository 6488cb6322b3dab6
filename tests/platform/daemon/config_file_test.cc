// SPDX-License-Identifier: BSD-3-Clause
#include "platform/daemon/config_file.h"

#include <gmock/gmock.h>

#include <random>

#include "tests/testing/temp_folder.h"

namespace viewfix {
namespace {

using testing::HasSubstr;
using testing::StartsWith;

class ConfigFileTest : public testing::Test {
 protected:
  // What ApplyConfigFile() says of this text, without the file's name.
  std::string Apply(std::string_view toml) {
    const std::string path = folder_.Write("viewfixd.toml", toml);
    std::string fault = ApplyConfigFile(path, options_);
    if (fault.rfind(path, 0) == 0) fault.erase(0, path.size());
    return fault;
  }

  TempFolder folder_;
  DaemonOptions options_;
};

TEST_F(ConfigFileTest, ReadsEverySetting) {
  EXPECT_EQ(Apply(R"(
model = "/var/lib/viewfix/site.vfx"
camera = "v4l2:/dev/video0"
calibration = "camera.yaml"
rotate = 90
window = 5
filter = false
max_fps = 10
idle_fps = 0.5
size = "1280x720"
rate = 30
pixel_format = "MJPG"
publish = ["stdout", "unix:/run/viewfix/fixes", "http:8080"]
frame_picture = true
[controls]
exposure_time_absolute = 100
auto_exposure = 1
)"),
            "");
  EXPECT_EQ(options_.model_path, "/var/lib/viewfix/site.vfx");
  EXPECT_EQ(options_.camera.kind, CameraSettings::Kind::kV4l2);
  EXPECT_EQ(options_.camera.where, "/dev/video0");
  EXPECT_EQ(options_.calibration_path, "camera.yaml");
  EXPECT_EQ(options_.rotate_deg, 90);
  EXPECT_EQ(options_.window, 5);
  EXPECT_FALSE(options_.filter);
  EXPECT_EQ(options_.max_fps, 10);
  EXPECT_EQ(options_.idle_fps, 0.5);
  EXPECT_EQ(options_.camera.width, 1280);
  EXPECT_EQ(options_.camera.height, 720);
  EXPECT_EQ(options_.camera.rate, 30);
  EXPECT_EQ(options_.camera.pixel_format, "MJPG");
  EXPECT_TRUE(options_.publish.to_stdout);
  EXPECT_EQ(options_.publish.unix_path, "/run/viewfix/fixes");
  EXPECT_EQ(options_.publish.http_port, 8080);
  EXPECT_EQ(options_.publish.http_address, "127.0.0.1");
  EXPECT_TRUE(options_.publish.frame_picture);
  EXPECT_THAT(options_.camera.controls,
              testing::ElementsAre(CameraControl{"exposure_time_absolute", 100},
                                   CameraControl{"auto_exposure", 1}));
}

TEST_F(ConfigFileTest, FaultsNameLineAndCause) {
  EXPECT_THAT(Apply("model = \"a\"\nmodle = \"b\"\n"), StartsWith(":2: unknown setting modle"));
  EXPECT_EQ(Apply("\n\nrotate = 45\n"), ":3: --rotate 45: not 0, 90, 180 or 270");
  EXPECT_THAT(Apply("model = \n"), StartsWith(":1: "));
  EXPECT_THAT(Apply("model = 1979-05-27\n"), HasSubstr("not a value"));
  EXPECT_THAT(Apply("[controls]\ngain = \"high\"\n"), HasSubstr("gain: not a whole number"));
  EXPECT_THAT(Apply("[camera]\nkind = 1\n"), HasSubstr("camera"));
  EXPECT_THAT(Apply("max_fps = nan\n"), HasSubstr("not a rate"));
  EXPECT_THAT(Apply("publish = \"http:0\"\n"), HasSubstr("http takes a port"));
  EXPECT_THAT(ApplyConfigFile(folder_ / "none.toml", options_),
              HasSubstr("none.toml: No such file"));
}

// Any bytes: one line that names the file, or settings; never a crash.
TEST_F(ConfigFileTest, AnyBytesAreReadOrRefused) {
  const std::string good = "model = \"a\"\npublish = [\"stdout\"]\n[controls]\ngain = 1\n";
  std::mt19937 random(1);
  for (int round = 0; round < 3000; ++round) {
    std::string text = good;
    for (int i = 0; i < 1 + round % 4; ++i) {
      text[random() % text.size()] = static_cast<char>(random() % 256);
    }
    if (round % 3 == 0) text.resize(random() % text.size());
    std::vector<ConfigEntry> entries;
    const std::string fault = ParseConfig(text, entries);
    EXPECT_EQ(fault.find('\n'), std::string::npos) << fault;
  }
}

TEST_F(ConfigFileTest, DeepNestingIsRefused) {
  EXPECT_NE(Apply("x = " + std::string(100'000, '[')), "");
}

}  // namespace
}  // namespace viewfix
