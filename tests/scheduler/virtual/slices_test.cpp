// Calls that are left between two slices for more urgent ones: the dispatcher's sequences and
// virtual time, worked by hand, and what mode budget makes of it.
#include <ctime>
#include <filesystem>

#include "scheduler/trace/replay.h"
#include "tests/scheduler/virtual/virtual_support.h"

namespace pirt::test {
namespace {

/// Two workloads on the GPU alone, as many at a time as the weight says, one after the other.
Script script_of(const std::string& mode, int weight) {
  PolicySetup setup = setup_of(weight, 0, 0);
  setup.weights.push_back(setup.weights.front());
  return {policy_of(mode, setup), {1, 1, 1, {}}};
}

NamedTask task(TaskId id, WorkloadId workload, std::optional<Nanos> deadline, bool image = false) {
  return {.id = id,
          .kind = {.workload = workload, .eligible = kLocal, .image_input = image},
          .deadline = deadline};
}

TEST(SlicedDispatcher, LetsInWhatHasANearerDeadlineTheNearestFirst) {
  Script script = script_of("throughput", 9);
  EXPECT_EQ(script.submit_all(1, {task(1, 0, {})}), "G1");
  EXPECT_EQ(script.slice(kGpu, 1), "") << "nothing waits";
  EXPECT_EQ(script.submit_all(2, {task(2, 1, Nanos(100))}), "");
  EXPECT_EQ(script.submit_all(3, {task(3, 1, Nanos(50))}), "");
  EXPECT_EQ(script.submit_all(4, {task(4, 1, {})}), "");
  EXPECT_EQ(script.slice(kGpu, 1), "~1 G3");
  EXPECT_EQ(script.dispatcher().running(kGpu), 1);
  EXPECT_EQ(script.dispatcher().suspended(kGpu), 1);
  EXPECT_EQ(script.dispatcher().load(kGpu), 4) << "it keeps its unit and counts as one";
  EXPECT_EQ(script.slice(kGpu, 1), "refused") << "it is left already";
  EXPECT_EQ(script.complete(kGpu, 3), "G2") << "before what was left goes on";
  EXPECT_EQ(script.complete(kGpu, 2), "+1");
  EXPECT_EQ(script.slice(kGpu, 1), "") << "4 has no deadline";
  EXPECT_EQ(script.complete(kGpu, 1), "G4");
  EXPECT_EQ(script.slice(kGpu, 1), "refused") << "it has ended";
}

TEST(SlicedDispatcher, LeavesNoneForTheSameOrALaterDeadlineNorForTheSameWorkload) {
  Script script = script_of("throughput", 9);
  EXPECT_EQ(script.submit_all(1, {task(1, 0, Nanos(50))}), "G1");
  EXPECT_EQ(script.submit_all(2, {task(2, 1, Nanos(50))}), "");
  EXPECT_EQ(script.submit_all(3, {task(3, 0, Nanos(10))}), "");
  EXPECT_EQ(script.slice(kGpu, 1), "");
  // Of nested ones, none has the workload of any that is left.
  EXPECT_EQ(script.submit_all(4, {task(4, 1, Nanos(30))}), "");
  EXPECT_EQ(script.slice(kGpu, 1), "~1 G4");
  EXPECT_EQ(script.slice(kGpu, 4), "") << "3 is of 1's workload";
  EXPECT_EQ(script.complete(kGpu, 4), "+1");
  EXPECT_EQ(script.complete(kGpu, 1), "G2");
}

// A walk through all of them at each end would take seconds.
TEST(SlicedDispatcher, LooksAtOneOfAWorkloadHoweverManyWait) {
  Script script = script_of("throughput", 1 << 20);
  EXPECT_EQ(script.submit_all(1, {task(1, 0, {})}), "G1");
  std::vector<NamedTask> same;
  for (TaskId id = 2; id < 20'000; ++id) same.push_back(task(id, 0, Nanos(50)));
  EXPECT_EQ(script.submit_all(2, same), "");
  EXPECT_EQ(script.slice(kGpu, 1), "") << "they are put in order, once";
  const std::clock_t begin = std::clock();
  for (int i = 0; i < 5000; ++i) ASSERT_EQ(script.slice(kGpu, 1), "");
  EXPECT_LT(std::clock() - begin, CLOCKS_PER_SEC / 2) << "of processor time";
  EXPECT_EQ(script.submit_all(3, {task(20'000, 1, Nanos(70))}), "");
  EXPECT_EQ(script.slice(kGpu, 1), "~1 G20000") << "the others are of 1's workload";
}

TEST(SlicedDispatcher, AsksThePolicyForWhatIsHeldAsIfNothingWereLeft) {
  Script script = script_of("throughput", 1);  // One task at a time on the unit: others are held.
  EXPECT_EQ(script.submit_all(1, {task(1, 0, {})}), "G1");
  EXPECT_EQ(script.submit_all(2, {task(2, 1, Nanos(50))}), "");
  EXPECT_EQ(script.dispatcher().state(2), TaskState::kHeld);
  EXPECT_EQ(script.slice(kGpu, 1), "~1 G2");
  EXPECT_EQ(script.complete(kGpu, 2), "+1");
}

TEST(SlicedDispatcher, LetsInFromTheHighPriorityQueueToo) {
  Script script = script_of("advanced", 9);
  EXPECT_EQ(script.submit_all(1, {task(1, 0, {})}), "G1");
  EXPECT_EQ(script.submit_all(2, {task(2, 1, Nanos(50), true)}), "");
  EXPECT_EQ(script.dispatcher().state(2), TaskState::kHighPriority);
  EXPECT_EQ(script.slice(kGpu, 1), "~1 G2");
  EXPECT_EQ(script.complete(kGpu, 2), "+1");
}

// Tasks of one class, which are held or in the high-priority queue in the order in which they came.
TEST(SlicedDispatcher, LetsInTheNearestOfWhatIsInNoQueueFirst) {
  for (const auto& [mode, weight] : {std::pair("throughput", 1), {"advanced", 9}}) {
    SCOPED_TRACE(mode);
    const bool image = weight == 9;
    Script script = script_of(mode, weight);
    EXPECT_EQ(script.submit_all(1, {task(1, 0, {})}), "G1");
    EXPECT_EQ(script.submit_all(2, {task(2, 1, Nanos(1000), image)}), "");
    EXPECT_EQ(script.submit_all(3, {task(3, 1, Nanos(50), image)}), "");
    EXPECT_EQ(script.dispatcher().state(2), image ? TaskState::kHighPriority : TaskState::kHeld);
    EXPECT_EQ(script.slice(kGpu, 1), "~1 G3");
    // And of those that come once a call has ended a slice.
    EXPECT_EQ(script.submit_all(4, {task(4, 1, Nanos(900), image)}), "");
    EXPECT_EQ(script.submit_all(5, {task(5, 1, Nanos(40), image)}), "");
    EXPECT_EQ(script.cancel(5), "-5");
    EXPECT_EQ(script.complete(kGpu, 3), "G4");
    EXPECT_EQ(script.complete(kGpu, 4), "G2");
    EXPECT_EQ(script.complete(kGpu, 2), "+1");
  }
}

TEST(SlicedDispatcher, WhatIsLeftMayBeCancelledFailAndLoseItsUnit) {
  Script script = script_of("throughput", 9);
  EXPECT_EQ(script.submit_all(1, {task(1, 0, {})}), "G1");
  EXPECT_EQ(script.submit_all(2, {task(2, 1, Nanos(50))}), "");
  EXPECT_EQ(script.slice(kGpu, 1), "~1 G2");
  EXPECT_EQ(script.cancel(1), "-1");
  EXPECT_EQ(script.complete(kGpu, 2, Outcome::kFailed), "+1") << "it still runs";
  EXPECT_EQ(script.complete(kGpu, 1), "");
  // A unit that drains lets nothing in, and ends what it has.
  EXPECT_EQ(script.submit_all(3, {task(3, 0, {})}), "G3");
  EXPECT_EQ(script.submit_all(4, {task(4, 1, Nanos(50))}), "");
  EXPECT_EQ(script.slice(kGpu, 3), "~3 G4");
  EXPECT_EQ(script.set(kGpu, UnitState::kDraining), "");
  EXPECT_EQ(script.submit_all(5, {task(5, 1, Nanos(40))}), "");
  EXPECT_EQ(script.complete(kGpu, 4), "+3");
  EXPECT_EQ(script.slice(kGpu, 3), "");
  EXPECT_EQ(script.set(kGpu, UnitState::kUp), "");
  EXPECT_EQ(script.slice(kGpu, 3), "~3 G5");
  // Whoever drives a unit that is gone ends both, in whatever order.
  EXPECT_EQ(script.set(kGpu, UnitState::kGone), "");
  EXPECT_EQ(script.complete(kGpu, 3, Outcome::kFailed), "");
  EXPECT_EQ(script.complete(kGpu, 5, Outcome::kFailed), "");
  EXPECT_EQ(script.dispatcher().suspended(kGpu), 0);
  EXPECT_EQ(script.dispatcher().counts().queued(), 0);
}

/// describe_scene can be left after 0.6 of it.
const std::string kOneUnit = R"(
platform: one
units: {cpu: {slots: 1, active_w: 2, idle_w: 0.5}}
workloads:
  describe_scene: {cpu: [{on: cpu, ms: 10}]}
  bundle_adjust: {cpu: [{on: cpu, ms: 66}]}
  alexnet: {cpu: [{on: cpu, ms: 30}]}
)";

ScheduleOptions options_of(const std::string& name, std::optional<bool> slices = {}) {
  ScheduleOptions options = mode(name, 2);
  options.slices = slices;
  return options;
}

/// Of this test.
std::string trace_path() {
  const std::string name = testing::UnitTest::GetInstance()->current_test_info()->name();
  return (std::filesystem::path(testing::TempDir()) / ("pirt_slices_" + name + ".json")).string();
}

std::int64_t misses(const RunRecord& record) {
  std::int64_t sum = 0;
  for (const auto& pipeline : record.pipelines) sum += pipeline.deadline_misses.value_or(0);
  return sum;
}

// The scene is [0, 6) and [7, 11), the plan that came at 3 [6, 7), each 100 ms; without slices it
// is [10, 11), 8 ms after it came.
TEST(SlicedVirtualTime, APlanIsLetInBetweenTwoNetworks) {
  const auto platform = platform_of(kOneUnit);
  const auto mix = mix_of(R"(
mix: m
pipelines:
  scene: {rate_hz: 10, tasks: [{workload: describe_scene}]}
  planning: {rate_hz: 10, offset_ms: 3, deadline_ms: 6, tasks: [{name: plan, service_ms: {cpu: 1}}]}
)");
  const auto whole = run_virtual(platform, nullptr, mix, options_of("edf"));
  EXPECT_EQ(whole.pipelines[1].deadline_misses, 20);
  EXPECT_FALSE(whole.suspensions);
  auto never = run_virtual(platform, nullptr, mix, options_of("edf", false));
  never.slices = whole.slices;
  EXPECT_EQ(whole, never);
  auto options = options_of("edf", true);
  options.trace = trace_path();
  const auto sliced = run_virtual(platform, nullptr, mix, options);
  EXPECT_EQ(sliced.pipelines[1].deadline_misses, 0);
  EXPECT_EQ(sliced.suspensions, 20);
  EXPECT_NEAR(*sliced.pipelines[1].p99_ms, 4, 0.01);
  EXPECT_NEAR(*sliced.pipelines[0].p99_ms, 11, 0.02);
  // What is left is neither busy nor part of what a call takes.
  EXPECT_DOUBLE_EQ(sliced.units[0].busy_s, whole.units[0].busy_s);
  EXPECT_DOUBLE_EQ(*sliced.energy_j, *whole.energy_j);
  const auto replayed = replay_file(*options.trace);
  EXPECT_FALSE(replayed.result.difference) << replayed.result.difference->replayed;
}

// One plan comes every 100 ms and takes 1 ms of 6: 66 ms of adjusting fit between them at some
// moments, and 132 at none; in slices of 2 and 4 ms they do at any.
TEST(SlicedVirtualTime, ModeBudgetBeginsWhatItCanLeave) {
  const auto platform = platform_of(kOneUnit);
  const auto mix = mix_of(R"(
mix: m
pipelines:
  planning: {rate_hz: 20, jitter_ms: 20, deadline_ms: 6, tasks: [{name: plan, service_ms: {cpu: 1}}]}
  mapping: {rate_hz: 4, real_time: false, tasks: [{workload: bundle_adjust}]}
)");
  const auto whole = run_virtual(platform, nullptr, mix, options_of("budget", false));
  EXPECT_EQ(misses(whole), 0);
  EXPECT_EQ(whole.pipelines[1].completed, 0);
  const auto sliced = run_virtual(platform, nullptr, mix, options_of("budget"));
  EXPECT_EQ(misses(sliced), 0);
  EXPECT_EQ(sliced.pipelines[1].completed, 8);
  EXPECT_GT(*sliced.suspensions, 7);
  auto always = run_virtual(platform, nullptr, mix, options_of("budget", true));
  always.slices = sliced.slices;
  EXPECT_EQ(sliced, always);
}

// Nothing responds later than it is guaranteed to, with calls that are left at several depths.
TEST(SlicedVirtualTime, GuaranteesHold) {
  const auto platform = platform_of(kOneUnit);
  const auto mix = mix_of(R"(
mix: m
pipelines:
  planning: {rate_hz: 20, jitter_ms: 10, deadline_ms: 8, tasks: [{name: plan, service_ms: {cpu: 1}}]}
  recognition: {rate_hz: 5, jitter_ms: 15, deadline_ms: 150, tasks: [{workload: alexnet}]}
  mapping: {rate_hz: 2, real_time: false, tasks: [{workload: bundle_adjust}]}
)");
  for (std::uint64_t seed = 1; seed <= 100; ++seed) {
    auto options = options_of("budget");
    options.seed = seed;
    const auto record = run_virtual(platform, nullptr, mix, options);
    EXPECT_EQ(misses(record), 0) << seed;
    EXPECT_EQ(record.pipelines[2].completed, 4) << seed;
    for (std::size_t p = 0; p < 2; ++p) {
      ASSERT_TRUE(record.pipelines[p].guaranteed == true) << p;
      EXPECT_LE(*record.pipelines[p].p99_ms, *record.pipelines[p].response_bound_ms * 1.001) << p;
    }
  }
}

// Whatever is drawn, failed, given back and left: tasks are conserved, and the trace replays.
TEST(SlicedVirtualTime, MeetsFaultsInEveryMode) {
  const auto platform = platform_of(R"(
platform: two
units: {cpu: {slots: 1}, gpu: {slots: 1}}
workloads:
  describe_scene: {cpu: [{on: cpu, ms: {uniform: [5, 15]}}], gpu: [{delay_ms: 1}, {on: gpu, ms: 9}]}
  alexnet: {cpu: [{on: cpu, ms: 30}], gpu: [{on: gpu, ms: {uniform: [10, 40]}}]}
)");
  const auto mix = mix_of(R"(
mix: m
pipelines:
  scene: {rate_hz: 20, tasks: [{workload: describe_scene}]}
  recognition: {rate_hz: 15, deadline_ms: 60, tasks: [{workload: alexnet}, {name: say, after: [alexnet], service_ms: {cpu: 1, gpu: 2}}]}
  planning: {rate_hz: 50, deadline_ms: 9, tasks: [{name: plan, service_ms: {cpu: 1}}]}
)");
  for (const char* mode : {"latency", "throughput", "energy", "edf", "ect", "budget"}) {
    for (std::uint64_t seed = 1; seed <= 10; ++seed) {
      SCOPED_TRACE(std::string(mode) + ", seed " + std::to_string(seed));
      auto options = options_of(mode, true);
      options.seed = seed;
      options.faults = Faults{.seed = seed, .failing = 0.1, .returning = 0.2};
      options.trace = trace_path();
      const auto record = run_virtual(platform, nullptr, mix, options);
      EXPECT_GT(record.suspensions.value_or(0), 0);
      expect_balanced(record);
      EXPECT_EQ(record.stalled, 0);
      const auto replayed = replay_file(*options.trace);
      EXPECT_FALSE(replayed.result.difference);
    }
  }
}

}  // namespace
}  // namespace pirt::test
