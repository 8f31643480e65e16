// What lengthens calls in virtual time, worked out by hand: hand-over by sleep, caches that others
// filled, a neighbour of the same memory.
#include <gmock/gmock.h>

#include <cmath>

#include "scheduler/services/call_plan.h"
#include "tests/scheduler/profile_rows.h"
#include "tests/scheduler/virtual/virtual_support.h"
#include "workloads/catalog/specs.h"

namespace pirt::test {
namespace {

const char* const kBoard = R"(
platform: board
units:
  cpu: {backend: cpu, memory: dram, active_w: 1}
  gpu: {backend: cpu, memory: dram, role: gpu, active_w: 1}
)";

PhaseRow execute(const std::string& workload, const std::string& unit, double ms,
                 Condition condition = Condition::kSteady) {
  PhaseRow row = row_of(workload, unit, Phase::kExecute, from_ms(ms));
  row.condition = condition;
  return row;
}

/// gaussian_blur takes 4 ms, sobel 2 ms, on either unit.
Profile steady_profile() {
  return profile_of({execute("gaussian_blur", "cpu", 4), execute("sobel", "cpu", 2),
                     execute("gaussian_blur", "gpu", 4), execute("sobel", "gpu", 2)});
}

void set_cache(Profile& profile, std::int64_t bytes) {
  profile.runs[0].environment["unit.cpu.own_cache_bytes"] = std::to_string(bytes);
}

void set_last_cache(Profile& profile, std::int64_t bytes) {
  for (const char* unit : {"cpu", "gpu"}) {
    profile.runs[0].environment[std::string("unit.") + unit + ".last_cache_bytes"] =
        std::to_string(bytes);
  }
}

void add_unit_time(Profile& profile, UnitPhase phase, double sleep_ms, double ms) {
  UnitTimeRow row;
  row.run_id = 1;
  row.unit = "cpu";
  row.phase = phase;
  row.sleep = from_ms(sleep_ms);
  row.samples = 20;
  row.median = row.p95 = from_ms(ms);
  profile.unit_times.push_back(row);
}

void add_handover(Profile& profile, double sleep_ms, double ms) {
  add_unit_time(profile, UnitPhase::kHandover, sleep_ms, ms);
}

/// Of the pipelines, in order.
std::vector<double> p50s_ms(const Profile& profile, const std::string& mix) {
  const bool closed = mix.find("closed_loop") != std::string::npos;
  const ScheduleOptions options = closed ? mode("met", 0, 1) : mode("met", 1);
  const RunRecord record = run_virtual(platform_of(kBoard), &profile, mix_of(mix), options);
  std::vector<double> found;
  for (const PipelineResult& pipeline : record.pipelines) {
    found.push_back(pipeline.p50_ms.value_or(-1));
  }
  return found;
}

/// 100 times a second.
const std::string kBlur = R"(
mix: m
pipelines:
  p: {rate_hz: 100, tasks: [{name: a, workload: gaussian_blur, eligible: [cpu]}]}
)";

/// One after the other, with what comes after each.
std::string frames(const std::string& more_tasks = "") {
  return "mix: m\npipelines:\n  p: {closed_loop: {frames: 50}, tasks: [{name: a, workload: "
         "gaussian_blur, eligible: [cpu]}" +
         more_tasks + "]}\n";
}
const std::string kSobelAfter = ", {name: b, workload: sobel, eligible: [cpu], after: [a]}";

constexpr double kHistogram = 0.001;  // relative: what a percentile of a record may be off

TEST(CallEffects, AreNoneWithoutRows) {
  const auto p50 = p50s_ms(steady_profile(), kBlur);
  EXPECT_NEAR(p50[0], 4, 4 * kHistogram);
}

// 100 firings a second, a call of 4 ms: the unit sleeps 6 ms less the hand-over each time. Rows of
// 1 ms (10 us) and 10 ms (110 us): at 5.9 ms 10 + 100 x log10(5.9) = 87 us.
TEST(CallEffects, AHandOverTakesWhatTheSleepBeforeItAsksFor) {
  Profile profile = steady_profile();
  add_handover(profile, 0, 0.002);
  add_handover(profile, 1, 0.010);
  add_handover(profile, 10, 0.110);
  const auto p50 = p50s_ms(profile, kBlur);
  EXPECT_NEAR(p50[0], 4.087, 4 * kHistogram);
}

