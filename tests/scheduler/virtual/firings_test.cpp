// When pipelines fire in virtual time, and what becomes of a firing: rates, closed loops, image
// buffers. Small enough to be worked by hand.
#include "tests/scheduler/virtual/virtual_support.h"

namespace pirt::test {
namespace {

TEST(VirtualTime, DropsAFiringThatFindsNoImageBuffer) {
  // 100 Hz for 50 ms: firings at 0, 10, 20, 30, 40; two buffers; 30 ms each. 0 runs [0, 30), 1
  // waits. 2 finds no buffer. At 30 the completion of 0 comes before the firing of 3 (it was set
  // going earlier), which takes its buffer; 1 runs [30, 60), 3 [60, 90). 4 finds none. At 50 one is
  // complete, 1 has 20 of its 30 ms; 40 ms more and all are. Fired at 10 and 30, with a deadline of
  // 35 1 is late by then, 3 is not.
  const auto record = run(platform_of(kOneModelled), mix_of(R"(
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
  const auto record = run(platform_of(kOneModelled), mix_of(R"(
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
  const auto record = run(platform_of(kOneModelled), mix_of(R"(
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

TEST(VirtualTime, FiresAtMultiplesOfThePeriodUntilTheDuration) {
  // 3 Hz for 2 s: 0, 1/3, ..., 5/3: six firings, and the last one does not come at 2.
  const auto record = run(platform_of(kOneModelled),
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
  const auto platform = platform_of(kOneModelled);
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

TEST(VirtualTime, ClosedLoopsKeepTheirFramesWhenBuffersRunOut) {
  // In flight 3, but two buffers: of the first three firings one is dropped; the other two go on,
  // one for one, to the end: whoever has no buffer then waits for one.
  const auto record = run(platform_of(kOneModelled), mix_of(R"(
mix: m
image_buffers: 2
pipelines: {p: {closed_loop: {frames: 10}, tasks: [{workload: fc8, image_input: true}]}}
)"),
                          mode("throughput", 0, 3));
  EXPECT_EQ(record.pipelines[0].fired, 10);
  EXPECT_EQ(record.pipelines[0].completed, 9);
  EXPECT_EQ(record.dropped, 1);
}

TEST(VirtualTime, AClosedLoopThatFoundNoBufferAtAllGoesOnWhenOneIsFree) {
  // `first` holds the only buffer until 30 ms; `loop`, which found none at 0, fires again then.
  const auto record = run(platform_of(kOneModelled), mix_of(R"(
mix: m
image_buffers: 1
pipelines:
  first: {closed_loop: {frames: 1}, tasks: [{workload: fc8, image_input: true}]}
  loop: {closed_loop: {frames: 3}, tasks: [{workload: fc8, image_input: true}]}
)"),
                          mode("throughput", 0, 1));
  EXPECT_EQ(record.pipelines[1].fired, 3);
  EXPECT_EQ(record.pipelines[1].completed, 2);
  EXPECT_DOUBLE_EQ(record.makespan_s, 0.09);
}

TEST(VirtualTime, AClosedLoopThatMissedABufferHasAllItsFramesInFlightAgainWhenOneIsFree) {
  // Six servers of 30 ms, two buffers: `other` has one of them until 30 ms and then no frame more,
  // so that of the loop's two frames at 0 one is dropped; from 30 ms on two are in flight: two each
  // at 30, 60 and 90. One at a time they would take till 210.
  ScheduleOptions options = mode("throughput", 0, 2);
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
  const auto record = run(platform_of(kOneModelled), mix_of(R"(
mix: m
image_buffers: 1
pipelines:
  first: {closed_loop: {frames: 1}, tasks: [{workload: fc8, image_input: true}]}
  loop: {closed_loop: {frames: 2}, tasks: [{workload: fc8, image_input: true}]}
)"),
                          mode("throughput", 0, 2));
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

TEST(VirtualTime, NothingFiresAtOrAfterTheDurationNotEvenAClosedLoop) {
  // 30 ms each: the loop's first [0, 30), the clock's [30, 60), the loop's second, fired at 30,
  // ends at 90, the duration: it is the last.
  const auto record = run(platform_of(kOneModelled), mix_of(R"(
mix: m
pipelines:
  loop: {closed_loop: {frames: 100}, tasks: [{workload: fc8}]}
  clock: {rate_hz: 1, tasks: [{workload: fc8}]}
)"),
                          mode("throughput", 0.09, 1));
  EXPECT_EQ(record.pipelines[0].fired, 2);
  EXPECT_EQ(record.pipelines[0].completed, 2);
  EXPECT_EQ(record.pipelines[1].completed, 1);
  EXPECT_EQ(record.queued, 0);
  EXPECT_EQ(record.drain_s, 0);
}

TEST(VirtualTime, HoldsClosedLoopTasksBeyondTheWeights) {
  // In flight 4, but the unit's weight is 1: latency counts from the dispatch, so that it is 30 ms
  // for each.
  ScheduleOptions options = mode("throughput", 0, 4);
  options.weights = {{"cpu", 1}};
  const auto mix = closed(8);
  const auto held = run(platform_of(kOneModelled), mix, options);
  EXPECT_DOUBLE_EQ(*held.mean_latency_ms, 30);
  EXPECT_EQ(held.overflow, "hold");
  // Literally all four are queued on the CPU: 30, 60, 90 and then five times 120: 780 / 8.
  options.overflow = Overflow::kLiteral;
  const auto literal = run(platform_of(kOneModelled), mix, options);
  EXPECT_DOUBLE_EQ(*literal.mean_latency_ms, 97.5);
  EXPECT_EQ(literal.overflow, "literal");
}

}  // namespace
}  // namespace pirt::test
