// SPDX-License-Identifier: BSD-3-Clause
#include "platform/publish/mqtt_output.h"

#include <mosquitto.h>

#include <chrono>
#include <condition_variable>
#include <mutex>
#include <thread>
#include <utility>
#include <vector>

#include "platform/file.h"
#include "platform/log.h"

namespace viewfix {
namespace {

constexpr int kKeepAliveS = 15;
constexpr int kLoopMs = 100;
constexpr std::chrono::seconds kTryAgain{2};
constexpr const char* kSystemCertificates = "/etc/ssl/certs";
constexpr std::string_view kOnline = "online", kOffline = "offline";

struct FreeMosquitto {
  void operator()(mosquitto* client) const { mosquitto_destroy(client); }
};

Status Refused(int error, const std::string& about) {
  return {StatusCode::kInvalidArgument, "mqtt", about + ": " + mosquitto_strerror(error)};
}

// The first line of a file.
Result<std::string> ReadPassword(const std::string& path) {
  const Result<std::vector<std::uint8_t>> bytes = ReadFile(path);
  if (!bytes.ok()) return bytes.status();
  std::string password(bytes->begin(), bytes->end());
  return password.substr(0, password.find_first_of("\r\n"));
}

class Mosquitto : public MqttOutput {
 public:
  Mosquitto() : client_(mosquitto_new(nullptr, true, this)) {}
  ~Mosquitto() override;

  Status Connect(const MqttAddress& address, const PublishSettings& settings);
  Status Publish(std::string_view line) override;
  std::uint64_t dropped() const override { return dropped_; }

 private:
  static void OnConnect(mosquitto*, void* self, int code);
  static void OnDisconnect(mosquitto*, void* self, int code);
  static void OnPublished(mosquitto*, void* self, int);
  Status SetUp(const MqttAddress& address, const PublishSettings& settings);
  Status SetPassword(const PublishSettings& settings);
  void Serve(const MqttAddress& address);
  void Say(std::string_view status);

