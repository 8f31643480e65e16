// What `pirt schedule` is asked for, and what it refuses.
#include "tests/scheduler/virtual/virtual_support.h"

namespace pirt::test {
namespace {

using testing::AllOf;
using testing::Contains;
using testing::HasSubstr;

TEST(Schedule, OffloadsExactlyTheNonRealTimeTasksOfTheFullRobot) {
  // 60 s: scene_understanding fires 6 times, map_generation at 0 and 50 s. The others: 1500 firings
  // of 6 tasks, 180, 600 and 600 of 1.
  const auto record = run(load_platform("fake"), load_mix("full-robot"), mode("advanced"));
  EXPECT_EQ(record.submitted, 10388);
  // The first frame has none before it to track from; its pose and its map come after that.
  EXPECT_EQ(record.completed, 10385);
  EXPECT_EQ(record.no_predecessor, 3);
  EXPECT_EQ(unit(record, "cloud").completed, 8);
  EXPECT_EQ(record.offloaded, 8);
  for (const char* name : {"cpu-only", "latency", "throughput", "energy", "ect", "edf"}) {
    const auto basic = run(load_platform("fake"), load_mix("full-robot"), mode(name));
    EXPECT_EQ(basic.offloaded, 0) << name;
    expect_balanced(basic);
  }
}

TEST(Schedule, OffloadsExactlyTheNonRealTimeTasksOfTheRobotOfTableOne) {
  // 60 s: scene_understanding at 0.1 Hz fires 6 times one task; map_generation at 0.02 Hz at 0 and
  // 50 s, two tasks each: 10. The others: 1500 firings of 4, 180 and 600 of 1: 6780.
  const auto record = run(load_platform("fake"), load_mix("table1-robot"), mode("advanced"));
  EXPECT_EQ(record.submitted, 6790);
  // The first frame has none before it to track from.
  EXPECT_EQ(record.completed, 6789);
  EXPECT_EQ(record.no_predecessor, 1);
  EXPECT_EQ(record.offloaded, 10);
  EXPECT_EQ(unit(record, "cloud").completed, 10);
  EXPECT_THAT(record.warnings, ElementsAre(HasSubstr("(@-1)")));
  for (const char* name : {"latency", "throughput", "energy"}) {
    const auto basic = run(load_platform("fake"), load_mix("table1-robot"), mode(name));
    EXPECT_EQ(basic.offloaded, 0) << name;
    expect_balanced(basic);
  }
}

// b finds the only buffer with a, and is dropped; c, which is planned behind it, runs all the same.
TEST(Schedule, APlanWaitsForNoPipelineThatFindsNoBuffer) {
  const auto record = run(platform_of("platform: one\nunits: {cpu: {slots: 1}}\n"), mix_of(R"(
mix: m
image_buffers: 1
pipelines:
  a: {closed_loop: {frames: 1}, tasks: [{name: t, service_ms: {cpu: 5}, image_input: true}]}
  b: {closed_loop: {frames: 1}, tasks: [{name: t, service_ms: {cpu: 4}, image_input: true}]}
  c: {closed_loop: {frames: 1}, tasks: [{name: t, service_ms: {cpu: 3}}]}
)"),
                          mode("heft"));
  EXPECT_EQ(record.stalled, 0);
  EXPECT_EQ(record.completed, 2);
}

// What one plan of all has, it has in the order in which tasks get a state.
TEST(Schedule, SaysWhatAPlanLeavesOutWhereItDoes) {
  const auto warnings = [](int frames) {
    const auto platform = platform_of(
        "platform: one\nunits: {cpu: {slots: 1, active_w: 1}}\n"
        "workloads: {update_pose: {cpu: 5}}\n");
    const auto mix =
        mix_of("mix: m\npipelines: {p: {closed_loop: {frames: " + std::to_string(frames) +
               "}, tasks: [{workload: update_pose, state: s}]}}\n");
    return run(platform, mix, mode("heft")).warnings;
  };
  EXPECT_THAT(warnings(1), Contains(HasSubstr("the bounds leave out")));
  EXPECT_THAT(warnings(1), testing::Not(Contains(HasSubstr("the plan"))));
  EXPECT_THAT(warnings(2), Contains(HasSubstr("the plan and the bounds leave out")));
}

TEST(Schedule, WarnsWhenAdvancedHasNoCloudAndWhenThereIsNoDsp) {
  const auto record = run(
      platform_of(kOneModelled),
      mix_of("mix: m\npipelines: {p: {rate_hz: 1, real_time: false, tasks: [{workload: fc8}]}}"),
      mode("advanced", 1));
  EXPECT_EQ(record.completed, 1);
  EXPECT_EQ(record.offloaded, 0);
  EXPECT_THAT(record.warnings, Contains(AllOf(HasSubstr("pipeline p"), HasSubstr("cloud"))));
  EXPECT_THAT(record.warnings, Contains(HasSubstr("no unit of role dsp")));
}

TEST(Schedule, SaysWhichWorkloadNobodyServesAndHowToMeasureIt) {
  const auto message = bad_input([] {
    static_cast<void>(run(load_platform("host"), load_mix("convolution-1000"), mode("latency")));
  });
  EXPECT_THAT(
      message,
      AllOf(HasSubstr("convolution"), HasSubstr("cpu: no profile given"),
            HasSubstr("pirt characterize --platform host --filter '^(convolution)$' --db")));
  const auto modelled = bad_input([] {
    static_cast<void>(run(load_platform("snapdragon820"), load_mix("full-robot"), mode("latency")));
  });
  EXPECT_THAT(modelled, AllOf(HasSubstr("no stages"), HasSubstr("workloads:")));
}

TEST(Schedule, DoesNotTakeTheCloudForARealTimeTask) {
  // Without a profile host has the cloud's alexnet only: recognition needs it here,
  // scene_understanding alone would not.
  const auto message = bad_input([] {
    static_cast<void>(run(load_platform("host"), load_mix("full-robot"), mode("advanced")));
  });
  EXPECT_THAT(message,
              HasSubstr("'^(undistort|extract_features|track_features|imu_propagate|update_pose|"
                        "extend_map|alexnet|plan_path|avoid_obstacles)$'"));
  const auto offline = mix_of(
      "mix: m\npipelines: {p: {rate_hz: 1, real_time: false, tasks: [{workload: alexnet}]}}");
  EXPECT_GE(run(load_platform("host"), offline, mode("advanced", 20)).offloaded,
            15);  // In 5 s each.
  EXPECT_THAT(bad_input([&] {
                static_cast<void>(run(load_platform("host"), offline, mode("latency", 2)));
              }),
              HasSubstr("'^(alexnet)$'"));
}

/// An offloaded foreign task on a link of 1 Mbit/s without latency, and what comes after it.
RunRecord run_foreign(const std::string& bytes) {
  const Platform platform = platform_of(R"(
platform: p
units: {cpu: {servers: 1}, cloud: {servers: 1, link: radio}}
links: {radio: {mbit_s: 1}}
workloads: {mine.icp: {cloud: 10}}
)");
  const Mix mix = mix_of(
      "mix: m\npipelines:\n  p:\n    closed_loop: {frames: 1}\n    tasks:\n"
      "      - {workload: mine.icp" +
      bytes + "}\n      - {name: act, service_ms: {cpu: 1}, after: [mine.icp]}\n");
  return run(platform, mix, mode("etf"));
}

TEST(Schedule, AnOffloadedForeignTaskMovesTheBytesThatItIsGiven) {
  const auto has_warning = [](const RunRecord& record) {
    return std::ranges::any_of(record.warnings, [](const std::string& warning) {
      return warning.find("mix m: pipelines.p: mine.icp: nobody has said what") == 0;
    });
  };
  // 10 ms there and 1 ms here.
  const RunRecord nothing = run_foreign("");
  EXPECT_DOUBLE_EQ(nothing.makespan_s, 0.011);
  EXPECT_TRUE(has_warning(nothing));
  // 1000 bytes take 8 ms each way, and 125 bytes 1 ms.
  const RunRecord alike = run_foreign(", bytes: 1000");
  EXPECT_DOUBLE_EQ(alike.makespan_s, 0.027);
  EXPECT_FALSE(has_warning(alike));
  EXPECT_DOUBLE_EQ(run_foreign(", bytes: {in: 1000, out: 125}").makespan_s, 0.020);
  const RunRecord none = run_foreign(", bytes: 0");
  EXPECT_DOUBLE_EQ(none.makespan_s, 0.011);
  EXPECT_FALSE(has_warning(none)) << "that has been said";
}

TEST(Schedule, LeavesOutTheUnitsThatItIsTold) {
  const auto mix = mix_of("mix: m\npipelines: {p: {rate_hz: 10, tasks: [{workload: alexnet}]}}");
  auto options = mode("met", 1);
  const auto with = run(load_platform("fake"), mix, options);
  EXPECT_EQ(unit(with, "gpu").completed, 10);
  options.without = {"gpu", "cloud"};
  const auto record = run(load_platform("fake"), mix, options);
  EXPECT_EQ(unit(record, "gpu").completed, 0);
  EXPECT_NEAR(*unit(record, "gpu").energy_j, 0.1, 1e-12);  // 1 s idle.
  EXPECT_GT(unit(record, "cpu").completed, 0);
  options.without = {"gpuu"};
  EXPECT_THAT(bad_input([&] { static_cast<void>(run(load_platform("fake"), mix, options)); }),
              AllOf(HasSubstr("'gpuu'"), HasSubstr("did you mean gpu")));
  options.without = {"cpu", "gpu", "dsp"};
  EXPECT_THAT(bad_input([&] { static_cast<void>(run(load_platform("fake"), mix, options)); }),
              HasSubstr("left out by --without"));
}

TEST(Schedule, RefusesEligibleThatNamesNothingOrLeavesNothing) {
  const auto refused = [](const std::string& eligible, const std::string& name = "throughput") {
    return bad_input([&] {
      static_cast<void>(run(load_platform("fake"),
                            mix_of("mix: m\npipelines: {p: {rate_hz: 1, eligible: [" + eligible +
                                   "], tasks: [{workload: alexnet}]}}"),
                            mode(name, 1)));
    });
  };
  EXPECT_THAT(refused("gpuu"), AllOf(HasSubstr("'gpuu'"), HasSubstr("did you mean gpu")));
  EXPECT_THAT(refused("fpga"), HasSubstr("leaves no unit"));
  // alexnet on the DSP is too slow for Algorithm 2's weights, and a real-time task never goes to
  // the cloud.
  EXPECT_THAT(refused("dsp"), HasSubstr("gives no weight"));
  for (const char* each : {"advanced", "budget"}) {
    EXPECT_THAT(refused("cloud", each), HasSubstr("would never place it"));
  }
}

TEST(Schedule, RefusesBadOptions) {
  const auto refused = [](const ScheduleOptions& options,
                          const std::string& mix = "convolution-1000") {
    return bad_input(
        [&] { static_cast<void>(run(load_platform("snapdragon820"), load_mix(mix), options)); });
  };
  EXPECT_THAT(refused(mode("latencyy")), HasSubstr("did you mean latency"));
  auto options = mode("latency");
  options.in_flight = 0;
  EXPECT_THAT(refused(options), HasSubstr("--in-flight"));
  EXPECT_THAT(refused(mode("latency", 5)), HasSubstr("--duration"));
  options = mode("advanced");
  options.basic = "advanced";
  EXPECT_THAT(refused(options), HasSubstr("not a basic scheduler"));
  options = mode("latency");
  options.weights = {{"npu", 1}};
  EXPECT_THAT(refused(options), HasSubstr("--weights"));
}

TEST(Schedule, RefusesAPlatformModeThatDoesNotExist) {
  auto platform = platform_of(kOneModelled);
  platform.modes["througput"].in_flight = 3;
  EXPECT_THAT(
      bad_input([&] {
        static_cast<void>(
            run(platform, mix_of("mix: m\npipelines: {p: {rate_hz: 1, tasks: [{workload: fc8}]}}"),
                mode("latency", 1)));
      }),
      AllOf(HasSubstr("'througput'"), HasSubstr("did you mean throughput")));
}

TEST(Schedule, MetersReplaceTheModelOfACall) {
  // 30 ms at 2 W would be 60 mJ; the meter says 10 mJ a call. Idle stays the platform's: 0.5 W for
  // 60 ms.
  auto platform = platform_of(kOneModelled);
  platform.units[0].backend = "fake";
  Profile profile;
  profile.path = "p.db";
  profile.runs.resize(1);
  profile.runs[0].platform = "one";
  profile.runs[0].units = {
      {.unit = "cpu", .backend = "fake", .device = "a device", .device_is_cpu = true, .cores = {}}};
  PhaseRow row;
  row.workload = "fc8";
  row.unit = "cpu";
  row.median = from_ms(30);
  profile.phases = {row};
  EnergyRow energy;
  energy.workload = "fc8";
  energy.unit = "cpu";
  energy.energy_j = 0.010;
  energy.provenance = Provenance::kMeasured;
  profile.energies = {energy};
  const auto mix =
      mix_of("mix: m\npipelines: {p: {closed_loop: {frames: 2}, tasks: [{workload: fc8}]}}");
  const auto record = run_virtual(platform, &profile, mix, mode("throughput"));
  EXPECT_NEAR(record.energy_j.value(), 2 * 0.010 + 0.5 * 0.06, 1e-12);
  EXPECT_EQ(record.profile, "p.db");
  EXPECT_EQ(record.units[0].device, "a device");
  EXPECT_EQ(record.units[0].device_is_cpu, true);
  EXPECT_EQ(record.units[0].provenance, std::vector<std::string>{"measured"});
  EXPECT_EQ(record.units[0].energy_provenance, std::vector<std::string>{"measured"});
}

}  // namespace
}  // namespace pirt::test
