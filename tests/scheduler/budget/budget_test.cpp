// Mode budget: what it meets that the paper's modes do not, what it waits for, and its cap of
// power.
#include <algorithm>

#include "scheduler/budget/planning.h"
#include "scheduler/dispatcher/dispatcher.h"
#include "scheduler/mix/dag_generator.h"
#include "scheduler/policies/foresight.h"
#include "scheduler/policies/power_window.h"
#include "scheduler/policies/setup.h"
#include "scheduler/record/keeping_up.h"
#include "scheduler/record/summary.h"
#include "scheduler/trace/log_json.h"
#include "scheduler/trace/power_peak.h"
#include "scheduler/virtual/virtual_time.h"
#include "tests/scheduler/support.h"

namespace pirt::test {
namespace {

using std::chrono::milliseconds;
using testing::HasSubstr;

RunRecord run(const Platform& platform, const Mix& mix, ScheduleOptions options) {
  if (options.mode.empty()) options.mode = "budget";
  return run_virtual(platform, nullptr, mix, options);
}
RunRecord run(const Platform& platform, const Mix& mix, const std::string& mode,
              std::optional<int> in_flight = {}) {
  ScheduleOptions options;
  options.mode = mode;
  options.in_flight = in_flight;
  return run_virtual(platform, nullptr, mix, options);
}

RunRecord run_for(double seconds, const Platform& platform, const Mix& mix,
                  const std::string& mode = "budget") {
  ScheduleOptions options;
  options.mode = mode;
  options.duration = from_s(seconds);
  return run_virtual(platform, nullptr, mix, options);
}

std::int64_t misses(const RunRecord& record) {
  std::int64_t sum = 0;
  for (const auto& pipeline : record.pipelines) sum += pipeline.deadline_misses.value_or(0);
  return sum;
}

TEST(Budget, BeatsThroughputModeInRateLatencyAndEnergyAtOnce) {
  const auto platform = load_platform("snapdragon820");
  const auto mix = load_mix("convolution-1000");
  const auto budget = run(platform, mix, "budget");
  const auto throughput = run(platform, mix, "throughput");
  EXPECT_GT(*budget.throughput_per_ms, *throughput.throughput_per_ms);
  EXPECT_LT(*budget.mean_latency_ms, *throughput.mean_latency_ms);
  EXPECT_LT(*budget.energy_j, *throughput.energy_j);
  EXPECT_EQ(budget.objective, "rate");
  EXPECT_EQ(budget, run(platform, mix, "budget")) << "the same inputs, another plan";
}

TEST(Budget, HasABetterTailThanLatencyModeWithAsManyInFlight) {
  const auto platform = load_platform("snapdragon820");
  const auto mix = load_mix("convolution-1000");
  ScheduleOptions options;
  options.in_flight = 4;
  const auto latency = run(platform, mix, "latency", 4);
  const auto fast = run(platform, mix, options);
  EXPECT_EQ(fast.in_flight, 4);
  EXPECT_GE(*fast.throughput_per_ms, 1.13 * *latency.throughput_per_ms);
  EXPECT_LE(*fast.p99_latency_ms, 0.5 * *latency.p99_latency_ms);
  options.objective = Objective::kEnergy;
  options.min_rate_per_ms = 1.13 * *latency.throughput_per_ms;
  const auto frugal = run(platform, mix, options);
  EXPECT_GE(*frugal.throughput_per_ms, 1.13 * *latency.throughput_per_ms);
  EXPECT_LE(*frugal.p99_latency_ms, 0.5 * *latency.p99_latency_ms);
  EXPECT_LE(*frugal.energy_j, 1.04 * *latency.energy_j);
}

TEST(Budget, NeedsLittleMoreThanTheLeastEnergyForARate) {
  const auto platform = load_platform("snapdragon820");
  const auto mix = load_mix("convolution-1000");
  for (const auto& mode : paper_modes()) {
    const double rate = *run(platform, mix, mode).throughput_per_ms;
    ScheduleOptions options;
    options.objective = Objective::kEnergy;
    options.min_rate_per_ms = rate;
    const auto record = run(platform, mix, options);
    EXPECT_GE(*record.throughput_per_ms, rate) << mode;
    EXPECT_LE(*record.energy_j, 1.03 * *record.bounds->energy_j) << mode;
  }
}

// Two units of 5 ms each: 0.4 tasks a millisecond with two frames in flight, 0.2 with one.
TEST(Budget, SeesWhatAClosedLoopBesideARateComesTo) {
  const auto platform = platform_of(
      "platform: three\nunits: {a: {slots: 1, active_w: 1}, b: {slots: 1, active_w: 2}, c: {slots: "
      "1, active_w: 1}}\n");
  const auto mix = mix_of(
      "mix: m\npipelines:\n"
      "  slow: {rate_hz: 1, tasks: [{name: s, service_ms: {c: 1}}]}\n"
      "  loop: {closed_loop: {frames: 1000000}, tasks: [{name: l, service_ms: {a: 5, b: 5}}]}\n");
  EXPECT_GE(*run_for(10, platform, mix).throughput_per_ms,
            0.99 * *run_for(10, platform, mix, "ect").throughput_per_ms);
}

TEST(Budget, KeepsThePlatformsFramesInFlight) {
  auto platform = load_platform("snapdragon820");
  platform.modes["budget"].in_flight = 3;
  EXPECT_EQ(run(platform, load_mix("convolution-1000"), "budget").in_flight, 3);
}

/// A planner with 6 ms, and a long job; one core.
const std::string kOneCore = R"(
platform: one
units: {cpu: {slots: 1, active_w: 2, idle_w: 0.5}}
)";
std::string planner_and_job(const std::string& arrivals, int job_ms) {
  return "mix: m\npipelines:\n"
         "  planning: {rate_hz: 10, deadline_ms: 6, " +
         arrivals + "tasks: [{name: plan, service_ms: {cpu: 1}}]}\n" +
         "  mapping: {rate_hz: 4, real_time: false, tasks: [{name: adjust, service_ms: {cpu: " +
         std::to_string(job_ms) + "}}]}\n";
}

TEST(Budget, LeavesAUnitIdleRatherThanBeginWhatWouldOverrunAPlan) {
  // The job comes at 0, 250, 500, ...; 60 ms from 250 on would end at 310, where the plan of 300
  // has to have begun by 305.
  const auto platform = platform_of(kOneCore);
  const auto mix = mix_of(planner_and_job("", 60));
  const auto expect_all = [&](const Mix& each) {
    const auto record = run_for(60, platform, each);
    EXPECT_EQ(misses(record), 0);
    EXPECT_EQ(record.pipelines[1].completed, 240);
  };
  expect_all(mix);
  EXPECT_GT(misses(run_for(60, platform, mix, "edf")), 100);
  // With jitter the plan of 300 may come at any moment until 320.
  expect_all(mix_of(planner_and_job("offset_ms: 30, jitter_ms: 20, ", 60)));
}

TEST(Budget, WhatFitsNowhereWaitsForTheEnd) {
  const auto platform = platform_of(kOneCore);
  const auto mix = mix_of(planner_and_job("", 120));
  const auto record = run_for(2, platform, mix);
  EXPECT_EQ(misses(record), 0);
  EXPECT_EQ(record.pipelines[1].completed, 0);
  EXPECT_EQ(record.pipelines[1].unfinished, 8);
  EXPECT_EQ(record.stalled, 0) << "once no plan comes any more, the jobs are done";
  EXPECT_EQ(record.pipelines[0].never_ran, std::nullopt);
  EXPECT_EQ(record.pipelines[1].never_ran, true);
  EXPECT_THAT(record.warnings, testing::Contains(HasSubstr("never ran: mapping: of 8 firings")));
}

/// A task of the pipeline, alone there, that may go to @p units of @p count.
BudgetPlan::Task task_on(std::vector<UnitId> units, std::size_t count, std::uint32_t pipeline,
                         int ms) {
  return {.pipeline = pipeline,
          .first = true,
          .units = std::move(units),
          .capacity = std::vector<int>(count, 1),
          .share = std::vector<double>(count, 1),
          .worst = std::vector<Nanos>(count, milliseconds(ms)),
          .context = std::vector<std::uint32_t>(count, pipeline),
          .prepare = std::vector<Nanos>(count, Nanos(0)),
          .window_j = std::vector<double>(count, 0)};
}

/// One pipeline that fires each 100 ms with a deadline of 10 and takes 2, and one without.
BudgetPlan small_plan() {
  BudgetPlan plan;
  plan.tasks = {task_on({0}, 1, 0, 2), task_on({0}, 1, 1, 50)};
  plan.tasks[0].pinned = true;
  plan.pipelines = {{.rate_hz = 10.0, .jitter = milliseconds(5), .deadline = milliseconds(10)}, {}};
  return plan;
}

Task firing(Nanos at) {
  return {.kind = {.entry = 0}, .deadline = at + milliseconds(10), .expires_at = {}};
}

TEST(Foresight, KnowsWhatIsToComeAndWhatWaits) {
  const BudgetPlan plan = small_plan();
  Foresight foresight(plan);
  const auto ask_again = [&](int ms) -> std::optional<double> {
    const auto conflict = foresight.conflict(1, 0, milliseconds(ms));
    return conflict ? std::optional(to_ms(*conflict)) : std::nullopt;
  };
  // Firing 0 is to come at 0 to 5 ms; 50 ms from now on would be too late for it. If it has not
  // come by 5 ms, and one of grace, it is worth asking again.
  EXPECT_NEAR(*ask_again(0), 6, 0.001);
  foresight.submitted(firing(milliseconds(2)));
  // It waits now.
  EXPECT_TRUE(ask_again(2));
  EXPECT_EQ(foresight.latest_end(0), milliseconds(12));
  foresight.departed(0, milliseconds(12));
  // Free until firing 1: from 100 on, to end by 110, so to be begun by 108.
  EXPECT_FALSE(ask_again(4));
  EXPECT_FALSE(ask_again(58));
  EXPECT_NEAR(*ask_again(59), 106, 0.001);
  // It does not come: the next one counts.
  EXPECT_FALSE(ask_again(107));
  EXPECT_NEAR(*ask_again(160), 206, 0.001);
  // Nor does that: the pipeline has ended.
  EXPECT_FALSE(ask_again(260));
  foresight.submitted(firing(milliseconds(400)));
  foresight.departed(0, milliseconds(410));
  EXPECT_NEAR(*ask_again(470), 506, 0.001);
}

// The next firing comes at 100 ms and bears to wait until 102. A call that has ended by then may
// begin, though its slices are longer: what comes is not let in before, and puts no end off.
TEST(Foresight, WhatHasEndedByWhenAGuaranteedTaskNeedsTheUnitMayBegin) {
  BudgetPlan plan = small_plan();
  plan.tasks[0].tolerates = milliseconds(2);
  plan.tasks[0].slice = {milliseconds(2)};
  plan.tasks[1].worst = {milliseconds(96)};
  plan.tasks[1].slice = {milliseconds(60)};
  Foresight foresight(plan);
  foresight.submitted(firing(Nanos(0)));
  foresight.departed(0, milliseconds(10));
  EXPECT_FALSE(foresight.conflict(1, 0, milliseconds(6)));
  EXPECT_TRUE(foresight.conflict(1, 0, milliseconds(6) + Nanos(1)));
}

// As a real-time task beside a cloud that the plan has first.
TEST(Foresight, LooksForATaskWhereItMayGo) {
  BudgetPlan plan;
  plan.tasks = {task_on({1, 0}, 2, 0, 2), task_on({1, 0}, 2, 1, 50)};
  plan.pipelines = {{.deadline = milliseconds(10)}, {}};
  Foresight foresight(plan);
  Task task = firing(Nanos(0));
  task.kind.eligible = unit_bit(0) | unit_bit(1);
  foresight.submitted(task);
  EXPECT_TRUE(foresight.conflict(1, 1, Nanos(0)));
  EXPECT_FALSE(foresight.conflict(1, 0, Nanos(0)));
  foresight.departed(0, milliseconds(10));
  task.kind.eligible = unit_bit(0);
  foresight.submitted(task);
  EXPECT_FALSE(foresight.conflict(1, 1, Nanos(0)));
  EXPECT_TRUE(foresight.conflict(1, 0, Nanos(0)));
}

// From the end of a firing to the latest start of the next one there are 46.5 to 56.5 ms.
TEST(Budget, AClosedLoopRunsInTheGapsThatGuaranteesLeave) {
  const auto platform = platform_of(
      "platform: gaps\nunits: {cpu: {role: cpu, slots: 1, active_w: 1}}\n"
      "workloads: {describe_scene: {cpu: [{on: cpu, ms: 46}]}}\n");
  const auto mix = mix_of(
      "mix: gaps\npipelines:\n"
      "  scene: {closed_loop: {frames: 100000}, real_time: false, tasks: [{workload: "
      "describe_scene}]}\n"
      "  urgent: {rate_hz: 20, deadline_ms: 25, jitter_ms: 5, tasks: [{name: t, service_ms: {cpu: "
      "11.5}}]}\n");
  const auto record = run_for(60, platform, mix);
  EXPECT_EQ(record.pipelines[1].guaranteed, true);
  EXPECT_EQ(misses(record), 0);
  EXPECT_GT(record.pipelines[0].completed, 100);
  EXPECT_EQ(record.pipelines[0].never_ran, std::nullopt);
}

// At 55.009 s `fix` would make the pose of 55.010 late, which waits for it from then on.
TEST(Budget, NothingWaitsForEverForWhatWaitsForItsState) {
  const auto platform = platform_of(
      "platform: one\nunits: {cpu: {slots: 1, active_w: 1}}\nworkloads: {update_pose: {cpu: 5}}\n");
  const auto mix = mix_of(
      "mix: m\npipelines:\n"
      "  pose: {rate_hz: 100, deadline_ms: 8, tasks: [{workload: update_pose, state: s}]}\n"
      "  fix: {rate_hz: 0.01, offset_ms: 55009, tasks: [{workload: update_pose, state: s}]}\n");
  const auto record = run_for(60, platform, mix);
  EXPECT_EQ(record.completed, record.submitted);
  EXPECT_LE(misses(record), 1);
}

// Two calls at a time would be between their delay and the kernel: the analysis knows one.
TEST(Budget, AGuaranteeIsKeptOnAUnitWhoseCallsHaveADelay) {
  const auto platform = platform_of(
      "platform: two\nunits: {cpu: {slots: 1, active_w: 1}, gpu: {active_w: 1}}\n"
      "workloads: {sobel: {gpu: [{delay_ms: 0.1}, {on: gpu, ms: 10}]}}\n");
  const auto mix = mix_of(
      "mix: g\npipelines:\n"
      "  y: {rate_hz: 10, deadline_ms: 100, tasks: [{workload: sobel}]}\n"
      "  x: {rate_hz: 10, deadline_ms: 100, tasks: [{workload: sobel}]}\n"
      "  z: {rate_hz: 10, offset_ms: 5, deadline_ms: 25, tasks: [{workload: sobel}]}\n");
  const auto record = run(platform, mix, "budget");
  EXPECT_EQ(record.pipelines[2].guaranteed, true);
  EXPECT_EQ(misses(record), 0);
}

// 33 slices of 3 ms, which let no other call of bundle_adjust in: `slow`, begun at n s, would make
// `fast` of n s + 10 ms end at n s + 198 ms. It waits for n s + 109 ms.
TEST(Budget, GuaranteesNothingWhereACallMeetsAnotherOfItsWorkload) {
  const auto platform = platform_of(
      "platform: one\nunits: {cpu: {slots: 1, active_w: 1}}\n"
      "workloads: {bundle_adjust: {cpu: 99}}\n");
  const auto mix = mix_of(
      "mix: m\npipelines:\n"
      "  slow: {rate_hz: 1, deadline_ms: 900, tasks: [{workload: bundle_adjust}]}\n"
      "  fast: {rate_hz: 5, offset_ms: 10, deadline_ms: 140, tasks: [{workload: "
      "bundle_adjust}]}\n");
  const auto record = run_for(10, platform, mix);
  EXPECT_EQ(record.pipelines[1].not_analysed,
            "calls of bundle_adjust on cpu let none of bundle_adjust in");
  EXPECT_FALSE(record.pipelines[1].guaranteed.value_or(false));
  EXPECT_EQ(misses(record), 0);
}

// Both hold p/background: b waits for a, and ends 60 ms after they came.
TEST(Budget, AFiringThatHoldsAStateTwiceTakesBothAfterEachOther) {
  const auto platform = platform_of(
      "platform: two\nunits: {cpu: {slots: 1, active_w: 1}, gpu: {slots: 1, active_w: 1}}\n"
      "workloads: {background_model: {cpu: 30, gpu: 30}}\n");
  const auto mix = mix_of(
      "mix: m\npipelines:\n  p: {rate_hz: 10, deadline_ms: 50, tasks: [{name: a, workload: "
      "background_model, eligible: [cpu]}, {name: b, workload: background_model, eligible: "
      "[gpu]}]}\n");
  const auto record = run_for(2, platform, mix);
  EXPECT_EQ(record.pipelines[0].guaranteed, false);
  EXPECT_EQ(record.pipelines[0].response_bound_ms, 60);
}

// Of the one buffer `hog` has 350 ms a second: what finds none is dropped, and foreseen no more.
TEST(Budget, GuaranteesNothingThatMayFindNoImageBufferOrExpire) {
  const auto platform = platform_of("platform: two\nunits: {cpu: {slots: 1}, gpu: {slots: 1}}\n");
  const std::string cam =
      "  cam: {rate_hz: 10, deadline_ms: 40, tasks: [{name: c, service_ms: {cpu: 10}, image_input: "
      "true}]}\n";
  const std::string hog =
      "  hog: {rate_hz: 1, real_time: false, tasks: [{name: h, service_ms: {gpu: 350}, "
      "image_input: true}]}\n";
  const std::string expires =
      "  e: {rate_hz: 10, deadline_ms: 50, expires_ms: 20, tasks: [{name: t, service_ms: {cpu: "
      "1}}]}\n";
  const auto first_of = [&](const std::string& pipelines) {
    const auto mix = mix_of("mix: m\nimage_buffers: 1\npipelines:\n" + pipelines);
    return run_for(2, platform, mix).pipelines.front();
  };
  EXPECT_EQ(first_of(cam + hog).not_analysed, "may find no image buffer");
  EXPECT_EQ(first_of(cam).guaranteed, true) << "it has the buffer to itself";
  EXPECT_EQ(first_of(expires).not_analysed, "its tasks may expire");
}

// A thousand million periods of the one before the deadline of the other.
TEST(Budget, ADeadlineMayBeManyPeriodsOfOthersLong) {
  const auto mix = mix_of(
      "mix: m\npipelines:\n"
      "  imu: {rate_hz: 1000, deadline_ms: 1, tasks: [{name: i, service_ms: {cpu: 0.1}}]}\n"
      "  log: {rate_hz: 1, deadline_ms: 1e9, tasks: [{name: l, service_ms: {cpu: 0.2}}]}\n");
  const auto record = run_for(1, platform_of(kOneCore), mix);
  EXPECT_EQ(record.pipelines[0].guaranteed, true);
  EXPECT_EQ(record.pipelines[1].guaranteed, true);
}

TEST(Budget, AMixThatFiresOnceIsRefusedWhatItsPlanDoesNotKeep) {
  const auto platform = platform_of("platform: three\nunits: {cpu: {}, gpu: {}, dsp: {}}\n");
  const auto mix = parse_mix("dag.yaml", generate_dag({.tasks = 5, .ccr = 1, .seed = 1}));
  ScheduleOptions capped, least;
  capped.power_cap_w = 1;
  least.min_rate_per_ms = 0.1;
  for (const ScheduleOptions& options : {capped, least}) {
    EXPECT_THAT(bad_input([&] { static_cast<void>(run(platform, mix, options)); }),
                HasSubstr("fires once"));
  }
}

// The core has time for one task of 2 ms in 2 ms.
TEST(Budget, SaysWhereTheLeastRateIsNotReached) {
  const auto mix = mix_of(
      "mix: m\npipelines: {p: {closed_loop: {frames: 50}, tasks: [{name: a, service_ms: {cpu: "
      "2}}]}}\n");
  ScheduleOptions options;
  options.min_rate_per_ms = 1;
  const auto record = run(platform_of(kOneCore), mix, options);
  EXPECT_TRUE(misses_rate(record));
  EXPECT_THAT(record.warnings,
              testing::Contains(HasSubstr("--min-rate 1 tasks/ms is not reached: 0.5")));
  options.min_rate_per_ms = 0.25;
  EXPECT_FALSE(misses_rate(run(platform_of(kOneCore), mix, options)));
}

TEST(Foresight, WhatWouldBeLateItselfDoesNotWait) {
  BudgetPlan plan = small_plan();
  plan.pipelines[1] = {.deadline = milliseconds(100)};
  Foresight foresight(plan);
  Task own = firing(Nanos(0));
  own.kind.entry = 1;
  own.deadline = milliseconds(56);
  foresight.submitted(own);
  // It takes 50 of its 56 ms, the plan 2: it can wait until 4 ms.
  EXPECT_EQ(foresight.conflict(1, 0, Nanos(0)), milliseconds(4));
  EXPECT_FALSE(foresight.conflict(1, 0, milliseconds(4)));
}

TEST(Foresight, WhatComesBackWaitsAgainInItsPlace) {
  const BudgetPlan plan = small_plan();
  Foresight foresight(plan);
  foresight.submitted(firing(Nanos(0)));
  foresight.submitted(firing(milliseconds(5)));
  foresight.departed(0, milliseconds(10));
  EXPECT_EQ(foresight.latest_end(0), milliseconds(15));
  foresight.came_back(0, milliseconds(10));
  EXPECT_EQ(foresight.latest_end(0), milliseconds(10));
  foresight.departed(0, milliseconds(10));
  EXPECT_EQ(foresight.latest_end(0), milliseconds(15));
}

TEST(Foresight, WhatWaitsNoMoreIsTheTaskThatIsNamed) {
  const BudgetPlan plan = small_plan();
  Foresight foresight(plan);
  for (const int at : {30, 0, 990}) foresight.submitted(firing(milliseconds(at)));
  EXPECT_EQ(foresight.latest_end(0), milliseconds(10));
  foresight.departed(0, milliseconds(40));  // In the middle.
  EXPECT_EQ(foresight.latest_end(0), milliseconds(10));
  foresight.departed(0, milliseconds(10));
  EXPECT_EQ(foresight.latest_end(0), milliseconds(1000));
  foresight.departed(0, Nanos::max());  // One without a deadline, of which nothing is known.
  EXPECT_EQ(foresight.latest_end(0), milliseconds(1000));
}

/// A GPU and a DSP of one server each, as a runtime has them that knows no mix: on the GPU entries
/// 0 to 2 take 25, 50 and 20 ms, on the DSP entry 3 takes 10.
Script without_a_mix() {
  PolicySetup setup;
  setup.roles = {Role::kGpu, Role::kDsp};
  setup.servers = {1, 1};
  const auto add = [&budget = setup.budget](UnitId unit, int ms) {
    const auto pipeline = static_cast<std::uint32_t>(budget.tasks.size());
    budget.tasks.push_back(task_on({unit}, 2, pipeline, ms));
    budget.pipelines.emplace_back();
  };
  for (const int ms : {25, 50, 20}) add(kGpu, ms);
  add(kDsp, 10);
  return {policy_of("budget", setup), {1, 1}};
}

NamedTask due(TaskId id, std::uint32_t entry, int deadline_ms, std::span<const TaskId> after = {}) {
  return {.id = id,
          .kind = {.eligible = unit_bit(entry == 3 ? kDsp : kGpu), .entry = entry},
          .deadline = milliseconds(deadline_ms),
          .expires_at = {},
          .after = after};
}

TEST(Budget, ForeseesTheTaskThatWaitsAndNotThatWhichWentBeforeIt) {
  Script script = without_a_mix();
  EXPECT_EQ(script.submit(0, {.eligible = unit_bit(kGpu), .entry = 2}), "G0");
  EXPECT_EQ(script.submit_all(1, {due(1, 0, 1000)}), "");
  EXPECT_EQ(script.submit_all(2, {due(2, 0, 65)}), "");
  EXPECT_EQ(script.submit_all(3, {due(3, 1, 200)}), "");
  // 20 + 25 + 50 + 25 ms without a pause, the nearest deadline first.
  script.at(milliseconds(20));
  EXPECT_EQ(script.complete(kGpu, 0), "G2");
  script.at(milliseconds(45));
  EXPECT_EQ(script.complete(kGpu, 2), "G3");
  script.at(milliseconds(95));
  EXPECT_EQ(script.complete(kGpu, 3), "G1");
}

TEST(Budget, ForeseesWhatWaitsBesideOneThatIsDropped) {
  Script script = without_a_mix();
  const std::vector<TaskId> first = {0};
  EXPECT_EQ(script.submit_all(0, {due(0, 3, 1000)}), "D0");
  EXPECT_EQ(script.submit_all(1, {due(1, 0, 65, first)}), "");
  EXPECT_EQ(script.submit_all(2, {due(2, 0, 1000, first)}), "");
  EXPECT_EQ(script.cancel(2), "-2");
  // 50 ms from 20 on leave no time for task 1, which has to begin by 40.
  script.at(milliseconds(20));
  EXPECT_EQ(script.submit_all(3, {due(3, 1, 200)}), "");
  EXPECT_EQ(script.complete(kDsp, 0), "G1");
  script.at(milliseconds(45));
  EXPECT_EQ(script.complete(kGpu, 1), "G3");
}

/// `heavy` needs most of b. `light` is a's; the next best for it is b, where it would not fit.
ModeSetup three_units(const Platform& platform, const Mix& mix, bool losses) {
  ScheduleOptions options;
  options.mode = "budget";
  options.duration = from_s(5);
  ModeSetup setup = set_up_mode(platform, nullptr, mix, options);
  follow(plan_budget(setup, options), setup);
  if (losses) plan_for_losses(setup, options);
  return setup;
}

const char* const kThreeUnits = R"(
platform: three
units:
  a: {slots: 1, active_w: 1}
  b: {slots: 1, active_w: 2}
  c: {slots: 1, active_w: 9}
)";
const char* const kLightAndHeavy = R"(
mix: m
pipelines:
  light: {rate_hz: 10, deadline_ms: 20, tasks: [{name: l, service_ms: {a: 10, b: 10, c: 10}}]}
  heavy: {rate_hz: 10, deadline_ms: 20, tasks: [{name: h, service_ms: {b: 15}}]}
)";