// Two tasks in a row: the second finds the unit awake.
TEST(CallEffects, ATaskThatFollowsAnotherIsHandedOverAtOnce) {
  Profile profile = steady_profile();
  add_handover(profile, 0, 0.5);
  add_handover(profile, 1, 1);
  const auto p50 = p50s_ms(profile, R"(
mix: m
pipelines:
  p:
    rate_hz: 20
    tasks:
      - {name: a, workload: gaussian_blur, eligible: [cpu]}
      - {name: b, workload: sobel, eligible: [cpu], after: [a]}
)");
  EXPECT_NEAR(p50[0], 4 + 2 + 1 + 0.5, 7.5 * kHistogram);
}

// Both touch what they state: of caches twice as large as what a call of sobel touches, half is
// other bytes when gaussian_blur comes again; alone, nothing is.
TEST(CallEffects, CachesAreAsColdAsOthersMadeThem) {
  const std::string sobel_name = "sobel";
  const std::int64_t sobel_bytes = find_spec(sobel_name).bytes;
  Profile profile = steady_profile();
  set_cache(profile, 2 * sobel_bytes);
  profile.conditions = {execute("gaussian_blur", "cpu", 6, Condition::kColdCache)};
  EXPECT_NEAR(p50s_ms(profile, frames())[0], 4, 4 * kHistogram);
  const auto others = p50s_ms(profile, frames(kSobelAfter));
  EXPECT_NEAR(others[0], (4 + (6 - 4) / 2.0) + 2, 7 * kHistogram);
}

TEST(CallEffects, ColdIsAtMostWhatWasMeasuredCold) {
  Profile profile = steady_profile();
  set_cache(profile, 1);
  profile.conditions = {execute("gaussian_blur", "cpu", 6, Condition::kColdCache)};
  const auto p50 = p50s_ms(profile, frames(kSobelAfter));
  EXPECT_NEAR(p50[0], 6 + 2, 8 * kHistogram);
}

// Blur and sobel by turns, each cold after the other: a pair takes 6 + 4 ms, whether the one that
// comes next waits for its slot or, with two of them, for its server.
TEST(CallEffects, CachesAreAsColdWhereTheNextCallBeginsBeforeTheTaskHasEnded) {
  Profile profile = steady_profile();
  set_cache(profile, 1);
  profile.conditions = {execute("gaussian_blur", "cpu", 6, Condition::kColdCache),
                        execute("sobel", "cpu", 4, Condition::kColdCache)};
  const Mix mix = mix_of(R"(
mix: m
pipelines:
  p: {closed_loop: {frames: 20}, tasks: [{name: a, workload: gaussian_blur, eligible: [cpu]}]}
  q: {closed_loop: {frames: 20}, tasks: [{name: a, workload: sobel, eligible: [cpu]}]}
)");
  for (const char* slots : {"slots: 1, ", "slots: 2, "}) {
    std::string board = kBoard;
    board.insert(board.find("backend: cpu"), slots);
    const RunRecord record = run_virtual(platform_of(board), &profile, mix, mode("met", 0, 1));
    EXPECT_NEAR(record.makespan_s, 20 * 0.010, 1e-6) << slots;
  }
}

// The unit's own caches hold nothing of it, and of the last ones, which gpu fills as well, half is
// others' when it comes again: one call of sobel on each unit.
TEST(CallEffects, TheLastCachesAreAsColdAsAllUnitsOfTheMemoryMadeThem) {
  const std::string sobel_name = "sobel";
  const std::int64_t sobel_bytes = find_spec(sobel_name).bytes;
  Profile profile = steady_profile();
  set_cache(profile, 1);
  set_last_cache(profile, 4 * sobel_bytes);
  profile.conditions = {execute("gaussian_blur", "cpu", 6, Condition::kColdCache),
                        execute("gaussian_blur", "cpu", 10, Condition::kColdMemory)};
  const auto p50 = p50s_ms(
      profile, frames(kSobelAfter + ", {name: c, workload: sobel, eligible: [gpu], after: [a]}"));
  EXPECT_NEAR(p50[0], (6 + (10 - 6) / 2.0) + 2, 10 * kHistogram);
}

