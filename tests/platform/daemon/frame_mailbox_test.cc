// SPDX-License-Identifier: BSD-3-Clause
#include "platform/daemon/frame_mailbox.h"

#include <gtest/gtest.h>

#include <thread>

namespace viewfix {
namespace {

using Taken = FrameMailbox::Taken;
using std::chrono::milliseconds;

constexpr milliseconds kNow{0};
constexpr milliseconds kLong{10'000};

Frame Numbered(std::uint64_t sequence) {
  Frame frame;
  frame.sequence = sequence;
  return frame;
}

TEST(FrameMailboxTest, OfACameraTheNewestWins) {
  FrameMailbox box(/*every_frame=*/false);
  for (std::uint64_t i = 0; i < 5; ++i) {
    Frame frame = Numbered(i);
    EXPECT_TRUE(box.Put(frame, kNow));
  }
  Frame frame;
  EXPECT_EQ(box.Take(frame, kNow), Taken::kFrame);
  EXPECT_EQ(frame.sequence, 4U);
  EXPECT_EQ(box.replaced(), 4U);
  EXPECT_EQ(box.Take(frame, kNow), Taken::kNothing);
}

TEST(FrameMailboxTest, OfAReplayNoneIsLost) {
  FrameMailbox box(/*every_frame=*/true);
  Frame frame = Numbered(0);
  EXPECT_TRUE(box.Put(frame, kNow));
  EXPECT_FALSE(box.Put(frame, kNow));
  constexpr std::uint64_t kFrames = 500;
  std::thread writer([&] {
    for (std::uint64_t i = 1; i < kFrames; ++i) {
      Frame next = Numbered(i);
      EXPECT_TRUE(box.Put(next, kLong));
    }
    box.Close();
  });
  std::uint64_t count = 0;
  while (box.Take(frame, kLong) == Taken::kFrame) EXPECT_EQ(frame.sequence, count++);
  EXPECT_EQ(count, kFrames);
  writer.join();
}

TEST(FrameMailboxTest, TheLastFrameIsTakenBeforeTheEnd) {
  FrameMailbox box(/*every_frame=*/true);
  Frame frame = Numbered(7);
  EXPECT_TRUE(box.Put(frame, kNow));
  box.Close();
  EXPECT_EQ(box.Take(frame, kNow), Taken::kFrame);
  EXPECT_EQ(frame.sequence, 7U);
  EXPECT_EQ(box.Take(frame, kLong), Taken::kEnded);
}

}  // namespace
}  // namespace viewfix
