// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <atomic>
#include <cstdint>
#include <memory>
#include <string>
#include <string_view>

#include "engine/base/status.h"
#include "platform/publish/publish_settings.h"
#include "platform/publish/publisher.h"

namespace viewfix {

struct MqttAddress {
  bool tls = false;
  std::string host;
  int port = 0;
  std::string topic;  // without a '/' at its ends
};

// mqtt://HOST[:PORT]/TOPIC, mqtts:// over TLS; ports 1883 and 8883 where none is given. Empty:
// parsed; else what is wrong.
std::string ParseMqttUrl(std::string_view url, MqttAddress& address);

// Fixes to a broker, by libmosquitto in a thread of its own, at most once each (QoS 0):
//   TOPIC/fix     every line
//   TOPIC/status  "online", retained; "offline" once the connection has broken (last will)
// A broker that is away is looked for again; lines that it has no room for are dropped and
// counted.
class MqttOutput : public Publisher {
 public:
  // So many lines may be on their way.
  static constexpr std::int64_t kMaxWaiting = 64;

  virtual std::uint64_t dropped() const = 0;
};

// kUnsupported: this build has no MQTT; kInvalidArgument, kIo, kNotFound: the password or the
// certificates cannot be read.
Result<std::unique_ptr<MqttOutput>> MakeMqttOutput(const PublishSettings& settings);

}  // namespace viewfix
