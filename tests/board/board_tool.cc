// SPDX-License-Identifier: BSD-3-Clause
//
// What the virtual board's script needs beside viewfixd and a shell.
//
//   board_tool control NODE NAME VALUE      sets a control, through a descriptor of its own
//   board_tool feed NODE SOCKET OUT JPEG... shows the pictures to a v4l2loopback node, a plain grey
//   one
//                                           before each; OUT gets the first fix of each, read from
//                                           SOCKET
//   board_tool notify SOCKET                prints what arrives there as the service manager would
#include <fcntl.h>
#include <linux/videodev2.h>
#include <poll.h>
#include <sys/ioctl.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <string>
#include <string_view>
#include <vector>

#include "platform/camera/jpeg_decoder.h"
#include "platform/camera/v4l2/v4l2_node.h"
#include "platform/clock.h"
#include "platform/file.h"

namespace viewfix {
namespace {

constexpr std::int64_t kPatienceNs = 60'000'000'000;
constexpr int kFrameMs = 100;

int Fail(const std::string& what) {
  std::fprintf(stderr, "board_tool: %s\n", what.c_str());
  return 1;
}

int SetControl(const std::string& path, const std::string& name, const std::string& value) {
  const Result<V4l2Node> node = V4l2Node::Open(RealV4l2System(), path);
  if (!node.ok()) return Fail(std::string(node.status().detail()));
  for (const V4l2ControlInfo& control : node->Controls()) {
    if (control.name != name) continue;
    const std::string fault = node->SetControl(control, std::atoll(value.c_str()));
    return fault.empty() ? 0 : Fail(name + ": " + fault);
  }
  return Fail("no control " + name);
}

int OpenUnix(const std::string& path, int type, bool listen) {
  sockaddr_un address = {};
  address.sun_family = AF_UNIX;
  std::copy(path.begin(), path.end(), address.sun_path);
  const int fd = ::socket(AF_UNIX, type | SOCK_CLOEXEC, 0);
  const auto* where = reinterpret_cast<const sockaddr*>(&address);
  const int result =
      listen ? ::bind(fd, where, sizeof address) : ::connect(fd, where, sizeof address);
  return result == 0 ? fd : -1;
}

class Feeder {
 public:
  Feeder(int device, int socket) : device_(device), socket_(socket) {}

  bool SetSize(int width, int height) const {
    v4l2_format format = {};
    format.type = V4L2_BUF_TYPE_VIDEO_OUTPUT;
    format.fmt.pix.width = static_cast<std::uint32_t>(width);
    format.fmt.pix.height = static_cast<std::uint32_t>(height);
    format.fmt.pix.pixelformat = V4L2_PIX_FMT_GREY;
    format.fmt.pix.field = V4L2_FIELD_NONE;
    format.fmt.pix.bytesperline = format.fmt.pix.width;
    format.fmt.pix.sizeimage = format.fmt.pix.width * format.fmt.pix.height;
    return ::ioctl(device_, VIDIOC_S_FMT, &format) == 0;
  }

  // Shows the picture until a line comes that has, or has not, the mark; empty: none came.
  std::string ShowUntil(const std::vector<std::uint8_t>& pixels, std::string_view mark, bool has) {
    const std::int64_t end_ns = MonotonicNs() + kPatienceNs;
    while (MonotonicNs() < end_ns) {
      if (::write(device_, pixels.data(), pixels.size()) < 0) return {};
      pollfd waiting = {socket_, POLLIN, 0};
      if (::poll(&waiting, 1, kFrameMs) > 0 && !Read()) return {};
      for (std::string line = TakeLine(); !line.empty(); line = TakeLine()) {
        if ((line.find(mark) != std::string::npos) == has) return line;
      }
    }
    return {};
  }

 private:
  bool Read() {
    char buffer[4096];
    const ssize_t got = ::read(socket_, buffer, sizeof buffer);
    if (got <= 0) return false;
    text_.append(buffer, static_cast<std::size_t>(got));
    return true;
  }
  std::string TakeLine() {
    const std::size_t end = text_.find('\n');
    if (end == std::string::npos) return {};
    std::string line = text_.substr(0, end + 1);
    text_.erase(0, end + 1);
    return line;
  }

  int device_;
  int socket_;
  std::string text_;
};

int Feed(int argc, char** argv) {
  std::vector<YuvImage> pictures;
  for (int i = 3; i < argc; ++i) {
    const auto bytes = ReadFile(argv[i]);
    if (!bytes.ok() || !DecodeJpeg(*bytes, pictures.emplace_back()).ok()) {
      return Fail(std::string("no picture: ") + argv[i]);
    }
  }
  const int device = ::open(argv[0], O_RDWR | O_CLOEXEC);
  if (device < 0) return Fail(std::string("cannot open ") + argv[0]);
  Feeder first(device, -1);
  if (!first.SetSize(pictures[0].width, pictures[0].height)) return Fail("S_FMT refused");
  const std::vector<std::uint8_t> plain(pictures[0].pixels.size(), 128);
  if (::write(device, plain.data(), plain.size()) < 0) return Fail("the first write failed");
  const int socket = OpenUnix(argv[1], SOCK_STREAM, false);
  if (socket < 0) return Fail(std::string("cannot connect to ") + argv[1]);
  std::FILE* out = std::fopen(argv[2], "we");
  if (out == nullptr) return Fail(std::string("cannot write ") + argv[2]);
  Feeder feeder(device, socket);
  for (const YuvImage& picture : pictures) {
    // Each picture's first frame follows one that shows nothing: what it says, it says alone.
    if (feeder.ShowUntil(plain, "too_few_features", true).empty()) return Fail("no line of plain");
    const std::string line = feeder.ShowUntil(picture.pixels, "too_few_features", false);
    if (line.empty()) return Fail("no line of a picture");
    std::fputs(line.c_str(), out);
    std::fflush(out);
  }
  std::fclose(out);
  return 0;
}

int Notify(const std::string& path) {
  const int fd = OpenUnix(path, SOCK_DGRAM, true);
  if (fd < 0) return Fail("cannot listen at " + path);
  char text[1024];
  for (ssize_t size = 0; (size = ::recv(fd, text, sizeof text - 1, 0)) > 0;) {
    text[size] = '\0';
    std::printf("%lld %s\n", static_cast<long long>(MonotonicNs() / 1'000'000), text);
    std::fflush(stdout);
  }
  return 0;
}

int Main(int argc, char** argv) {
  const std::string_view command = argc > 1 ? argv[1] : "";
  if (command == "control" && argc == 5) return SetControl(argv[2], argv[3], argv[4]);
  if (command == "feed" && argc > 5) return Feed(argc - 2, argv + 2);
  if (command == "notify" && argc == 3) return Notify(argv[2]);
  return Fail("see the head of board_tool.cc");
}

}  // namespace
}  // namespace viewfix

int main(int argc, char** argv) { return viewfix::Main(argc, argv); }
