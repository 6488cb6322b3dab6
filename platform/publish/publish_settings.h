// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>

namespace viewfix {

// Where fixes go, all at the same time.
struct PublishSettings {
  bool to_stdout = true;
  std::string unix_path;  // empty: no socket
  // MQTT.
  std::string mqtt_url;            // empty: no broker
  std::string mqtt_user;           // empty: none
  std::string mqtt_password_file;  // its first line
  std::string mqtt_ca_file;        // who may vouch for the broker; empty: whom the system trusts
  // HTTP.
  int http_port = 0;                       // 0: no HTTP
  std::string http_address = "127.0.0.1";  // another needs a token
  std::string token_file;                  // its first line is the token
  bool frame_picture = false;              // /frame.jpg, off for privacy

  friend bool operator==(const PublishSettings&, const PublishSettings&) = default;
};

}  // namespace viewfix
