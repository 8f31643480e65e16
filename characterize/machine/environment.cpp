#include "characterize/machine/environment.h"

#include <features.h>
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <sqlite3.h>
#ifdef __GLIBC__
#include <gnu/libc-version.h>
#endif

#include <algorithm>
#include <array>
#include <fstream>
#include <optional>
#include <utility>
#include <vector>

#include "characterize/machine/build_info.h"
#include "characterize/machine/inherited.h"
#include "characterize/machine/system_files.h"
#include "workloads/base/system/caches.h"
#include "workloads/base/text/text.h"

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
  const auto found = read_turbo(root);
  return found ? std::optional(found->on ? "on" : "off") : std::nullopt;
}

std::optional<std::string> steal_percent(const std::filesystem::path& root) {
  const HostCounters counters = read_host_counters({}, root);
  if (!counters.steal || counters.total <= Nanos(0)) return std::nullopt;
  return fmt::format("{:.2f}", 100 * to_s(*counters.steal) / to_s(*counters.total));
}

std::optional<std::string> temperature(const std::filesystem::path& root) {
  std::optional<double> hottest;
  std::error_code failed;
  for (const auto& zone : std::filesystem::directory_iterator(root / "sys/class/thermal", failed)) {
    // On Jetson boards, the power chip's is a constant 100 degrees; what is off says -256.
    if (first_line(zone.path() / "type").value_or("").starts_with("PMIC")) continue;
    std::ifstream in(zone.path() / "temp");
    double millidegrees = 0;
    if (in >> millidegrees && millidegrees > -50'000 && millidegrees < 200'000)
      hottest = std::max(hottest.value_or(millidegrees), millidegrees);
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

std::optional<std::string> megabytes(std::optional<std::int64_t> kib) {
  return kib ? std::optional(std::to_string(*kib / 1024)) : std::nullopt;
}

std::optional<std::string> swap_used_mb(const std::filesystem::path& root) {
  const auto total = number_of(root / "proc/meminfo", "SwapTotal", ':');
  const auto free = number_of(root / "proc/meminfo", "SwapFree", ':');
  return total && free ? megabytes(*total - *free) : std::nullopt;
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

std::optional<std::string> smt(const std::filesystem::path& root) {
  const auto active = first_line(root / "sys/devices/system/cpu/smt/active");
  if (!active) return std::nullopt;
  return *active == "1" ? "on" : "off";
}

/// "performance", or where cores differ "performance (0,1), powersave (2,3)".
std::optional<std::string> of_all_cores(const std::filesystem::path& root, const char* file) {
  const auto folder = root / "sys/devices/system/cpu";
  std::map<std::string, std::vector<int>> cores;
  for (const int core : numbered_folders(folder, "cpu")) {
    const auto value = first_line(folder / ("cpu" + std::to_string(core)) / "cpufreq" / file);
    if (value && !value->empty()) cores[*value].push_back(core);
  }
  if (cores.empty()) return std::nullopt;
  if (cores.size() == 1) return cores.begin()->first;
  std::vector<std::string> parts;
  for (const auto& [value, list] : cores) {
    parts.push_back(fmt::format("{} ({})", value, fmt::join(list, ",")));
  }
  return join(parts, ", ");
}

/// The governors' upper limit, which is below what the hardware could do where somebody lowered it.
std::optional<std::string> max_mhz(const std::filesystem::path& root) {
  const auto folder = root / "sys/devices/system/cpu";
  std::optional<std::int64_t> fastest;
  for (const int core : numbered_folders(folder, "cpu")) {
    const auto cpufreq = folder / ("cpu" + std::to_string(core)) / "cpufreq";
    if (const auto khz = read_number(cpufreq / "scaling_max_freq")) {
      fastest = std::max(fastest.value_or(0), *khz);
    }
  }
  return fastest ? std::optional(std::to_string(*fastest / 1000)) : std::nullopt;
}

/// The word in brackets of "always [madvise] never".
std::optional<std::string> huge_pages(const std::filesystem::path& root) {
  const auto line = first_line(root / "sys/kernel/mm/transparent_hugepage/enabled");
  if (!line) return std::nullopt;
  const auto from = line->find('[');
  const auto to = line->find(']');
  if (from == std::string::npos || to == std::string::npos || to < from) return std::nullopt;
  return line->substr(from + 1, to - from - 1);
}

std::optional<std::string> machine(const std::filesystem::path& root) {
  if (auto board = first_line(root / "proc/device-tree/model")) return board;
  const auto dmi = root / "sys/class/dmi/id";
  const auto vendor = first_line(dmi / "sys_vendor");
  const auto product = first_line(dmi / "product_name");
  if (!vendor && !product) return std::nullopt;
  return trimmed(vendor.value_or("") + " " + product.value_or(""));
}

std::optional<std::string> kilobytes(std::optional<std::int64_t> bytes) {
  return bytes ? std::optional(std::to_string(*bytes / 1024)) : std::nullopt;
}

/// How many cores' time the process' control group may use: "1.50", or "none" without a limit.
std::optional<std::string> cpu_quota(const std::filesystem::path& root) {
  const auto cores = read_cpu_quota(root);
  if (!cores) return std::nullopt;
  return *cores == 0 ? "none" : fmt::format("{:.2f}", *cores);
}

}  // namespace

std::optional<Turbo> read_turbo(const std::filesystem::path& root) {
  for (const auto& [file, off] : {std::pair("sys/devices/system/cpu/intel_pstate/no_turbo", "1"),
                                  {"sys/devices/system/cpu/cpufreq/boost", "0"}}) {
    const auto is = first_line(root / file);
    if (is) return Turbo{*is != off, fmt::format("echo {} | sudo tee /{}", off, file)};
  }
  return std::nullopt;
}

Environment host_environment(const std::filesystem::path& root) {
  const auto cpuinfo = root / "proc/cpuinfo";
  const auto meminfo = root / "proc/meminfo";
  const std::string no_cpufreq = "no cpufreq in /sys (a virtual machine, or a fixed clock)";
  const CacheSizes caches = read_cache_sizes(0, root);
  Environment facts;
  put(facts, "machine", machine(root), "neither a device tree nor DMI names it");
  put(facts, "cpu_model",
      first_known(value_of(cpuinfo, "model name", ':'), value_of(cpuinfo, "Model", ':'),
                  first_line(root / "proc/device-tree/model")),
      "/proc/cpuinfo and the device tree name no model");
  put(facts, "cpu_flags", cpu_flags(root), "/proc/cpuinfo lists none");
  put(facts, "cores_online", core_count(root), "/proc/cpuinfo lists no processor");
  put(facts, "smt", smt(root), "the kernel does not control it (no cpu/smt in /sys)");
  put(facts, "l2_cache_kb", kilobytes(caches.l2_bytes), "/sys lists no cache of level 2");
  put(facts, "last_cache_kb", kilobytes(caches.last_bytes), "/sys lists no cache of level 2 or 3");
  put(facts, "memory_mb", megabytes(number_of(meminfo, "MemTotal", ':')),
      "/proc/meminfo does not say");
  put(facts, "swap_used_mb", swap_used_mb(root), "/proc/meminfo does not say");
  put(facts, "os", value_of(root / "etc/os-release", "PRETTY_NAME", '='), "no /etc/os-release");
  put(facts, "kernel", first_line(root / "proc/sys/kernel/osrelease"), "/proc does not say");
  put(facts, "governor", of_all_cores(root, "scaling_governor"), no_cpufreq);
  put(facts, "energy_preference", of_all_cores(root, "energy_performance_preference"),
      "the cpufreq driver has none");
  put(facts, "cpufreq_driver", of_all_cores(root, "scaling_driver"), no_cpufreq);
  put(facts, "cpu_max_mhz", max_mhz(root), no_cpufreq);
  put(facts, "turbo", turbo(root), "neither intel_pstate nor cpufreq/boost in /sys");
  put(facts, "huge_pages", huge_pages(root), "no transparent_hugepage in /sys");
  put(facts, "clock_source",
      first_line(root / "sys/devices/system/clocksource/clocksource0/current_clocksource"),
      "no clocksource in /sys");
  put(facts, "cpu_quota", cpu_quota(root), "no control group for processor time in /sys");
  put(facts, "load_1m", load_1m(root), "no /proc/loadavg");
  put(facts, "steal_percent", steal_percent(root), "/proc/stat does not count it");
  put(facts, "temperature_c", temperature(root), "no readable zone in /sys/class/thermal");
  put(facts, "hypervisor", hypervisor(root), "/proc/cpuinfo has no flags line");
  facts.merge(power_modes(root));
  return facts;
}

Environment end_environment(const HostCounters& before, const HostCounters& after,
                            const std::filesystem::path& root) {
  Environment facts;
  put(facts, "end.load_1m", load_1m(root), "no /proc/loadavg");
  put(facts, "end.temperature_c", temperature(root), "no readable zone in /sys/class/thermal");
  std::optional<std::string> steal;
  if (before.steal && after.steal && before.total && after.total && *after.total > *before.total) {
    const double share = to_s(*after.steal - *before.steal) / to_s(*after.total - *before.total);
    steal = fmt::format("{:.2f}", 100 * share);
  }
  put(facts, "run.steal_percent", steal, "/proc/stat does not count it");
  std::optional<std::string> waited;
  if (before.quota_wait && after.quota_wait) {
    waited = fmt::format("{:.0f}", to_ms(*after.quota_wait - *before.quota_wait));
  }
  put(facts, "run.quota_wait_ms", waited, "no control group counts throttled time");
  std::optional<std::string> heat;
  if (before.heat_events && after.heat_events) {
    heat = std::to_string(*after.heat_events - *before.heat_events);
  }
  put(facts, "run.heat_events", heat,
      "neither thermal_throttle nor cooling devices' stats in /sys");
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
  put(facts, "compiler_flags", trimmed(build.compiler_flags), "the compiler's defaults");
  put(facts, "build_type", std::string(build.build_type), "none was chosen");
  facts["sanitizers"] = build.sanitizers.empty() ? "none" : std::string(build.sanitizers);
  const std::string no_git = "not built from a git checkout with a commit";
  put(facts, "git_commit", std::string(build.git_commit), no_git);
  const bool known = !build.git_commit.empty();
  put(facts, "git_dirty",
      known ? std::optional<std::string>(build.git_dirty ? "yes" : "no") : std::nullopt, no_git);
  facts["sqlite_version"] = sqlite3_libversion();
#ifdef __GLIBC__
  facts["libc_version"] = std::string("glibc ") + gnu_get_libc_version();
#else
  facts["libc_version_unknown"] = "not the GNU C library";
#endif
  return facts;
}

}  // namespace pirt
