// SPDX-License-Identifier: BSD-3-Clause
#include "platform/camera/libcamera/libcamera_camera.h"

#include <gmock/gmock.h>
#include <linux/videodev2.h>

#include "platform/camera/libcamera/completed_queue.h"
#include "platform/camera/libcamera/pixel_formats.h"

namespace viewfix {
namespace {

using testing::HasSubstr;
using Dequeued = CameraStream::Dequeued;

TEST(LibcameraCameraTest, AMissingCameraIsAState) {
  CameraSettings settings;
  settings.where = "no sensor of this name";
  auto source = MakeLibcameraCamera(settings);
  ASSERT_TRUE(source.ok());
  Frame frame;
  for (int i = 0; i < 2; ++i) {
    EXPECT_EQ((*source)->Next(frame).code(), StatusCode::kCancelled);
    EXPECT_FALSE((*source)->condition().present);
    EXPECT_THAT((*source)->condition().text, HasSubstr("no such camera"));
  }
}

TEST(LibcameraCameraTest, FormatsAreNamedByHowTheyLieInMemory) {
  EXPECT_EQ(V4l2FormatOf(v4l2_fourcc('B', 'G', '2', '4')), V4L2_PIX_FMT_RGB24);
  EXPECT_EQ(V4l2FormatOf(v4l2_fourcc('R', 'G', '2', '4')), V4L2_PIX_FMT_BGR24);
  EXPECT_EQ(V4l2FormatOf(v4l2_fourcc('R', '8', ' ', ' ')), V4L2_PIX_FMT_GREY);
  EXPECT_EQ(V4l2FormatOf(v4l2_fourcc('N', 'V', '1', '2')), V4L2_PIX_FMT_NV12);
  EXPECT_EQ(V4l2FormatOf(v4l2_fourcc('X', 'R', '2', '4')), 0U);
}

TEST(CompletedQueueTest, IsFirstInFirstOutAndWakesWhoWaits) {
  CompletedQueue queue;
  std::uint32_t index = 9;
  EXPECT_EQ(queue.Wait(-1, 0), 0);
  EXPECT_EQ(queue.Pop(index), Dequeued::kNone);
  queue.Push(3);
  queue.Push(1);
  EXPECT_NE(queue.Wait(-1, 0), 0);
  EXPECT_EQ(queue.Pop(index), Dequeued::kBuffer);
  EXPECT_EQ(index, 3U);
  EXPECT_EQ(queue.Pop(index), Dequeued::kBuffer);
  EXPECT_EQ(index, 1U);
  EXPECT_EQ(queue.Pop(index), Dequeued::kNone);
  EXPECT_EQ(queue.Wait(-1, 0), 0);
}

TEST(CompletedQueueTest, TellsThatTheCameraIsGone) {
  CompletedQueue queue;
  queue.Push(0);
  queue.Break();
  std::uint32_t index = 0;
  EXPECT_NE(queue.Wait(-1, 0), 0);
  EXPECT_EQ(queue.Pop(index), Dequeued::kBroken);
}

TEST(CompletedQueueTest, MoreThanThereCanBeBreaksIt) {
  CompletedQueue queue;
  for (std::uint32_t i = 0; i <= CompletedQueue::kCapacity; ++i) queue.Push(i);
  std::uint32_t index = 0;
  EXPECT_EQ(queue.Pop(index), Dequeued::kBroken);
}

}  // namespace
}  // namespace viewfix