  std::unique_ptr<mosquitto, FreeMosquitto> client_;
  std::string fix_topic_, status_topic_, where_;
  LimitedLog log_{/*limited=*/true};
  std::atomic<bool> connected_ = false;
  std::atomic<std::int64_t> waiting_ = 0;
  std::atomic<std::uint64_t> dropped_ = 0;
  std::mutex mutex_;
  std::condition_variable wake_;
  bool stop_ = false;  // under mutex_
  std::thread thread_;
};

Mosquitto::~Mosquitto() {
  if (!thread_.joinable()) return;
  if (connected_) Say(kOffline);  // a will is only of those that vanish
  mosquitto_disconnect(client_.get());
  {
    const std::lock_guard lock(mutex_);
    stop_ = true;
    wake_.notify_all();
  }
  thread_.join();
}

// The library's own loop gives up where the first attempt fails at once, and cannot be woken from
// its wait between two attempts.
void Mosquitto::Serve(const MqttAddress& address) {
  int error =
      mosquitto_connect_async(client_.get(), address.host.c_str(), address.port, kKeepAliveS);
  while (true) {
    if (error == MOSQ_ERR_SUCCESS) error = mosquitto_loop(client_.get(), kLoopMs, 1);
    std::unique_lock lock(mutex_);
    if (stop_) return;
    if (error == MOSQ_ERR_SUCCESS) continue;
    connected_ = false;
    if (wake_.wait_for(lock, kTryAgain, [&] { return stop_; })) return;
    lock.unlock();
    error = mosquitto_reconnect_async(client_.get());
  }
}

Status Mosquitto::SetPassword(const PublishSettings& settings) {
  if (settings.mqtt_user.empty()) return {};
  std::string password;
  if (!settings.mqtt_password_file.empty()) {
    Result<std::string> read = ReadPassword(settings.mqtt_password_file);
    if (!read.ok()) return read.status();
    password = std::move(*read);
  }
  const int error = mosquitto_username_pw_set(client_.get(), settings.mqtt_user.c_str(),
                                              password.empty() ? nullptr : password.c_str());
  return error == MOSQ_ERR_SUCCESS ? Status() : Refused(error, settings.mqtt_user);
}

Status Mosquitto::SetUp(const MqttAddress& address, const PublishSettings& settings) {
  mosquitto_connect_callback_set(client_.get(), OnConnect);
  mosquitto_disconnect_callback_set(client_.get(), OnDisconnect);
  mosquitto_publish_callback_set(client_.get(), OnPublished);
  mosquitto_threaded_set(client_.get(), true);
  if (Status status = SetPassword(settings); !status.ok()) return status;
  if (address.tls) {
    const std::string& ca = settings.mqtt_ca_file;
    const int error =
        mosquitto_tls_set(client_.get(), ca.empty() ? nullptr : ca.c_str(),
                          ca.empty() ? kSystemCertificates : nullptr, nullptr, nullptr, nullptr);
    if (error != MOSQ_ERR_SUCCESS) return Refused(error, ca.empty() ? kSystemCertificates : ca);
  }
  const int error = mosquitto_will_set(client_.get(), status_topic_.c_str(),
                                       static_cast<int>(kOffline.size()), kOffline.data(), 1, true);
  return error == MOSQ_ERR_SUCCESS ? Status() : Refused(error, status_topic_);
}

Status Mosquitto::Connect(const MqttAddress& address, const PublishSettings& settings) {
  if (client_ == nullptr) return {StatusCode::kResourceExhausted, "no memory for mqtt"};
  fix_topic_ = address.topic + "/fix";
  status_topic_ = address.topic + "/status";
  where_ = address.host + ":" + std::to_string(address.port);
  if (Status status = SetUp(address, settings); !status.ok()) return status;
  // A broker that is away is no error: the thread goes on trying.
  thread_ = std::thread([this, address] { Serve(address); });
  return {};
}

void Mosquitto::Say(std::string_view status) {
  ++waiting_;
  mosquitto_publish(client_.get(), nullptr, status_topic_.c_str(), static_cast<int>(status.size()),
                    status.data(), 1, true);
}

void Mosquitto::OnConnect(mosquitto*, void* self, int code) {
  auto* output = static_cast<Mosquitto*>(self);
  if (code != 0) {
    output->log_.Write(LogLevel::kWarning,
                       "mqtt: " + output->where_ + ": " + mosquitto_connack_string(code));
    return;
  }
  output->waiting_ = 0;
  output->connected_ = true;
  output->log_.Write(LogLevel::kInfo, "mqtt: connected to " + output->where_);
  output->Say(kOnline);
}

void Mosquitto::OnDisconnect(mosquitto*, void* self, int code) {
  auto* output = static_cast<Mosquitto*>(self);
  if (output->connected_.exchange(false) && code != 0) {
    output->log_.Write(LogLevel::kWarning, "mqtt: " + output->where_ + " has gone");
  }
}

void Mosquitto::OnPublished(mosquitto*, void* self, int) {
  --static_cast<Mosquitto*>(self)->waiting_;
}

Status Mosquitto::Publish(std::string_view line) {
  if (!connected_ || waiting_ >= kMaxWaiting) {
    ++dropped_;
    return {};
  }
  if (line.ends_with('\n')) line.remove_suffix(1);
  ++waiting_;
  const int error = mosquitto_publish(client_.get(), nullptr, fix_topic_.c_str(),
                                      static_cast<int>(line.size()), line.data(), 0, false);
  if (error != MOSQ_ERR_SUCCESS) {
    --waiting_;
    ++dropped_;
  }
  return {};
}

}  // namespace

Result<std::unique_ptr<MqttOutput>> MakeMqttOutput(const PublishSettings& settings) {
  MqttAddress address;
  if (const std::string fault = ParseMqttUrl(settings.mqtt_url, address); !fault.empty()) {
    return Status(StatusCode::kInvalidArgument, "mqtt", fault);
  }
  static const int library = mosquitto_lib_init();
  if (library != MOSQ_ERR_SUCCESS) return Refused(library, settings.mqtt_url);
  auto output = std::make_unique<Mosquitto>();
  if (Status status = output->Connect(address, settings); !status.ok()) return status;
  return std::unique_ptr<MqttOutput>(std::move(output));
}

}  // namespace viewfix
