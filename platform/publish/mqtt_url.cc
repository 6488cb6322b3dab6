// SPDX-License-Identifier: BSD-3-Clause
#include <charconv>

#include "platform/publish/mqtt_output.h"

namespace viewfix {
namespace {

constexpr int kPlainPort = 1883;
constexpr int kTlsPort = 8883;
constexpr std::size_t kMaxTopicBytes = 1024;

bool ParsePort(std::string_view text, int& port) {
  const auto end = text.data() + text.size();
  const auto parsed = std::from_chars(text.data(), end, port);
  return parsed.ec == std::errc() && parsed.ptr == end && port >= 1 && port <= 65535;
}

// '+' and '#' stand for other topics; '$' begins the broker's own.
bool IsTopic(std::string_view topic) {
  if (topic.empty() || topic.size() > kMaxTopicBytes || topic.front() == '$') return false;
  for (const char c : topic) {
    if (c == '+' || c == '#' || static_cast<unsigned char>(c) < 0x20) return false;
  }
  return true;
}

}  // namespace

std::string ParseMqttUrl(std::string_view url, MqttAddress& address) {
  constexpr std::string_view kPlain = "mqtt://", kTls = "mqtts://";
  address.tls = url.rfind(kTls, 0) == 0;
  if (!address.tls && url.rfind(kPlain, 0) != 0)
    return "not mqtt://HOST/TOPIC or mqtts://HOST/TOPIC";
  url.remove_prefix(address.tls ? kTls.size() : kPlain.size());
  const std::size_t slash = url.find('/');
  if (slash == std::string_view::npos) return "mqtt needs a topic: mqtt://HOST/TOPIC";
  std::string_view where = url.substr(0, slash), topic = url.substr(slash + 1);
  while (!topic.empty() && topic.back() == '/') topic.remove_suffix(1);
  address.port = address.tls ? kTlsPort : kPlainPort;
  const std::size_t colon = where.rfind(':');
  if (colon != std::string_view::npos && where.back() != ']') {
    if (!ParsePort(where.substr(colon + 1), address.port)) return "mqtt takes a port of 1 to 65535";
    where = where.substr(0, colon);
  }
  if (where.find('@') != std::string_view::npos) return "mqtt takes the user from --mqtt-user";
  address.host = where;
  address.topic = topic;
  if (address.host.empty()) return "mqtt needs a host";
  return IsTopic(topic) ? "" : "mqtt needs a topic without + and #";
}

}  // namespace viewfix
