// SPDX-License-Identifier: BSD-3-Clause
#include "platform/publish/mqtt_output.h"

namespace viewfix {

Result<std::unique_ptr<MqttOutput>> MakeMqttOutput(const PublishSettings& settings) {
  return Status(StatusCode::kUnsupported, "this build has no MQTT", settings.mqtt_url);
}

}  // namespace viewfix
