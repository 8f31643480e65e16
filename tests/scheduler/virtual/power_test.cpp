// Joules and when they are drawn: a call's own ones, those of links and contexts, and the cap that
// speaks of any second; worked out by hand.
#include <gtest/gtest.h>

#include <ctime>

#include "scheduler/trace/power_peak.h"
#include "tests/scheduler/virtual/virtual_support.h"

namespace pirt::test {
namespace {

/// One call of 10 ms costs a joule of its own.
const char* const kOwnJoules = R"(
platform: own
units: {dsp: {slots: 1, active_w: 0, energy: {call_j: 1}}}
workloads: {fc8: {dsp: [{on: dsp, ms: 10}]}}
)";

RunRecord watched(const Platform& platform, const Mix& mix, ScheduleOptions options) {
  options.watch_power = true;
  return run(platform, mix, options);
}

TEST(Power, ACallsOwnJoulesAreDrawnWhileItIsServed) {
  // 200 calls of 10 ms one after the other: 100 W all the time.
  const auto record = watched(platform_of(kOwnJoules), closed(200), mode("ect"));
  EXPECT_NEAR(*record.energy_j, 200, 1e-9);
  EXPECT_NEAR(*record.power_highest_w, 100, 1e-6);
  EXPECT_NEAR(*record.average_power_w, 100, 1e-6);
}

// 2 W every other 10 us, above 0.5 W idle. If each change asked for all of the second before it,
// these would be billions of steps.
TEST(Power, TheFullestSecondIsFoundAmongManyChanges) {
  const Platform platform = platform_of(kOneModelled);
  PowerPeak peak(platform);
  const std::vector<int> none;
  const std::clock_t begin = std::clock();
  for (int i = 0; i < 120'000; ++i) {
    if (i % 2 == 0) {
      peak.arrived(0, 1, 2);
    } else {
      peak.departed(0, 1);
    }
    peak.settled(i * Nanos(10'000), none);
  }
  EXPECT_LT(std::clock() - begin, 3 * CLOCKS_PER_SEC) << "of processor time";
  EXPECT_NEAR(peak.highest_w(), 0.5 + 2 * 0.5, 1e-9);
}

TEST(Power, OwnJoulesKeepTheCap) {
  // No second has room for more than five calls.
  ScheduleOptions options = mode("budget");
  options.power_cap_w = 5;
  const auto record = run(platform_of(kOwnJoules), closed(40), options);
  EXPECT_EQ(record.completed, 40);
  EXPECT_LE(*record.power_highest_w, 5 + 1e-9);
  EXPECT_EQ(record.over_cap, 0);
  EXPECT_GT(record.makespan_s, 7);
}

TEST(Power, CallsThatFailHaveDrawnTheirJoules) {
  ScheduleOptions options = mode("ect");
  options.faults = Faults{.seed = 1, .failing = 1, .returning = 0};
  const auto record = run(platform_of(kOwnJoules), closed(10), options);
  EXPECT_EQ(record.failed, 10);
  EXPECT_NEAR(*record.energy_j, 10, 1e-9) << "each was served to its end";
}

TEST(Power, AJouleOfACallThatIsWantedBackIsDrawnByPart) {
  // The cloud takes 4 s and 4 J. The task has to be back 1 s before its deadline at 3 s, so that it
  // has been there for 2 s: 2 J, and the robot's own call draws 1 W for 1 s.
  const auto platform = platform_of(R"(
platform: there
units:
  cpu: {slots: 1, active_w: 1}
  cloud: {role: cloud}
workloads:
  fc8:
    cpu: [{on: cpu, ms: 1000}]
    cloud: [{delay_ms: 4000}]
    call_j: {cloud: 4}
)");
  const auto mix = mix_of(
      "mix: m\npipelines: {a: {rate_hz: 0.1, deadline_ms: 3000, real_time: false, tasks: "
      "[{workload: fc8}]}}\n");
  const auto record = watched(platform, mix, mode("advanced", 10));
  EXPECT_EQ(record.returned, 1);
  EXPECT_NEAR(*record.energy_j, 3, 1e-6);
  EXPECT_NEAR(*record.power_highest_w, 1, 1e-6);
}

TEST(Power, WhatIsDrawnIdleCountsAlone) {
  const auto platform = platform_of(
      "platform: idle\nunits: {cpu: {slots: 1, active_w: 0, idle_w: 1}}\nworkloads: {fc8: {cpu: "
      "[{on: cpu, ms: "
      "30}]}}\n");
  EXPECT_NEAR(*watched(platform, closed(1), mode("ect")).power_highest_w, 1, 1e-9);
}

TEST(Power, LinksCountTowardsTheCap) {
  // alexnet's picture is 227 x 227 x 3 floats, 618,348 bytes: over 100 Mbit/s 49.5 ms, at 20 W
  // 0.989 J each way but for its 4,000 bytes of scores (0.3 ms, 6 mJ); its call 1 mJ.
  const auto platform = platform_of(R"(
platform: linked
units: {gpu: {slots: 1, active_w: 1, link: bus}}
links: {bus: {mbit_s: 100, active_w: 20}}
workloads: {alexnet: {gpu: [{on: gpu, ms: 1}]}}
)");
  const auto free = watched(platform, closed(40, "alexnet"), mode("ect"));
  EXPECT_GT(*free.power_highest_w, 19);
  ScheduleOptions options = mode("budget");
  options.power_cap_w = 4;
  const auto record = run(platform, closed(40, "alexnet"), options);
  EXPECT_EQ(record.completed, 40);
  EXPECT_LE(*record.power_highest_w, 4 + 1e-9);
  EXPECT_GT(*record.power_highest_w, 3.8);
}

TEST(Power, ContextsCountTowardsTheCap) {
  // Each call loads its program, 100 ms at 10 W, and takes 1 ms: 1.01 J, four times a second.
  const auto platform = platform_of(R"(
platform: loads
units: {fpga: {role: fpga, slots: 1, active_w: 10, contexts: {prepare_ms: 100}}}
workloads:
  sobel: {fpga: [{on: fpga, ms: 1}]}
  undistort: {fpga: [{on: fpga, ms: 1}]}
)");
  const auto mix = mix_of(R"(
mix: m
pipelines:
  a: {rate_hz: 2, tasks: [{workload: sobel}]}
  b: {rate_hz: 2, offset_ms: 250, tasks: [{workload: undistort}]}
)");
  ScheduleOptions options = mode("budget", 10);
  options.power_cap_w = 2.1;
  const auto record = run(platform, mix, options);
  EXPECT_GT(record.completed, 10);
  EXPECT_LE(*record.power_highest_w, 2.1 + 1e-9);
  EXPECT_EQ(record.over_cap, 0);
}

TEST(Power, DataOfAnEarlierTaskCountsWhenItIsKnownToMove) {
  // 1 MB over 8 Mbit/s at 2 W: 1 s and 2 J, of which the cap of 1 W leaves room for none.
  const auto platform = platform_of(R"(
platform: moves
units: {cpu: {slots: 1}, gpu: {slots: 1, link: bus}}
links: {bus: {mbit_s: 8, active_w: 2}}
)");
  const auto mix = mix_of(R"(
mix: m
pipelines:
  a:
    closed_loop: {frames: 3}
    tasks:
      - {name: make, service_ms: {cpu: 1}}
      - {name: use, service_ms: {gpu: 1}, after: [{task: make, bytes: 1000000}]}
)");
  ScheduleOptions options = mode("ect", 0, 1);
  const auto free = watched(platform, mix, options);
  EXPECT_NEAR(*free.power_highest_w, 2, 1e-6);
  EXPECT_NEAR(*free.energy_j, 6, 1e-6);
  options.mode = "budget";
  options.power_cap_w = 1;
  const auto capped = run(platform, mix, options);
  EXPECT_EQ(capped.stalled, 1) << "of one frame in flight what reads never starts";
  EXPECT_LE(*capped.power_highest_w, 1);
}

}  // namespace
}  // namespace pirt::test
