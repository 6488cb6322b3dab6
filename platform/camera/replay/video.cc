// SPDX-License-Identifier: BSD-3-Clause
#include <fcntl.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <charconv>
#include <csignal>
#include <cstring>
#include <string>
#include <string_view>
#include <utility>

#include "platform/camera/replay/replay.h"
#include "platform/file.h"

extern char** environ;

namespace viewfix {
namespace {

constexpr std::size_t kMaxHeaderBytes = 256;

// An ffmpeg process and the end of the pipe that its frames come out of.
class Decoder {
 public:
  Decoder() = default;
  ~Decoder() { Stop(); }
  Decoder(const Decoder&) = delete;
  Decoder& operator=(const Decoder&) = delete;

  Status Start(const std::string& video) {
    Stop();
    int ends[2];
    if (::pipe2(ends, O_CLOEXEC) != 0) return {StatusCode::kIo, "no pipe", std::strerror(errno)};
    const int error = Spawn(video, ends[1]);
    ::close(ends[1]);
    if (error == 0) {
      fd_ = ends[0];
      return {};
    }
    ::close(ends[0]);
    pid_ = 0;
    return {StatusCode::kUnsupported, "a video needs ffmpeg", std::strerror(error)};
  }

  void Stop() {
    if (fd_ >= 0) ::close(std::exchange(fd_, -1));
    if (pid_ <= 0) return;
    ::kill(pid_, SIGKILL);
    while (::waitpid(pid_, nullptr, 0) < 0 && errno == EINTR) {
    }
    pid_ = 0;
  }

  // Whether all bytes came.
  bool Read(std::uint8_t* bytes, std::size_t size) {
    while (size > 0) {
      const ssize_t got = ::read(fd_, bytes, size);
      if (got < 0 && errno == EINTR) continue;
      if (got <= 0) return false;
      bytes += got;
      size -= static_cast<std::size_t>(got);
    }
    return true;
  }

  // Up to the line's end, which is left out. False: too long, or the stream ended.
  bool ReadLine(std::string& line) {
    line.clear();
    std::uint8_t byte = 0;
    while (line.size() < kMaxHeaderBytes && Read(&byte, 1)) {
      if (byte == '\n') return true;
      line.push_back(static_cast<char>(byte));
    }
    return false;
  }

 private:
  // The child gets no signal blocked: viewfixd blocks those that end it.
  int Spawn(const std::string& video, int out) {
    posix_spawn_file_actions_t files;
    posix_spawn_file_actions_init(&files);
    posix_spawn_file_actions_adddup2(&files, out, STDOUT_FILENO);
    posix_spawn_file_actions_addopen(&files, STDIN_FILENO, "/dev/null", O_RDONLY, 0);
    posix_spawnattr_t attributes;
    posix_spawnattr_init(&attributes);
    sigset_t none;
    sigemptyset(&none);
    posix_spawnattr_setsigmask(&attributes, &none);
    posix_spawnattr_setflags(&attributes, POSIX_SPAWN_SETSIGMASK);
    // A name that begins with "-" or holds ":" is a file all the same.
    const std::string input = "file:" + video;
    const char* words[] = {"ffmpeg",  "-nostdin", "-v", "quiet",        "-i",       input.c_str(),
                           "-an",     "-sn",      "-f", "yuv4mpegpipe", "-pix_fmt", "yuvj420p",
                           "-strict", "-1",       "-",  nullptr};
    const int error = ::posix_spawnp(&pid_, "ffmpeg", &files, &attributes,
                                     const_cast<char* const*>(words), environ);
    posix_spawnattr_destroy(&attributes);
    posix_spawn_file_actions_destroy(&files);
    return error;
  }

  int fd_ = -1;
  pid_t pid_ = 0;
};

// The number after " W" or " H" of a Y4M header; 0: none.
int FieldOf(std::string_view header, std::string_view mark) {
  const std::size_t at = header.find(mark);
  if (at == std::string_view::npos) return 0;
  const std::string_view digits = header.substr(at + mark.size());
  int value = 0;
  const auto parsed = std::from_chars(digits.data(), digits.data() + digits.size(), value);
  return parsed.ec == std::errc() && value > 0 ? value : 0;
}

class Video : public Recording {
 public:
  explicit Video(std::string path) : path_(std::move(path)) {}

  Status Rewind() override {
    if (Status status = decoder_.Start(path_); !status.ok()) return AboutFile(path_, status);
    std::string header;
    if (!decoder_.ReadLine(header) || header.rfind("YUV4MPEG2 ", 0) != 0) {
      return {StatusCode::kCorrupt, "no video that ffmpeg can read", path_};
    }
    width_ = FieldOf(header, " W");
    height_ = FieldOf(header, " H");
    const bool fits = width_ > 0 && height_ > 0 && width_ <= kMaxImageSide &&
                      height_ <= kMaxImageSide && std::int64_t{width_} * height_ <= kMaxImagePixels;
    if (!fits) return {StatusCode::kUnsupported, "image is too large", path_};
    return {};
  }

  Status Next(Frame& frame) override {
    std::string header;
    if (!decoder_.ReadLine(header)) return {StatusCode::kNotFound, "end of video"};
    frame.name.clear();
    frame.image.width = width_;
    frame.image.height = height_;
    frame.image.pixels.resize(std::size_t(width_) * height_);
    frame.image.ResizeChroma();
    for (auto* plane : {&frame.image.pixels, &frame.image.cb, &frame.image.cr}) {
      if (!decoder_.Read(plane->data(), plane->size())) {
        return {StatusCode::kNotFound, "end of video"};
      }
    }
    if (frame.image.luma_only) frame.image.ClearChroma();
    return {};
  }

 private:
  std::string path_;
  Decoder decoder_;
  int width_ = 0;
  int height_ = 0;
};

}  // namespace

Result<std::unique_ptr<Recording>> OpenVideo(const std::string& path) {
  auto video = std::make_unique<Video>(path);
  if (Status status = video->Rewind(); !status.ok()) return status;
  return std::unique_ptr<Recording>(std::move(video));
}

}  // namespace viewfix