TEST(Budget, HasAPlanForWhenAUnitGoesAwayAndForWhenItComesBack) {
  const Platform platform = platform_of(kThreeUnits);
  const Mix mix = mix_of(kLightAndHeavy);
  const auto misses_after = [&](bool losses, const std::vector<UnitState>& states) {
    ModeSetup setup = three_units(platform, mix, losses);
    Dispatcher dispatcher(setup.slots, std::move(setup.policy));
    Effects effects;
    for (const UnitState state : states) dispatcher.set_unit(0, state, Nanos(0), effects);
    return misses(
        summarize(setup.scenario, nullptr, {}, VirtualTime(setup.scenario, dispatcher).run()));
  };
  EXPECT_GT(misses_after(false, {UnitState::kDraining}), 25)
      << "light would follow heavy's calls on b";
  EXPECT_EQ(misses_after(true, {UnitState::kDraining}), 0);
  EXPECT_EQ(misses_after(true, {UnitState::kGone}), 0);
  EXPECT_EQ(misses_after(true, {UnitState::kDraining, UnitState::kUp}), 0);
}

TEST(Budget, ThePlansForLossesLeaveTheUnitForLastAndAreInATrace) {
  const Platform platform = platform_of(kThreeUnits);
  const Mix mix = mix_of(kLightAndHeavy);
  const ModeSetup setup = three_units(platform, mix, true);
  const auto& without = setup.policy_setup.budget_without;
  ASSERT_EQ(without.size(), 3U);
  EXPECT_EQ(without[0].tasks[0].units.front(), 2U);
  EXPECT_EQ(without[0].tasks[0].units.back(), 0U);
  EXPECT_EQ(without[0].tasks[1].units, std::vector<UnitId>{1}) << "there is no other";
  EXPECT_EQ(setup.policy_setup.budget.tasks[0].units.front(), 0U);
  DispatcherSetup made{&setup.mode.policy, platform.unit_names(), setup.slots, setup.policy_setup};
  const DispatcherSetup read = dispatcher_setup_from_json(to_json(made));
  EXPECT_EQ(read.policy.budget_without, without);
}

