// Machines as their kernels describe them, written below a folder: what probes are tested on.
#pragma once

#include <filesystem>
#include <fstream>
#include <string>

namespace pirt::test {

/// A folder that stands for the root of a machine's file system.
class RecordedMachine {
 public:
  explicit RecordedMachine(std::filesystem::path root) : root_(std::move(root)) {}

  RecordedMachine& put(const std::string& path, const std::string& text) {
    std::filesystem::create_directories((root_ / path).parent_path());
    std::ofstream(root_ / path, std::ios::binary) << text;
    return *this;
  }
  RecordedMachine& core(int number, const std::string& file, const std::string& text) {
    return put("sys/devices/system/cpu/cpu" + std::to_string(number) + "/" + file, text);
  }
  [[nodiscard]] const std::filesystem::path& root() const { return root_; }

 private:
  std::filesystem::path root_;
};

/// An ARM board set up for measuring: nothing to complain about.
inline RecordedMachine healthy_board(const std::filesystem::path& root) {
  RecordedMachine m(root);
  m.put("proc/cpuinfo", "processor\t: 0\nFeatures\t: asimd\n\nprocessor\t: 1\nFeatures\t: asimd\n");
  m.put("proc/device-tree/model", "Test Board");
  m.put("proc/stat",
        "cpu  100 0 100 9800 0 0 0 0 0 0\ncpu0 50 0 50 4900 0 0 0 0 0 0\n"
        "cpu1 50 0 50 4900 0 0 0 0 0 0\n");
  m.put("proc/loadavg", "0.01 0.02 0.00 1/100 1234\n");
  m.put("proc/meminfo",
        "MemTotal: 8000000 kB\nMemAvailable: 7000000 kB\nSwapTotal: 0 kB\nSwapFree: 0 kB\n");
  m.put("proc/vmstat", "pswpin 0\npswpout 0\n");
  m.put("proc/pressure/memory", "some avg10=0.00 avg60=0.00 avg300=0.00 total=0\n");
  m.put("proc/self/cgroup", "0::/\n");
  m.put("sys/fs/cgroup/cpu.max", "max 100000\n");
  m.put("sys/fs/cgroup/cpu.stat", "usage_usec 1\nthrottled_usec 0\n");
  m.put("sys/devices/system/cpu/smt/active", "0\n");
  m.put("sys/devices/system/cpu/cpufreq/boost", "0\n");
  for (const int core : {0, 1}) {
    m.core(core, "cpufreq/scaling_governor", "performance\n");
    m.core(core, "cpufreq/scaling_max_freq", "1500000\n");
    m.core(core, "cpufreq/cpuinfo_max_freq", "1500000\n");
    m.core(core, "thermal_throttle/core_throttle_count", "0\n");
  }
  m.put("sys/class/thermal/thermal_zone0/temp", "45000\n");
  m.put("sys/devices/system/clocksource/clocksource0/current_clocksource", "arch_sys_counter\n");
  m.put("sys/devices/system/clocksource/clocksource0/available_clocksource", "arch_sys_counter\n");
  m.put("sys/class/powercap/intel-rapl:0/name", "package-0\n");
  m.put("sys/class/powercap/intel-rapl:0/energy_uj", "1\n");
  return m;
}

/// A laptop as it comes: powersave, turbo, siblings, on battery, warm, swap in use, RAPL for root.
inline RecordedMachine laptop(const std::filesystem::path& root) {
  RecordedMachine m = healthy_board(root);
  for (const int core : {0, 1}) {
    m.core(core, "cpufreq/scaling_governor", "powersave\n");
    m.core(core, "cpufreq/scaling_max_freq", "1200000\n");
    m.core(core, "topology/thread_siblings_list", "0-1\n");
  }
  std::filesystem::remove(root / "sys/devices/system/cpu/cpufreq/boost");
  m.put("sys/devices/system/cpu/intel_pstate/no_turbo", "0\n");
  m.put("sys/devices/system/cpu/smt/active", "1\n");
  m.put("sys/class/power_supply/AC/type", "Mains\n");
  m.put("sys/class/power_supply/AC/online", "0\n");
  m.put("sys/class/thermal/thermal_zone0/temp", "91000\n");
  m.put("proc/meminfo",
        "MemTotal: 8000000 kB\nMemAvailable: 500000 kB\nSwapTotal: 2048000 kB\nSwapFree: 1024000 "
        "kB\n");
  m.put("sys/devices/system/clocksource/clocksource0/current_clocksource", "hpet\n");
  m.put("sys/devices/system/clocksource/clocksource0/available_clocksource", "hpet tsc acpi_pm\n");
  return m;
}

/// A virtual machine with neighbours: 5 % of its time was stolen; it sees no clock and no sensors.
inline RecordedMachine stolen_from_vm(const std::filesystem::path& root) {
  RecordedMachine m(root);
  m.put("proc/cpuinfo",
        "processor\t: 0\nflags\t: avx2 hypervisor\n\nprocessor\t: 1\nflags\t: avx2\n");
  m.put("proc/stat",
        "cpu  1000 0 0 8500 0 0 0 500 0 0\ncpu0 500 0 0 4250 0 0 0 250 0 0\n"
        "cpu1 500 0 0 4250 0 0 0 250 0 0\n");
  m.put("proc/loadavg", "0.10 0.02 0.00 1/100 1234\n");
  m.put("proc/meminfo",
        "MemTotal: 8000000 kB\nMemAvailable: 7000000 kB\nSwapTotal: 0 kB\nSwapFree: 0 kB\n");
  m.put("sys/devices/system/clocksource/clocksource0/current_clocksource", "kvm-clock\n");
  return m;
}

/// A container on the healthy board that may use one and a half of its two cores.
inline RecordedMachine throttled_container(const std::filesystem::path& root) {
  RecordedMachine m = healthy_board(root);
  m.put("sys/fs/cgroup/cpu.max", "150000 100000\n");
  m.put("sys/fs/cgroup/cpu.stat", "usage_usec 1\nnr_throttled 7\nthrottled_usec 70000\n");
  return m;
}

}  // namespace pirt::test