// 100 firings a second: 6 ms after one call had ended, the next begins. Reading again takes 1 ms at
// once and 3 ms from memory; 1.5 after 1 ms and 2.5 after 10 ms, so that a quarter and three
// quarters are lost by then, and 0.25 + 0.5 x log10(6) after 6 ms. (Those 6 ms are a little less:
// the call is longer by what it lost.)
TEST(CallEffects, CachesForgetInTimeWhatNobodyOfTheMixTouched) {
  Profile profile = steady_profile();
  set_cache(profile, std::int64_t{1} << 40);
  set_last_cache(profile, std::int64_t{1} << 40);
  profile.conditions = {execute("gaussian_blur", "cpu", 4.1, Condition::kColdMemory)};
  for (const auto& [sleep_ms, ms] : {std::pair(0.0, 1.0), {1.0, 1.5}, {10.0, 2.5}}) {
    add_unit_time(profile, UnitPhase::kReread, sleep_ms, ms);
  }
  EXPECT_NEAR(p50s_ms(profile, kBlur)[0], 4, 4 * kHistogram)
      << "nobody knows what memory would cost";
  add_unit_time(profile, UnitPhase::kRereadCold, 0, 3);
  const double lost = 0.25 + 0.5 * std::log10(5.94);
  EXPECT_NEAR(p50s_ms(profile, kBlur)[0], 4 + 0.1 * lost, 4 * kHistogram);
  profile.unit_times.back().median = from_ms(1.05);
  EXPECT_NEAR(p50s_ms(profile, kBlur)[0], 4, 4 * kHistogram) << "nothing to lose";
}

// The blur finds what it has just touched itself, however many sobels began beside it: 4 ms on a
// server of its own, 8 where they share one.
TEST(CallEffects, CachesForgetNothingOfACallThatHasJustEndedBesideAnother) {
  Profile profile = steady_profile();
  set_cache(profile, std::int64_t{1} << 40);
  set_last_cache(profile, std::int64_t{1} << 40);
  profile.conditions = {execute("gaussian_blur", "cpu", 8, Condition::kColdMemory)};
  for (const auto& [sleep_ms, ms] : {std::pair(0.0, 1.0), {1.0, 1.5}, {10.0, 2.5}}) {
    add_unit_time(profile, UnitPhase::kReread, sleep_ms, ms);
  }
  add_unit_time(profile, UnitPhase::kRereadCold, 0, 3);
  const Mix mix = mix_of(R"(
mix: m
pipelines:
  p: {closed_loop: {frames: 20}, tasks: [{name: a, workload: gaussian_blur, eligible: [cpu]}]}
  q: {closed_loop: {frames: 200}, tasks: [{name: a, workload: sobel, eligible: [cpu]}]}
)");
  for (const auto& [servers, takes_ms] :
       {std::pair("slots: 2, servers: 2, ", 4.0),
        {"slots: 2, servers: 1, discipline: processor_sharing, ", 8.0}}) {
    std::string board = kBoard;
    board.insert(board.find("backend: cpu"), servers);
    const RunRecord record = run_virtual(platform_of(board), &profile, mix, mode("met", 0, 1));
    EXPECT_NEAR(record.pipelines[0].p50_ms.value(), takes_ms, takes_ms * kHistogram) << servers;
  }
}