TEST(PowerWindow, CountsACallUntilASecondAfterItsEnd) {
  PowerWindow window(2);
  EXPECT_TRUE(window.allows(2, Nanos(0)));
  EXPECT_FALSE(window.allows(2.001, Nanos(0)));
  window.started(1.5);
  EXPECT_TRUE(window.allows(0.5, Nanos(0)));
  EXPECT_FALSE(window.allows(0.6, milliseconds(500)));
  EXPECT_EQ(window.next(), Nanos::max());
  window.ended(1.5, milliseconds(600));
  EXPECT_FALSE(window.allows(0.6, milliseconds(1600)));
  EXPECT_EQ(window.next(), milliseconds(1600) + Nanos(1));
  EXPECT_TRUE(window.allows(2, window.next()));
}

TEST(PowerPeak, FindsTheFullestSecond) {
  const auto platform = platform_of(kOneCore);
  PowerPeak peak(platform);
  const std::vector<int> none;
  peak.settled(Nanos(0), none);
  // 2 W for 400 ms from 0.5 s on, and for 200 ms from 1.4 s on: [0.5, 1.5] has 500 ms of it and
  // [0.6, 1.6] as many.
  for (const auto& [from, to] : {std::pair(500, 900), std::pair(1400, 1600)}) {
    peak.arrived(0, 1, 2);
    peak.settled(milliseconds(from), none);
    peak.departed(0, 1);
    peak.settled(milliseconds(to), none);
  }
  EXPECT_NEAR(peak.highest_w(), 0.5 + 2 * 0.5, 1e-9);
}

