// SPDX-License-Identifier: BSD-3-Clause
#include <cstdio>

#include "platform/camera/v4l2/to_yuv.h"
#include "platform/camera/v4l2/v4l2_camera.h"
#include "platform/camera/v4l2/v4l2_node.h"

namespace viewfix {
namespace {

std::string RatesText(const std::vector<double>& rates) {
  std::string text;
  for (const double rate : rates) {
    char number[32];
    std::snprintf(number, sizeof number, "%s%g", text.empty() ? " at " : ", ", rate);
    text.append(number);
  }
  return text.empty() ? text : text + "/s";
}

void DescribeFormats(const V4l2Node& node, std::string& text) {
  for (const V4l2FormatInfo& format : node.Formats()) {
    text.append("  format ").append(FourccText(format.fourcc)).append("  ").append(format.text);
    text.append(KnowsPixelFormat(format.fourcc) ? "\n" : " (viewfixd does not read it)\n");
    for (const V4l2SizeInfo& size : format.sizes) {
      text.append("    ").append(std::to_string(size.width)).append("x");
      text.append(std::to_string(size.height)).append(RatesText(size.rates)).append("\n");
    }
  }
}

void DescribeControls(const V4l2Node& node, std::string& text) {
  for (const V4l2ControlInfo& control : node.Controls()) {
    text.append("  control ").append(control.name).append("  ");
    text.append(std::to_string(control.minimum)).append("..");
    text.append(std::to_string(control.maximum));
    if (control.step > 1) text.append(" by ").append(std::to_string(control.step));
    text.append(", default ").append(std::to_string(control.standard));
    if (control.read_only) text.append(", read only");
    if (control.inactive) text.append(", inactive");
    text.append("\n");
    for (const std::string& entry : control.menu) text.append("    ").append(entry).append("\n");
  }
}

}  // namespace

std::string DescribeCameras(V4l2System& system) {
  std::string text;
  for (const std::string& path : system.Nodes()) {
    const Result<V4l2Node> node = V4l2Node::Open(system, path);
    if (node.status().code() == StatusCode::kUnsupported) continue;  // of a camera's second node
    text.append("v4l2:").append(path).append("  ");
    if (!node.ok()) {
      text.append(node.status().text()).append(": ").append(node.status().detail()).append("\n");
      continue;
    }
    const CameraIdentity& identity = node->identity();
    text.append(identity.card).append(" (").append(identity.driver).append(", ");
    text.append(identity.bus).append(")\n");
    for (const std::string& name : system.StableNames(path)) {
      text.append("  also v4l2:").append(name).append("\n");
    }
    DescribeFormats(*node, text);
    DescribeControls(*node, text);
  }
  return text;
}

}  // namespace viewfix
