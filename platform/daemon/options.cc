// SPDX-License-Identifier: BSD-3-Clause
#include "platform/daemon/options.h"

#include <getopt.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <string_view>

#include "engine/image/image_view.h"
#include "platform/daemon/config_file.h"
#include "platform/publish/mqtt_output.h"

namespace viewfix {
namespace {

constexpr double kMaxRate = 1000;  // frames a second

template <typename T>
bool ParseNumber(std::string_view text, T& value) {
  const auto end = text.data() + text.size();
  const auto parsed = std::from_chars(text.data(), end, value);
  return parsed.ec == std::errc() && parsed.ptr == end;
}

bool ParseRate(const std::string& value, double& rate) {
  return ParseNumber(value, rate) && std::isfinite(rate) && rate >= 0 && rate <= kMaxRate;
}

bool ParseSwitch(const std::string& value, bool& on) {
  on = value == "on";
  return on || value == "off";
}

std::string TakeModel(const std::string& value, DaemonOptions& options) {
  options.model_path = value;
  return value.empty() ? "needs a file" : "";
}

std::string TakeStore(const std::string& value, DaemonOptions& options) {
  options.store_folder = value;
  return value.empty() ? "needs a folder" : "";
}

std::string TakeTrust(const std::string& value, DaemonOptions& options) {
  options.trust_folder = value;
  return value.empty() ? "needs a folder" : "";
}

std::string TakeCamera(const std::string& value, DaemonOptions& options) {
  using Kind = CameraSettings::Kind;
  constexpr std::pair<std::string_view, Kind> kKinds[] = {
      {"replay:", Kind::kReplay}, {"v4l2:", Kind::kV4l2}, {"libcamera:", Kind::kLibcamera}};
  for (const auto& [prefix, kind] : kKinds) {
    if (value.rfind(prefix, 0) != 0 || value.size() == prefix.size()) continue;
    options.camera.kind = kind;
    options.camera.where = value.substr(prefix.size());
    return {};
  }
  return "not replay:PATH, v4l2:DEVICE or libcamera:NAME";
}

std::string TakeCalibration(const std::string& value, DaemonOptions& options) {
  options.calibration_path = value;
  return value.empty() ? "needs a file" : "";
}

std::string TakeRotate(const std::string& value, DaemonOptions& options) {
  constexpr std::string_view kTurns[] = {"0", "90", "180", "270"};
  const auto turn = std::find(std::begin(kTurns), std::end(kTurns), value);
  if (turn == std::end(kTurns)) return "not 0, 90, 180 or 270";
  options.rotate_deg = static_cast<int>(turn - std::begin(kTurns)) * 90;
  return {};
}

std::string TakeWindow(const std::string& value, DaemonOptions& options) {
  const bool known = value.size() == 1 && (value[0] == '0' || (value[0] >= '3' && value[0] <= '8'));
  if (!known) return "not 0 or 3 to 8";
  options.window = value[0] - '0';
  return {};
}

std::string TakeFilter(const std::string& value, DaemonOptions& options) {
  return ParseSwitch(value, options.filter) ? "" : "not on or off";
}

std::string TakeMaxFps(const std::string& value, DaemonOptions& options) {
  return ParseRate(value, options.max_fps) ? "" : "not a rate of 0 to 1000 a second";
}

std::string TakeIdleFps(const std::string& value, DaemonOptions& options) {
  return ParseRate(value, options.idle_fps) ? "" : "not a rate of 0 to 1000 a second";
}

std::string TakeRate(const std::string& value, DaemonOptions& options) {
  return ParseRate(value, options.camera.rate) ? "" : "not a rate of 0 to 1000 a second";
}

std::string TakeSize(const std::string& value, DaemonOptions& options) {
  const std::size_t cross = value.find('x');
  const std::string_view text(value);
  CameraSettings& camera = options.camera;
  const bool ok = cross != std::string::npos && ParseNumber(text.substr(0, cross), camera.width) &&
                  ParseNumber(text.substr(cross + 1), camera.height);
  const auto fits = [](int side) { return side >= 16 && side <= kMaxImageSide; };
  return ok && fits(camera.width) && fits(camera.height) ? "" : "not a size like 640x480";
}

std::string TakePixelFormat(const std::string& value, DaemonOptions& options) {
  options.camera.pixel_format = value;
  // "Y16" stands for "Y16 ".
  if (!value.empty() && value.size() < 4) options.camera.pixel_format.resize(4, ' ');
  return value.size() <= 4 ? "" : "not four characters, as YUYV";
}

std::string TakeControl(const std::string& value, DaemonOptions& options) {
  const std::size_t equals = value.find('=');
  CameraControl control = {value.substr(0, equals), 0};
  const bool ok = equals != std::string::npos && equals > 0 &&
                  ParseNumber(std::string_view(value).substr(equals + 1), control.value);
  if (!ok) return "not NAME=NUMBER";
  std::erase_if(options.camera.controls, [&](const auto& c) { return c.name == control.name; });
  options.camera.controls.push_back(std::move(control));
  return {};
}

std::string TakeRealTime(const std::string& value, DaemonOptions& options) {
  return ParseSwitch(value, options.camera.real_time) ? "" : "not on or off";
}

std::string TakeLoop(const std::string& value, DaemonOptions& options) {
  return ParseSwitch(value, options.camera.loop) ? "" : "not on or off";
}

std::string TakeHttp(std::string_view where, PublishSettings& publish) {
  const std::size_t colon = where.rfind(':');
  if (colon != std::string_view::npos) {
    publish.http_address = where.substr(0, colon);
    where.remove_prefix(colon + 1);
  }
  const bool ok = ParseNumber(where, publish.http_port) && publish.http_port >= 1 &&
                  publish.http_port <= 65535 && !publish.http_address.empty();
  return ok ? "" : "http takes a port of 1 to 65535, or ADDRESS:PORT";
}

// Longer paths do not fit into a socket's address.
constexpr std::size_t kMaxSocketPath = 107;

std::string TakeOutput(std::string_view output, PublishSettings& publish) {
  constexpr std::string_view kUnix = "unix:", kHttp = "http:";
  if (output == "stdout") {
    publish.to_stdout = true;
  } else if (output.rfind(kUnix, 0) == 0) {
    publish.unix_path = output.substr(kUnix.size());
    const std::size_t size = publish.unix_path.size();
    return size > 0 && size <= kMaxSocketPath ? "" : "unix needs a path of at most 107 bytes";
  } else if (output.rfind(kHttp, 0) == 0) {
    return TakeHttp(output.substr(kHttp.size()), publish);
  } else if (output.rfind("mqtt", 0) == 0) {
    // "mqtt:mqtt://..." too: every output begins with its kind.
    publish.mqtt_url = output.substr(output.rfind("mqtt:mqtt", 0) == 0 ? 5 : 0);
    MqttAddress address;
    return ParseMqttUrl(publish.mqtt_url, address);
  } else if (output != "none") {
    return "not stdout, unix:PATH, http:PORT, mqtt://HOST/TOPIC or none";
  }
  return {};
}

std::string TakePublish(const std::string& value, DaemonOptions& options) {
  PublishSettings& publish = options.publish;
  publish.to_stdout = false;
  publish.unix_path.clear();
  publish.mqtt_url.clear();
  publish.http_port = 0;
  publish.http_address = PublishSettings().http_address;
  std::string_view rest = value;
  while (true) {
    const std::size_t comma = rest.find(',');
    if (std::string fault = TakeOutput(rest.substr(0, comma), publish); !fault.empty()) {
      return fault;
    }
    if (comma == std::string_view::npos) return {};
    rest.remove_prefix(comma + 1);
  }
}

std::string TakeTokenFile(const std::string& value, DaemonOptions& options) {
  options.publish.token_file = value;
  return value.empty() ? "needs a file" : "";
}

std::string TakeMqttUser(const std::string& value, DaemonOptions& options) {
  options.publish.mqtt_user = value;
  return {};
}

std::string TakeMqttPasswordFile(const std::string& value, DaemonOptions& options) {
  options.publish.mqtt_password_file = value;
  return value.empty() ? "needs a file" : "";
}

std::string TakeMqttCaFile(const std::string& value, DaemonOptions& options) {
  options.publish.mqtt_ca_file = value;
  return value.empty() ? "needs a file" : "";
}

std::string TakeFramePicture(const std::string& value, DaemonOptions& options) {
  return ParseSwitch(value, options.publish.frame_picture) ? "" : "not on or off";
}

struct Setting {
  const char* name;
  std::string (*take)(const std::string& value, DaemonOptions& options);
};

constexpr Setting kSettings[] = {
    {"model", TakeModel},
    {"store", TakeStore},
    {"trust", TakeTrust},
    {"camera", TakeCamera},
    {"calibration", TakeCalibration},
    {"rotate", TakeRotate},
    {"window", TakeWindow},
    {"filter", TakeFilter},
    {"publish", TakePublish},
    {"max-fps", TakeMaxFps},
    {"idle-fps", TakeIdleFps},
    {"size", TakeSize},
    {"rate", TakeRate},
    {"pixel-format", TakePixelFormat},
    {"control", TakeControl},
    {"real-time", TakeRealTime},
    {"loop", TakeLoop},
    {"token-file", TakeTokenFile},
    {"frame-picture", TakeFramePicture},
    {"mqtt-user", TakeMqttUser},
    {"mqtt-password-file", TakeMqttPasswordFile},
    {"mqtt-ca-file", TakeMqttCaFile},
};

const Setting* FindSetting(std::string_view name) {
  const auto found = std::find_if(std::begin(kSettings), std::end(kSettings),
                                  [&](const Setting& s) { return s.name == name; });
  return found == std::end(kSettings) ? nullptr : found;
}

enum Flag : int { kConfig = 1000, kCheckConfig, kHelp, kVersion };

std::vector<option> Flags() {
  std::vector<option> flags;
  for (int i = 0; i < static_cast<int>(std::size(kSettings)); ++i) {
    flags.push_back({kSettings[i].name, required_argument, nullptr, i});
  }
  flags.push_back({"config", required_argument, nullptr, kConfig});
  flags.push_back({"check-config", no_argument, nullptr, kCheckConfig});
  flags.push_back({"help", no_argument, nullptr, kHelp});
  flags.push_back({"version", no_argument, nullptr, kVersion});
  flags.push_back({});
  return flags;
}

CommandLine WrongUsage(std::string error) {
  CommandLine line;
  line.action = CommandLine::Action::kWrongUsage;
  line.error = std::move(error);
  return line;
}

void TakeFlag(int flag, const std::string& value, CommandLine& line) {
  switch (flag) {
    case kConfig:
      line.config_path = value;
      return;
    case kCheckConfig:
      line.action = CommandLine::Action::kCheckConfig;
      return;
    case kHelp:
      line.action = CommandLine::Action::kHelp;
      return;
    case kVersion:
      line.action = CommandLine::Action::kVersion;
      return;
    default:
      line.settings.emplace_back(kSettings[flag].name, value);
  }
}

bool IsLoopback(const std::string& address) {
  return address == "localhost" || address == "[::1]" || address.rfind("127.", 0) == 0;
}

std::string Inconsistent(const DaemonOptions& options) {
  const PublishSettings& publish = options.publish;
  if (options.model_path.empty() && options.store_folder.empty()) {
    return "--model FILE is missing, or --store DIR";
  }
  if (!options.model_path.empty() && !options.store_folder.empty()) {
    return "--model and --store exclude each other";
  }
  if (options.camera.kind == CameraSettings::Kind::kNone) {
    return "--camera replay:PATH, v4l2:DEVICE or libcamera:NAME is missing";
  }
  if (publish.http_port != 0 && !IsLoopback(publish.http_address) && publish.token_file.empty()) {
    return "http beyond this machine (" + publish.http_address + ") needs --token-file";
  }
  return {};
}

}  // namespace

bool IsSetting(const std::string& name) { return FindSetting(name) != nullptr; }

std::string TakeSetting(const SettingText& setting, DaemonOptions& options) {
  const std::string fault = FindSetting(setting.first)->take(setting.second, options);
  if (fault.empty()) return {};
  const bool value_missing = fault.rfind("needs ", 0) == 0;
  return "--" + setting.first + (value_missing ? " " : " " + setting.second + ": ") + fault;
}

CommandLine ParseCommandLine(int argc, char** argv) {
  const std::vector<option> flags = Flags();
  CommandLine line;
  opterr = 0;
  int flag = 0;
  while ((flag = getopt_long(argc, argv, ":", flags.data(), nullptr)) != -1) {
    const std::string given = argv[optind - 1];
    if (flag == ':') return WrongUsage(given + " needs a value");
    if (flag == '?') return WrongUsage("unknown option " + given);
    TakeFlag(flag, optarg == nullptr ? "" : optarg, line);
    using Action = CommandLine::Action;
    if (line.action == Action::kHelp || line.action == Action::kVersion) return line;
  }
  if (optind < argc) return WrongUsage(std::string("unexpected argument ") + argv[optind]);
  return line;
}

std::string LoadOptions(const CommandLine& command_line, DaemonOptions& options) {
  DaemonOptions loaded;
  if (!command_line.config_path.empty()) {
    std::string fault = ApplyConfigFile(command_line.config_path, loaded);
    if (!fault.empty()) return fault;
  }
  for (const SettingText& setting : command_line.settings) {
    if (std::string fault = TakeSetting(setting, loaded); !fault.empty()) return fault;
  }
  if (std::string fault = Inconsistent(loaded); !fault.empty()) return fault;
  options = std::move(loaded);
  return {};
}

const char* DaemonHelp() {
  return R"(viewfixd: tells where a camera is, one JSON line a frame.

  viewfixd --model FILE | --store DIR --camera v4l2:DEVICE|libcamera:NAME|replay:PATH [OPTIONS]
  viewfixd --config FILE [OPTIONS]
  viewfixd cameras                   the cameras of this machine, what they can do
  viewfixd store --help              the folder of models that `viewfix flash` fills

  --model FILE         the model that `viewfix train` made; a new one is picked up as it comes
  --store DIR          the folder of models that `viewfix flash` and `viewfixd store` fill: starts
                       from the current one, and goes over to the next while it runs
  --trust DIR          whose models are taken from it (default /etc/viewfix/trust)
  --camera v4l2:DEVICE /dev/video0, a name in /dev/v4l/by-id, or part of the camera's own name;
                       it may be unplugged and come back
  --camera libcamera:NAME
                       the same by libcamera (where this build has it), for sensors that need its
                       pipelines: part of the id or of the model, as `viewfixd cameras` shows them
  --camera replay:PATH the *.jpg of a folder in name order, or, where the folder holds
                       images.csv, the files of its path column in row order; or a list of images,
                       a .txt of one path a line; or a video (needs ffmpeg)
  --calibration FILE   of the camera, in OpenCV's or ROS's YAML, for frames as they are after
                       --rotate; default: the camera that the site was photographed with
  --publish LIST       where fixes go, with commas: stdout (the default), unix:PATH (any number of
                       readers), http:PORT or http:ADDRESS:PORT, mqtt://HOST/TOPIC or
                       mqtts://HOST/TOPIC (where this build has it), none; see README
  --rotate DEG         turn frames clockwise first: 0, 90, 180 or 270
  --window N           adjust the poses of the last N frames together, 3 to 8, for a camera that
                       moves steadily in a map in metres; 0: each frame alone (the default)
  --filter on|off      on (the default): frames that agree with those before them gain confidence,
                       those that contradict them lose it, and their answer where it becomes too
                       small; off: each frame is judged alone
  --max-fps N          localize at most N frames a second; 0: as many as possible (the default)
  --idle-fps N         the same while nothing moves in the picture; 0: no slower (the default)

Live cameras take the nearest that they have, and say what it is:
  --size WxH           default 640x480
  --rate N             frames a second; 0: the camera's own (the default)
  --pixel-format FOUR  as `viewfixd cameras` shows it: GREY, YUYV, MJPG...; default: the best there is
  --control NAME=N     exposure, gain, focus...: set and kept; may be repeated

A replay takes every frame, however long it takes, unless:
  --real-time on       frames come at --rate (10), and those there is no time for are lost
  --loop on            begin again at its end

HTTP:
  --token-file FILE    whose first line a client must know; needed beyond this machine
  --frame-picture on   serve the last frame as /frame.jpg, its features drawn, those that speak for
                       the fix in green; off by default, for privacy

MQTT:
  --mqtt-user NAME, --mqtt-password-file FILE, --mqtt-ca-file FILE

  --config FILE        a TOML file; keys are the options above with _ for -. Options win
  --check-config       read the configuration, say what is wrong with it, and end
  --help, --version    print and end

Signals: SIGHUP reads configuration and model again; SIGTERM and SIGINT end it.
Exit codes: 0 done, or ended by a signal; 1 failed, with one line on stderr; 2 wrong usage or
configuration.

Example: viewfixd --model site.vfx --camera replay:walk/ > fixes.jsonl
)";
}

}  // namespace viewfix
