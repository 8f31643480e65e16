#include <fmt/format.h>
#include <fmt/ranges.h>
#include <unistd.h>

#include <algorithm>
#include <map>
#include <utility>

#include "characterize/doctor/doctor_checks.h"
#include "characterize/machine/system_files.h"
#include "workloads/base/system/control_groups.h"
#include "workloads/base/system/cores.h"
#include "workloads/base/text/text.h"

namespace pirt::doctor {
namespace {

constexpr double kLoadShare = 0.05;   // as host_load.h counts a sample as contended
constexpr double kStealShare = 0.01;  // what an interval of +/- 2 % should not have to swallow
constexpr double kJitter = 0.05;      // what 20 processes a cell average to about 2 %
constexpr std::size_t kFewestPieces = 20;
constexpr const char* kRecorded = "a recorded machine: there are no two moments to compare";

std::optional<double> share(const std::optional<Nanos>& part_before,
                            const std::optional<Nanos>& part_after,
                            const std::optional<Nanos>& all_before,
                            const std::optional<Nanos>& all_after) {
  if (!part_before || !part_after || !all_before || !all_after) return std::nullopt;
  const double all = to_s(*all_after - *all_before);
  if (all <= 0) return std::nullopt;
  return std::clamp(to_s(*part_after - *part_before) / all, 0.0, 1.0);
}

/// "0,1 (1593 MHz, capacity 572) and 2,3 (2150 MHz, capacity 1024)"; empty where all are alike, but
/// for what makers allow single cores of one kind.
std::string kinds_of_cores(const DoctorInput& input) {
  constexpr double kAlike = 0.85;
  std::map<std::pair<std::int64_t, std::int64_t>, std::vector<int>> kinds;  // capacity, kHz
  for (const int core : input.cores) {
    const auto folder = input.root / fmt::format("sys/devices/system/cpu/cpu{}", core);
    kinds[{read_number(folder / "cpu_capacity").value_or(0),
           read_number(folder / "cpufreq/cpuinfo_max_freq").value_or(0)}]
        .push_back(core);
  }
  if (kinds.empty()) return "";
  const auto& [least, slow] = *kinds.begin();
  const auto& [most, fast] = *kinds.rbegin();
  const auto differ = [](std::int64_t low, std::int64_t high) {
    return static_cast<double>(low) < kAlike * static_cast<double>(high);
  };
  if (!differ(least.first, most.first) && !differ(least.second, most.second)) return "";
  std::vector<std::string> parts;
  for (const auto& [kind, cores] : kinds) {
    parts.push_back(fmt::format("{} ({} MHz{})", fmt::join(cores, ","), kind.second / 1000,
                                kind.first > 0 ? fmt::format(", capacity {}", kind.first) : ""));
  }
  return join(parts, " and ");
}

}  // namespace

Findings cores(const DoctorInput& input) {
  const auto online = ::sysconf(_SC_NPROCESSORS_ONLN);
  const bool fewer = input.inherited && std::cmp_less(input.cores.size(), online);
  const std::string found = fmt::format(
      "{}{} usable", input.cores.size(),
      fewer ? fmt::format(" of {} (taskset, a launcher or a control group)", online) : "");
  const std::string kinds = kinds_of_cores(input);
  if (!kinds.empty()) {
    return {{"cores", Level::kNote, fmt::format("{}, of different kinds: {}", found, kinds),
             "units on cores of one kind and of another are not alike, whatever they compute with",
             "measure on those of one kind: taskset -c CORES pirt ..."}};
  }
  if (input.cores.size() >= 2) return {good("cores", found)};
  return {{"cores", Level::kNote, found, "the units of platform host share one core",
           "give the machine or container more cores (taskset -p $$ shows what the shell may use), "
           "or measure with --platform host-cpu"}};
}

Findings siblings(const DoctorInput& input) {
  const auto active = first_line(input.root / "sys/devices/system/cpu/smt/active");
  if (!active) return {unknown("siblings", "the kernel does not say (no cpu/smt in /sys)")};
  if (*active != "1") return {good("siblings", "no two usable cores share a physical one")};
  const std::string off = "echo off | sudo tee /sys/devices/system/cpu/smt/control";
  for (const auto& a : input.units.value_or(std::vector<UnitProbe>{})) {
    for (const int core : a.cores) {
      const auto mates = core_siblings(input.root, core);
      for (const auto& b : *input.units) {
        const auto shared = std::ranges::find_if(b.cores, [&](int c) { return mates.contains(c); });
        if (b.unit <= a.unit || shared == b.cores.end()) continue;
        return {{"siblings", Level::kSpoils,
                 fmt::format("core {} of {} and core {} of {} are one physical core", core, a.unit,
                             *shared, b.unit),
                 "a unit's figure would not hold while the other computes", off}};
      }
    }
  }
  return {{"siblings", Level::kNote, "simultaneous multithreading is on",
           "other programs on a sibling take half a core unseen", off}};
}

Findings load(const DoctorInput& input) {
  const auto load_1m = first_line(input.root / "proc/loadavg");
  const std::string average =
      load_1m ? fmt::format("load average {}", split(*load_1m, ' ').front()) : "no load average";
  if (!input.after) return {unknown("load", fmt::format("{}; {}", average, kRecorded))};
  const HostCounters& before = input.before.host;
  const HostCounters& after = input.after->host;
  if (!before.busy || !after.busy || !before.total || !after.total ||
      *after.total <= *before.total) {
    return {unknown("load", "/proc/stat does not count processor time")};
  }
  Nanos others = (*after.busy - *before.busy) - (after.own - before.own);
  if (before.steal && after.steal) others -= *after.steal - *before.steal;  // a check of its own
  const double part = std::clamp(to_s(others) / to_s(*after.total - *before.total), 0.0, 1.0);
  const std::string found =
      fmt::format("other programs take {:.0f} % of the cores' time, {}", 100 * part, average);
  if (part <= kLoadShare) return {good("load", found)};
  return {
      {"load", Level::kSpoils, found, "calls wait for a core",
       "stop them (ps -eo pcpu,pid,comm --sort=-pcpu | head shows which), or keep them off with "
       "taskset"}};
}

Findings steal(const DoctorInput& input) {
  const HostCounters& before = input.before.host;
  const std::string remedy =
      "nothing inside the machine helps; measure on a dedicated instance, or at another hour";
  const auto judge = [&](double part, const std::string& when) -> Findings {
    const std::string found = fmt::format("{:.1f} % {}", 100 * part, when);
    if (part <= kStealShare) return {good("steal", found)};
    return {{"steal", Level::kSpoils, found, "the hypervisor gives the cores to others meanwhile",
             remedy}};
  };
  if (input.after) {
    const HostCounters& after = input.after->host;
    const auto now = share(before.steal, after.steal, before.total, after.total);
    if (now) return judge(*now, "while doctor looked");
  }
  const auto since = share(Nanos(0), before.steal, Nanos(0), before.total);
  if (!since) return {unknown("steal", "/proc/stat does not count it")};
  return judge(*since, "since the machine started");
}

Findings jitter(const DoctorInput& input) {
  if (!input.jitter) return {unknown("jitter", "a recorded machine: nothing is computed")};
  double worst = 0;
  bool brief = false;
  std::vector<std::string> uneven;
  const auto judge = [&](const std::string& what, std::span<const Nanos> pieces) {
    brief = brief || pieces.size() < kFewestPieces;
    if (pieces.empty()) return;
    const JitterRange range = range_of(pieces);
    worst = std::max(worst, range.spread());
    if (range.spread() <= kJitter) return;
    uneven.push_back(
        fmt::format("{} takes {:.2f} to {:.2f} times its median", what, range.low, range.high));
  };
  for (const CoreJitter& core : input.jitter->cores) {
    judge(fmt::format("the same arithmetic on core {}", core.core), core.pieces);
  }
  judge("reading memory", input.jitter->reading);
  if (brief) return {unknown("jitter", "looked too briefly to tell; try --seconds 1")};
  if (uneven.empty()) {
    return {good(
        "jitter",
        fmt::format("the same arithmetic, and reading memory, take the same time within {:.1f} %",
                    100 * worst))};
  }
  return {
      {"jitter", Level::kSpoils, join(uneven, "; "),
       "what is not shown here shares the cores, their caches or the memory (another virtual "
       "machine, a sibling thread), or their clock changes; processes differ as much",
       "nothing inside the machine helps against neighbours: measure on a dedicated instance, or "
       "at another hour (pirt doctor --seconds 60 looks for longer); otherwise give more time "
       "(--max-time 30min), and go by the intervals"}};
}

Findings quota(const DoctorInput& input) {
  const auto limit = read_cpu_quota(input.root);
  if (!limit) return {unknown("quota", "no control group for processor time in /sys")};
  const std::string remedy =
      "start the container without --cpus (docker update --cpus 0 CONTAINER), or: sudo systemctl "
      "set-property UNIT CPUQuota=";
  if (input.after && input.before.host.quota_wait && input.after->host.quota_wait) {
    const Nanos waited = *input.after->host.quota_wait - *input.before.host.quota_wait;
    if (waited.count() > 0) {
      return {{"quota", Level::kSpoils,
               fmt::format("the control group was held back for {:.0f} ms while doctor looked",
                           to_ms(waited)),
               "calls stop until the group's next period", remedy}};
    }
  }
  if (*limit == 0) return {good("quota", "no limit on processor time")};
  const std::string found =
      fmt::format("{:.2f} cores' time for {} cores", *limit, input.cores.size());
  if (*limit >= static_cast<double>(input.cores.size())) return {good("quota", found)};
  return {{"quota", Level::kSpoils, found,
           "a group that has used its share waits for its next period", remedy}};
}

Findings memory(const DoctorInput& input) {
  // The largest worker, which measures the AlexNet chain, takes 750 MiB.
  constexpr std::int64_t kEnoughKib = std::int64_t{1} << 20;
  auto available = number_of(input.root / "proc/meminfo", "MemAvailable", ':');
  const auto limit_bytes = memory_limit_bytes(input.root);
  const bool limited =
      limit_bytes && *limit_bytes / 1024 < available.value_or(*limit_bytes / 1024 + 1);
  if (limited) available = *limit_bytes / 1024;
  if (!available) return {unknown("memory", "/proc/meminfo does not say")};
  const std::string found = fmt::format("{} MB {}", *available / 1024,
                                        limited ? "are the control group's limit" : "available");
  if (input.after && input.before.memory_stall && input.after->memory_stall) {
    const Nanos stalled = *input.after->memory_stall - *input.before.memory_stall;
    if (stalled.count() > 0) {
      return {{"memory", Level::kSpoils,
               fmt::format("{}, programs waited {:.1f} ms for memory", found, to_ms(stalled)),
               "pages are taken back and read again while something is timed",
               "stop what uses memory (ps -eo rss,pid,comm --sort=-rss | head shows which)"}};
    }
  }
  if (*available >= kEnoughKib) return {good("memory", found)};
  return {
      {"memory", Level::kSpoils, found, "a worker needs up to 750 MB",
       limited
           ? "give the container more (docker run -m 2g), or leave large workloads out with "
             "--filter"
           : "stop what uses memory (ps -eo rss,pid,comm --sort=-rss | head shows which), or leave "
             "large workloads out with --filter"}};
}

Findings swapping(const DoctorInput& input) {
  const auto total = number_of(input.root / "proc/meminfo", "SwapTotal", ':');
  if (!total) return {unknown("swap", "/proc/meminfo does not say")};
  const std::string remedy = "sudo swapoff -a";
  if (input.after && input.before.swapped_pages && input.after->swapped_pages) {
    const auto pages = *input.after->swapped_pages - *input.before.swapped_pages;
    if (pages > 0) {
      return {{"swap", Level::kSpoils, fmt::format("{} pages moved while doctor looked", pages),
               "calls wait for the disk", remedy}};
    }
  }
  if (*total == 0) return {good("swap", "off")};
  const auto free = number_of(input.root / "proc/meminfo", "SwapFree", ':');
  const std::int64_t used = *total - free.value_or(*total);
  if (used == 0) return {good("swap", "on, nothing in it")};
  return {{"swap", Level::kNote, fmt::format("{} MB are in it", used / 1024),
           "pages may come back while something is timed", remedy}};
}

}  // namespace pirt::doctor