// Both begin at once. Of sobel all 2 ms are beside gaussian_blur, of that 2 of its 4 ms: 2 x 1.5
// and 4 + 2 x (1.25 - 1).
TEST(CallEffects, UnitsOfOneMemorySlowEachOtherWhileBothAreBusy) {
  Profile profile = steady_profile();
  profile.conditions = {execute("gaussian_blur", "cpu", 5, Condition::kBesideCompute),
                        execute("sobel", "gpu", 3, Condition::kBesideCompute)};
  const std::string mix = R"(
mix: m
pipelines:
  p: {rate_hz: 10, tasks: [{name: a, workload: gaussian_blur, eligible: [cpu]}]}
  q: {rate_hz: 10, tasks: [{name: a, workload: sobel, eligible: [gpu]}]}
)";
  const auto p50 = p50s_ms(profile, mix);
  EXPECT_NEAR(p50[0], 4.5, 5 * kHistogram);
  EXPECT_NEAR(p50[1], 3, 3 * kHistogram);
  // On memories of their own they do not.
  std::string board = kBoard;
  board.replace(board.rfind("dram"), 4, "vram");
  const RunRecord apart = run_virtual(platform_of(board), &profile, mix_of(mix), mode("met", 1));
  EXPECT_NEAR(apart.pipelines[0].p50_ms.value(), 4, 4 * kHistogram);
}

RunRecord run_on(const std::string& board, const Profile& profile, const std::string& mix,
                 ScheduleOptions options) {
  options.watch_power = true;
  return run_virtual(platform_of(board), &profile, mix_of(mix), options);
}

// The scene's 10 ms, which end a slice after 6, take twice as long beside the blur, which comes at
// 1 ms: the slice ends at 1 + 2 x 5 = 11 ms, where the plan is let in, and the rest is [12, 20).
TEST(CallEffects, WhatSlowsASlicedCallSlowsEachOfItsSlicesOnce) {
  Profile profile = steady_profile();
  profile.phases = {execute("describe_scene", "cpu", 10), execute("gaussian_blur", "gpu", 20)};
  profile.conditions = {execute("describe_scene", "cpu", 20, Condition::kBesideCompute),
                        execute("gaussian_blur", "gpu", 20, Condition::kBesideCompute)};
  ScheduleOptions options = mode("edf", 1);
  options.slices = true;
  const RunRecord record = run_on(kBoard, profile, R"(
mix: m
pipelines:
  scene: {rate_hz: 10, tasks: [{name: a, workload: describe_scene, eligible: [cpu]}]}
  blur: {rate_hz: 10, offset_ms: 1, tasks: [{name: a, workload: gaussian_blur, eligible: [gpu]}]}
  planning: {rate_hz: 10, offset_ms: 2, deadline_ms: 50, tasks: [{name: a, service_ms: {cpu: 1}}]}
)",
                                  options);
  EXPECT_EQ(record.suspensions, 10);
  EXPECT_NEAR(record.pipelines[2].p50_ms.value(), 12 - 2, 0.05);
  EXPECT_NEAR(record.pipelines[0].p50_ms.value(), 20, 0.05);
}

// On units 0 and 2 the blur, from 0, and sobel, from 8, slow each other: 20 + 2 and 2 x 2 ms.
// Nobody knows what slows the scene, which is suspended at 6 and resumed at 7.
TEST(CallEffects, ASlicedCallOfWhichNothingIsKnownLeavesOtherUnitsAsTheyAre) {
  Profile profile = steady_profile();
  profile.phases = {execute("gaussian_blur", "gpu", 20), execute("sobel", "dsp", 2)};
  profile.conditions = {execute("gaussian_blur", "gpu", 40, Condition::kBesideCompute),
                        execute("sobel", "dsp", 4, Condition::kBesideCompute)};
  ScheduleOptions options = mode("edf", 1);
  options.slices = true;
  const RunRecord record = run_on(R"(
platform: board
units:
  gpu: {backend: cpu, role: gpu, memory: dram, active_w: 1}
  cpu: {slots: 1, active_w: 1}
  dsp: {backend: cpu, role: dsp, memory: dram, active_w: 1}
workloads: {describe_scene: {cpu: [{on: cpu, ms: 10}]}}
)",
                                  profile, R"(
mix: m
pipelines:
  blur: {rate_hz: 10, tasks: [{name: a, workload: gaussian_blur, eligible: [gpu]}]}
  scene: {rate_hz: 10, tasks: [{name: a, workload: describe_scene, eligible: [cpu]}]}
  planning: {rate_hz: 10, offset_ms: 3, deadline_ms: 50, tasks: [{name: a, service_ms: {cpu: 1}}]}
  sobel: {rate_hz: 10, offset_ms: 8, tasks: [{name: a, workload: sobel, eligible: [dsp]}]}
)",
                                  options);
  EXPECT_EQ(record.suspensions, 10);
  EXPECT_NEAR(record.pipelines[0].p50_ms.value(), 22, 22 * kHistogram);
  EXPECT_NEAR(record.pipelines[3].p50_ms.value(), 4, 4 * kHistogram);
}

