// SPDX-License-Identifier: BSD-3-Clause
#include "platform/camera/v4l2/v4l2_camera.h"

#include <gmock/gmock.h>

#include <thread>

#include "tests/platform/camera/v4l2/fake_v4l2.h"

namespace viewfix {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;

class V4l2CameraTest : public testing::Test {
 protected:
  V4l2CameraTest() {
    settings_.kind = CameraSettings::Kind::kV4l2;
    settings_.where = "/dev/video0";
    settings_.width = 64;
    settings_.height = 48;
  }

  FakeCamera& camera() { return system_.cameras[0]; }
  FrameSource& source() {
    if (source_ == nullptr)
      source_ = MakeV4l2Camera(system_, settings_, [this] { return slept_ns_; });
    return *source_;
  }
  // Next() until the camera streams, at most so often.
  bool Connect(int turns = 50) {
    for (int i = 0; i < turns; ++i) {
      if (camera().streaming && source().condition().present) return true;
      (void)source().Next(frame_);
    }
    return camera().streaming;
  }
  Status Next() { return source().Next(frame_); }

  FakeV4l2 system_;
  CameraSettings settings_;
  std::int64_t slept_ns_ = 0;
  std::unique_ptr<FrameSource> source_;
  Frame frame_;
};

TEST_F(V4l2CameraTest, DeliversFramesWithTheDriversTime) {
  ASSERT_TRUE(Connect());
  EXPECT_THAT(source().condition().text, HasSubstr("64x48 YUYV at 30/s, Fake Camera"));
  camera().Fill(0, 77);
  ASSERT_TRUE(Next().ok());
  EXPECT_EQ(frame_.image.width, 64);
  EXPECT_EQ(frame_.image.height, 48);
  EXPECT_THAT(frame_.image.pixels, testing::Each(77));
  EXPECT_EQ(frame_.capture_time_ns, 1'000'000'000);
  EXPECT_EQ(frame_.sequence, 0U);
  EXPECT_EQ(camera().queued.size(), 4U);
  EXPECT_EQ(Next().code(), StatusCode::kCancelled);
  EXPECT_EQ(source().counts().timeouts, 2U);  // one while connecting
}

TEST_F(V4l2CameraTest, MultiPlanarIsTheSame) {
  camera().multi_planar = true;
  camera().formats = {V4L2_PIX_FMT_NV12M};
  ASSERT_TRUE(Connect());
  camera().Fill(0, 50);
  ASSERT_TRUE(Next().ok());
  EXPECT_THAT(frame_.image.pixels, testing::Each(50));
}

TEST_F(V4l2CameraTest, ExportedBuffersAreReadAsDmabufs) {
  camera().exports = true;
  ASSERT_TRUE(Connect());
  EXPECT_THAT(source().condition().text, HasSubstr("DMABUF"));
  for (std::uint32_t i = 0; i < 10; ++i) {
    camera().Fill(2 * i, 1);
    camera().Fill(2 * i + 1, 77);
    ASSERT_TRUE(Next().ok());
    EXPECT_EQ(frame_.image.pixels[0], 77);
    EXPECT_EQ(camera().being_read, 0);  // all were given back to the device
  }
  camera().plugged = false;
  (void)Next();
  EXPECT_EQ(system_.open_files(), 0U);
  EXPECT_EQ(system_.mapped, 0);
}

TEST_F(V4l2CameraTest, TheNewestFrameWinsAndGapsAreCounted) {
  ASSERT_TRUE(Connect());
  camera().Fill(0, 1);
  camera().Fill(1, 2);
  camera().Fill(5, 3);  // 2, 3 and 4 are lost
  ASSERT_TRUE(Next().ok());
  EXPECT_THAT(frame_.image.pixels, testing::Each(3));
  EXPECT_EQ(frame_.sequence, 5U);
  EXPECT_EQ(source().counts().skipped, 2U);
  EXPECT_EQ(source().counts().lost, 3U);
  EXPECT_EQ(camera().queued.size(), 4U);
}

TEST_F(V4l2CameraTest, DamagedBuffersAreDroppedAndCounted) {
  ASSERT_TRUE(Connect());
  camera().Fill(0, 9, V4L2_BUF_FLAG_ERROR);
  EXPECT_EQ(Next().code(), StatusCode::kCancelled);
  EXPECT_EQ(source().counts().erroneous, 1U);
  camera().Fill(1, 9, 0, 100);
  EXPECT_EQ(Next().code(), StatusCode::kCancelled);
  EXPECT_EQ(source().counts().truncated, 1U);
  camera().Fill(2, 8);
  camera().Fill(3, 9, V4L2_BUF_FLAG_ERROR);
  EXPECT_TRUE(Next().ok());  // the one before the damaged one
  EXPECT_THAT(frame_.image.pixels, testing::Each(8));
  EXPECT_EQ(camera().queued.size(), 4U);
}

TEST_F(V4l2CameraTest, FramesThatComeTooSoonAreNotDecoded) {
  ASSERT_TRUE(Connect());
  source().SetMinInterval(100'000'000);
  int delivered = 0;
  for (std::uint32_t i = 0; i < 30; ++i) {  // at 33 ms
    camera().Fill(i, 1);
    if (Next().ok()) ++delivered;
  }
  EXPECT_EQ(delivered, 10);
  EXPECT_EQ(source().counts().skipped, 20U);
}

TEST_F(V4l2CameraTest, ControlsAreSetAutomatismsFirst) {
  settings_.controls = {{"gain", 7}, {"exposure_auto", 1}, {"warp", 9}};
  ASSERT_TRUE(Connect());
  EXPECT_THAT(camera().set_order, ElementsAre("Exposure, Auto", "Gain"));
  EXPECT_EQ(camera().controls["Gain"], 7);
}

TEST_F(V4l2CameraTest, TheRateAskedForIsSet) {
  settings_.rate = 15;
  ASSERT_TRUE(Connect());
  EXPECT_THAT(source().condition().text, HasSubstr("at 15/s"));
}

TEST_F(V4l2CameraTest, UnpluggedAndBackUnderAnotherNumberItGetsItsControlsAgain) {
  settings_.controls = {{"gain", 7}};
  ASSERT_TRUE(Connect());
  camera().Fill(10, 1);
  ASSERT_TRUE(Next().ok());
  const std::uint64_t before = frame_.sequence;
  camera().plugged = false;
  EXPECT_EQ(Next().code(), StatusCode::kCancelled);
  EXPECT_FALSE(source().condition().present);
  EXPECT_EQ(system_.open_files(), 0U);
  EXPECT_EQ(system_.mapped, 0);
  camera().plugged = true;
  camera().path = "/dev/video3";
  camera().controls["Gain"] = 0;
  ASSERT_TRUE(Connect());
  EXPECT_THAT(source().condition().text, HasSubstr("/dev/video3"));
  EXPECT_EQ(camera().controls["Gain"], 7);
  camera().Fill(0, 1);
  ASSERT_TRUE(Next().ok());
  EXPECT_EQ(frame_.sequence, before + 1);  // the count goes on
  EXPECT_EQ(source().counts().reconnects, 1U);
}

TEST_F(V4l2CameraTest, AnotherCameraUnderItsNumberIsNotTaken) {
  ASSERT_TRUE(Connect());
  camera().plugged = false;
  system_.cameras.emplace_back();
  system_.cameras[1].card = "Other";
  for (int i = 0; i < 4; ++i) EXPECT_EQ(Next().code(), StatusCode::kCancelled);
  EXPECT_FALSE(system_.cameras[1].streaming);
  EXPECT_THAT(source().condition().text, HasSubstr("another camera has this number now"));
}

TEST_F(V4l2CameraTest, IsFoundByStableNameAndByCard) {
  system_.cameras.emplace_back();
  system_.cameras[1].path = "/dev/video7";
  system_.cameras[1].card = "HD Webcam C920";
  system_.links["/dev/v4l/by-id/usb-c920-index0"] = "/dev/video7";
  for (const char* where : {"usb-c920-index0", "/dev/v4l/by-id/usb-c920-index0", "c920"}) {
    settings_.where = where;
    source_.reset();
    (void)Next();
    EXPECT_TRUE(system_.cameras[1].streaming) << where;
  }
}

TEST_F(V4l2CameraTest, AMissingCameraIsAStateUntilItComes) {
  camera().plugged = false;
  for (int i = 0; i < 3; ++i) EXPECT_EQ(Next().code(), StatusCode::kCancelled);
  EXPECT_FALSE(source().condition().present);
  EXPECT_THAT(source().condition().text, HasSubstr("/dev/video0"));
  camera().plugged = true;
  EXPECT_TRUE(Connect());
}

// Every request that can fail, once: afterwards it streams, and nothing is left open.
TEST_F(V4l2CameraTest, EveryRequestMayFailOnce) {
  for (const unsigned long request : {VIDIOC_QUERYCAP, VIDIOC_S_FMT, VIDIOC_REQBUFS,
                                      VIDIOC_QUERYBUF, VIDIOC_QBUF, VIDIOC_STREAMON}) {
    source_.reset();
    camera().errors[request] = {EINVAL};
    EXPECT_EQ(Next().code(), StatusCode::kCancelled);
    EXPECT_FALSE(source().condition().present);
    EXPECT_EQ(system_.open_files(), 0U);
    EXPECT_EQ(system_.mapped, 0);
    EXPECT_TRUE(Connect());
  }
}

TEST_F(V4l2CameraTest, AStreamThatBreaksIsStartedAnew) {
  for (const int error : {EIO, ENODEV}) {
    ASSERT_TRUE(Connect());
    camera().Fill(0, 1);
    camera().errors[VIDIOC_DQBUF] = {error};
    EXPECT_EQ(Next().code(), StatusCode::kCancelled);
    EXPECT_FALSE(source().condition().present);
    ASSERT_TRUE(Connect());
    camera().Fill(0, 1);
    EXPECT_TRUE(Next().ok());
  }
  camera().error_on_poll = true;
  EXPECT_EQ(Next().code(), StatusCode::kCancelled);
  EXPECT_FALSE(source().condition().present);
  camera().error_on_poll = false;
  EXPECT_TRUE(Connect());
}

TEST_F(V4l2CameraTest, ACameraThatFallsSilentIsStartedAnew) {
  ASSERT_TRUE(Connect());
  int turns = 0;
  while (source().condition().present && ++turns < 10) (void)Next();
  EXPECT_LE(turns, 3);
  EXPECT_THAT(source().condition().text, HasSubstr("sends no frames"));
  EXPECT_TRUE(Connect());
}

TEST_F(V4l2CameraTest, AfterASleepTheStreamAndItsControlsAreSetAnew) {
  settings_.controls = {{"gain", 7}};
  ASSERT_TRUE(Connect());
  camera().Fill(0, 1);  // before the sleep: what it shows is old
  camera().controls["Gain"] = 0;
  slept_ns_ = 3'600'000'000'000;
  EXPECT_EQ(Next().code(), StatusCode::kCancelled);
  ASSERT_TRUE(Connect(1));  // without back-off
  EXPECT_EQ(camera().controls["Gain"], 7);
  EXPECT_EQ(Next().code(), StatusCode::kCancelled);  // the old frame is gone
  camera().Fill(0, 2);
  EXPECT_TRUE(Next().ok());
  EXPECT_EQ(source().counts().reconnects, 1U);
  slept_ns_ += 1000;  // what two clocks differ by when read in turn
  camera().Fill(1, 3);
  EXPECT_TRUE(Next().ok());
}

TEST_F(V4l2CameraTest, TakesTheNearestAndCheapestThatItHas) {
  camera().formats = {V4L2_PIX_FMT_MJPEG, V4L2_PIX_FMT_RGB24, V4L2_PIX_FMT_UYVY};
  ASSERT_TRUE(Connect());
  EXPECT_EQ(camera().fourcc, V4L2_PIX_FMT_UYVY);
  source_.reset();
  settings_.pixel_format = "RGB3";
  ASSERT_TRUE(Connect());
  EXPECT_EQ(camera().fourcc, V4L2_PIX_FMT_RGB24);
}

TEST_F(V4l2CameraTest, ACameraOfUnknownFormatsIsAState) {
  camera().formats = {V4L2_PIX_FMT_H264};
  EXPECT_EQ(Next().code(), StatusCode::kCancelled);
  EXPECT_THAT(source().condition().text, HasSubstr("no pixel format that we read"));
}

TEST_F(V4l2CameraTest, IsWokenFromItsBackOff) {
  camera().plugged = false;
  (void)Next();
  source().Wake();
  EXPECT_EQ(Next().code(), StatusCode::kCancelled);
}

TEST_F(V4l2CameraTest, DescribesWhatTheMachineHas) {
  const std::string text = DescribeCameras(system_);
  EXPECT_THAT(text, HasSubstr("v4l2:/dev/video0  Fake Camera (fake, usb-1)"));
  EXPECT_THAT(text, HasSubstr("format YUYV"));
  EXPECT_THAT(text, HasSubstr("64x48 at 30/s"));
  EXPECT_THAT(text, HasSubstr("control exposure_auto  0..1000"));
  camera().plugged = false;
  EXPECT_EQ(DescribeCameras(system_), "");
}

}  // namespace
}  // namespace viewfix
