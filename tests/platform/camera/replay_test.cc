// SPDX-License-Identifier: BSD-3-Clause
#include <gmock/gmock.h>

#include <chrono>
#include <thread>

#include "platform/camera/frame_source.h"
#include "platform/clock.h"
#include "tests/testing/jpeg_encoder.h"
#include "tests/testing/temp_folder.h"

namespace viewfix {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;

std::vector<std::uint8_t> Jpeg(int width) {
  const std::vector<std::uint8_t> pixels(std::size_t(width) * 4, 128);
  return EncodeJpeg(pixels, width, 4, 1);
}

// Name and width of every frame, or "name!" of one that could not be read.
std::vector<std::string> Play(const std::string& where) {
  auto source = OpenReplay(where);
  if (!source.ok()) return {source.status().text()};
  std::vector<std::string> played;
  Frame frame;
  for (Status status = (*source)->Next(frame); status.code() != StatusCode::kNotFound;
       status = (*source)->Next(frame)) {
    EXPECT_EQ(frame.sequence, played.size());
    std::string& entry = played.emplace_back(frame.name);
    if (status.ok()) {
      entry.append(":").append(std::to_string(frame.image.width));
    } else {
      entry.push_back('!');
    }
  }
  return played;
}

TEST(ReplayTest, PlaysAFolderInNameOrder) {
  const TempFolder folder;
  folder.Write("b/2.jpeg", Jpeg(12));
  folder.Write("b/1.JPG", Jpeg(11));
  folder.Write("a.jpg", Jpeg(10));
  folder.Write("c.jpg", Jpeg(13));
  folder.Write("notes.txt", "no frame");
  folder.Write("d.jpg/inner.jpg", Jpeg(14));
  EXPECT_THAT(Play(folder.path()), ElementsAre("a.jpg:10", "b/1.JPG:11", "b/2.jpeg:12", "c.jpg:13",
                                        "d.jpg/inner.jpg:14"));
}

TEST(ReplayTest, PlaysACsvInRowOrder) {
  const TempFolder folder;
  folder.Write("x/1.jpg", Jpeg(10));
  folder.Write("x/2, or so.jpg", Jpeg(11));
  folder.Write("x/3.jpg", Jpeg(12));
  folder.Write("images.csv",
               "location,path\r\nhall,\"x/2, or so.jpg\"\r\nhall,x/1.jpg\r\nhall,x/1.jpg\r\n");
  EXPECT_THAT(Play(folder.path()), ElementsAre("x/2, or so.jpg:11", "x/1.jpg:10", "x/1.jpg:10"));
}

TEST(ReplayTest, PlaysAListOfImages) {
  const TempFolder folder;
  folder.Write("x/1.jpg", Jpeg(10));
  folder.Write("x/2.jpg", Jpeg(11));
  folder.Write("lists/some.txt", "# the second first\r\n../x/2.jpg\r\n\n../x/1.jpg\nnone.jpg");
  EXPECT_THAT(Play(folder / "lists/some.txt"),
              ElementsAre("../x/2.jpg:11", "../x/1.jpg:10", "none.jpg!"));
  folder.Write("picked.CSV", "path,view\nx/2.jpg,left\n");
  EXPECT_THAT(Play(folder / "picked.CSV"), ElementsAre("x/2.jpg:11"));
  folder.Write("empty.txt", "#\n\n");
  EXPECT_THAT(Play(folder / "empty.txt"), ElementsAre("no JPEG image in"));
}

TEST(ReplayTest, ABadFileIsOneBadFrame) {
  const TempFolder folder;
  folder.Write("images.csv", "path\n1.jpg\nnone.jpg\n2.jpg\n3.jpg\n");
  folder.Write("1.jpg", Jpeg(10));
  folder.Write("2.jpg", "no JPEG");
  folder.Write("3.jpg", Jpeg(11));
  EXPECT_THAT(Play(folder.path()), ElementsAre("1.jpg:10", "none.jpg!", "2.jpg!", "3.jpg:11"));
}

TEST(ReplayTest, ErrorsNameTheFile) {
  const TempFolder folder;
  folder.Write("images.csv", "path\nnone.jpg\ntext.jpg\n");
  folder.Write("text.jpg", "no JPEG");
  auto source = OpenReplay(folder.path());
  ASSERT_TRUE(source.ok());
  Frame frame;
  EXPECT_THAT(std::string((*source)->Next(frame).detail()), HasSubstr("none.jpg: No such file"));
  const Status status = (*source)->Next(frame);
  EXPECT_STREQ(status.text(), "not a JPEG");
  EXPECT_THAT(std::string(status.detail()), HasSubstr("text.jpg"));
}

TEST(ReplayTest, CaptureTimeIsTheMonotonicClock) {
  const TempFolder folder;
  folder.Write("1.jpg", Jpeg(10));
  auto source = OpenReplay(folder.path());
  const std::int64_t before = MonotonicNs();
  Frame frame;
  ASSERT_TRUE((*source)->Next(frame).ok());
  EXPECT_GE(frame.capture_time_ns, before);
  EXPECT_LE(frame.capture_time_ns, MonotonicNs());
}

TEST(ReplayTest, StaysAtItsEnd) {
  const TempFolder folder;
  folder.Write("1.jpg", Jpeg(10));
  auto source = OpenReplay(folder.path());
  Frame frame;
  ASSERT_TRUE((*source)->Next(frame).ok());
  EXPECT_EQ((*source)->Next(frame).code(), StatusCode::kNotFound);
  EXPECT_EQ((*source)->Next(frame).code(), StatusCode::kNotFound);
}

TEST(ReplayTest, RefusesWhatHoldsNoFrames) {
  const TempFolder folder;
  EXPECT_THAT(Play(folder.path()), ElementsAre("no JPEG image in"));
  const std::string file = folder.Write("one.mp4", "text");
  // No video; or nobody here could tell, without ffmpeg.
  EXPECT_THAT(OpenReplay(file).status().code(),
              testing::AnyOf(StatusCode::kCorrupt, StatusCode::kUnsupported));
  const Status missing = OpenReplay(folder / "none").status();
  EXPECT_EQ(missing.code(), StatusCode::kNotFound);
  EXPECT_THAT(std::string(missing.detail()), HasSubstr("none"));
}

TEST(ReplayTest, ALoopGoesOnCounting) {
  const TempFolder folder;
  folder.Write("1.jpg", Jpeg(10));
  folder.Write("2.jpg", Jpeg(20));
  CameraSettings settings;
  settings.where = folder.path();
  settings.loop = true;
  const auto source = OpenReplay(settings);
  ASSERT_TRUE(source.ok());
  EXPECT_FALSE((*source)->live());
  Frame frame;
  for (std::uint64_t i = 0; i < 7; ++i) {
    ASSERT_TRUE((*source)->Next(frame).ok());
    EXPECT_EQ(frame.sequence, i);
    EXPECT_EQ(frame.name, i % 2 == 0 ? "1.jpg" : "2.jpg");
  }
}

TEST(ReplayTest, RealTimeIsWokenFromItsWait) {
  const TempFolder folder;
  folder.Write("1.jpg", Jpeg(10));
  folder.Write("2.jpg", Jpeg(20));
  CameraSettings settings;
  settings.where = folder.path();
  settings.real_time = true;
  settings.rate = 0.01;
  const auto source = OpenReplay(settings);
  ASSERT_TRUE(source.ok());
  EXPECT_TRUE((*source)->live());
  Frame frame;
  EXPECT_TRUE((*source)->Next(frame).ok());  // the first comes at once, the next in 100 s
  std::thread waker([&] {
    std::this_thread::sleep_for(std::chrono::milliseconds(50));
    (*source)->Wake();
  });
  EXPECT_EQ((*source)->Next(frame).code(), StatusCode::kCancelled);
  waker.join();
}

TEST(ReplayTest, RefusesABrokenCsv) {
  const TempFolder folder;
  folder.Write("1.jpg", Jpeg(10));
  folder.Write("images.csv", "file,location\n1.jpg,hall\n");
  EXPECT_THAT(Play(folder.path()), ElementsAre("no column `path`"));
  folder.Write("images.csv", "path,location\n1.jpg\n");
  const Status status = OpenReplay(folder.path()).status();
  EXPECT_EQ(status.code(), StatusCode::kCorrupt);
  EXPECT_THAT(std::string(status.detail()), HasSubstr("images.csv: line 2"));
}

}  // namespace
}  // namespace viewfix
