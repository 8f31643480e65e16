#include "characterize/machine/environment.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "characterize/machine/answering.h"
#include "characterize/machine/environment_keys.h"
#include "characterize/machine/host_load.h"
#include "characterize/machine/inherited.h"
#include "tests/characterize/support.h"
#include "workloads/base/system/control_groups.h"

namespace pirt {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;
using test::TemporaryFolder;

void put(const TemporaryFolder& root, const std::string& path, const std::string& text) {
  std::filesystem::create_directories((root / path).parent_path());
  test::write_bytes(root / path, text);
}

TEST(Environment, ReadsAMachine) {
  const TemporaryFolder root;
  put(root, "proc/cpuinfo",
      "processor\t: 0\nmodel name\t: Test CPU @ 3 GHz\nflags\t\t: fpu avx2 fma sse hypervisor\n\n"
      "processor\t: 1\nmodel name\t: Test CPU @ 3 GHz\n");
  put(root, "proc/meminfo",
      "MemTotal:       2097152 kB\nSwapTotal:        20480 kB\nSwapFree:         10240 kB\n");
  put(root, "etc/os-release", "NAME=x\nPRETTY_NAME=\"Test OS 1\"\n");
  put(root, "proc/sys/kernel/osrelease", "6.1.0-test\n");
  const std::string cpu = "sys/devices/system/cpu/";
  put(root, cpu + "cpu0/cpufreq/scaling_governor", "performance\n");
  put(root, cpu + "cpu1/cpufreq/scaling_governor", "powersave\n");
  put(root, cpu + "cpu0/cpufreq/scaling_driver", "intel_pstate\n");
  put(root, cpu + "cpu0/cpufreq/energy_performance_preference", "balance_power\n");
  put(root, cpu + "cpu0/cpufreq/scaling_max_freq", "2400000\n");
  put(root, cpu + "cpu1/cpufreq/scaling_max_freq", "3600000\n");
  put(root, cpu + "intel_pstate/no_turbo", "1\n");
  put(root, cpu + "smt/active", "1\n");
  put(root, cpu + "cpu0/cache/index0/level", "1\n");
  put(root, cpu + "cpu0/cache/index0/size", "32K\n");
  put(root, cpu + "cpu0/cache/index1/level", "2\n");
  put(root, cpu + "cpu0/cache/index1/size", "512K\n");
  put(root, cpu + "cpu0/cache/index2/level", "3\n");
  put(root, cpu + "cpu0/cache/index2/size", "8M\n");
  put(root, "sys/kernel/mm/transparent_hugepage/enabled", "always [madvise] never\n");
  put(root, "sys/devices/system/clocksource/clocksource0/current_clocksource", "tsc\n");
  put(root, "sys/class/dmi/id/sys_vendor", "Maker\n");
  put(root, "sys/class/dmi/id/product_name", "Board 2\n");
  put(root, "proc/self/cgroup", "0::/jobs/one\n");
  put(root, "sys/fs/cgroup/jobs/one/cpu.max", "max 100000\n");
  put(root, "sys/fs/cgroup/jobs/cpu.max", "150000 100000\n");
  put(root, "proc/loadavg", "0.50 0.40 0.30 1/100 1234\n");
  put(root, "proc/stat", "cpu  50 0 20 100 20 0 0 10 0 0\n");  // 10 of 200
  put(root, "sys/class/thermal/thermal_zone0/temp", "45000\n");
  put(root, "sys/class/thermal/thermal_zone1/temp", "61500\n");
  const Environment expected = {{"machine", "Maker Board 2"},
                                {"cpu_model", "Test CPU @ 3 GHz"},
                                {"cpu_flags", "avx2 fma"},
                                {"cores_online", "2"},
                                {"smt", "on"},
                                {"l2_cache_kb", "512"},
                                {"last_cache_kb", "8192"},
                                {"memory_mb", "2048"},
                                {"swap_used_mb", "10"},
                                {"os", "Test OS 1"},
                                {"kernel", "6.1.0-test"},
                                {"governor", "performance (0), powersave (1)"},
                                {"energy_preference", "balance_power"},
                                {"cpufreq_driver", "intel_pstate"},
                                {"cpu_max_mhz", "3600"},
                                {"turbo", "off"},
                                {"huge_pages", "madvise"},
                                {"clock_source", "tsc"},
                                {"cpu_quota", "1.50"},
                                {"load_1m", "0.50"},
                                {"steal_percent", "5.00"},
                                {"temperature_c", "61.5"},
                                {"hypervisor", "yes"}};
  EXPECT_EQ(host_environment(root.path()), expected);
}

TEST(Environment, SaysWhyAFactIsNotKnown) {
  const TemporaryFolder root;
  const Environment facts = host_environment(root.path());
  ASSERT_GT(facts.size(), 20U);
  for (const auto& [key, value] : facts) {
    EXPECT_NE(without_unknown(key), key) << key << " is known of an empty machine: " << value;
    EXPECT_NE(value, "") << key;
  }
}

TEST(Environment, ReadsTheQuotaOfBothGenerationsOfControlGroups) {
  const TemporaryFolder v1;
  put(v1, "proc/self/cgroup", "4:memory:/m\n2:cpu,cpuacct:/box\n0::/\n");
  put(v1, "sys/fs/cgroup/cpu/box/cpu.cfs_quota_us", "50000\n");
  put(v1, "sys/fs/cgroup/cpu/box/cpu.cfs_period_us", "100000\n");
  put(v1, "sys/fs/cgroup/cpu/box/cpu.stat", "nr_periods 9\nnr_throttled 4\nthrottled_time 7000\n");
  EXPECT_EQ(read_cpu_quota(v1.path()), 0.5);
  EXPECT_EQ(read_host_counters({}, v1.path()).quota_wait, Nanos(7000));
  put(v1, "sys/fs/cgroup/cpu/box/cpu.cfs_quota_us", "-1\n");
  EXPECT_EQ(read_cpu_quota(v1.path()), 0.0);
  const TemporaryFolder container;  // sees its own group as the root of the tree
  put(container, "proc/self/cgroup", "0::/\n");
  put(container, "sys/fs/cgroup/cpu.max", "200000 100000\n");
  EXPECT_EQ(read_cpu_quota(container.path()), 2.0);
  const TemporaryFolder none;
  EXPECT_EQ(read_cpu_quota(none.path()), std::nullopt);
}

TEST(Environment, SeesThatAnInnerGroupIsHeldBackWhereAnOuterOneWasForLonger) {
  const TemporaryFolder root;
  put(root, "proc/self/cgroup", "0::/a/b\n");
  put(root, "sys/fs/cgroup/a/cpu.stat", "throttled_usec 100000000\n");
  put(root, "sys/fs/cgroup/a/b/cpu.stat", "throttled_usec 0\n");
  const auto before = read_host_counters({}, root.path());
  put(root, "sys/fs/cgroup/a/b/cpu.stat", "throttled_usec 5000000\n");
  const auto after = read_host_counters({}, root.path());
  EXPECT_EQ(after.quota_wait.value() - before.quota_wait.value(), Nanos(seconds(5)));
}

TEST(Environment, ReadsTheMemoryLimitOfBothGenerationsOfControlGroups) {
  const TemporaryFolder v2;
  put(v2, "proc/self/cgroup", "0::/jobs/one\n");
  put(v2, "sys/fs/cgroup/jobs/one/memory.max", "max\n");
  put(v2, "sys/fs/cgroup/jobs/memory.max", "419430400\n");
  EXPECT_EQ(memory_limit_bytes(v2.path()), 419'430'400);
  const TemporaryFolder v1;
  put(v1, "proc/self/cgroup", "4:memory:/docker/x\n");
  put(v1, "sys/fs/cgroup/memory/docker/x/memory.limit_in_bytes", "1000000\n");
  put(v1, "sys/fs/cgroup/memory/memory.limit_in_bytes", "9223372036854771712\n");
  EXPECT_EQ(memory_limit_bytes(v1.path()), 1'000'000);
  EXPECT_EQ(most_filled_bytes(v1.path()), 125'000);
  EXPECT_EQ(memory_limit_bytes(TemporaryFolder().path()), std::nullopt);
}

TEST(Environment, TakesNoConstantOfAPowerChipForHeat) {
  const TemporaryFolder root;
  const auto zone = [&](const std::string& name, const std::string& type, const std::string& temp) {
    put(root, "sys/class/thermal/" + name + "/type", type + "\n");
    put(root, "sys/class/thermal/" + name + "/temp", temp + "\n");
  };
  zone("thermal_zone0", "AO-therm", "39500");
  zone("thermal_zone1", "PMIC-Die", "100000");
  zone("thermal_zone2", "gpu-thermal", "-256000");
  EXPECT_EQ(host_environment(root.path()).at("temperature_c"), "39.5");
}

TEST(Environment, KnowsWhatHappenedDuringTheRun) {
  const TemporaryFolder root;
  put(root, "proc/loadavg", "1.25 0.40 0.30 1/100 1234\n");
  HostCounters before;
  before.total = seconds(100);
  before.steal = seconds(1);
  before.quota_wait = Nanos(0);
  HostCounters after = before;
  after.total = seconds(300);
  after.steal = seconds(7);
  after.quota_wait = milliseconds(20);
  const Environment facts = end_environment(before, after, root.path());
  EXPECT_EQ(facts.at("end.load_1m"), "1.25");
  EXPECT_EQ(facts.at("run.steal_percent"), "3.00");  // 6 s of 200
  EXPECT_EQ(facts.at("run.quota_wait_ms"), "20");
  EXPECT_TRUE(facts.contains("run.heat_events_unknown"));
  EXPECT_TRUE(facts.contains("end.temperature_c_unknown"));
}

TEST(Environment, VariablesThatLibrariesObeyAreFacts) {
  const char* const variables[] = {"ONEDNN_MAX_CPU_ISA=SSE41",
                                   "OMP_NUM_THREADS=1",
                                   "OPENBLAS_CORETYPE=Prescott",
                                   "POCL_MAX_PTHREAD_COUNT=1",
                                   "OPENCV_CPU_DISABLE=",
                                   "GLIBC_TUNABLES=glibc.malloc.arena_max=1",
                                   "LD_PRELOAD=libx.so",
                                   "MALLOC_ARENA_MAX=1",
                                   "GALLIVM_PERF=no_opt",
                                   "HWLOC_XMLFILE=/x",
                                   "POCL_CACHE_DIR=/tmp/x",
                                   "HOME=/root",
                                   "SLURM_JOB_ID=7",
                                   nullptr};
  const Environment expected = {{"env.ONEDNN_MAX_CPU_ISA", "SSE41"},
                                {"env.OMP_NUM_THREADS", "1"},
                                {"env.OPENBLAS_CORETYPE", "Prescott"},
                                {"env.POCL_MAX_PTHREAD_COUNT", "1"},
                                {"env.OPENCV_CPU_DISABLE", "set, and empty"},
                                {"env.GLIBC_TUNABLES", "glibc.malloc.arena_max=1"},
                                {"env.LD_PRELOAD", "libx.so"},
                                {"env.MALLOC_ARENA_MAX", "1"},
                                {"env.GALLIVM_PERF", "no_opt"},
                                {"env.HWLOC_XMLFILE", "/x"}};
  EXPECT_EQ(inherited_environment(variables), expected);
  for (const auto& [key, value] : expected) EXPECT_EQ(fact_kind(key), FactKind::kIdentity) << key;
}

TEST(Environment, VariablesThatDifferAtTheirEndAreTwoFacts) {
  const std::string places = "OMP_PLACES=" + std::string(400, '0');
  const std::string others = places.substr(0, places.size() - 1) + "1";
  const auto value = [](const std::string& variable) {
    const char* const variables[] = {variable.c_str(), nullptr};
    return inherited_environment(variables).at("env.OMP_PLACES");
  };
  EXPECT_NE(value(places), value(others));
  EXPECT_EQ(value(places).size(), 300 + std::string("... (0123456789abcdef)").size());
}

TEST(Environment, PowerModesAreFacts) {
  const TemporaryFolder root;
  put(root, "sys/firmware/acpi/platform_profile", "low-power\n");
  put(root, "sys/firmware/acpi/platform_profile_choices", "low-power balanced\n");
  put(root, "var/lib/nvpmodel/status", "pmode:0002\n");
  put(root, "sys/class/devfreq/17000000.gpu/governor", "nvhost_podgov\n");
  put(root, "sys/class/devfreq/17000000.gpu/max_freq", "1300500000\n");
  put(root, "sys/class/drm/card0/gt_max_freq_mhz", "1150\n");
  put(root, "sys/class/drm/card0/device/hwmon/hwmon4/power1_cap", "90000000\n");
  put(root, "sys/devices/system/cpu/intel_pstate/max_perf_pct", "50\n");
  put(root, "sys/devices/system/cpu/intel_uncore_frequency/package_00_die_00/max_freq_khz",
      "2400000\n");
  put(root, "sys/class/drm/card0-HDMI-A-1/status", "connected\n");
  put(root, "sys/class/powercap/intel-rapl:0/constraint_0_power_limit_uw", "15000000\n");
  const Environment expected = {
      {"power_mode.platform_profile", "low-power"},
      {"power_mode.nvpmodel", "pmode:0002"},
      {"power_mode.17000000.gpu.governor", "nvhost_podgov"},
      {"power_mode.17000000.gpu.max_freq", "1300500000"},
      {"power_mode.card0.gt_max_freq_mhz", "1150"},
      {"power_mode.card0.power1_cap", "90000000"},
      {"power_mode.max_perf_pct", "50"},
      {"power_mode.package_00_die_00.max_freq_khz", "2400000"},
      {"power_mode.intel-rapl:0.constraint_0_power_limit_uw", "15000000"}};
  EXPECT_EQ(power_modes(root.path()), expected);
  for (const auto& [key, value] : expected) EXPECT_EQ(fact_kind(key), FactKind::kIdentity) << key;
  put(root, "sys/devices/system/cpu/intel_pstate/max_perf_pct", "100\n");
  EXPECT_FALSE(power_modes(root.path()).contains("power_mode.max_perf_pct"));
}

TEST(Environment, EveryFactHasItsKind) {
  Environment facts = host_environment();
  facts.merge(inherited_environment());
  facts.merge(build_environment());
  facts.merge(end_environment({}, {}, "/"));
  for (const auto& [key, value] : facts) {
    EXPECT_NE(find_environment_key(key), nullptr) << key << " is not in environment_keys.cpp";
  }
  for (const EnvironmentKey& key : environment_keys()) {
    EXPECT_NE(key.why, "") << key.key;
    EXPECT_EQ(find_environment_key(key.key), &key) << key.key << " is listed twice";
  }
}

TEST(Environment, HasNoEmptyValuesHere) {
  Environment facts = host_environment();
  facts.merge(build_environment());
  for (const auto& [key, value] : facts) EXPECT_NE(value, "") << key;
  EXPECT_TRUE(facts.contains("compiler"));
  EXPECT_NE(facts.contains("git_commit"), facts.contains("git_commit_unknown"));
}

HostCounters at(Nanos when, Nanos busy, Nanos own) {
  HostCounters counters;
  counters.at = when;
  counters.busy = busy;
  counters.own = own;
  return counters;
}

TEST(HostLoad, NoticesOthersOnTheSameCores) {
  const auto before = at(Nanos(0), seconds(100), seconds(10));
  // 2 s on 2 cores: 5 % are 0.2 s.
  EXPECT_FALSE(interference(before, at(seconds(2), seconds(102), seconds(12)), 2).contended);
  EXPECT_FALSE(
      interference(before, at(seconds(2), milliseconds(102'200), seconds(12)), 2).contended);
  EXPECT_TRUE(
      interference(before, at(seconds(2), milliseconds(102'250), seconds(12)), 2).contended);
  const auto found = interference(before, at(seconds(2), milliseconds(102'250), seconds(12)), 2);
  EXPECT_NEAR(found.others.value(), 0.125, 1e-9);
  // Ticks may have less than the process: others took nothing, which is not the same as unknown.
  EXPECT_EQ(interference(before, at(seconds(2), seconds(101), seconds(12)), 2).others, 0);
  EXPECT_EQ(interference({}, {}, 2).others, std::nullopt);
  // Within what ticks can tell: 0.02 s on one core, though it is 20 % of the time.
  EXPECT_FALSE(
      interference(before, at(milliseconds(100), milliseconds(100'020), seconds(10)), 1).contended);
  // The process' own time on other cores does not count against it.
  EXPECT_FALSE(interference(before, at(seconds(2), seconds(101), seconds(13)), 1).contended);
  // A quarter of 4 s is 1 s.
  EXPECT_FALSE(interference(before, at(seconds(2), seconds(103), seconds(12)), 2).crowded);
  EXPECT_TRUE(interference(before, at(seconds(2), milliseconds(103'010), seconds(12)), 2).crowded);
}

TEST(HostLoad, OfWhatIsElsewhereCountsWaitingForACore) {
  auto before = at(Nanos(0), seconds(100), seconds(10));
  auto after = at(seconds(2), seconds(104), seconds(10));
  const auto found = [&] { return interference_elsewhere(before, after, Nanos(0)); };
  EXPECT_FALSE(found().contended);  // Nobody counts it.
  before.waited = seconds(1);
  after.waited = milliseconds(1100);  // 5 % of 2 s
  EXPECT_FALSE(found().contended);
  after.waited = milliseconds(1110);
  EXPECT_TRUE(found().contended);
  EXPECT_FALSE(found().crowded);
  after.waited = milliseconds(1510);
  EXPECT_TRUE(found().crowded);
  before.busy = after.busy = std::nullopt;
  EXPECT_TRUE(found().crowded) << "whoever had the cores";
  before.quota_wait = Nanos(0);
  after.quota_wait = seconds(1);
  EXPECT_TRUE(found().throttled);
}

// A server and a worker of this machine had the cores that the process waited for.
TEST(HostLoad, OfWhatIsElsewhereNobodyWaitsForOthersLongerThanTheyRan) {
  auto before = at(Nanos(0), seconds(100), seconds(10));
  auto after = at(seconds(2), seconds(104), seconds(11));  // 3 s, of which 1 s not its own
  before.waited = seconds(0);
  after.waited = seconds(1);
  const auto others_ran = [&](Nanos others) {
    return interference_elsewhere(before, after, seconds(3) - others);
  };
  EXPECT_TRUE(others_ran(seconds(3)).crowded);
  EXPECT_FALSE(others_ran(milliseconds(500)).crowded);  // 25 % of 2 s
  EXPECT_TRUE(others_ran(milliseconds(500)).contended);
  EXPECT_FALSE(others_ran(milliseconds(100)).contended);  // 5 %
  EXPECT_FALSE(others_ran(Nanos(0)).contended);
  // Within what ticks can tell, though it is 10 % of the time.
  after.at = milliseconds(200);
  EXPECT_FALSE(others_ran(milliseconds(20)).contended);
}

/// Columns that nobody reads are left as they are on a machine.
std::string socket_row(const std::string& here, const std::string& there, const std::string& state,
                       int inode) {
  return "   0: " + here + ' ' + there + ' ' + state +
         " 00000000:00000000 00:00000000 00000000  1000        0 " + std::to_string(inode) +
         " 1 0000000000000000 20 4 30 10 -1\n";
}

// This process (7) is connected to a server (20), as are a worker (30), whose child (31) computes,
// and, in IPv6's words, another worker (40); 50 is connected to something else, and 20 was started
// by 10.
TEST(Answering, AreTheServerItsOtherClientsAndWhatTheyHaveStarted) {
  const TemporaryFolder root;
  const std::string server = "0100007F:107E", mapped = "0000000000000000FFFF00000100007F:107E";
  put(root, "proc/self/net/tcp",
      "  sl  local_address rem_address   st\n" + socket_row(server, "00000000:0000", "0A", 200) +
          socket_row("0100007F:A001", server, "01", 70) +
          socket_row(server, "0100007F:A001", "01", 201) +
          socket_row("0100007F:A002", server, "01", 300) +
          socket_row("0100007F:A004", server, "06", 600) +
          socket_row("0100007F:A003", "0100007F:2222", "01", 500));
  put(root, "proc/self/net/tcp6",
      "  sl  local_address rem_address   st\n" +
          socket_row("0000000000000000FFFF00000100007F:A005", mapped, "01", 400));
  const auto process = [&](const std::string& id, int parent, int ticks, int inode) {
    put(root, "proc/" + id + "/stat",
        id + " (a (b) c) S " + std::to_string(parent) + " 1 1 0 -1 4194560 1 2 3 4 " +
            std::to_string(ticks) + " 2 9 9 20 0 1 0 100\n");
    std::filesystem::create_directories(root / "proc" / id / "fd");
    std::filesystem::create_symlink("/dev/null", root / "proc" / id / "fd" / "0");
    std::filesystem::create_symlink("socket:[" + std::to_string(inode) + "]",
                                    root / "proc" / id / "fd" / "3");
  };
  std::filesystem::create_directories(root / "proc/self/fd");
  std::filesystem::create_symlink("socket:[70]", root / "proc/self/fd/3");
  process("7", 1, 500, 70);
  process("10", 1, 0, 99);
  process("20", 10, 100, 201);
  process("30", 1, 10, 300);
  process("31", 30, 40, 98);
  process("40", 1, 5, 400);
  process("50", 1, 5, 500);
  process("60", 1, 5, 600);
  const ProcessTimes all = read_process_times(root.path());
  ASSERT_EQ(all.size(), 8U);
  EXPECT_EQ(all.at(31).parent, 30);
  EXPECT_EQ(all.at(31).used, milliseconds(420));
  const auto found = answering_processes(all, root.path());
  EXPECT_THAT(found, testing::ElementsAre(20, 30, 31, 40));
  // 40 came meanwhile: all of it counts, of the others what is new.
  ProcessTimes before = all;
  before.erase(40);
  before[20].used -= milliseconds(500);
  EXPECT_EQ(used_by(found, before, all), milliseconds(500 + 70));
  EXPECT_TRUE(answering_processes(all, root / "nowhere").empty());
}

TEST(HostLoad, NoticesThrottling) {
  auto before = at(Nanos(0), Nanos(0), Nanos(0));
  auto after = at(seconds(1), Nanos(0), Nanos(0));
  EXPECT_FALSE(interference(before, after, 1).throttled);  // nothing is counted here
  before.heat_events = 3;
  after.heat_events = 3;
  before.quota_wait = after.quota_wait = seconds(5);
  EXPECT_FALSE(interference(before, after, 1).throttled);
  after.heat_events = 4;
  EXPECT_TRUE(interference(before, after, 1).throttled);
  after.heat_events = 3;
  after.quota_wait = seconds(5) + milliseconds(11);  // 1.1 %
  EXPECT_TRUE(interference(before, after, 1).throttled);
}

TEST(HostLoad, NoticesThatABoardIsSlowedDownForHeat) {
  const TemporaryFolder root;
  const std::string cpu = "sys/devices/system/cpu/";
  put(root, "sys/class/thermal/cooling_device0/type", "thermal-cpufreq-0\n");
  put(root, "sys/class/thermal/cooling_device0/cur_state", "0\n");
  put(root, "sys/class/thermal/cooling_device1/type", "pwm-fan\n");
  put(root, "sys/class/thermal/cooling_device1/cur_state", "3\n");
  put(root, cpu + "cpu0/cpufreq/scaling_max_freq", "1900000\n");
  put(root, cpu + "cpu1/cpufreq/scaling_max_freq", "1900000\n");
  const auto before = read_host_counters({0}, root.path());
  EXPECT_FALSE(interference(before, read_host_counters({0}, root.path()), 1).throttled);
  put(root, cpu + "cpu1/cpufreq/scaling_max_freq", "1200000\n");
  EXPECT_FALSE(interference(before, read_host_counters({0}, root.path()), 1).throttled);
  put(root, cpu + "cpu0/cpufreq/scaling_max_freq", "1200000\n");
  EXPECT_TRUE(interference(before, read_host_counters({0}, root.path()), 1).throttled);
  put(root, cpu + "cpu0/cpufreq/scaling_max_freq", "1900000\n");
  put(root, "sys/class/thermal/cooling_device0/cur_state", "1\n");
  const auto cooled = read_host_counters({0}, root.path());
  EXPECT_TRUE(interference(cooled, cooled, 1).throttled);
  // Slowed down and released between two looks.
  put(root, "sys/class/thermal/cooling_device0/cur_state", "0\n");
  put(root, "sys/class/thermal/cooling_device0/stats/total_trans", "4\n");
  put(root, "sys/class/thermal/cooling_device1/stats/total_trans", "9\n");
  const auto counted = read_host_counters({0}, root.path());
  EXPECT_EQ(counted.heat_events, 4);
  put(root, "sys/class/thermal/cooling_device1/stats/total_trans", "11\n");
  EXPECT_FALSE(interference(counted, read_host_counters({0}, root.path()), 1).throttled);
  put(root, "sys/class/thermal/cooling_device0/stats/total_trans", "6\n");
  EXPECT_TRUE(interference(counted, read_host_counters({0}, root.path()), 1).throttled);
}

TEST(HostLoad, KnowsWhatSlowsProcessorsDownByItsName) {
  const auto throttled = [](const std::string& type, const std::string& state) {
    const TemporaryFolder root;
    put(root, "sys/class/thermal/cooling_device0/type", type + "\n");
    put(root, "sys/class/thermal/cooling_device0/cur_state", state + "\n");
    const auto counters = read_host_counters({0}, root.path());
    return interference(counters, counters, 1).throttled;
  };
  for (const char* type : {"cpu-balanced", "gpu-balanced", "emergency-balanced", "tegra-heavy",
                           "intel_powerclamp", "thermal-idle-0", "idle-cpu0", "Processor"}) {
    EXPECT_TRUE(throttled(type, "1")) << type;
    EXPECT_FALSE(throttled(type, "0")) << type;
  }
  EXPECT_FALSE(throttled("pwm-fan", "3"));
  const TemporaryFolder both;
  put(both, "sys/class/thermal/cooling_device0/type", "intel_powerclamp\n");
  put(both, "sys/class/thermal/cooling_device0/cur_state", "-1\n");
  put(both, "sys/class/thermal/cooling_device1/type", "thermal-cpufreq-0\n");
  put(both, "sys/class/thermal/cooling_device1/cur_state", "1\n");
  EXPECT_EQ(read_host_counters({0}, both.path()).cooled, 1) << "what is off takes nothing off";
}

TEST(HostLoad, NoticesThatABoardIsSlowedDownForItsSupply) {
  const TemporaryFolder root;
  put(root, "sys/class/hwmon/hwmon0/name", "other\n");
  put(root, "sys/class/hwmon/hwmon0/in0_lcrit_alarm", "1\n");
  put(root, "sys/class/hwmon/hwmon1/name", "rpi_volt\n");
  put(root, "sys/class/hwmon/hwmon1/in0_lcrit_alarm", "0\n");
  const auto before = read_host_counters({0}, root.path());
  EXPECT_FALSE(interference(before, before, 1).throttled);
  put(root, "sys/class/hwmon/hwmon1/in0_lcrit_alarm", "1\n");
  EXPECT_TRUE(interference(before, read_host_counters({0}, root.path()), 1).throttled);
}

TEST(HostLoad, NoticesThatThePackageOfACoreIsAtItsLimit) {
  const TemporaryFolder root;
  const std::string core = "sys/devices/system/cpu/cpu4/thermal_throttle/";
  put(root, core + "core_throttle_count", "0\n");
  put(root, core + "package_throttle_count", "5\n");
  const auto before = read_host_counters({4}, root.path());
  EXPECT_FALSE(interference(before, read_host_counters({4}, root.path()), 1).throttled);
  put(root, core + "package_throttle_count", "6\n");
  EXPECT_TRUE(interference(before, read_host_counters({4}, root.path()), 1).throttled);
}

TEST(HostLoad, ReadsTheCountersOfTheCoresAskedFor) {
  const TemporaryFolder root;
  put(root, "proc/stat",
      "cpu  60 0 0 1000 5 0 0 6 0 0\ncpu0 10 1 2 500 5 3 4 6 0 0\ncpu1 50 0 0 500 0 0 0 0 0 0\n"
      "cpu10 900 0 0 0 0 0 0 0 0 0\nintr 1\n");
  put(root, "proc/self/cgroup", "0::/robots\n");
  put(root, "sys/fs/cgroup/robots/cpu.stat", "usage_usec 10\nthrottled_usec 70\n");
  put(root, "sys/devices/system/cpu/cpu1/thermal_throttle/core_throttle_count", "9\n");
  // All fields but idle (500) and iowait (5): 10+1+2+3+4+6 = 26 ticks of 10 ms (the kernel's unit
  // for user space: 100 a second).
  EXPECT_EQ(read_host_counters({0}, root.path()).busy, Nanos(milliseconds(260)));
  EXPECT_EQ(read_host_counters({1}, root.path()).busy, Nanos(milliseconds(500)));
  EXPECT_EQ(read_host_counters({0, 1}, root.path()).busy, Nanos(milliseconds(760)));
  EXPECT_EQ(read_host_counters({}, root.path()).busy, Nanos(milliseconds(660)));
  EXPECT_EQ(read_host_counters({0}, root.path()).heat_events, std::nullopt);
  EXPECT_EQ(read_host_counters({0, 1}, root.path()).heat_events, 9);
  EXPECT_EQ(read_host_counters({0}, root.path()).quota_wait, Nanos(std::chrono::microseconds(70)));
  const TemporaryFolder empty;
  EXPECT_EQ(read_host_counters({0}, empty.path()).busy, std::nullopt);
  EXPECT_EQ(read_host_counters({0}, empty.path()).quota_wait, std::nullopt);
}

TEST(Environment, TellsIdentityFromInformation) {
  for (const char* key : {"cpu_model", "cpu_model_unknown", "compiler_flags", "images_hash",
                          "precision", "unit.opencl.version"}) {
    EXPECT_EQ(fact_kind(key), FactKind::kIdentity) << key;
  }
  for (const char* key : {"load_1m", "temperature_c_unknown", "git_commit", "mode", "os"}) {
    EXPECT_EQ(fact_kind(key), FactKind::kInformation) << key;
  }
}

}  // namespace
}  // namespace pirt
