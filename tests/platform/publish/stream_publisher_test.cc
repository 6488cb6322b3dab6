// SPDX-License-Identifier: BSD-3-Clause
#include <fcntl.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <csignal>
#include <string>
#include <thread>

#include "platform/publish/publisher.h"

namespace viewfix {
namespace {

class StreamPublisherTest : public testing::Test {
 protected:
  void SetUp() override {
    std::signal(SIGPIPE, SIG_IGN);
    ASSERT_EQ(::pipe(ends_), 0);
  }
  void TearDown() override {
    ::close(ends_[1]);
    CloseReader();
  }
  void CloseReader() {
    if (ends_[0] >= 0) ::close(ends_[0]);
    ends_[0] = -1;
  }
  std::string Read(std::size_t size) {
    std::string text(size, ' ');
    std::size_t got = 0;
    while (got < size) {
      const ssize_t count = ::read(ends_[0], text.data() + got, size - got);
      if (count <= 0) break;
      got += static_cast<std::size_t>(count);
    }
    text.resize(got);
    return text;
  }

  int ends_[2] = {-1, -1};
};

TEST_F(StreamPublisherTest, LinesArriveAtOnce) {
  const auto publisher = MakeStreamPublisher(ends_[1]);
  ASSERT_TRUE(publisher->Publish("{\"seq\":0}\n").ok());
  EXPECT_EQ(Read(10), "{\"seq\":0}\n");
}

TEST_F(StreamPublisherTest, WaitsForASlowReader) {
  ASSERT_EQ(::fcntl(ends_[1], F_SETFL, O_NONBLOCK), 0);
  const auto publisher = MakeStreamPublisher(ends_[1]);
  const std::string line(1 << 20, 'x');  // more than a pipe holds
  std::string read;
  std::thread reader([&] { read = Read(line.size()); });
  EXPECT_TRUE(publisher->Publish(line).ok());
  reader.join();
  EXPECT_EQ(read, line);
}

TEST_F(StreamPublisherTest, NoReaderIsNoFault) {
  const auto publisher = MakeStreamPublisher(ends_[1]);
  CloseReader();
  EXPECT_EQ(publisher->Publish("{}\n").code(), StatusCode::kCancelled);
}

TEST_F(StreamPublisherTest, AFullDiskIsAFault) {
  const int full = ::open("/dev/full", O_WRONLY);
  ASSERT_GE(full, 0);
  const Status status = MakeStreamPublisher(full)->Publish("{}\n");
  EXPECT_EQ(status.code(), StatusCode::kIo);
  EXPECT_EQ(status.detail(), "No space left on device");
  ::close(full);
}

}  // namespace
}  // namespace viewfix
