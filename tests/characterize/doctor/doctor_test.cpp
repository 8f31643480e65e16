// What doctor finds on recorded machines, and what it says to do; nothing here looks at this
// machine.
#include "characterize/doctor/doctor.h"

#include <fmt/core.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdlib>

#include "tests/characterize/support.h"
#include "tests/support/paths.h"
#include "tests/support/recorded_machines.h"

namespace pirt {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;
using test::RecordedMachine;
using test::TemporaryFolder;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::UnorderedElementsAre;

/// A core whose pieces of work lie evenly between @p low and @p high.
CoreJitter pieces_between(int core, Nanos low, Nanos high) {
  constexpr int kSteps = 40;
  CoreJitter jitter{core, {}};
  for (int i = 0; i <= kSteps; ++i) jitter.pieces.push_back(low + (high - low) * i / kSteps);
  return jitter;
}

/// The machine twice, one quiet second apart; both units there.
DoctorInput input_of(const RecordedMachine& machine) {
  DoctorInput input;
  input.root = machine.root();
  input.cores = {0, 1};
  input.before = read_doctor_snapshot(input.cores, machine.root());
  input.before.host.own = Nanos(0);
  input.after = input.before;
  if (input.after->host.total) *input.after->host.total += seconds(2);
  const auto reading = pieces_between(0, milliseconds(7), milliseconds(7)).pieces;
  input.jitter = {{pieces_between(0, milliseconds(5), milliseconds(5)),
                   pieces_between(1, milliseconds(6), milliseconds(6))},
                  reading};
  input.build = {{"build_type", "Release"}, {"sanitizers", "none"}};
  input.units = {{"cpu", "Some CPU", "", {0}}, {"opencl", "Some device", "", {1}}};
  input.disks = {{"/tmp", std::int64_t{1} << 40}};
  input.readable = [](const std::filesystem::path&) { return true; };
  return input;
}

std::vector<std::string> checks_at(const std::vector<Finding>& findings, Level level) {
  std::vector<std::string> names;
  for (const Finding& finding : findings) {
    if (finding.level == level) names.push_back(finding.check);
  }
  return names;
}

Finding finding_of(const DoctorInput& input, const std::string& check) {
  for (const Finding& finding : diagnose(input)) {
    if (finding.check == check) return finding;
  }
  ADD_FAILURE() << "no check " << check;
  return {};
}

/// As the machine's OpenCL has them: the host's cores, and a card.
std::vector<DeviceInfo> with_card(const std::string& name = "NVIDIA H100") {
  DeviceInfo card{.name = name, .platform = "a platform", .version = "OpenCL 3.0, driver 535"};
  card.compute_units = 132;
  card.pci = "0000:01:00.0";
  card.own_memory = true;
  return {card, {.name = "cpu-EPYC", .platform = "PoCL", .version = "1", .is_cpu = true}};
}

/// What read_nvml() finds with the library that stands in for the driver's.
NvmlFacts nvml_facts(const std::string& script) {
  ::setenv("PIRT_NVML", test::kNvmlStandIn, 1);
  ::setenv("NVML_STAND_IN", script.c_str(), 1);
  NvmlFacts facts = read_nvml();
  ::setenv("PIRT_NVML", "none", 1);
  ::unsetenv("NVML_STAND_IN");
  return facts;
}

TEST(BoardSettings, WhatWasSetOfABoardIsAFactOfTheRun) {
  ::setenv("PIRT_NVML", test::kNvmlStandIn, 1);
  ::setenv("NVML_STAND_IN", "boards=01 limit_w=300 core_mhz=1200", 1);
  using testing::Pair;
  EXPECT_THAT(board_settings("0000:01:00.0"),
              ElementsAre(Pair("core_mhz", "1200"), Pair("ecc", "true"), Pair("memory_mhz", "2619"),
                          Pair("power_limit_w", "300")));
  EXPECT_THAT(board_settings("0000:02:00.0"), IsEmpty());
  ::setenv("PIRT_NVML", "none", 1);
  ::unsetenv("NVML_STAND_IN");
}

class Doctor : public testing::Test {
 protected:
  TemporaryFolder folder;
};

TEST_F(Doctor, FindsNothingOnAHealthyBoard) {
  const auto findings = diagnose(input_of(test::healthy_board(folder.path())));
  for (const Finding& finding : findings) {
    EXPECT_EQ(finding.level, Level::kGood) << finding.check << ": " << finding.found;
    EXPECT_EQ(finding.why + finding.remedy, "") << finding.check;
    EXPECT_NE(finding.found, "") << finding.check;
  }
  EXPECT_EQ(verdict(findings), Level::kGood);
  EXPECT_GE(findings.size(), 16U);
}

TEST_F(Doctor, FindsWhatALaptopDoesToMeasurements) {
  auto input = input_of(test::laptop(folder.path()));
  input.readable = [](const std::filesystem::path&) { return false; };
  const auto findings = diagnose(input);
  EXPECT_THAT(checks_at(findings, Level::kSpoils),
              UnorderedElementsAre("governor", "turbo", "siblings", "power_supply", "clock_source",
                                   "memory"));
  EXPECT_THAT(checks_at(findings, Level::kNote),
              UnorderedElementsAre("frequency_limit", "heat", "swap", "energy_meter"));
  EXPECT_EQ(verdict(findings), Level::kSpoils);
  for (const Finding& finding : findings) {
    if (finding.level < Level::kNote) continue;
    EXPECT_NE(finding.why, "") << finding.check;
    EXPECT_NE(finding.remedy, "") << finding.check;
  }
}

// What characterize warns of before it begins.
TEST_F(Doctor, SpoilingAreAllFindingsOfThatLevelAndNoOthers) {
  const auto findings = spoiling(diagnose(input_of(test::laptop(folder.path()))));
  EXPECT_THAT(checks_at(findings, Level::kSpoils),
              ::testing::IsSupersetOf({"governor", "turbo", "siblings", "clock_source"}));
  EXPECT_EQ(checks_at(findings, Level::kSpoils).size(), findings.size());
  EXPECT_TRUE(spoiling({{"cores", Level::kNote, "", "", ""}}).empty());
}

// This machine's cores compute meanwhile; what they show is theirs.
TEST(LookBeforeMeasuring, FindsWhatTheRecordedMachineSays) {
  test::TemporaryFolder folder;
  DoctorInput input;
  input.root = test::laptop(folder.path()).root();
  input.cores = {usable_cores().front()};
  input.build = {{"build_type", "Release"}};
  input.readable = [](const std::filesystem::path&) { return true; };
  std::vector<std::string> checks;
  for (const Finding& each :
       look_before_measuring(std::move(input), std::chrono::milliseconds(100)))
    checks.push_back(each.check);
  EXPECT_THAT(checks, ::testing::IsSupersetOf({"turbo", "clock_source"}));
}

TEST_F(Doctor, TakesAnEmptyUsbPortForNoBattery) {
  const auto level_with = [&](const std::map<std::string, std::string>& files) {
    const TemporaryFolder root;
    auto machine = test::healthy_board(root.path());
    std::filesystem::remove_all(root / "sys/class/power_supply");
    for (const auto& [file, text] : files)
      machine.put("sys/class/power_supply/" + file, text + "\n");
    const auto findings = diagnose(input_of(machine));
    const auto found = std::ranges::find(findings, "power_supply", &Finding::check);
    return found == findings.end() ? std::string("no word") : std::string(to_string(found->level));
  };
  const std::map<std::string, std::string> port = {{"ucsi/type", "USB"}, {"ucsi/online", "0"}};
  EXPECT_EQ(level_with(port), "no word");
  auto mouse = port;
  mouse["hid/type"] = "Battery", mouse["hid/scope"] = "Device";
  EXPECT_EQ(level_with(mouse), "no word");
  auto laptop = port;
  laptop["BAT0/type"] = "Battery";
  EXPECT_EQ(level_with(laptop), "spoils");
  laptop["ucsi/online"] = "1";
  EXPECT_EQ(level_with(laptop), "good");
  EXPECT_EQ(level_with({{"AC/type", "Mains"}, {"AC/online", "0"}}), "spoils");
}

TEST_F(Doctor, SaysThatTheControlGroupHasTooLittleMemory) {
  auto machine = test::healthy_board(folder.path());
  machine.put("proc/self/cgroup", "0::/\n");
  machine.put("sys/fs/cgroup/memory.max", "419430400\n");
  const Finding finding = finding_of(input_of(machine), "memory");
  EXPECT_EQ(finding.level, Level::kSpoils);
  EXPECT_EQ(finding.found, "400 MB are the control group's limit");
}

TEST_F(Doctor, SaysWhatLibrariesObey) {
  auto input = input_of(test::healthy_board(folder.path()));
  input.inherited = {{"env.OMP_NUM_THREADS", "1"}, {"scheduling", "nice 5"}};
  input.no_new_code = "'/tmp' is mounted noexec; set TMPDIR";
  const Finding inherited = finding_of(input, "inherited");
  EXPECT_EQ(inherited.level, Level::kNote);
  EXPECT_EQ(inherited.found, "OMP_NUM_THREADS=1, nice 5");
  EXPECT_EQ(inherited.remedy, "unset OMP_NUM_THREADS");
  EXPECT_EQ(finding_of(input, "new_code").level, Level::kSpoils);
}

TEST_F(Doctor, NamesTheExactCommands) {
  auto input = input_of(test::laptop(folder.path()));
  EXPECT_EQ(finding_of(input, "governor").found, "powersave on cores 0,1");
  EXPECT_EQ(finding_of(input, "governor").remedy,
            "echo performance | sudo tee /sys/devices/system/cpu/cpu*/cpufreq/scaling_governor");
  EXPECT_EQ(finding_of(input, "turbo").remedy,
            "echo 1 | sudo tee /sys/devices/system/cpu/intel_pstate/no_turbo");
  EXPECT_EQ(finding_of(input, "frequency_limit").remedy,
            "echo 1500000 | sudo tee /sys/devices/system/cpu/cpu*/cpufreq/scaling_max_freq");
  const auto percent = folder.path() / "sys/devices/system/cpu/intel_pstate/max_perf_pct";
  test::write_bytes(percent, "30\n");
  EXPECT_EQ(finding_of(input, "frequency_limit").found,
            "all cores are limited to 30 % of their highest clock");
  std::filesystem::remove(percent);
  EXPECT_EQ(finding_of(input, "siblings").found,
            "core 0 of cpu and core 1 of opencl are one physical core");
  EXPECT_EQ(finding_of(input, "clock_source").remedy,
            "echo tsc | sudo tee /sys/devices/system/clocksource/clocksource0/current_clocksource");
  EXPECT_EQ(finding_of(input, "swap").remedy, "sudo swapoff -a");
  EXPECT_EQ(finding_of(input, "energy_meter").level, Level::kGood);  // this user may read it
}

// As `pirt list meters` does; a Jetson has no RAPL.
TEST_F(Doctor, LooksForEveryMeter) {
  auto machine = test::healthy_board(folder.path());
  auto input = input_of(machine);
  const auto rapl = folder.path() / "sys/class/powercap";
  std::filesystem::rename(rapl, folder.path() / "powercap");
  EXPECT_EQ(finding_of(input, "energy_meter").level, Level::kUnknown);
  const auto chip = folder.path() / "sys/bus/i2c/drivers/ina3221/1-0040/hwmon/hwmon3";
  std::filesystem::create_directories(chip);
  for (const auto& [file, text] : {std::pair{"name", "ina3221"},
                                   {"in1_label", "VDD_IN"},
                                   {"in1_enable", "1"},
                                   {"in1_input", "5000"},
                                   {"curr1_input", "400"}}) {
    test::write_bytes(chip / file, std::string(text) + "\n");
  }
  EXPECT_EQ(finding_of(input, "energy_meter").level, Level::kGood);
  EXPECT_THAT(finding_of(input, "energy_meter").found, HasSubstr("VDD_IN"));
  input.readable = [](const auto&) { return false; };
  EXPECT_EQ(finding_of(input, "energy_meter").level, Level::kNote);
  EXPECT_THAT(finding_of(input, "energy_meter").found, HasSubstr("VDD_IN"));
  std::filesystem::rename(folder.path() / "powercap", rapl);
  input.readable = [](const std::filesystem::path& file) {
    return file.string().find("powercap") == std::string::npos;
  };
  EXPECT_EQ(finding_of(input, "energy_meter").level, Level::kGood);
  EXPECT_EQ(finding_of(input, "energy_meter").found,
            "VDD_IN can be read (pirt list meters); RAPL is there and may not be read");
}

// Else the boards of this machine would be named.
TEST_F(Doctor, ARecordedMachineHasNoBoardsOfNvml) {
  auto input = input_of(test::healthy_board(folder.path()));
  ::setenv("PIRT_NVML", test::kNvmlStandIn, 1);
  ::setenv("NVML_STAND_IN", "boards=01", 1);
  EXPECT_THAT(finding_of(input, "energy_meter").found, testing::Not(HasSubstr("nvidia")));
  input.inherited.emplace();
  EXPECT_THAT(finding_of(input, "energy_meter").found, HasSubstr("nvidia/0000:01:00.0"));
  ::setenv("PIRT_NVML", "none", 1);
  ::unsetenv("NVML_STAND_IN");
}

TEST_F(Doctor, SaysWhatAGpuIs) {
  auto input = input_of(test::healthy_board(folder.path()));
  EXPECT_THAT(checks_at(diagnose(input), Level::kGood), testing::Not(testing::Contains("gpu")));
  input.devices = {with_card().back()};
  EXPECT_EQ(finding_of(input, "gpu").found, "none with memory of its own");
  input.devices = with_card();
  input.nvml = nvml_facts("boards=01,41");
  EXPECT_EQ(finding_of(input, "gpu 0").found,
            "NVIDIA H100 (OpenCL 3.0, driver 535), 0000:01:00.0, PCIe 3.0 x16 (at most 5.0 x16), "
            "80.0 GB, 79.0 GB free, at most 700 W, ECC on, all of its time for one context");
  EXPECT_EQ(verdict(diagnose(input)), Level::kGood);
  for (const auto& [script, share] : {std::pair{"pids=1,2", "1/3 of its time for a context"},
                                      {"pids_status=3", "a context's share of its time not known"},
                                      {"mig=1", "a MIG instance of 132 compute units"}}) {
    input.nvml = nvml_facts(script);
    EXPECT_THAT(finding_of(input, "gpu 0").found, testing::EndsWith(share));
  }
  input.nvml = nvml_facts("boards=01 ecc_status=3");
  EXPECT_THAT(finding_of(input, "gpu 0").found, testing::Not(HasSubstr("ECC")));
  input.nvml = nvml_facts("boards=41");
  EXPECT_EQ(finding_of(input, "gpu 0").found,
            "NVIDIA H100 (OpenCL 3.0, driver 535), 0000:01:00.0, link not known");
}

TEST_F(Doctor, ReadsAnyBoardsLinkFromTheKernel) {
  auto machine = test::healthy_board(folder.path());
  const std::string board = "sys/bus/pci/devices/0000:01:00.0/";
  machine.put(board + "current_link_speed", "2.5 GT/s PCIe\n");
  machine.put(board + "current_link_width", "8\n");
  auto input = input_of(machine);
  input.devices = with_card("gfx1100");
  EXPECT_THAT(finding_of(input, "gpu 0").found, testing::EndsWith("PCIe 1.0 x8"));
  machine.put(board + "max_link_speed", "16.0 GT/s PCIe\n");
  machine.put(board + "max_link_width", "16\n");
  EXPECT_THAT(finding_of(input, "gpu 0").found, testing::EndsWith("(at most 4.0 x16)"));
  const auto findings = diagnose(input);
  EXPECT_THAT(checks_at(findings, Level::kNote), ElementsAre("gpu 0")) << "half of its lanes";
  machine.put(board + "current_link_width", "16\n");
  EXPECT_THAT(checks_at(diagnose(input), Level::kNote), IsEmpty()) << "slow at rest, as all are";
}

TEST_F(Doctor, FindsWhatSpoilsAGpu) {
  auto input = input_of(test::healthy_board(folder.path()));
  input.devices = with_card();
  const auto found = [&](const std::string& script) {
    input.nvml = nvml_facts(script);
    const auto findings = diagnose(input);
    const auto problem = std::ranges::find_if(
        findings, [](const Finding& each) { return each.level >= Level::kNote; });
    if (problem == findings.end()) return std::string("nothing");
    return fmt::format("{}: {}; {}", to_string(problem->level), problem->found, problem->remedy);
  };
  EXPECT_EQ(found("pids=1,2"),
            "spoils: 2 other processes compute on it; end them; see: nvidia-smi");
  EXPECT_EQ(found("mig=1"), "note: MIG is on; sudo nvidia-smi -i 0000:01:00.0 -mig 0");
  EXPECT_EQ(found("limit_w=300"),
            "note: at most 300 W, 700 W by default; sudo nvidia-smi -i 0000:01:00.0 -pl 700");
  EXPECT_EQ(found("lanes=8"),
            "note: x8 of x16 lanes; another slot; see: sudo lspci -vvs 0000:01:00.0");
  EXPECT_EQ(found("limit_w=699"), "nothing");
  EXPECT_EQ(found("core_mhz=1200"),
            "note: its clock is set to 1200 MHz, 1980 MHz by default; sudo nvidia-smi -i "
            "0000:01:00.0 -rac");
}

TEST_F(Doctor, FindsCoresOfDifferentKinds) {
  auto machine = test::healthy_board(folder.path());
  auto input = input_of(machine);
  const auto kind = [&](int core, const char* khz, const char* capacity) {
    const auto of_core = fmt::format("sys/devices/system/cpu/cpu{}/", core);
    machine.put(of_core + "cpufreq/cpuinfo_max_freq", khz);
    machine.put(of_core + "cpu_capacity", capacity);
  };
  const int last = input.cores.back();
  for (const int core : input.cores) kind(core, "2150400", "1024");
  EXPECT_EQ(finding_of(input, "cores").level, Level::kGood);
  kind(last, "1593600", "572");
  EXPECT_EQ(finding_of(input, "cores").level, Level::kNote);
  EXPECT_THAT(finding_of(input, "cores").found,
              HasSubstr(fmt::format("{} (1593 MHz, capacity 572) and ", last)));
  kind(last, "2100000", "1000");
  EXPECT_EQ(finding_of(input, "cores").level, Level::kGood);
}

TEST_F(Doctor, FindsABoardOfNvidiasThatOpenClDoesNotReach) {
  for (const std::string& trace :
       {std::string("sys/bus/pci/devices/0000:01:00.0/vendor"), std::string("dev/nvidiactl"),
        std::string("proc/driver/nvidia/version")}) {
    const TemporaryFolder root;
    auto machine = test::healthy_board(root.path());
    machine.put("sys/bus/pci/devices/0000:01:00.0/class", "0x030200\n");
    machine.put(trace, "0x10de\n");
    auto input = input_of(machine);
    EXPECT_THAT(finding_of(input, "gpu").found, HasSubstr("recorded machine")) << trace;
    input.devices = {with_card().back()};
    input.nvml = nvml_facts("");
    EXPECT_THAT(finding_of(input, "gpu driver").remedy,
                HasSubstr("echo libnvidia-opencl.so.1 > /etc/OpenCL/vendors/nvidia.icd"));
    machine.put("etc/OpenCL/vendors/nvidia.icd", "libnvidia-opencl.so.1\n");
    EXPECT_THAT(finding_of(input, "gpu driver").remedy,
                HasSubstr("NVIDIA_DRIVER_CAPABILITIES=compute,utility"));
    input.devices = with_card();
    EXPECT_THAT(checks_at(diagnose(input), Level::kNote), IsEmpty());
    input.nvml = NvmlFacts{.boards = {}, .missing = "libnvidia-ml.so.1: not found"};
    EXPECT_EQ(finding_of(input, "gpu driver").found, "NVML: libnvidia-ml.so.1: not found");
    EXPECT_THAT(finding_of(input, "gpu driver").remedy, HasSubstr("reboot"));
    EXPECT_EQ(verdict(diagnose(input)), Level::kGood) << "what is measured is right";
  }
  // A sound card of the same maker is no board.
  auto machine = test::healthy_board(folder.path());
  machine.put("sys/bus/pci/devices/0000:01:00.1/class", "0x040300\n");
  machine.put("sys/bus/pci/devices/0000:01:00.1/vendor", "0x10de\n");
  auto input = input_of(machine);
  input.devices.emplace();
  EXPECT_EQ(finding_of(input, "gpu").level, Level::kGood);
}

TEST_F(Doctor, OnlyTheCoresInUseCount) {
  auto machine = test::healthy_board(folder.path());
  machine.core(1, "cpufreq/scaling_governor", "ondemand\n");
  auto input = input_of(machine);
  EXPECT_EQ(finding_of(input, "governor").found, "ondemand on cores 1");
  input.cores = {0};
  EXPECT_EQ(finding_of(input, "governor").level, Level::kGood);
  EXPECT_EQ(finding_of(input, "cores").level, Level::kNote);
}

TEST_F(Doctor, FindsStealInAVirtualMachineNowOrSinceItsStart) {
  auto input = input_of(test::stolen_from_vm(folder.path()));
  EXPECT_EQ(finding_of(input, "steal").level, Level::kGood);  // none while doctor looked
  *input.after->host.steal += milliseconds(30);               // of 2 s
  EXPECT_EQ(finding_of(input, "steal").level, Level::kSpoils);
  EXPECT_EQ(finding_of(input, "steal").found, "1.5 % while doctor looked");
  input.after.reset();
  EXPECT_EQ(finding_of(input, "steal").found, "5.0 % since the machine started");
  EXPECT_EQ(finding_of(input, "steal").level, Level::kSpoils);
}

TEST_F(Doctor, WhatAVirtualMachineDoesNotShowIsUnknownAndNotBad) {
  const auto findings = diagnose(input_of(test::stolen_from_vm(folder.path())));
  EXPECT_THAT(checks_at(findings, Level::kUnknown),
              UnorderedElementsAre("governor", "frequency_limit", "turbo", "siblings", "heat",
                                   "quota", "energy_meter"));
  EXPECT_EQ(verdict(findings), Level::kGood);
}

TEST_F(Doctor, FindsAContainersQuotaAndItsThrottling) {
  auto input = input_of(test::throttled_container(folder.path()));
  EXPECT_EQ(finding_of(input, "quota").level, Level::kSpoils);
  EXPECT_EQ(finding_of(input, "quota").found, "1.50 cores' time for 2 cores");
  EXPECT_THAT(finding_of(input, "quota").remedy, HasSubstr("docker update --cpus 0"));
  input.cores = {0};
  EXPECT_EQ(finding_of(input, "quota").level, Level::kGood);  // more than the one core can use
  *input.after->host.quota_wait += milliseconds(40);
  EXPECT_EQ(finding_of(input, "quota").found,
            "the control group was held back for 40 ms while doctor looked");
}

TEST_F(Doctor, FindsOtherProgramsButNotItself) {
  auto input = input_of(test::healthy_board(folder.path()));
  *input.after->host.busy += milliseconds(300);  // 15 % of 2 s
  EXPECT_EQ(finding_of(input, "load").level, Level::kSpoils);
  EXPECT_EQ(finding_of(input, "load").found,
            "other programs take 15 % of the cores' time, load average 0.01");
  input.after->host.own = milliseconds(250);
  EXPECT_EQ(finding_of(input, "load").level, Level::kGood);
}

TEST_F(Doctor, WhatTheHypervisorTakesIsNotTakenByOtherPrograms) {
  auto input = input_of(test::stolen_from_vm(folder.path()));
  *input.after->host.busy += milliseconds(300);
  *input.after->host.steal += milliseconds(300);  // which is within busy
  EXPECT_EQ(finding_of(input, "load").level, Level::kGood);
  EXPECT_EQ(finding_of(input, "steal").level, Level::kSpoils);
}

TEST_F(Doctor, FindsANeighbourThatNoCounterShows) {
  auto input = input_of(test::healthy_board(folder.path()));
  EXPECT_THAT(finding_of(input, "jitter").found, HasSubstr("take the same time within 0.0 %"));
  auto& cores = input.jitter->cores;
  cores[1] = pieces_between(1, milliseconds(980), milliseconds(1020));
  EXPECT_EQ(finding_of(input, "jitter").level, Level::kGood);
  cores[1] = pieces_between(1, milliseconds(800), milliseconds(1200));
  const Finding found = finding_of(input, "jitter");
  EXPECT_EQ(found.level, Level::kSpoils);
  EXPECT_EQ(found.found, "the same arithmetic on core 1 takes 0.82 to 1.18 times its median");
  EXPECT_THAT(found.remedy, HasSubstr("dedicated instance"));
  cores[1] = cores[0];
  input.jitter->reading = pieces_between(0, milliseconds(900), milliseconds(1100)).pieces;
  EXPECT_EQ(finding_of(input, "jitter").found,
            "reading memory takes 0.91 to 1.09 times its median");
  cores[0].pieces.resize(19);
  EXPECT_EQ(finding_of(input, "jitter").level, Level::kUnknown) << "too few to tell";
  input.jitter.reset();
  EXPECT_EQ(finding_of(input, "jitter").level, Level::kUnknown);
}

TEST_F(Doctor, FindsWhatHappenedWhileItLooked) {
  auto input = input_of(test::healthy_board(folder.path()));
  input.after->host.heat_events = 1;
  input.after->swapped_pages = 12;
  input.after->memory_stall = milliseconds(3);
  EXPECT_THAT(checks_at(diagnose(input), Level::kSpoils),
              UnorderedElementsAre("heat", "swap", "memory"));
  EXPECT_EQ(finding_of(input, "swap").found, "12 pages moved while doctor looked");
}

TEST_F(Doctor, FindsThatABoardIsSlowedDownForItsSupply) {
  auto input = input_of(test::healthy_board(folder.path()));
  input.after->host.low_voltage = true;
  EXPECT_EQ(finding_of(input, "power_supply").level, Level::kSpoils);
}

TEST_F(Doctor, FindsThatABoardIsSlowedDownForHeat) {
  test::RecordedMachine board = test::healthy_board(folder.path());
  EXPECT_EQ(finding_of(input_of(board), "heat").level, Level::kGood);
  auto input = input_of(board);
  input.after->host.max_khz = *input.before.host.max_khz - 300'000;
  EXPECT_EQ(finding_of(input, "heat").level, Level::kSpoils);
  EXPECT_THAT(finding_of(input, "heat").found, HasSubstr("went from 3000 to 2700 MHz"));
  board.put("sys/class/thermal/cooling_device0/type", "cpufreq-cpu0\n");
  board.put("sys/class/thermal/cooling_device0/cur_state", "2\n");
  EXPECT_EQ(finding_of(input_of(board), "heat").level, Level::kSpoils);
  EXPECT_THAT(finding_of(input_of(board), "heat").found, HasSubstr("by 2 steps"));
}

TEST_F(Doctor, FindsSlowBuilds) {
  auto input = input_of(test::healthy_board(folder.path()));
  input.build["build_type"] = "Debug";
  EXPECT_EQ(finding_of(input, "build").level, Level::kSpoils);
  input.build = {{"build_type", "Release"}, {"sanitizers", "address"}};
  EXPECT_EQ(finding_of(input, "build").found, "Release with sanitizers address");
  EXPECT_EQ(finding_of(input, "build").level, Level::kSpoils);
  input.build = {};
  EXPECT_EQ(finding_of(input, "build").level, Level::kSpoils);
}

TEST_F(Doctor, AMissingUnitSpoilsAndNoUnitBlocks) {
  auto input = input_of(test::healthy_board(folder.path()));
  (*input.units)[1] = {"opencl", "", "no OpenCL device; apt-get install pocl-opencl-icd", {}};
  const Finding missing = finding_of(input, "unit opencl");
  EXPECT_EQ(missing.level, Level::kSpoils);
  EXPECT_THAT(missing.remedy, HasSubstr("apt-get install"));
  EXPECT_EQ(finding_of(input, "unit cpu").level, Level::kGood);
  (*input.units)[0].error = "core 7 does not exist";
  EXPECT_EQ(verdict(diagnose(input)), Level::kBlocks);
}

TEST_F(Doctor, FindsAFullDisk) {
  auto input = input_of(test::healthy_board(folder.path()));
  input.disks = {{"/scratch", std::int64_t{50} << 20}, {"/nowhere", std::nullopt}};
  EXPECT_THAT(checks_at(diagnose(input), Level::kSpoils), ElementsAre("disk"));
  EXPECT_THAT(checks_at(diagnose(input), Level::kUnknown), ElementsAre("disk"));
  EXPECT_EQ(free_space("/does/not/exist").free_bytes, std::nullopt);
}

TEST_F(Doctor, OnAnEmptyRootKnowsLittleAndClaimsNothing) {
  DoctorInput input;
  input.root = folder.path();
  input.cores = recorded_cores(folder.path());
  EXPECT_THAT(input.cores, IsEmpty());
  input.before = read_doctor_snapshot(input.cores, folder.path());
  input.build = {{"build_type", "Release"}};
  input.readable = [](const std::filesystem::path&) { return false; };
  for (const Finding& finding : diagnose(input)) {
    EXPECT_NE(finding.level, Level::kSpoils) << finding.check << ": " << finding.found;
    EXPECT_NE(finding.found, "") << finding.check;
  }
}

TEST_F(Doctor, KnowsTheCoresOfARecordedMachine) {
  auto machine = test::stolen_from_vm(folder.path());
  EXPECT_THAT(recorded_cores(folder.path()), ElementsAre(0, 1));  // from /proc/cpuinfo
  machine.core(2, "online", "1\n");
  EXPECT_THAT(recorded_cores(folder.path()), ElementsAre(2));
}

}  // namespace
}  // namespace pirt