// The blur is [0, 4), the scene, of a live run, [4, 7) and, 10 ms after the plan of [7, 8), [18,
// 20): beside it sobel, which comes at 9, takes what it takes alone.
TEST(CallEffects, ASlicedCallOfWhichNothingIsKnownIsNotTakenForTheOneBeforeIt) {
  Profile profile = steady_profile();
  profile.phases.push_back(execute("describe_scene", "cpu", 5));
  profile.phases.back().notes = {"live"};
  profile.conditions = {execute("sobel", "gpu", 4, Condition::kBesideCompute)};
  add_unit_time(profile, UnitPhase::kLeave, 0, 10);
  ScheduleOptions options = mode("edf", 1);
  options.slices = true;
  const RunRecord record = run_on(kBoard, profile, R"(
mix: m
pipelines:
  blur: {rate_hz: 10, tasks: [{name: a, workload: gaussian_blur, eligible: [cpu]}]}
  scene: {rate_hz: 10, offset_ms: 1, tasks: [{name: a, workload: describe_scene, eligible: [cpu]}]}
  planning: {rate_hz: 10, offset_ms: 5, deadline_ms: 50, tasks: [{name: a, service_ms: {cpu: 1}}]}
  sobel: {rate_hz: 10, offset_ms: 9, tasks: [{name: a, workload: sobel, eligible: [gpu]}]}
)",
                                  options);
  EXPECT_EQ(record.suspensions, 10);
  EXPECT_NEAR(record.pipelines[1].p50_ms.value(), 20 - 1, 19 * kHistogram);
  EXPECT_NEAR(record.pipelines[3].p50_ms.value(), 2, 2 * kHistogram);
}

/// A call on its unit cpu costs a joule of its own.
std::string with_own_joules() {
  std::string board = kBoard;
  return board.replace(board.find("active_w: 1"), 11, "active_w: 1, energy: {call_j: 1}");
}

// The blur takes 4 ms, and 2 more beside sobel, whichever begins first, and in the midst of it: a
// joule of its own, and 1 W of 6 ms beside 1 W of sobel's 2.
TEST(CallEffects, ACallsOwnJoulesAreTheSameBesideOthers) {
  Profile profile = steady_profile();
  profile.conditions = {execute("gaussian_blur", "cpu", 8, Condition::kBesideCompute)};
  const std::string blur = "tasks: [{name: a, workload: gaussian_blur, eligible: [cpu]}]}\n";
  const std::string sobel = "tasks: [{name: a, workload: sobel, eligible: [gpu]}]}\n";
  for (const std::string& pipelines :
       {"  q: {rate_hz: 10, " + sobel + "  p: {rate_hz: 10, " + blur,
        "  p: {rate_hz: 10, " + blur + "  q: {rate_hz: 10, " + sobel,
        "  p: {rate_hz: 10, " + blur + "  q: {rate_hz: 10, offset_ms: 1, " + sobel}) {
    const RunRecord record =
        run_on(with_own_joules(), profile, "mix: m\npipelines:\n" + pipelines, mode("met", 1));
    EXPECT_NEAR(record.energy_j.value(), 10 * (1 + 0.006 + 0.002), 1e-6) << pipelines;
    EXPECT_NEAR(record.power_highest_w.value(), record.energy_j.value(), 1e-6) << pipelines;
  }
}

