// SPDX-License-Identifier: BSD-3-Clause
#include <arpa/inet.h>
#include <gmock/gmock.h>
#include <mosquitto.h>
#include <spawn.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <csignal>
#include <cstdlib>
#include <filesystem>
#include <thread>

#include "platform/publish/mqtt_output.h"
#include "tests/testing/temp_folder.h"

extern char** environ;

namespace viewfix {
namespace {

using std::chrono::milliseconds;
using testing::HasSubstr;

constexpr const char* kBroker = "/usr/sbin/mosquitto";
constexpr int kTries = 500;  // of 20 ms

// A port that was free a moment ago.
int FreePort() {
  const int fd = ::socket(AF_INET, SOCK_STREAM, 0);
  sockaddr_in address = {};
  address.sin_family = AF_INET;
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  (void)::bind(fd, reinterpret_cast<sockaddr*>(&address), sizeof address);
  socklen_t size = sizeof address;
  (void)::getsockname(fd, reinterpret_cast<sockaddr*>(&address), &size);
  ::close(fd);
  return ntohs(address.sin_port);
}

class MqttOutputTest : public testing::Test {
 protected:
  void SetUp() override {
    if (!std::filesystem::exists(kBroker)) GTEST_SKIP() << "mosquitto is not installed";
    port_ = FreePort();
    settings_.mqtt_url = "mqtt://127.0.0.1:" + std::to_string(port_) + "/museum/kiosk";
  }
  void TearDown() override { StopBroker(); }

  void StartBroker() {
    const std::string config =
        folder_.Write("mosquitto.conf",
                      "listener " + std::to_string(port_) + " 127.0.0.1\nallow_anonymous true\n");
    std::string words[] = {kBroker, "-c", config};
    char* arguments[] = {words[0].data(), words[1].data(), words[2].data(), nullptr};
    posix_spawn_file_actions_t files;
    posix_spawn_file_actions_init(&files);
    posix_spawn_file_actions_addopen(&files, STDERR_FILENO, "/dev/null", 1, 0);
    ASSERT_EQ(posix_spawn(&broker_, kBroker, &files, nullptr, arguments, environ), 0);
    posix_spawn_file_actions_destroy(&files);
  }
  void StopBroker() {
    if (broker_ <= 0) return;
    ::kill(broker_, SIGTERM);
    ::waitpid(std::exchange(broker_, 0), nullptr, 0);
  }

  // The next message of a topic, retained ones included; empty: the broker is not there.
  std::string Message(const std::string& topic, bool retained) const {
    for (int i = 0; i < kTries; ++i) {
      mosquitto_message* message = nullptr;
      const int error =
          mosquitto_subscribe_simple(&message, 1, retained, topic.c_str(), 1, "127.0.0.1", port_,
                                     nullptr, 5, true, nullptr, nullptr, nullptr, nullptr);
      if (error == MOSQ_ERR_SUCCESS && message != nullptr) {
        std::string text(static_cast<const char*>(message->payload),
                         static_cast<std::size_t>(message->payloadlen));
        mosquitto_message_free(&message);
        return text;
      }
      std::this_thread::sleep_for(milliseconds(20));
    }
    return {};
  }
  std::string StatusOnce(const std::string& wanted) const {
    std::string status;
    for (int i = 0; i < kTries && status != wanted; ++i) {
      status = Message("museum/kiosk/status", true);
      std::this_thread::sleep_for(milliseconds(20));
    }
    return status;
  }

  TempFolder folder_;
  PublishSettings settings_;
  int port_ = 0;
  pid_t broker_ = 0;
};

TEST_F(MqttOutputTest, FixesArriveAndTheStatusStays) {
  StartBroker();
  auto output = MakeMqttOutput(settings_);
  ASSERT_TRUE(output.ok()) << output.status().detail();
  EXPECT_EQ(StatusOnce("online"), "online");
  std::atomic<bool> stop = false;
  std::thread writer([&] {
    while (!stop) {
      (void)(*output)->Publish("{\"seq\":1}\n");
      std::this_thread::sleep_for(milliseconds(20));
    }
  });
  EXPECT_EQ(Message("museum/kiosk/fix", false), "{\"seq\":1}");
  stop = true;
  writer.join();
  output->reset();
  EXPECT_EQ(StatusOnce("offline"), "offline");
}

TEST_F(MqttOutputTest, ABrokerThatIsAwayCostsLinesOnly) {
  auto output = MakeMqttOutput(settings_);
  ASSERT_TRUE(output.ok()) << output.status().detail();
  for (int i = 0; i < 100; ++i) EXPECT_TRUE((*output)->Publish("{}\n").ok());
  EXPECT_EQ((*output)->dropped(), 100U);
  StartBroker();
  EXPECT_EQ(StatusOnce("online"), "online");
}

TEST(MqttUrlTest, IsReadOrRefused) {
  MqttAddress address;
  EXPECT_EQ(ParseMqttUrl("mqtt://broker/a/b", address), "");
  EXPECT_EQ(address.host, "broker");
  EXPECT_EQ(address.port, 1883);
  EXPECT_EQ(address.topic, "a/b");
  EXPECT_FALSE(address.tls);
  EXPECT_EQ(ParseMqttUrl("mqtts://10.0.0.1:9999/x/", address), "");
  EXPECT_EQ(address.port, 9999);
  EXPECT_EQ(address.topic, "x");
  EXPECT_TRUE(address.tls);
  for (const char* wrong :
       {"", "here", "mqtt://", "mqtt://broker", "mqtt://broker/", "mqtt:///x", "mqtt://b:0/x",
        "mqtt://b:70000/x", "mqtt://u:p@b/x", "mqtt://b/a/#", "mqtt://b/$SYS", "http://b/x"}) {
    EXPECT_NE(ParseMqttUrl(wrong, address), "") << wrong;
  }
}

TEST_F(MqttOutputTest, WhatCannotBeReadIsNamed) {
  settings_.mqtt_user = "kiosk";
  settings_.mqtt_password_file = folder_ / "none";
  EXPECT_THAT(std::string(MakeMqttOutput(settings_).status().detail()), HasSubstr("none"));
  settings_.mqtt_user.clear();
  settings_.mqtt_url = "mqtts://127.0.0.1/x";
  settings_.mqtt_ca_file = folder_ / "no-ca";
  EXPECT_THAT(std::string(MakeMqttOutput(settings_).status().detail()), HasSubstr("no-ca"));
}

}  // namespace
}  // namespace viewfix
