// Whole runs in virtual time, small enough to be worked by hand.
#include "scheduler/virtual/virtual_time.h"

#include "scheduler/record/summary.h"
#include "scheduler/services/scenario.h"
#include "tests/scheduler/support.h"
#include "workloads/base/math/random.h"
#include "workloads/base/text/json.h"

namespace pirt::test {
namespace {

using testing::AllOf;
using testing::Contains;
using testing::HasSubstr;
using testing::IsEmpty;

RunRecord run(const Platform& platform, const Mix& mix, ScheduleOptions options) {
  return run_virtual(platform, nullptr, mix, options);
}

ScheduleOptions mode(const std::string& name, double duration_s = 0) {
  ScheduleOptions options;
  options.mode = name;
  if (duration_s > 0) options.duration = from_s(duration_s);
  return options;
}

const UnitResult& unit(const RunRecord& record, const std::string& name) {
  return *std::ranges::find(record.units, name, &UnitResult::unit);
}

void expect_balanced(const RunRecord& record) {
  EXPECT_EQ(record.submitted,
            record.completed + record.dropped + record.expired + record.failed + record.queued);
}

/// One unit `cpu` that serves fc8 in 30 ms, one at a time.
const std::string kOneUnit = R"(
platform: one
units: {cpu: {slots: 1, active_w: 2, idle_w: 0.5}}
workloads: {fc8: {cpu: [{on: cpu, ms: 30}]}}
)";

TEST(VirtualTime, DropsAFiringThatFindsNoImageBuffer) {
  // 100 Hz for 50 ms: firings at 0, 10, 20, 30, 40; two buffers; 30 ms each. 0 runs [0, 30), 1
  // waits. 2 finds no buffer. At 30 the completion of 0 comes before the firing of 3 (it was set
  // going earlier), which takes its buffer; 1 runs [30, 60), 3 [60, 90). 4 finds none. At 50 one is
  // complete, 1 has 20 of its 30 ms; 40 ms more and all are. Fired at 10 and 30, with a deadline of
  // 35 1 is late by then, 3 is not.
  const auto record = run(platform_of(kOneUnit), mix_of(R"(
mix: m
image_buffers: 2
pipelines:
  camera:
    rate_hz: 100
    deadline_ms: 35
    tasks: [{workload: fc8, image_input: true}]
)"),
                          mode("throughput", 0.05));
  EXPECT_EQ(record.submitted, 5);
  EXPECT_EQ(record.completed, 1);
  EXPECT_EQ(record.dropped, 2);
  EXPECT_EQ(record.queued, 2);
  EXPECT_EQ(record.stalled, 0);
  const PipelineResult& camera = record.pipelines[0];
  EXPECT_EQ(camera.fired, 5);
  EXPECT_EQ(camera.completed, 1);
  EXPECT_EQ(camera.dropped, 2);
  EXPECT_EQ(camera.unfinished, 2);
  EXPECT_EQ(camera.deadline_misses, 1);
  EXPECT_NEAR(*camera.p50_ms, 30, 0.05);
  EXPECT_DOUBLE_EQ(record.makespan_s, 0.05);
  EXPECT_DOUBLE_EQ(*record.drain_s, 0.04);
  // 50 ms busy at 2 W, 50 ms at 0.5 W.
  EXPECT_DOUBLE_EQ(unit(record, "cpu").busy_s, 0.05);
  EXPECT_NEAR(record.energy_j.value(), 0.1 + 0.025, 1e-12);
  EXPECT_NEAR(*camera.rate_hz, 1 / 0.05, 1e-9);
}

TEST(VirtualTime, CountsEveryTaskOfADroppedFiring) {
  // One buffer, held until the last image task is done. 50 Hz for 40 ms: the second firing, at 20
  // ms, finds it taken.
  const auto record = run(platform_of(kOneUnit), mix_of(R"(
mix: m
image_buffers: 1
pipelines:
  camera:
    rate_hz: 50
    tasks:
      - {name: a, workload: fc8, image_input: true}
      - {name: b, workload: fc8, after: [a]}
      - {name: c, workload: fc8, after: [b]}
)"),
                          mode("throughput", 0.04));
  EXPECT_EQ(record.submitted, 6);
  EXPECT_EQ(record.dropped, 3);
  EXPECT_EQ(record.completed, 1);  // At 40 ms: a since 30; b has begun.
  EXPECT_EQ(record.queued, 2);
  EXPECT_DOUBLE_EQ(*record.drain_s, 0.05);
  EXPECT_FALSE(record.pipelines[0].deadline_misses);
}

TEST(VirtualTime, FreesABufferWithTheLastImageTask) {
  // As above, but at 40 ms only b and c, which take no image, are under way: the buffer is free
  // again since 30.
  const auto record = run(platform_of(kOneUnit), mix_of(R"(
mix: m
image_buffers: 1
pipelines:
  camera:
    rate_hz: 25
    tasks: [{name: a, workload: fc8, image_input: true}, {name: b, workload: fc8, after: [a]}]
)"),
                          mode("throughput", 0.08));
  EXPECT_EQ(record.dropped, 0);
  EXPECT_EQ(record.completed, 2);  // By 80 ms; b of 0 and a of 1 follow one another.
  EXPECT_EQ(record.queued, 2);
}

TEST(VirtualTime, ExpiresTasksThatDoNotStartInTime) {
  // 100 Hz for 50 ms, 30 ms each, to be started within 25 ms: 0 runs [0, 30); 1 (fired 10) would
  // start at 30, in time; 2 (fired 20) at 60, expires at 45.
  const auto record = run(platform_of(kOneUnit), mix_of(R"(
mix: m
pipelines:
  p: {rate_hz: 100, expires_ms: 25, tasks: [{name: a, workload: fc8}, {name: b, workload: fc8, after: [a]}]}
)"),
                          mode("throughput", 0.05));
  // By 50: b of 0 expired at 25, before it was released; b of 1 at 35; a of 2, with its b, at 45. a
  // of 1 has begun and is all that is left of it; 3 and 4 (fired 30, 40) wait as a whole.
  EXPECT_EQ(record.submitted, 10);
  EXPECT_EQ(record.completed, 1);
  EXPECT_EQ(record.expired, 3);
  EXPECT_EQ(record.dropped, 1);
  EXPECT_EQ(record.queued, 5);
  EXPECT_EQ(record.pipelines[0].completed, 0);
  EXPECT_EQ(record.pipelines[0].dropped, 2);
  EXPECT_EQ(record.pipelines[0].unfinished, 3);
  EXPECT_FALSE(record.pipelines[0].p50_ms);
}

TEST(VirtualTime, FiresAtMultiplesOfThePeriodUntilTheDuration) {
  // 3 Hz for 2 s: 0, 1/3, ..., 5/3: six firings, and the last one does not come at 2.
  const auto record = run(platform_of(kOneUnit),
                          mix_of("mix: m\npipelines: {p: {rate_hz: 3, tasks: [{workload: fc8}]}}"),
                          mode("throughput", 2));
  EXPECT_EQ(record.pipelines[0].fired, 6);
  EXPECT_DOUBLE_EQ(*record.pipelines[0].rate_hz, 3);
  EXPECT_DOUBLE_EQ(record.makespan_s,
                   2);  // The last completion is at 1.697 s, but the robot is on for 2 s.
  EXPECT_EQ(record.duration_s, 2);
  EXPECT_FALSE(record.in_flight);
}

TEST(VirtualTime, AnOffsetAndJitterMoveFirings) {
  // 3 Hz for 2 s, from 0.5 on: 0.5, 0.833, ..., 1.833: five firings.
  const std::string line = "rate_hz: 3, offset_ms: 500, tasks: [{workload: fc8}]";
  const auto platform = platform_of(kOneUnit);
  const auto late =
      run(platform, mix_of("mix: m\npipelines: {p: {" + line + "}}"), mode("throughput", 2));
  EXPECT_EQ(late.pipelines[0].fired, 5);
  // Each up to 30 ms later: beside an equal pipeline at the nominal time, whose 30 ms it waits for,
  // it takes 30 + 30 - jitter, 45 on average.
  const auto mix =
      mix_of("mix: m\npipelines:\n  p: {" + line + "}\n  q: {jitter_ms: 30, " + line + "}\n");
  auto options = mode("throughput", 300);
  const auto one = run(platform, mix, options);
  EXPECT_NEAR(*one.pipelines[0].p99_ms, 30, 0.1);
  EXPECT_NEAR(*one.pipelines[1].p50_ms, 45, 2);
  EXPECT_GT(*one.pipelines[1].p99_ms, 58);
  EXPECT_LE(*one.pipelines[1].p99_ms, 60.1);
  EXPECT_EQ(one, run(platform, mix, options));
  options.seed = 2;
  EXPECT_NE(one.pipelines[1], run(platform, mix, options).pipelines[1]);
}

TEST(VirtualTime, SharesCoresBetweenStagesOfSeveralUnits) {
  // Two cores, shared. In flight 3, one each of: cpu 4 ms; gpu frames with 2 ms on the cores, then
  // 1 ms kernel. Weights gpu 2, cpu 1. At 0 all three are on the cores at rate 2/3: the gpu's 2 ms
  // end at 3; the cpu's 4 then has 2 left, alone: 5. Kernels: the first [3, 4), the second [4, 5).
  const auto platform = platform_of(R"(
platform: shared
units:
  cpu: {servers: 2, discipline: processor_sharing, active_w: 1}
  gpu: {active_w: 10}
workloads:
  convolution:
    cpu: [{on: cpu, ms: 4}]
    gpu: [{on: cpu, ms: 2, name: host}, {on: gpu, ms: 1, name: kernel}]
)");
  ScheduleOptions options = mode("throughput");
  options.weights = {{"gpu", 2}, {"cpu", 1}};
  options.in_flight = 3;
  const auto record = run(
      platform,
      mix_of(
          "mix: m\npipelines: {p: {closed_loop: {frames: 3}, tasks: [{workload: convolution}]}}"),
      options);
  EXPECT_DOUBLE_EQ(record.makespan_s, 0.005);
  EXPECT_DOUBLE_EQ(*unit(record, "cpu").mean_latency_ms, 5);
  EXPECT_DOUBLE_EQ(*unit(record, "gpu").mean_latency_ms, 4.5);
  EXPECT_DOUBLE_EQ(unit(record, "cpu").busy_s,
                   0.008);  // 4 + 2 + 2 core-milliseconds, whoever they are for.
  EXPECT_DOUBLE_EQ(*unit(record, "cpu").utilization, 0.8);
  EXPECT_NEAR(record.energy_j.value(), 0.008 * 1 + 0.002 * 10, 1e-12);
}

TEST(VirtualTime, RefusesRunsThatNoNanosecondsCount) {
  // 11.6 days a frame, one after the other: more than 300 years; and a thousand side by side, whose
  // first ends after 31 years.
  for (const std::string of : {"discipline: fifo", "discipline: processor_sharing"}) {
    const auto platform = platform_of("platform: slow\nunits: {cpu: {active_w: 1, slots: 1000, " +
                                      of + "}}\nworkloads: {fc8: {cpu: [{on: cpu, ms: 1e9}]}}");
    const auto mix = mix_of(
        "mix: m\npipelines: {p: {closed_loop: {frames: 1000000}, tasks: [{workload: fc8}]}}");
    auto options = mode("olb");
    options.in_flight = 1000;
    EXPECT_THAT(bad_input([&] { static_cast<void>(run(platform, mix, options)); }),
                HasSubstr("20 years"));
  }
}

TEST(VirtualTime, ScaledStagesTakeLongerAndCostTheSame) {
  auto platform = platform_of(kOneUnit);
  platform.modes["throughput"].stage_scale = {{"cpu.execute", 1.5}};
  platform.units[0].idle_w = 0;
  const auto record =
      run(platform,
          mix_of("mix: m\npipelines: {p: {closed_loop: {frames: 2}, tasks: [{workload: fc8}]}}"),
          mode("throughput"));
  EXPECT_DOUBLE_EQ(record.makespan_s, 0.09);
  EXPECT_DOUBLE_EQ(unit(record, "cpu").busy_s, 0.09);
  EXPECT_NEAR(record.energy_j.value(), 2 * 0.06, 1e-12);
}

TEST(VirtualTime, ATaskWithADeadlineComesBackFromTheCloudInTime) {
  // The cloud takes 500 ms, the cpu 20 ms. Two at 10 Hz, due at 100: what has not come back by 80
  // is computed here and done at 100. One of them runs in the cloud, the other one waits: for a
  // slot, or for its server.
  for (const char* slots : {"1", "2"}) {
    const auto platform = platform_of(std::string(R"(
platform: p
units: {cpu: {servers: 2, active_w: 1}, cloud: {slots: )") +
                                      slots +
                                      R"(, active_w: 2}}
workloads: {fc8: {cpu: [{on: cpu, ms: 20}], cloud: [{on: cloud, ms: 500}]}}
)");
    const auto mix = mix_of(R"(
mix: m
pipelines:
  p: {rate_hz: 10, real_time: false, deadline_ms: 100, tasks: [{workload: fc8}]}
  q: {rate_hz: 10, real_time: false, deadline_ms: 100, tasks: [{workload: fc8}]}
)");
    const auto record = run(platform, mix, mode("advanced", 0.41));
    EXPECT_EQ(record.offloaded, 0) << slots;
    EXPECT_EQ(record.completed, 8) << slots;
    for (const PipelineResult& each : record.pipelines) {
      EXPECT_EQ(each.deadline_misses, 0) << slots;
      EXPECT_NEAR(*each.p99_ms, 100, 0.1) << slots;
    }
    // One of each two ran there for 80 ms, and the next pair's for 10.
    EXPECT_NEAR(unit(record, "cloud").busy_s, 4 * 0.08 + 0.01, 1e-9) << slots;
    EXPECT_NEAR(unit(record, "cloud").energy_j.value(), 2 * (4 * 0.08 + 0.01), 1e-9) << slots;
  }
}

// Ten minutes without the cloud, at 10 tasks a second that are meant for it.
TEST(VirtualTime, AnOutageOfTheCloudCostsNoRealTimeTaskItsDeadline) {
  const auto platform = platform_of(R"(
platform: p
units: {cpu: {slots: 1, active_w: 1}, cloud: {servers: 4}}
workloads: {fc8: {cpu: [{on: cpu, ms: 3}], cloud: [{delay_ms: 80}]}}
)");
  const auto mix = mix_of(R"(
mix: m
pipelines:
  camera: {rate_hz: 100, deadline_ms: 10, tasks: [{workload: fc8, image_input: true}]}
  far: {rate_hz: 10, real_time: false, tasks: [{workload: fc8}]}
)");
  const auto outage = [&](bool away) {
    const auto driver = [away](const Scenario& scenario, Dispatcher& dispatcher, TraceWriter*) {
      VirtualTime time(scenario, dispatcher);
      time.begin();
      const auto is = [&](UnitState state, double at_s) {
        while (time.next() <= from_s(at_s)) static_cast<void>(time.advance());
        time.set_unit(1, state, from_s(at_s));
      };
      if (away) is(UnitState::kDraining, 60);
      if (away) is(UnitState::kUp, 660);
      while (time.advance()) continue;
      return time.finish();
    };
    return run_mix(platform, nullptr, mix, mode("advanced", 720), driver, "virtual");
  };
  const auto usual = outage(false), without = outage(true);
  for (const RunRecord* each : {&usual, &without}) {
    EXPECT_EQ(each->pipelines[0].completed, 72'000);
    EXPECT_EQ(each->pipelines[0].deadline_misses, 0);
    EXPECT_GE(each->pipelines[1].completed, 7'199) << "the last one may be under way";
  }
  EXPECT_EQ(usual.offloaded, usual.pipelines[1].completed);
  EXPECT_EQ(without.offloaded, without.pipelines[1].completed - 6'000);
}

TEST(VirtualTime, ATaskLeavesTimeForThoseAfterIt) {
  // a and b take 20 ms here, one after the other: a has to be back at 60 to be done at 80, b begins
  // then.
  const auto platform = platform_of(R"(
platform: p
units: {cpu: {slots: 1}, cloud: {servers: 4}}
workloads: {fc8: {cpu: [{on: cpu, ms: 20}], cloud: [{delay_ms: 500}]}}
)");
  const auto mix = mix_of(R"(
mix: m
pipelines:
  p:
    rate_hz: 1
    real_time: false
    deadline_ms: 100
    tasks: [{name: a, workload: fc8}, {name: b, workload: fc8, after: [a]}]
)");
  const auto record = run(platform, mix, mode("advanced", 0.5));
  EXPECT_EQ(record.pipelines[0].completed, 1);
  EXPECT_EQ(record.pipelines[0].deadline_misses, 0);
  EXPECT_NEAR(*record.pipelines[0].p99_ms, 100, 0.1);
}

TEST(VirtualTime, SendsInputsAndOutputsOverTheLink) {
  // fc8: 4096 floats in = 16384 B, at 8 Mbit/s 16.384 ms; 1000 out = 4000 B, 4 ms; latency 10 ms
  // each way; the cloud takes 5 ms. Two calls at once. Inputs are sent [0, 16.384) and [16.384,
  // 32.768). The first result is ready at 31.384, waits for the link, is sent [32.768, 36.768) and
  // there at 46.768. The second is ready at 47.768, sent till 51.768 and there at 61.768.
  const auto platform = platform_of(R"(
platform: linked
units: {cpu: {}, cloud: {servers: 64, link: up}}
links: {up: {mbit_s: 8, latency_ms: 10, active_w: 0.5}}
workloads: {fc8: {cpu: [{on: cpu, ms: 1}], cloud: [{on: cloud, ms: 5}], call_j: {cloud: 0.25}}}
)");
  const auto mix = mix_of(R"(
mix: m
pipelines:
  p: {rate_hz: 1, real_time: false, tasks: [{name: a, workload: fc8}, {name: b, workload: fc8}]}
)");
  const auto record = run(platform, mix, mode("advanced", 0.5));
  EXPECT_EQ(record.offloaded, 2);
  EXPECT_DOUBLE_EQ(*unit(record, "cloud").mean_latency_ms, (46.768 + 61.768) / 2);
  // Sending only: 2 * (16.384 + 4) ms at 0.5 W, and 0.25 J a call.
  EXPECT_NEAR(unit(record, "cloud").energy_j.value(), 0.5 * 2 * 0.020384 + 0.5, 1e-12);
}

TEST(VirtualTime, TakesBytesFromTheEdgeWhereGiven) {
  // b's 1000 given bytes instead of its tensors: 1 ms at 8 Mbit/s, output 4 ms, cloud 5 ms; no
  // latency.
  const auto platform = platform_of(R"(
platform: linked
units: {cloud: {link: up}, cpu: {}}
links: {up: {mbit_s: 8}}
workloads: {fc8: {cloud: [{on: cloud, ms: 5}], cpu: [{on: cpu, ms: 1}]}}
)");
  const auto record = run(platform, mix_of(R"(
mix: m
pipelines:
  p: {rate_hz: 1, real_time: false, tasks: [{name: a, workload: fc8}, {name: b, workload: fc8, after: [{task: a, bytes: 1000}]}]}
)"),
                          mode("advanced", 0.5));
  EXPECT_DOUBLE_EQ(*unit(record, "cloud").mean_latency_ms, (16.384 + 5 + 4 + 1 + 5 + 4) / 2);
}

TEST(VirtualTime, DrawsUniformDelaysWithinTheirBoundsFromTheSeed) {
  const auto platform = load_platform("fake");
  const auto mix = mix_of(
      "mix: m\npipelines: {p: {rate_hz: 1, real_time: false, tasks: [{workload: alexnet}]}}");
  ScheduleOptions options = mode("advanced", 1000);
  const auto record = run(platform, mix, options);
  // Fired at 0, 1, ..., 999 s: all of those up to 995 are back by 1000 s.
  EXPECT_EQ(record.submitted, 1000);
  EXPECT_GE(record.offloaded, 996);
  // Uniform in [2000, 5000] ms: the mean of 1000 has a standard deviation of 866/sqrt(1000) = 27
  // ms; five of them.
  EXPECT_NEAR(*unit(record, "cloud").mean_latency_ms, 3500, 137);
  EXPECT_LE(*record.pipelines[0].p99_ms, 5000);
  EXPECT_GE(*record.pipelines[0].p99_ms, 4850);
  EXPECT_EQ(to_json(run(platform, mix, options)), to_json(record));
  options.seed = 2;
  EXPECT_NE(run(platform, mix, options).mean_latency_ms, record.mean_latency_ms);
}

TEST(VirtualTime, ClosedLoopsKeepTheirFramesWhenBuffersRunOut) {
  // In flight 3, but two buffers: of the first three firings one is dropped; the other two go on,
  // one for one, to the end: whoever has no buffer then waits for one.
  ScheduleOptions options = mode("throughput");
  options.in_flight = 3;
  const auto record = run(platform_of(kOneUnit), mix_of(R"(
mix: m
image_buffers: 2
pipelines: {p: {closed_loop: {frames: 10}, tasks: [{workload: fc8, image_input: true}]}}
)"),
                          options);
  EXPECT_EQ(record.pipelines[0].fired, 10);
  EXPECT_EQ(record.pipelines[0].completed, 9);
  EXPECT_EQ(record.dropped, 1);
}

TEST(VirtualTime, AClosedLoopThatFoundNoBufferAtAllGoesOnWhenOneIsFree) {
  // `first` holds the only buffer until 30 ms; `loop`, which found none at 0, fires again then.
  const auto record = run(platform_of(kOneUnit), mix_of(R"(
mix: m
image_buffers: 1
pipelines:
  first: {closed_loop: {frames: 1}, tasks: [{workload: fc8, image_input: true}]}
  loop: {closed_loop: {frames: 3}, tasks: [{workload: fc8, image_input: true}]}
)"),
                          [] {
                            auto options = mode("throughput");
                            options.in_flight = 1;
                            return options;
                          }());
  EXPECT_EQ(record.pipelines[1].fired, 3);
  EXPECT_EQ(record.pipelines[1].completed, 2);
  EXPECT_DOUBLE_EQ(record.makespan_s, 0.09);
}

TEST(VirtualTime, AClosedLoopThatMissedABufferHasAllItsFramesInFlightAgainWhenOneIsFree) {
  // Six servers of 30 ms, two buffers: `other` has one of them until 30 ms and then no frame more,
  // so that of the loop's two frames at 0 one is dropped; from 30 ms on two are in flight: two each
  // at 30, 60 and 90. One at a time they would take till 210.
  ScheduleOptions options = mode("throughput");
  options.in_flight = 2;
  options.weights = {{"cpu", 6}};
  const auto record = run(platform_of(R"(
platform: six
units: {cpu: {servers: 6}}
workloads: {fc8: {cpu: [{on: cpu, ms: 30}]}}
)"),
                          mix_of(R"(
mix: m
image_buffers: 2
pipelines:
  other: {closed_loop: {frames: 1}, tasks: [{workload: fc8, image_input: true}]}
  loop: {closed_loop: {frames: 8}, tasks: [{workload: fc8, image_input: true}]}
)"),
                          options);
  EXPECT_EQ(record.pipelines[1].fired, 8);
  EXPECT_EQ(record.pipelines[1].completed, 7);
  EXPECT_EQ(record.dropped, 1);
  EXPECT_DOUBLE_EQ(record.makespan_s, 0.12);  // 1 + 2 + 2 + 2.
}

TEST(VirtualTime, FiresAsManyFramesAsAClosedLoopHasWhenItsFirstFindsNoBuffer) {
  // Both frames are fired at 0; the first finds no buffer, and none is left for its place.
  ScheduleOptions options = mode("throughput");
  options.in_flight = 2;
  const auto record = run(platform_of(kOneUnit), mix_of(R"(
mix: m
image_buffers: 1
pipelines:
  first: {closed_loop: {frames: 1}, tasks: [{workload: fc8, image_input: true}]}
  loop: {closed_loop: {frames: 2}, tasks: [{workload: fc8, image_input: true}]}
)"),
                          options);
  EXPECT_EQ(record.pipelines[1].fired, 2);
  EXPECT_EQ(record.pipelines[1].dropped, 2);
  expect_balanced(record);
}

TEST(VirtualTime, AStarvedPipelineShowsTheRateThatItHad) {
  // 10 Hz of 150 ms each for 60 s: 400 are complete by then. Latency of the n-th: 150 n - 100 (n -
  // 1) ms; deadline 1 s: n = 18 is at 1 s, so that 382 were late. Of the 200 unfinished those fired
  // before 59 s are: all but 59.0 to 59.9, 190.
  auto platform = platform_of(R"(
platform: slow
units: {cpu: {slots: 1, active_w: 2, idle_w: 0.5}}
workloads: {fc8: {cpu: [{on: cpu, ms: 150}], call_j: {cpu: 0.01}}}
)");
  const auto mix =
      mix_of("mix: m\npipelines: {p: {rate_hz: 10, deadline_ms: 1000, tasks: [{workload: fc8}]}}");
  for (const char* name : {"throughput", "ect", "edf", "latency", "olb"}) {
    const auto record = run(platform, mix, mode(name));
    const PipelineResult& p = record.pipelines[0];
    EXPECT_EQ(p.fired, 600) << name;
    EXPECT_EQ(p.completed, 400) << name;
    EXPECT_EQ(p.unfinished, 200) << name;
    EXPECT_EQ(record.queued, 200) << name;
    EXPECT_DOUBLE_EQ(*p.rate_hz, 400 / 60.0) << name;
    EXPECT_EQ(p.deadline_misses, 382 + 190) << name;
    EXPECT_DOUBLE_EQ(record.makespan_s, 60) << name;
    EXPECT_DOUBLE_EQ(*record.drain_s, 30) << name;
    EXPECT_DOUBLE_EQ(unit(record, "cpu").busy_s, 60) << name;
    EXPECT_NEAR(record.energy_j.value(), 60 * 2.5 + 400 * 0.01, 1e-9) << name;
    EXPECT_EQ(record.stalled, 0) << name;
  }
}

TEST(VirtualTime, CountsWhatSharedServersAndLinksServedByTheEnd) {
  // Two cores, shared by three calls of 40 ms, all fired at 0: 60 ms each. At 45 ms 30 of 40 ms are
  // done of each: 90 core-ms. Over the link (1 Mbit/s: 16384 B in 131.072 ms) the cloud's call is
  // sending all the time.
  const auto record = run(platform_of(R"(
platform: shared
units:
  cpu: {servers: 2, discipline: processor_sharing, active_w: 1}
  cloud: {link: up}
links: {up: {mbit_s: 1, active_w: 4}}
workloads:
  fc8: {cloud: [{on: cloud, ms: 5}]}
  fc7: {cpu: [{on: cpu, ms: 40}]}
)"),
                          mix_of(R"(
mix: m
pipelines:
  p: {rate_hz: 1, tasks: [{name: a, workload: fc7}, {name: b, workload: fc7}, {name: c, workload: fc7}]}
  q: {rate_hz: 1, real_time: false, tasks: [{workload: fc8}]}
)"),
                          [] {
                            auto options = mode("advanced", 0.045);
                            options.basic = "ect";
                            return options;
                          }());
  EXPECT_EQ(record.completed, 0);
  EXPECT_EQ(record.queued, 4);
  EXPECT_NEAR(unit(record, "cpu").busy_s, 0.09, 1e-8);
  EXPECT_NEAR(unit(record, "cpu").energy_j.value(), 0.09, 1e-8);
  EXPECT_NEAR(unit(record, "cloud").energy_j.value(), 0.045 * 4, 1e-8);
}

TEST(VirtualTime, NothingFiresAtOrAfterTheDurationNotEvenAClosedLoop) {
  // 30 ms each: the loop's first [0, 30), the clock's [30, 60), the loop's second, fired at 30,
  // ends at 90, the duration: it is the last.
  const auto record = run(platform_of(kOneUnit), mix_of(R"(
mix: m
pipelines:
  loop: {closed_loop: {frames: 100}, tasks: [{workload: fc8}]}
  clock: {rate_hz: 1, tasks: [{workload: fc8}]}
)"),
                          [] {
                            auto options = mode("throughput", 0.09);
                            options.in_flight = 1;
                            return options;
                          }());
  EXPECT_EQ(record.pipelines[0].fired, 2);
  EXPECT_EQ(record.pipelines[0].completed, 2);
  EXPECT_EQ(record.pipelines[1].completed, 1);
  EXPECT_EQ(record.queued, 0);
  EXPECT_EQ(record.drain_s, 0);
}

TEST(VirtualTime, SaysWhichTasksNothingIsEverGoingToStart) {
  // A policy that takes two tasks and then refuses for ever.
  class TakesTwo final : public Policy {
   public:
    Placement place(const TaskClass&, const UnitsView&) override {
      return taken_++ < 2 ? Placement::on(0) : Placement::hold();
    }
    UnitMask takers(const TaskClass& task, UnitMask) const override { return task.eligible; }
    const std::vector<UnitId>& order() const override { return order_; }

   private:
    int taken_ = 0;
    std::vector<UnitId> order_ = {0};
  };
  const auto platform = platform_of(kOneUnit);
  const auto mix =
      mix_of("mix: m\npipelines: {p: {closed_loop: {frames: 5}, tasks: [{workload: fc8}]}}");
  Scenario scenario = make_scenario(platform, nullptr, mix, {}, CloudUse::kNone);
  scenario.in_flight = {3};
  Dispatcher dispatcher({1}, std::make_unique<TakesTwo>());
  const Tally tally = VirtualTime(scenario, dispatcher).run();
  const auto record = summarize(scenario, nullptr, {}, tally);
  EXPECT_EQ(record.completed, 2);
  EXPECT_EQ(record.queued, 3);
  EXPECT_EQ(record.stalled, 3);
  EXPECT_EQ(record.pipelines[0].unfinished, 3);
  expect_balanced(record);
}

TEST(VirtualTime, HoldsClosedLoopTasksBeyondTheWeights) {
  // In flight 4, but the unit's weight is 1: latency counts from the dispatch, so that it is 30 ms
  // for each.
  ScheduleOptions options = mode("throughput");
  options.in_flight = 4;
  options.weights = {{"cpu", 1}};
  const auto mix =
      mix_of("mix: m\npipelines: {p: {closed_loop: {frames: 8}, tasks: [{workload: fc8}]}}");
  const auto held = run(platform_of(kOneUnit), mix, options);
  EXPECT_DOUBLE_EQ(*held.mean_latency_ms, 30);
  EXPECT_EQ(held.overflow, "hold");
  // Literally all four are queued on the CPU: 30, 60, 90 and then five times 120: 780 / 8.
  options.overflow = Overflow::kLiteral;
  const auto literal = run(platform_of(kOneUnit), mix, options);
  EXPECT_DOUBLE_EQ(*literal.mean_latency_ms, 97.5);
  EXPECT_EQ(literal.overflow, "literal");
}

TEST(VirtualTime, EverythingBalancesInRandomMixes) {
  const auto platform = load_platform("fake");
  const std::vector<std::string> workloads = {"gaussian_blur", "convolution", "undistort", "fc8",
                                              "feature_detect"};
  for (std::uint64_t seed = 0; seed < 200; ++seed) {
    Random random(seed);
    const auto pick = [&](std::uint64_t n) { return std::to_string(1 + random.below(n)); };
    std::string yaml = "mix: random\nimage_buffers: " + pick(4) + "\npipelines:\n";
    for (int p = 0; p < 4; ++p) {
      yaml += "  p" + std::to_string(p) + ":\n    " +
              (random.below(2) == 0 ? "rate_hz: " + pick(200)
                                    : "closed_loop: {frames: " + pick(50) + "}") +
              "\n    real_time: " + (random.below(4) != 0 ? "true" : "false") +
              "\n    deadline_ms: " + pick(50) + "\n" +
              (random.below(2) == 0 ? "    expires_ms: " + pick(60) + "\n" : "") + "    tasks:\n";
      for (int t = 0; t < 4; ++t) {
        yaml += "      - {name: t" + std::to_string(t) +
                ", workload: " + workloads[random.below(5)] +
                ", image_input: " + (random.below(2) == 0 ? "true" : "false");
        if (t > 0)
          yaml += ", after: [t" + std::to_string(random.below(static_cast<std::uint64_t>(t))) + "]";
        yaml += "}\n";
      }
    }
    const Mix mix = mix_of(yaml);
    ScheduleOptions options = mode(policy_names()[random.below(4)]);
    if (mix.open_loop()) options.duration = from_s(0.3);
    options.seed = seed;
    const auto record = run(platform, mix, options);
    SCOPED_TRACE("seed " + std::to_string(seed) + ", " + options.mode);
    expect_balanced(record);
    EXPECT_EQ(record.stalled, 0);
    EXPECT_TRUE(mix.open_loop() || record.queued == 0);
    std::int64_t fired = 0;
    std::int64_t served = 0;
    for (const auto& pipeline : record.pipelines) {
      EXPECT_EQ(pipeline.fired, pipeline.completed + pipeline.dropped + pipeline.unfinished);
      fired += pipeline.fired;
    }
    for (const auto& each : record.units) {
      served += each.completed;
      EXPECT_LE(each.utilization.value_or(0), 1 + 1e-9);
    }
    EXPECT_EQ(record.submitted, 4 * fired);
    EXPECT_EQ(record.completed, served);
    for (std::size_t p = 0; p < mix.pipelines.size(); ++p) {
      const auto frames = mix.pipelines[p].frames.value_or(record.pipelines[p].fired);
      EXPECT_LE(record.pipelines[p].fired, frames);
      EXPECT_TRUE(mix.open_loop() || record.pipelines[p].fired == frames);
    }
    ASSERT_EQ(to_json(run(platform, mix, options)), to_json(record));
    ASSERT_FALSE(testing::Test::HasFailure());
  }
}

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

TEST(Schedule, WarnsWhenAdvancedHasNoCloudAndWhenThereIsNoDsp) {
  const auto record = run(
      platform_of(kOneUnit),
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
  EXPECT_THAT(refused("cloud", "advanced"), HasSubstr("would never place it"));
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
  auto platform = platform_of(kOneUnit);
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
  auto platform = platform_of(kOneUnit);
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
  row.valid = true;
  row.median = from_ms(30);
  profile.phases = {row};
  EnergyRow energy;
  energy.workload = "fc8";
  energy.unit = "cpu";
  energy.energy_j = 0.010;
  energy.provenance = Provenance::kMeasured;
  energy.valid = true;
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

TEST(VirtualTime, AnImageOnTheJetsonTakesWhatTableFourPrints) {
  const Mix mix =
      mix_of("mix: m\npipelines: {p: {closed_loop: {frames: 10}, tasks: [{workload: alexnet}]}}\n");
  for (const auto& [mode, ms, joules] :
       {std::tuple("cpu-only", 400.0, 0.8), std::tuple("throughput", 33.0, 0.132)}) {
    ScheduleOptions options;
    options.mode = mode;
    options.in_flight = 1;
    if (mode == std::string("throughput")) options.weights = {{"gpu", 1}};
    const RunRecord record = run_virtual(load_platform("jetson-tx1"), nullptr, mix, options);
    EXPECT_NEAR(record.makespan_s, 10 * ms / 1e3, 1e-9) << mode;
    EXPECT_NEAR(record.energy_j.value(), 10 * joules, 1e-9) << mode;
  }
}

}  // namespace
}  // namespace pirt::test