// Beside sobels of 2 ms, from 1 and from 4 ms on, the blur takes 4, 6 and then 8 ms.
TEST(CallEffects, ACallsOwnJoulesAreTheSameIfItIsSlowedTwice) {
  Profile profile = steady_profile();
  profile.conditions = {execute("gaussian_blur", "cpu", 8, Condition::kBesideCompute)};
  const RunRecord record = run_on(with_own_joules(), profile, R"(
mix: m
pipelines:
  p: {rate_hz: 10, tasks: [{name: a, workload: gaussian_blur, eligible: [cpu]}]}
  q: {rate_hz: 10, offset_ms: 1, tasks: [{name: a, workload: sobel, eligible: [gpu]}]}
  r: {rate_hz: 10, offset_ms: 4, tasks: [{name: a, workload: sobel, eligible: [gpu]}]}
)",
                                  mode("met", 1));
  EXPECT_NEAR(record.pipelines[0].p50_ms.value(), 8, 8 * kHistogram);
  EXPECT_NEAR(record.energy_j.value(), 10 * (1 + 0.008 + 2 * 0.002), 1e-6);
  EXPECT_NEAR(record.power_highest_w.value(), record.energy_j.value(), 1e-6);
}

// Sobel waits for the blur, or shares its server, and becomes longer as it begins: who looks for
// the fullest second hears of it then.
TEST(CallEffects, WhatACallThatWaitedDrawsIsInTheFullestSecond) {
  Profile profile = steady_profile();
  profile.conditions = {execute("gaussian_blur", "cpu", 8, Condition::kBesideCompute),
                        execute("sobel", "cpu", 4, Condition::kBesideCompute)};
  for (const char* slots :
       {"slots: 2, servers: 1, ", "slots: 2, servers: 1, discipline: processor_sharing, "}) {
    std::string board = with_own_joules();
    board.insert(board.find("backend: cpu"), slots);
    const RunRecord record = run_on(board, profile, R"(
mix: m
pipelines:
  p: {rate_hz: 10, tasks: [{name: a, workload: gaussian_blur, eligible: [cpu]}]}
  r: {rate_hz: 10, offset_ms: 1, tasks: [{name: a, workload: sobel, eligible: [cpu]}]}
  q: {rate_hz: 10, offset_ms: 2, tasks: [{name: a, workload: gaussian_blur, eligible: [gpu]}]}
)",
                                    mode("met", 1));
    EXPECT_GT(record.energy_j.value(), 20) << slots;
    EXPECT_NEAR(record.power_highest_w.value(), record.energy_j.value(), 1e-6) << slots;
  }
}

// Of the scene's joule 0.6 is drawn in [0, 6), and 0.4 from 7, when the plan has ended, in its rest
// of 4 ms and the 0.5 ms that going on takes, which draw nothing else.
TEST(CallEffects, ACallsOwnJoulesAreTheSameIfItIsSuspended) {
  Profile profile = steady_profile();
  profile.phases = {execute("describe_scene", "cpu", 10)};
  add_unit_time(profile, UnitPhase::kLeave, 0, 0.5);
  ScheduleOptions options = mode("edf", 1);
  options.slices = true;
  const RunRecord record = run_on(with_own_joules(), profile, R"(
mix: m
pipelines:
  scene: {rate_hz: 10, tasks: [{name: a, workload: describe_scene, eligible: [cpu]}]}
  planning: {rate_hz: 10, offset_ms: 3, deadline_ms: 50, tasks: [{name: a, service_ms: {cpu: 1}}]}
)",
                                  options);
  EXPECT_EQ(record.suspensions, 10);
  EXPECT_NEAR(record.pipelines[0].p50_ms.value(), 11.5, 11.5 * kHistogram);
  EXPECT_NEAR(record.energy_j.value(), 10 * (1 + 0.010 + 0.001), 1e-6);
  EXPECT_NEAR(record.power_highest_w.value(), record.energy_j.value(), 1e-6);
}

