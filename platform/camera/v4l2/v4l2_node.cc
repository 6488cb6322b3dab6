// SPDX-License-Identifier: BSD-3-Clause
#include "platform/camera/v4l2/v4l2_node.h"

#include <linux/videodev2.h>

#include <algorithm>
#include <cctype>
#include <cerrno>
#include <cstring>
#include <functional>
#include <utility>

namespace viewfix {
namespace {

// Drivers that never say "that was the last" must not hang us.
constexpr std::uint32_t kMaxEntries = 256;

template <std::size_t N>
std::string TextOf(const std::uint8_t (&field)[N]) {
  const auto end = std::find(field, field + N, 0);
  return {field, end};
}

// As v4l2-ctl spells it: "Exposure Time, Absolute" becomes exposure_time_absolute.
std::string ControlName(const std::string& text) {
  std::string name;
  for (const char c : text) {
    if (std::isalnum(static_cast<unsigned char>(c)) != 0) {
      name.push_back(static_cast<char>(std::tolower(static_cast<unsigned char>(c))));
    } else if (!name.empty() && name.back() != '_') {
      name.push_back('_');
    }
  }
  while (!name.empty() && name.back() == '_') name.pop_back();
  return name;
}

double RateOf(const v4l2_fract& interval) {
  return interval.numerator == 0 ? 0 : double(interval.denominator) / interval.numerator;
}

std::string Lower(std::string text) {
  std::transform(text.begin(), text.end(), text.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return text;
}

bool IsSettable(std::uint32_t type) {
  return type == V4L2_CTRL_TYPE_INTEGER || type == V4L2_CTRL_TYPE_BOOLEAN ||
         type == V4L2_CTRL_TYPE_MENU || type == V4L2_CTRL_TYPE_INTEGER_MENU ||
         type == V4L2_CTRL_TYPE_BITMASK || type == V4L2_CTRL_TYPE_INTEGER64 ||
         type == V4L2_CTRL_TYPE_BUTTON;
}

}  // namespace

std::string FourccText(std::uint32_t fourcc) {
  std::string text;
  for (int shift = 0; shift < 32; shift += 8) {
    const auto c = static_cast<char>(fourcc >> shift & 0x7F);
    text.push_back(std::isprint(static_cast<unsigned char>(c)) != 0 ? c : '?');
  }
  return text;
}

std::uint32_t FourccOf(const std::string& text) {
  if (text.size() != 4) return 0;
  return v4l2_fourcc(static_cast<std::uint8_t>(text[0]), static_cast<std::uint8_t>(text[1]),
                     static_cast<std::uint8_t>(text[2]), static_cast<std::uint8_t>(text[3]));
}

V4l2Node::V4l2Node(V4l2System& system, std::string path, int fd)
    : system_(&system), path_(std::move(path)), fd_(fd) {}

V4l2Node::V4l2Node(V4l2Node&& other) noexcept
    : system_(other.system_),
      path_(std::move(other.path_)),
      fd_(std::exchange(other.fd_, -1)),
      identity_(std::move(other.identity_)),
      buffer_type_(other.buffer_type_),
      multi_planar_(other.multi_planar_) {}

V4l2Node::~V4l2Node() {
  if (fd_ >= 0) system_->Close(fd_);
}

Status V4l2Node::Failed(const char* request) const {
  return {StatusCode::kIo, "camera refuses", path_ + ": " + request + ": " + std::strerror(errno)};
}

Result<V4l2Node> V4l2Node::Open(V4l2System& system, const std::string& path) {
  const int fd = system.Open(path.c_str());
  if (fd < 0) {
    const bool absent = errno == ENOENT || errno == ENODEV || errno == ENXIO;
    return Status(absent ? StatusCode::kNotFound : StatusCode::kIo, "cannot open camera",
                  path + ": " + std::strerror(errno));
  }
  V4l2Node node(system, path, fd);
  if (Status status = node.ReadCapabilities(); !status.ok()) return status;
  return node;
}

Status V4l2Node::ReadCapabilities() {
  v4l2_capability capability = {};
  if (Ioctl(VIDIOC_QUERYCAP, &capability) != 0) return Failed("QUERYCAP");
  const bool own = (capability.capabilities & V4L2_CAP_DEVICE_CAPS) != 0;
  const std::uint32_t can = own ? capability.device_caps : capability.capabilities;
  multi_planar_ = (can & V4L2_CAP_VIDEO_CAPTURE) == 0;
  const bool captures = (can & (V4L2_CAP_VIDEO_CAPTURE | V4L2_CAP_VIDEO_CAPTURE_MPLANE)) != 0;
  if (!captures || (can & V4L2_CAP_STREAMING) == 0) {
    return {StatusCode::kUnsupported, "not a camera that streams", path_};
  }
  buffer_type_ = multi_planar_ ? V4L2_BUF_TYPE_VIDEO_CAPTURE_MPLANE : V4L2_BUF_TYPE_VIDEO_CAPTURE;
  identity_ = {TextOf(capability.driver), TextOf(capability.card), TextOf(capability.bus_info)};
  return {};
}

std::vector<V4l2FormatInfo> V4l2Node::Formats() const {
  std::vector<V4l2FormatInfo> formats;
  for (std::uint32_t index = 0; index < kMaxEntries; ++index) {
    v4l2_fmtdesc format = {};
    format.index = index;
    format.type = buffer_type_;
    if (Ioctl(VIDIOC_ENUM_FMT, &format) != 0) break;
    formats.push_back({format.pixelformat, TextOf(format.description), Sizes(format.pixelformat)});
  }
  return formats;
}

std::vector<std::uint32_t> V4l2Node::PixelFormats() const {
  std::vector<std::uint32_t> formats;
  for (std::uint32_t index = 0; index < kMaxEntries; ++index) {
    v4l2_fmtdesc format = {};
    format.index = index;
    format.type = buffer_type_;
    if (Ioctl(VIDIOC_ENUM_FMT, &format) != 0) break;
    formats.push_back(format.pixelformat);
  }
  return formats;
}

std::vector<V4l2SizeInfo> V4l2Node::Sizes(std::uint32_t fourcc) const {
  std::vector<V4l2SizeInfo> sizes;
  for (std::uint32_t index = 0; index < kMaxEntries; ++index) {
    v4l2_frmsizeenum size = {};
    size.index = index;
    size.pixel_format = fourcc;
    if (Ioctl(VIDIOC_ENUM_FRAMESIZES, &size) != 0) break;
    const bool fixed = size.type == V4L2_FRMSIZE_TYPE_DISCRETE;
    const auto width = static_cast<int>(fixed ? size.discrete.width : size.stepwise.max_width);
    const auto height = static_cast<int>(fixed ? size.discrete.height : size.stepwise.max_height);
    sizes.push_back({width, height, Rates(fourcc, width, height)});
    if (!fixed) break;
  }
  return sizes;
}

std::vector<double> V4l2Node::Rates(std::uint32_t fourcc, int width, int height) const {
  std::vector<double> rates;
  for (std::uint32_t index = 0; index < kMaxEntries; ++index) {
    v4l2_frmivalenum interval = {};
    interval.index = index;
    interval.pixel_format = fourcc;
    interval.width = static_cast<std::uint32_t>(width);
    interval.height = static_cast<std::uint32_t>(height);
    if (Ioctl(VIDIOC_ENUM_FRAMEINTERVALS, &interval) != 0) break;
    const bool fixed = interval.type == V4L2_FRMIVAL_TYPE_DISCRETE;
    rates.push_back(RateOf(fixed ? interval.discrete : interval.stepwise.min));
    if (!fixed) break;
  }
  std::sort(rates.begin(), rates.end(), std::greater<>());
  return rates;
}

std::vector<V4l2ControlInfo> V4l2Node::Controls() const {
  std::vector<V4l2ControlInfo> controls;
  v4l2_query_ext_ctrl query = {};
  for (std::uint32_t count = 0; count < 4 * kMaxEntries; ++count) {
    query.id |= V4L2_CTRL_FLAG_NEXT_CTRL;
    if (Ioctl(VIDIOC_QUERY_EXT_CTRL, &query) != 0) break;
    if ((query.flags & V4L2_CTRL_FLAG_DISABLED) != 0 || !IsSettable(query.type)) continue;
    const auto end = std::find(std::begin(query.name), std::end(query.name), '\0');
    V4l2ControlInfo control = {query.id,
                               ControlName({std::begin(query.name), end}),
                               query.minimum,
                               query.maximum,
                               static_cast<std::int64_t>(query.step),
                               query.default_value,
                               (query.flags & V4L2_CTRL_FLAG_READ_ONLY) != 0,
                               (query.flags & V4L2_CTRL_FLAG_INACTIVE) != 0,
                               {}};
    const bool menu = query.type == V4L2_CTRL_TYPE_MENU;
    for (std::int64_t i = query.minimum; menu && i <= query.maximum && i < kMaxEntries; ++i) {
      v4l2_querymenu entry = {};
      entry.id = query.id;
      entry.index = static_cast<std::uint32_t>(i);
      if (Ioctl(VIDIOC_QUERYMENU, &entry) != 0) continue;
      control.menu.push_back(std::to_string(i) + " " + TextOf(entry.name));
    }
    controls.push_back(std::move(control));
  }
  return controls;
}

std::string V4l2Node::SetControl(const V4l2ControlInfo& control, std::int64_t value) const {
  v4l2_ext_control one = {};
  one.id = control.id;
  if (control.minimum < INT32_MIN || control.maximum > INT32_MAX) {
    one.value64 = value;
  } else if (value < INT32_MIN || value > INT32_MAX) {
    return "out of range";
  } else {
    one.value = static_cast<std::int32_t>(value);
  }
  v4l2_ext_controls all = {};
  all.which = V4L2_CTRL_WHICH_CUR_VAL;
  all.count = 1;
  all.controls = &one;
  return Ioctl(VIDIOC_S_EXT_CTRLS, &all) == 0 ? "" : std::strerror(errno);
}

namespace {

// By path, by-id name or part of the card's name.
Result<V4l2Node> FindByName(V4l2System& system, const std::string& where) {
  const bool is_path = where.find('/') != std::string::npos;
  const std::string real = system.Resolve(is_path ? where : "/dev/v4l/by-id/" + where);
  if (!real.empty()) return V4l2Node::Open(system, real);
  if (is_path) return V4l2Node::Open(system, where);
  for (const std::string& path : system.Nodes()) {
    Result<V4l2Node> node = V4l2Node::Open(system, path);
    if (!node.ok()) continue;
    if (Lower(node->identity().card).find(Lower(where)) != std::string::npos) return node;
  }
  return Status(StatusCode::kNotFound, "no such camera", where);
}

}  // namespace

Result<V4l2Node> FindCamera(V4l2System& system, const std::string& where,
                            const std::optional<CameraIdentity>& known) {
  Result<V4l2Node> named = FindByName(system, where);
  if (!known || (named.ok() && named->identity() == *known)) return named;
  // Unplugged and back: under another number, or even at another socket.
  std::optional<V4l2Node> alike;
  for (const std::string& path : system.Nodes()) {
    Result<V4l2Node> node = V4l2Node::Open(system, path);
    if (!node.ok()) continue;
    if (node->identity() == *known) return node;
    const bool same_kind = node->identity().card == known->card;
    if (same_kind && !alike) alike.emplace(std::move(*node));
  }
  if (alike) return std::move(*alike);
  // A number may belong to another camera by now; a name is what was asked for.
  if (!named.ok() || where.rfind("/dev/video", 0) != 0) return named;
  return Status(StatusCode::kNotFound, "another camera has this number now", where);
}

}  // namespace viewfix
