// SPDX-License-Identifier: BSD-3-Clause
#include "platform/publish/server.h"

#include <arpa/inet.h>
#include <gmock/gmock.h>
#include <poll.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <unistd.h>

#include <atomic>
#include <chrono>
#include <csignal>
#include <filesystem>
#include <random>
#include <thread>
#include <utility>

#include "platform/publish/map_json.h"
#include "platform/publish/reader_queue.h"
#include "tests/testing/jpeg_encoder.h"
#include "tests/testing/temp_folder.h"
#include "tests/testing/tiny_model.h"

namespace viewfix {
namespace {

using std::chrono::milliseconds;
using testing::HasSubstr;
using testing::StartsWith;

constexpr int kPatienceMs = 10'000;
constexpr const char* kToken = "0123456789abcdef";

// One end of a connection, closed at the end of the scope.
class Connection {
 public:
  explicit Connection(int fd = -1) : fd_(fd) {}
  Connection(Connection&& other) noexcept : fd_(std::exchange(other.fd_, -1)) {}
  ~Connection() {
    if (fd_ >= 0) ::close(fd_);
  }
  bool ok() const { return fd_ >= 0; }
  int fd() const { return fd_; }
  void Write(const std::string& text) const {
    (void)::send(fd_, text.data(), text.size(), MSG_NOSIGNAL);
  }
  // Until `mark` was read, the other end closed, or patience is over.
  std::string ReadUntil(const std::string& mark) const {
    std::string text;
    char buffer[4096];
    pollfd waiting = {fd_, POLLIN, 0};
    while (text.find(mark) == std::string::npos && ::poll(&waiting, 1, kPatienceMs) > 0) {
      const ssize_t got = ::recv(fd_, buffer, sizeof buffer, 0);
      if (got <= 0) break;
      text.append(buffer, static_cast<std::size_t>(got));
    }
    return text;
  }
  std::string ReadAll() const { return ReadUntil("\x01never"); }

 private:
  int fd_;
};

Connection ConnectUnix(const std::string& path) {
  sockaddr_un address = {};
  address.sun_family = AF_UNIX;
  std::copy(path.begin(), path.end(), address.sun_path);
  const int fd = ::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0);
  if (::connect(fd, reinterpret_cast<sockaddr*>(&address), sizeof address) == 0) {
    return Connection(fd);
  }
  ::close(fd);
  return Connection();
}

Connection ConnectHttp(int port) {
  sockaddr_in address = {};
  address.sin_family = AF_INET;
  address.sin_port = htons(static_cast<std::uint16_t>(port));
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  const int fd = ::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
  if (::connect(fd, reinterpret_cast<sockaddr*>(&address), sizeof address) == 0) {
    return Connection(fd);
  }
  ::close(fd);
  return Connection();
}

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

class ServerTest : public testing::Test {
 protected:
  ServerTest() : bytes_(TinyModel()) {
    settings_.unix_path = folder_ / "fixes";
    settings_.http_port = FreePort();
  }

  void Start() {
    auto view = std::make_shared<ModelView>(*ModelView::Open(bytes_));
    ServerContent content = {
        [](const PublishCounts&) { return std::string("{\"state\":\"ok\"}\n"); },
        [](const PublishCounts&) { return std::string("viewfix_up 1\n"); },
        [this] { return well_.load(); }, [view] { return view; }, [] {}};
    auto server = Server::Start(settings_, std::move(content));
    ASSERT_TRUE(server.ok()) << server.status().text() << server.status().detail();
    server_ = std::move(*server);
  }

  std::string Get(const std::string& path, const std::string& headers = "Host: localhost\r\n") {
    const Connection connection = ConnectHttp(settings_.http_port);
    connection.Write("GET " + path + " HTTP/1.1\r\n" + headers + "Connection: close\r\n\r\n");
    return connection.ReadAll();
  }
  // Connected, and known to the server.
  Connection Listener(const std::string& path = "/events") {
    Connection connection = ConnectHttp(settings_.http_port);
    connection.Write("GET " + path + " HTTP/1.1\r\nHost: localhost\r\n\r\n");
    EXPECT_THAT(connection.ReadUntil("\r\n\r\n"), HasSubstr("200 OK"));
    return connection;
  }
  void WaitForClients(std::uint64_t clients) const {
    for (int i = 0; i < 1000 && server_->counts().clients != clients; ++i) {
      std::this_thread::sleep_for(milliseconds(10));
    }
    EXPECT_EQ(server_->counts().clients, clients);
  }