TEST(Budget, DrawsNoMoreThanItsCapInAnySecond) {
  const auto platform = load_platform("snapdragon820");
  const auto mix = load_mix("convolution-1000");
  const double free_w = *run(platform, mix, "budget").average_power_w;
  double before = 0;
  for (const double cap_w : {0.4, 1.0, 2.0, 3.0}) {
    ScheduleOptions options;
    options.power_cap_w = cap_w;
    const auto record = run(platform, mix, options);
    EXPECT_EQ(record.completed, 1000);
    EXPECT_LE(*record.power_highest_w, cap_w);
    EXPECT_GT(*record.power_highest_w, 0.85 * std::min(cap_w, free_w));
    EXPECT_GT(*record.throughput_per_ms, before);
    EXPECT_EQ(record.over_cap, 0);
    before = *record.throughput_per_ms;
  }
}

TEST(Budget, CountsTasksWithADeadlineThatGoBeyondTheCap) {
  // 10 Hz of 20 ms at 2 W are 0.4 W; with 0.5 W idle 0.9 W. A cap of 0.7 W leaves room for five.
  const auto platform = platform_of(kOneCore);
  const auto mix = mix_of(
      "mix: m\npipelines:\n  p: {rate_hz: 10, deadline_ms: 50, tasks: [{name: a, service_ms: {cpu: "
      "20}}]}\n  q: {rate_hz: 10, offset_ms: 50, tasks: [{name: b, service_ms: {cpu: 20}}]}\n");
  ScheduleOptions options;
  options.duration = from_s(20);
  options.power_cap_w = 0.7;
  const auto tight = run(platform, mix, options);
  EXPECT_EQ(misses(tight), 0);
  EXPECT_GT(*tight.over_cap, 150);
  EXPECT_LT(tight.pipelines[1].completed, 20);
  options.power_cap_w = 1.4;
  const auto wide = run(platform, mix, options);
  EXPECT_EQ(wide.over_cap, 0);
  EXPECT_EQ(wide.pipelines[1].completed, 200);
  EXPECT_LE(*wide.power_highest_w, 1.4);
  options.power_cap_w = 0.4;
  EXPECT_THAT(bad_input([&] { static_cast<void>(run(platform, mix, options)); }),
              HasSubstr("--power-cap 0.4 W is infeasible: the units of one draw 0.5 W idle"));
}