// Twice as long at the same energy: the blur takes 8 ms, and 2 more beside sobel, for 5 ms of 1 W.
TEST(CallEffects, AScaledStageDrawsLessWhereOthersLengthenIt) {
  Profile profile = steady_profile();
  profile.conditions = {execute("gaussian_blur", "cpu", 8, Condition::kBesideCompute)};
  Platform platform = platform_of(kBoard);
  platform.modes["met"].stage_scale["cpu.execute"] = 2;
  ScheduleOptions options = mode("met", 1);
  options.watch_power = true;
  const std::string p =
      "  p: {rate_hz: 10, tasks: [{name: a, workload: gaussian_blur, eligible: [cpu]}]}\n";
  const std::string q =
      "  q: {rate_hz: 10, tasks: [{name: a, workload: sobel, eligible: [gpu]}]}\n";
  for (const std::string& pipelines : {p + q, q + p}) {
    const RunRecord record =
        run_virtual(platform, &profile, mix_of("mix: m\npipelines:\n" + pipelines), options);
    EXPECT_NEAR(record.energy_j.value(), 10 * (0.005 + 0.002), 1e-6) << pipelines;
    EXPECT_NEAR(record.power_highest_w.value(), record.energy_j.value(), 1e-6) << pipelines;
  }
}

// The blur, whose caches are cold, takes 6 ms of 1 W: 12 or 3 ms of as many joules.
TEST(CallEffects, AScaledStageIsScaledWithColdCachesAsWell) {
  Profile profile = steady_profile();
  set_cache(profile, 1);
  profile.conditions = {execute("gaussian_blur", "cpu", 6, Condition::kColdCache)};
  ScheduleOptions options = mode("met", 0, 1);
  options.watch_power = true;
  for (const double scale : {2.0, 0.5}) {
    Platform platform = platform_of(kBoard);
    platform.modes["met"].stage_scale["cpu.execute"] = scale;
    const RunRecord record = run_virtual(platform, &profile, mix_of(R"(
mix: m
pipelines:
  p: {closed_loop: {frames: 1}, tasks: [{name: a, workload: gaussian_blur, eligible: [cpu]}]}
)"),
                                         options);
    EXPECT_NEAR(record.makespan_s, scale * 0.006, 1e-9);
    EXPECT_GE(record.makespan_s, record.bounds.value().makespan_s.value_or(0));
    EXPECT_NEAR(record.energy_j.value(), 0.006, 1e-9);
    EXPECT_NEAR(record.power_highest_w.value(), 0.006, 1e-9);
  }
}

// At most 8 ms of 1 W beside one that runs all the time, and a joule of its own.
TEST(CallEffects, ACallsOwnJoulesCountOnceTowardsACap) {
  Profile profile = steady_profile();
  profile.conditions = {execute("gaussian_blur", "cpu", 8, Condition::kBesideCompute)};
  const Platform platform = platform_of(with_own_joules());
  const Mix mix = mix_of(kBlur);
  const Scenario scenario = make_scenario(platform, &profile, mix, {}, CloudUse::kAll);
  EXPECT_NEAR(plan_tasks(scenario, 0)[0].calls[0].window_j(), 1 + 0.008, 1e-9);
}

// 4 ms of each 8 pass before the call begins.
TEST(CallEffects, AHandOverDrawsNothingInTheFullestSecondEither) {
  Profile profile = steady_profile();
  for (const double sleep_ms : {0.0, 1.0}) add_handover(profile, sleep_ms, 4);
  const RunRecord record = run_on(kBoard, profile, R"(
mix: m
pipelines:
  p: {closed_loop: {frames: 250}, tasks: [{name: a, workload: gaussian_blur, eligible: [cpu]}]}
)",
                                  mode("met", 0, 1));
  EXPECT_NEAR(record.makespan_s, 2, 1e-6);
  EXPECT_NEAR(record.power_highest_w.value(), record.average_power_w.value(), 1e-6);
}

