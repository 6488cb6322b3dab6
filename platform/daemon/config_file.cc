// SPDX-License-Identifier: BSD-3-Clause
#include "platform/daemon/config_file.h"

#include <algorithm>
#include <charconv>

#include "platform/file.h"

// Errors as values: the board side throws nothing.
#define TOML_EXCEPTIONS 0
#define TOML_ENABLE_FORMATTERS 0
// A file's bytes get as far as some of its assertions; behind each it says what is wrong. Without
// NDEBUG they are no hints for the optimizer either, as they are to clang.
#define TOML_ASSERT(condition) static_assert(true)
#pragma push_macro("NDEBUG")
#undef NDEBUG
#include <toml++/toml.h>
#pragma pop_macro("NDEBUG")

namespace viewfix {
namespace {

constexpr std::string_view kControls = "controls";

std::string At(unsigned line, const std::string& what) {
  return std::to_string(line) + ": " + what;
}

std::string FlagName(std::string_view key) {
  std::string name(key);
  std::replace(name.begin(), name.end(), '_', '-');
  return name;
}

std::string NumberText(double value) {
  char digits[32];
  return {digits, std::to_chars(digits, digits + sizeof digits, value).ptr};
}

// Empty and `ok` false: a kind of value that no setting has.
std::string TextOf(const toml::node& node, bool& ok) {
  ok = true;
  if (const auto* text = node.as_string()) return text->get();
  if (const auto* number = node.as_integer()) return std::to_string(number->get());
  if (const auto* number = node.as_floating_point()) return NumberText(number->get());
  if (const auto* flag = node.as_boolean()) return flag->get() ? "on" : "off";
  std::string list;
  const toml::array* array = node.as_array();
  ok = array != nullptr;
  for (std::size_t i = 0; ok && i < array->size(); ++i) {
    const auto* text = (*array)[i].as_string();
    ok = text != nullptr;
    if (ok) list.append(i == 0 ? "" : ",").append(text->get());
  }
  return list;
}

// The message without the toml library's own file name.
std::string Fault(const toml::parse_error& error) {
  std::string text(error.description());
  std::replace_if(
      text.begin(), text.end(), [](unsigned char c) { return c < 0x20; }, ' ');
  return At(error.source().begin.line, text);
}

std::string TakeControls(const toml::table& controls, std::vector<ConfigEntry>& entries) {
  for (const auto& [key, node] : controls) {
    const unsigned line = node.source().begin.line;
    const auto value = node.value<std::int64_t>();
    if (!value || node.is_string())
      return At(line, "control " + std::string(key) + ": not a whole number");
    entries.push_back({{"control", std::string(key) + "=" + std::to_string(*value)}, line});
  }
  return {};
}

}  // namespace

std::string ParseConfig(std::string_view toml, std::vector<ConfigEntry>& entries) {
  const toml::parse_result parsed = toml::parse(toml);
  if (!parsed) return Fault(parsed.error());
  for (const auto& [key, node] : parsed.table()) {
    const unsigned line = node.source().begin.line;
    if (key == kControls && node.is_table()) {
      if (std::string fault = TakeControls(*node.as_table(), entries); !fault.empty()) return fault;
      continue;
    }
    bool ok = false;
    std::string text = TextOf(node, ok);
    if (!ok) return At(line, std::string(key) + ": not a value of this setting");
    entries.push_back({{FlagName(key.str()), std::move(text)}, line});
  }
  std::stable_sort(entries.begin(), entries.end(),
                   [](const ConfigEntry& a, const ConfigEntry& b) { return a.line < b.line; });
  return {};
}

std::string ApplyConfigFile(const std::string& path, DaemonOptions& options) {
  const Result<std::vector<std::uint8_t>> bytes = ReadFile(path);
  if (!bytes.ok()) {
    return std::string(bytes.status().text()) + ": " + std::string(bytes.status().detail());
  }
  if (bytes->size() > kMaxConfigBytes) return path + ": too large for a configuration";
  std::vector<ConfigEntry> entries;
  std::string fault =
      ParseConfig({reinterpret_cast<const char*>(bytes->data()), bytes->size()}, entries);
  if (!fault.empty()) return path + ":" + fault;
  for (const ConfigEntry& entry : entries) {
    fault = IsSetting(entry.setting.first) ? TakeSetting(entry.setting, options)
                                           : "unknown setting " + entry.setting.first;
    if (!fault.empty()) return path + ":" + At(entry.line, fault);
  }
  return {};
}

}  // namespace viewfix