TEST(Budget, ItsOptionsAreItsOwn) {
  ScheduleOptions options;
  options.mode = "edf";
  options.power_cap_w = 5;
  EXPECT_THAT(bad_input([&] {
                static_cast<void>(run(load_platform("fake"), load_mix("table1-robot"), options));
              }),
              HasSubstr("are about mode budget; mode edf has no use for them"));
  // Side by side, the others go without.
  const auto runs = run_modes(load_platform("fake"), nullptr, load_mix("table1-robot"),
                              {"edf", "budget"}, options);
  EXPECT_EQ(runs.runs.size(), 2U);
  EXPECT_THAT(bad_input([&] {
                static_cast<void>(run_modes(load_platform("fake"), nullptr,
                                            load_mix("table1-robot"), {"edf"}, options));
              }),
              HasSubstr("none of these"));
}

TEST(Budget, ServesWithWhatIsLeftWhenAUnitGoes) {
  // Two units; the tasks' own is the gpu. While it is away the cpu serves them.
  BudgetPlan plan = small_plan();
  plan.tasks = {task_on({0, 2}, 4, 0, 2)};
  plan.tasks[0].pinned = true;
  PolicySetup setup = setup_of(1, 1, 1);
  setup.servers = {1, 1, 1, 1};
  setup.budget = plan;
  Script script(policy_of("budget", setup), {1, 1, 1, 1});
  EXPECT_EQ(script.submit(1), "G1");
  EXPECT_EQ(script.submit(2), "");
  EXPECT_EQ(script.set(kGpu, UnitState::kDraining), "C2");
  EXPECT_EQ(script.set(kGpu, UnitState::kUp), "");
  EXPECT_EQ(script.complete(kGpu, 1, Outcome::kReturned), "");
  EXPECT_EQ(script.submit(3), "G3");
  EXPECT_EQ(script.complete(kCpu, 2), "C1");
}

TEST(Budget, PlansATaskGraphShorterThanHeft) {
  // Three units and 30 tasks; the paper's parameters at random.
  const auto platform = platform_of("platform: three\nunits: {cpu: {}, gpu: {}, dsp: {}}\n");
  std::vector<double> ratios;
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    const auto mix = parse_mix("dag.yaml", generate_dag({.tasks = 30, .ccr = 1, .seed = seed}));
    const auto budget = run(platform, mix, "budget");
    const auto heft = run(platform, mix, "heft");
    EXPECT_EQ(budget.planned_makespan_s, budget.makespan_s);
    ratios.push_back(budget.makespan_s / heft.makespan_s);
    EXPECT_LE(ratios.back(), 1.0);
  }
  std::ranges::sort(ratios);
  EXPECT_LE(ratios[10], 0.95);
}

}  // namespace
}  // namespace pirt::test
