#include "characterize/environment.h"

#include <fmt/format.h>
#include <sqlite3.h>

#include <algorithm>
#include <array>
#include <fstream>
#include <optional>
#include <sstream>
#include <vector>

#include "characterize/build_info.h"
#include "workloads/base/text.h"

namespace pirt {
namespace {

/// Either the fact or why it is not known.
void put(Environment& facts, const std::string& key, const std::optional<std::string>& value,
         const std::string& why_unknown) {
  if (value && !value->empty()) {
    facts[key] = *value;
  } else {
    facts[key + "_unknown"] = why_unknown;
  }
}

std::optional<std::string> first_line(const std::filesystem::path& path) {
  std::ifstream in(path);
  std::string line;
  if (!std::getline(in, line)) return std::nullopt;
  while (!line.empty() && (line.back() == '\0' || line.back() == ' ')) line.pop_back();
  return line;
}

std::string trimmed(std::string text) {
  const auto is_space = [](char c) { return c == ' ' || c == '\t' || c == '"'; };
  while (!text.empty() && is_space(text.back())) text.pop_back();
  while (!text.empty() && is_space(text.front())) text.erase(0, 1);
  return text;
}

/// The value of the first line "key <separator> value" of a file.
std::optional<std::string> value_of(const std::filesystem::path& path, const std::string& key,
                                    char separator) {
  std::ifstream in(path);
  std::string line;
  while (std::getline(in, line)) {
    const auto at = line.find(separator);
    if (at != std::string::npos && trimmed(line.substr(0, at)) == key) {
      return trimmed(line.substr(at + 1));
    }
  }
  return std::nullopt;
}

template <typename... Rest>
std::optional<std::string> first_known(std::optional<std::string> first, Rest... rest) {
  if constexpr (sizeof...(rest) == 0) {
    return first;
  } else {
    return first ? first : first_known(rest...);
  }
}

std::optional<std::string> cpu_flags(const std::filesystem::path& root) {
  const auto cpuinfo = root / "proc/cpuinfo";
  const auto all = first_known(value_of(cpuinfo, "flags", ':'), value_of(cpuinfo, "Features", ':'));
  if (!all) return std::nullopt;
  constexpr std::array<std::string_view, 18> kTelling = {
      "sse4_2",   "avx",         "f16c",     "fma",      "avx2", "avx512f",
      "avx512bw", "avx512_vnni", "avx_vnni", "amx_tile", "neon", "asimd",
      "asimdhp",  "asimddp",     "sve",      "sve2",     "i8mm", "bf16"};
  std::vector<std::string> found;
  for (const auto& flag : split(*all, ' ')) {
    if (std::ranges::find(kTelling, flag) != kTelling.end()) found.push_back(flag);
  }
  return found.empty() ? std::optional<std::string>("none of note") : join(found, " ");
}

std::optional<std::string> turbo(const std::filesystem::path& root) {
  const auto cpu = root / "sys/devices/system/cpu";
  if (const auto off = first_line(cpu / "intel_pstate/no_turbo")) return *off == "0" ? "on" : "off";
  if (const auto on = first_line(cpu / "cpufreq/boost")) return *on == "1" ? "on" : "off";
  return std::nullopt;
}

std::optional<std::string> steal_percent(const std::filesystem::path& root) {
  std::ifstream in(root / "proc/stat");
  std::string name;
  in >> name;
  double total = 0;
  double steal = 0;
  for (int i = 0; i < 8; ++i) {
    double value = 0;
    if (!(in >> value)) return std::nullopt;
    total += value;
    if (i == 7) steal = value;
  }
  if (total <= 0) return std::nullopt;
  return fmt::format("{:.2f}", 100 * steal / total);
}

std::optional<std::string> temperature(const std::filesystem::path& root) {
  std::optional<double> hottest;
  std::error_code failed;
  for (const auto& zone : std::filesystem::directory_iterator(root / "sys/class/thermal", failed)) {
    std::ifstream in(zone.path() / "temp");
    double millidegrees = 0;
    if (in >> millidegrees) hottest = std::max(hottest.value_or(millidegrees), millidegrees);
  }
  if (!hottest) return std::nullopt;
  return fmt::format("{:.1f}", *hottest / 1000);
}

std::optional<std::string> core_count(const std::filesystem::path& root) {
  std::ifstream in(root / "proc/cpuinfo");
  std::string line;
  int count = 0;
  while (std::getline(in, line)) count += line.starts_with("processor") ? 1 : 0;
  return count == 0 ? std::nullopt : std::optional(std::to_string(count));
}

std::optional<std::string> memory_mb(const std::filesystem::path& root) {
  const auto text = value_of(root / "proc/meminfo", "MemTotal", ':');
  std::istringstream in(text.value_or(""));
  std::int64_t kib = 0;
  if (!(in >> kib)) return std::nullopt;
  return std::to_string(kib / 1024);
}

std::optional<std::string> load_1m(const std::filesystem::path& root) {
  const auto line = first_line(root / "proc/loadavg");
  return line ? std::optional(split(*line, ' ').front()) : std::nullopt;
}

std::optional<std::string> hypervisor(const std::filesystem::path& root) {
  const auto flags = value_of(root / "proc/cpuinfo", "flags", ':');
  if (!flags) return std::nullopt;
  const auto words = split(*flags, ' ');
  return std::ranges::find(words, "hypervisor") != words.end() ? "yes" : "no";
}

}  // namespace

std::string_view to_string(FactKind kind) {
  return kind == FactKind::kIdentity ? "identity" : "information";
}

FactKind fact_kind(std::string_view key) {
  constexpr std::array<std::string_view, 8> kIdentity = {
      "cpu_model", "cpu_flags", "cores_usable",   "images_hash",
      "precision", "compiler",  "compiler_flags", "build_type"};
  constexpr std::string_view kUnknown = "_unknown";
  if (key.ends_with(kUnknown)) key.remove_suffix(kUnknown.size());
  const bool listed = std::ranges::find(kIdentity, key) != kIdentity.end();
  return listed || key.starts_with("unit.") ? FactKind::kIdentity : FactKind::kInformation;
}

Environment host_environment(const std::filesystem::path& root) {
  const auto cpuinfo = root / "proc/cpuinfo";
  Environment facts;
  put(facts, "cpu_model",
      first_known(value_of(cpuinfo, "model name", ':'), value_of(cpuinfo, "Model", ':'),
                  first_line(root / "proc/device-tree/model")),
      "/proc/cpuinfo and the device tree name no model");
  put(facts, "cpu_flags", cpu_flags(root), "/proc/cpuinfo lists none");
  put(facts, "cores_online", core_count(root), "/proc/cpuinfo lists no processor");
  put(facts, "memory_mb", memory_mb(root), "/proc/meminfo does not say");
  put(facts, "os", value_of(root / "etc/os-release", "PRETTY_NAME", '='), "no /etc/os-release");
  put(facts, "kernel", first_line(root / "proc/sys/kernel/osrelease"), "/proc does not say");
  put(facts, "governor", first_line(root / "sys/devices/system/cpu/cpu0/cpufreq/scaling_governor"),
      "no cpufreq in /sys (a virtual machine, or a fixed clock)");
  put(facts, "turbo", turbo(root), "neither intel_pstate nor cpufreq/boost in /sys");
  put(facts, "load_1m", load_1m(root), "no /proc/loadavg");
  put(facts, "steal_percent", steal_percent(root), "/proc/stat does not count it");
  put(facts, "temperature_c", temperature(root), "no readable zone in /sys/class/thermal");
  put(facts, "hypervisor", hypervisor(root), "/proc/cpuinfo has no flags line");
  return facts;
}

Environment build_environment() {
  const BuildInfo build = build_info();
  Environment facts;
  facts["pirt_version"] = build.version;
#ifdef __clang__
  facts["compiler"] = __VERSION__;
#else
  facts["compiler"] = "GCC " __VERSION__;
#endif
  put(facts, "compiler_flags", trimmed(std::string(build.compiler_flags)),
      "the compiler's defaults");
  put(facts, "build_type", std::string(build.build_type), "none was chosen");
  const std::string no_git = "not built from a git checkout with a commit";
  put(facts, "git_commit", std::string(build.git_commit), no_git);
  const bool known = !build.git_commit.empty();
  put(facts, "git_dirty",
      known ? std::optional<std::string>(build.git_dirty ? "yes" : "no") : std::nullopt, no_git);
  facts["sqlite_version"] = sqlite3_libversion();
  return facts;
}

}  // namespace pirt