  TempFolder folder_;
  std::vector<std::uint8_t> bytes_;
  PublishSettings settings_;
  std::atomic<bool> well_ = true;
  std::unique_ptr<Server> server_;
};

TEST_F(ServerTest, EveryReaderGetsEveryLine) {
  Start();
  std::vector<Connection> readers;
  for (int i = 0; i < 3; ++i) readers.push_back(ConnectUnix(settings_.unix_path));
  readers.push_back(Listener());
  WaitForClients(4);
  for (int i = 0; i < 20; ++i) {
    (void)server_->Publish("{\"seq\":" + std::to_string(i) + "}\n");
    std::this_thread::sleep_for(milliseconds(1));
  }
  for (const Connection& reader : readers) {
    const std::string text = reader.ReadUntil("{\"seq\":19}\n");
    for (int i = 0; i < 20; ++i) {
      EXPECT_THAT(text, HasSubstr("{\"seq\":" + std::to_string(i) + "}\n"));
    }
  }
  EXPECT_EQ(server_->counts().dropped_lines, 0U);
}

TEST_F(ServerTest, PagesSayWhatTheyAre) {
  Start();
  EXPECT_THAT(Get("/fix"), HasSubstr("503"));
  (void)server_->Publish("{\"seq\":7}\n");
  for (int i = 0; i < 500 && Get("/fix").find("200 OK") == std::string::npos; ++i) {
    std::this_thread::sleep_for(milliseconds(10));
  }
  EXPECT_THAT(Get("/fix"), HasSubstr("{\"seq\":7}\n"));
  EXPECT_THAT(Get("/"), HasSubstr("<!doctype html>"));
  EXPECT_THAT(Get("/"), HasSubstr("Content-Security-Policy"));
  EXPECT_THAT(Get("/metrics"), HasSubstr("viewfix_up 1\n"));
  EXPECT_THAT(Get("/map.json"), HasSubstr("\"locations\":[\"floor1/caf\u00e9\",\"floor1/lobby\"]"));
  EXPECT_THAT(Get("/floorplan"), HasSubstr("404"));
  EXPECT_THAT(Get("/frame.jpg"), HasSubstr("404"));
  EXPECT_THAT(Get("/../etc/passwd"), HasSubstr("404"));
  EXPECT_THAT(Get("/health"), HasSubstr("200 OK"));
  well_ = false;
  EXPECT_THAT(Get("/health"), HasSubstr("503"));
}

TEST_F(ServerTest, AFloorPlanIsServedAsItIs) {
  ModelData data = TinyModelData();
  AddTinyFloorPlan(data);
  bytes_ = *WriteModel(data);
  Start();
  EXPECT_THAT(Get("/floorplan"), HasSubstr("image/png"));
  EXPECT_THAT(Get("/map.json"), HasSubstr("\"floor_plan\":{\"width\":20,\"height\":10"));
}

TEST_F(ServerTest, ThePictureIsTheLastFrame) {
  settings_.frame_picture = true;
  Start();
  EXPECT_THAT(Get("/frame.jpg"), HasSubstr("503"));
  server_->Show({64, 48, MakeTexture(64, 48, 1)}, {});
  const std::string reply = Get("/frame.jpg");
  const std::size_t body = reply.find("\r\n\r\n") + 4;
  const std::vector<std::uint8_t> jpeg(reply.begin() + static_cast<std::ptrdiff_t>(body),
                                       reply.end());
  YuvImage decoded;
  ASSERT_TRUE(DecodeJpeg(jpeg, decoded).ok());
  EXPECT_EQ(decoded.width, 64);
}

TEST_F(ServerTest, ATokenIsAskedFor) {
  settings_.token_file = folder_.Write("token", std::string(kToken) + "\n");
  Start();
  EXPECT_THAT(Get("/health"), HasSubstr("403"));
  EXPECT_THAT(Get("/health?token=wrong"), HasSubstr("403"));
  EXPECT_THAT(Get(std::string("/health?token=") + kToken), HasSubstr("200 OK"));
  EXPECT_THAT(Get("/health", std::string("Authorization: Bearer ") + kToken + "\r\n"),
              HasSubstr("200 OK"));
}

TEST_F(ServerTest, AnotherNameForThisMachineIsRefused) {
  Start();
  EXPECT_THAT(Get("/health", "Host: evil.example\r\n"), HasSubstr("403"));
  EXPECT_THAT(Get("/health", "Host: 127.0.0.1:80\r\n"), HasSubstr("200 OK"));
}

TEST_F(ServerTest, WhatCannotBeOpenedIsNamed) {
  const auto fault = [&](const PublishSettings& settings) {
    const auto server = Server::Start(settings, {});
    return server.ok() ? "started" : std::string(server.status().detail());
  };
  PublishSettings settings;
  settings.unix_path = folder_.Write("file", "text");
  EXPECT_THAT(fault(settings), HasSubstr("there is something else"));
  settings.unix_path = folder_ / "none/fixes";
  EXPECT_THAT(fault(settings), HasSubstr("No such file"));
  settings = {};
  settings.http_port = settings_.http_port;
  settings.http_address = "example.org";
  EXPECT_THAT(fault(settings), HasSubstr("example.org"));
  settings.http_address = "127.0.0.1";
  settings.token_file = folder_.Write("short", "abc\n");
  EXPECT_THAT(fault(settings), HasSubstr("short"));
  Start();
  settings.token_file.clear();
  EXPECT_THAT(fault(settings), HasSubstr("Address already in use"));
  settings = {};
  settings.unix_path = settings_.unix_path;
  EXPECT_THAT(fault(settings), HasSubstr("another program serves it"));
}

TEST_F(ServerTest, ASocketLeftBehindIsReplacedAndOursIsTakenAway) {
  const int left = ::socket(AF_UNIX, SOCK_STREAM, 0);
  sockaddr_un address = {};
  address.sun_family = AF_UNIX;
  std::copy(settings_.unix_path.begin(), settings_.unix_path.end(), address.sun_path);
  ASSERT_EQ(::bind(left, reinterpret_cast<sockaddr*>(&address), sizeof address), 0);
  ::close(left);
  Start();
  EXPECT_TRUE(ConnectUnix(settings_.unix_path).ok());
  server_.reset();
  EXPECT_FALSE(std::filesystem::exists(settings_.unix_path));
}

TEST(ReaderQueueTest, MissesLinesThenIsDropped) {
  using Verdict = ReaderQueue::Verdict;
  ReaderQueue queue(100, 3);
  EXPECT_EQ(queue.Judge(60, 40), Verdict::kSend);
  for (int i = 0; i < 3; ++i) EXPECT_EQ(queue.Judge(61, 40), Verdict::kMiss);
  EXPECT_EQ(queue.Judge(0, 40), Verdict::kSend);  // it reads again
  for (int i = 0; i < 3; ++i) EXPECT_EQ(queue.Judge(61, 40), Verdict::kMiss);
  EXPECT_EQ(queue.Judge(61, 40), Verdict::kDrop);
}

// Readers that never read: lines are dropped, then they; one that reads gets what is said
// afterwards, and other pages are answered all the while.
TEST_F(ServerTest, ReadersThatDoNotReadAreDropped) {
  Start();
  std::vector<Connection> idle;
  for (int i = 0; i < 20; ++i) idle.push_back(ConnectUnix(settings_.unix_path));
  for (int i = 0; i < 20; ++i) idle.push_back(Listener());
  WaitForClients(40);
  const std::string line(2000, 'x');
  for (int i = 0; i < 200'000 && server_->counts().dropped_clients < 40; ++i) {
    (void)server_->Publish(line + "\n");
    if (i % 100 == 0) std::this_thread::sleep_for(milliseconds(2));
    if (i % 1000 == 0) {
      EXPECT_THAT(Get("/health"), HasSubstr("200 OK"));
    }
  }
  EXPECT_EQ(server_->counts().dropped_clients, 40U);
  EXPECT_GT(server_->counts().dropped_lines, 0U);
  WaitForClients(0);
  const Connection reader = ConnectUnix(settings_.unix_path);
  WaitForClients(1);
  (void)server_->Publish("well\n");
  EXPECT_THAT(reader.ReadUntil("well\n"), HasSubstr("well\n"));
}

// What libevent leaves of each such reader is freed: the build with sanitizers looks at it.
TEST_F(ServerTest, ReadersThatHangUpAreForgotten) {
  Start();
  for (int i = 0; i < 3; ++i) {
    { const Connection reader = Listener(); }
    WaitForClients(0);
  }
  (void)server_->Publish("well\n");
  EXPECT_THAT(Get("/health"), HasSubstr("200 OK"));
  EXPECT_EQ(server_->counts().dropped_clients, 0U);
}

TEST_F(ServerTest, MoreReadersThanThereIsRoomForAreTurnedAway) {
  Start();
  std::vector<Connection> readers;
  for (std::size_t i = 0; i < Server::kMaxReaders; ++i) readers.push_back(Listener());
  WaitForClients(Server::kMaxReaders);
  EXPECT_THAT(Get("/events"), HasSubstr("503"));
  readers.clear();
  WaitForClients(0);
  readers.push_back(Listener());
}

TEST_F(ServerTest, AnyBytesAreAnsweredOrRefused) {
  Start();
  std::mt19937 random(1);
  const std::string good = "GET /health HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n\r\n";
  for (int round = 0; round < 300; ++round) {
    std::string request = good;
    for (int i = 0; i < 1 + round % 5; ++i) {
      request[random() % request.size()] = static_cast<char>(random() % 256);
    }
    const Connection connection = ConnectHttp(settings_.http_port);
    connection.Write(request);
    ::shutdown(connection.fd(), SHUT_WR);
    (void)connection.ReadAll();
  }
  EXPECT_THAT(Get("/health", "Host: localhost\r\nX: " + std::string(20'000, 'x') + "\r\n"),
              testing::Not(HasSubstr("200 OK")));
  EXPECT_THAT(Get("/health"), HasSubstr("200 OK"));
}

TEST(MapJsonTest, HasPointsAndKeyframesOfTheFirstMap) {
  ModelData data = TinyModelData();
  AddTinyMaps(data);
  const std::vector<std::uint8_t> bytes = *WriteModel(data);
  const std::string json = MapJson(*ModelView::Open(bytes));
  EXPECT_THAT(json, StartsWith("{\"schema\":1,\"model\":\""));
  EXPECT_THAT(json, HasSubstr("\"points\":[["));
  EXPECT_THAT(json, HasSubstr("\"keyframes\":[{\"x\":"));
  EXPECT_THAT(json, HasSubstr("\"floor_plan\":null"));
}

}  // namespace
}  // namespace viewfix