// What a live run measured has it in it.
TEST(CallEffects, RowsOfLiveRunsGetNothingAdded) {
  Profile profile = steady_profile();
  set_cache(profile, 1);
  profile.conditions = {execute("gaussian_blur", "cpu", 6, Condition::kColdCache)};
  for (PhaseRow& row : profile.phases) row.notes = {"live"};
  const auto p50 = p50s_ms(profile, kBlur);
  EXPECT_NEAR(p50[0], 4, 4 * kHistogram);
}

/// A board whose cloud would take half a second for what is due in 100 ms.
RunRecord with_a_cloud(const Profile& profile, Draw draw, const std::string& more_tasks = "") {
  ScheduleOptions options = mode("advanced", 0.5);
  options.draw = draw;
  const std::string tasks =
      "tasks: [{name: a, workload: gaussian_blur, eligible: [cpu, cloud]}" + more_tasks + "]";
  return run_virtual(
      platform_of(std::string(kBoard) + "  cloud: {servers: 4}\n" +
                  "workloads: {gaussian_blur: {cloud: [{delay_ms: 500}]}}\n"),
      &profile,
      mix_of("mix: m\npipelines:\n  p: {rate_hz: 1, real_time: false, deadline_ms: 100, " + tasks +
             "}\n"),
      options);
}

/// A call takes 4 ms, with cold caches 6, and 7 at p95; handing it over 0.2 ms, and 0.4 at p95.
Profile with_late_calls() {
  Profile profile = steady_profile();
  profile.phases[0].p95 = from_ms(5);
  set_cache(profile, 1);
  profile.conditions = {execute("gaussian_blur", "cpu", 6, Condition::kColdCache)};
  profile.conditions[0].p95 = from_ms(7);
  for (const double sleep_ms : {0.0, 1.0}) add_handover(profile, sleep_ms, 0.2);
  profile.unit_times[1].p95 = from_ms(0.4);
  return profile;
}

// Three wake-ups of 0.4 ms and a call of 7 ms before the deadline it is taken back, at 91.8 ms;
// then it takes 0.2 + 6 ms, or, when all of it takes long, 0.4 + 7.
TEST(CallEffects, ATaskComesBackFromTheCloudInTimeToBeHandedOverToAColdUnit) {
  const RunRecord usual = with_a_cloud(with_late_calls(), Draw::kMedian);
  EXPECT_EQ(usual.offloaded, 0);
  EXPECT_EQ(usual.pipelines[0].completed, 1);
  EXPECT_EQ(usual.pipelines[0].deadline_misses, 0);
  EXPECT_NEAR(usual.pipelines[0].p50_ms.value(), 91.8 + 0.2 + 6, 98 * kHistogram);
  const RunRecord slow = with_a_cloud(with_late_calls(), Draw::kP95);
  EXPECT_EQ(slow.pipelines[0].deadline_misses, 0);
  EXPECT_NEAR(slow.pipelines[0].p50_ms.value(), 91.8 + 0.4 + 7, 99 * kHistogram);
}

// What comes after it is handed over as well: 0.4 + 2 ms more.
TEST(CallEffects, ATaskComesBackFromTheCloudInTimeForThoseAfterItToBeHandedOver) {
  const RunRecord record = with_a_cloud(with_late_calls(), Draw::kP95, kSobelAfter);
  EXPECT_EQ(record.pipelines[0].deadline_misses, 0);
  // b follows a: handed over to a unit that is awake, in 0.2 ms.
  EXPECT_NEAR(record.pipelines[0].p50_ms.value(), 91.8 - 2.4 + 0.4 + 7 + 0.2 + 2, 99 * kHistogram);
}

// Beside another unit of its memory it takes half as long again.
TEST(CallEffects, ATaskComesBackFromTheCloudInTimeToBeSlowedByANeighbour) {
  Profile profile = with_late_calls();
  profile.conditions.push_back(execute("gaussian_blur", "cpu", 6, Condition::kBesideCompute));
  const RunRecord record = with_a_cloud(profile, Draw::kMedian);
  EXPECT_NEAR(record.pipelines[0].p50_ms.value(), 91.8 - 3.5 + 0.2 + 6, 99 * kHistogram);
}

}  // namespace
}  // namespace pirt::test
