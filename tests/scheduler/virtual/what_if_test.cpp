// What breaks first when a rate rises or the cap of power falls, worked by hand; and the frontier.
#include "scheduler/what_if.h"

#include "scheduler/frontier.h"
#include "scheduler/record/keeping_up.h"
#include "tests/scheduler/profile_rows.h"
#include "tests/scheduler/support.h"

namespace pirt::test {
namespace {

using testing::HasSubstr;
using testing::IsEmpty;

/// One core, 2 W beside 0.5 W idle.
const std::string kOneCore = "platform: one\nunits: {cpu: {slots: 1, active_w: 2, idle_w: 0.5}}\n";

Mix camera() {
  return mix_of(
      "mix: m\npipelines:\n"
      "  camera: {rate_hz: 20, tasks: [{name: a, service_ms: {cpu: 20}}]}\n"
      "  planning: {rate_hz: 10, deadline_ms: 30, tasks: [{name: a, service_ms: {cpu: 5}}]}\n");
}

ScheduleOptions ten_seconds() {
  ScheduleOptions options;
  options.duration = std::chrono::seconds(10);
  return options;
}

TEST(WhatIf, FindsTheRateThatAUnitHasNoTimeFor) {
  // 10 Hz of 5 ms leave 950 ms a second: 47.5 Hz of 20 ms.
  const auto found = what_if(platform_of(kOneCore), nullptr, camera(), {"edf", "budget"},
                             parse_raise("camera.rate_hz", camera()), ten_seconds());
  EXPECT_EQ(found.parameter, "camera.rate_hz");
  EXPECT_EQ(found.given, 20);
  ASSERT_EQ(found.rows.size(), 2U);
  for (const WhatIfRow& row : found.rows) {
    SCOPED_TRACE(row.mode);
    ASSERT_TRUE(row.holds && row.breaks && row.breakage);
    EXPECT_LT(*row.holds, *row.breaks);
    EXPECT_NEAR(*row.breaks, 47.5, 1.5);
    EXPECT_LT(*row.breaks - *row.holds, 0.01);
    EXPECT_EQ(row.breakage->pipeline, "camera");
    EXPECT_EQ(row.breakage->unit, "cpu");
    EXPECT_THAT(row.breakage->resource, HasSubstr("time of the unit"));
    EXPECT_THAT(row.breakage->what, HasSubstr("unfinished"));
  }
}

TEST(WhatIf, SaysWhoseTurnComesTooLate) {
  // 20 ms that are not interrupted, and 5 ms: 24 of planning's deadline are not enough.
  auto mix = camera();
  mix.pipelines[1].deadline = std::chrono::milliseconds(24);
  const auto found = what_if(platform_of(kOneCore), nullptr, mix, {"edf", "budget"},
                             parse_raise("planning.rate_hz", mix), ten_seconds());
  const WhatIfRow& edf = found.rows[0];
  ASSERT_TRUE(edf.breakage);
  EXPECT_EQ(edf.breakage->pipeline, "planning");
  EXPECT_THAT(edf.breakage->resource, HasSubstr("not interrupted"));
  EXPECT_GT(found.rows[1].holds.value_or(0), edf.holds.value_or(0)) << "it foresees the plans";
}

TEST(WhatIf, LowersTheCapUntilSomethingIsNotDone) {
  // 20 Hz of 20 ms and 10 Hz of 5 ms at 2 W beside 0.5 W idle: 1.4 W on average.
  auto options = ten_seconds();
  options.power_cap_w = 3;
  const auto found = what_if(platform_of(kOneCore), nullptr, camera(), {"edf", "budget"},
                             {.kind = WhatIfChange::Kind::kPowerCap, .pipeline = ""}, options);
  EXPECT_EQ(found.unit, "W");
  for (const WhatIfRow& row : found.rows) {
    SCOPED_TRACE(row.mode);
    ASSERT_TRUE(row.holds && row.breaks && row.breakage);
    EXPECT_NEAR(*row.breaks, 1.42, 0.05);
  }
  EXPECT_THAT(found.rows[0].breakage->resource, HasSubstr("power"));
  EXPECT_EQ(found.rows[1].breakage->pipeline, "camera");
  EXPECT_THAT(found.rows[1].breakage->resource, HasSubstr("power"));
  options.power_cap_w.reset();
  EXPECT_THAT(bad_input([&] {
                static_cast<void>(what_if(platform_of(kOneCore), nullptr, camera(), {"edf"},
                                          {.kind = WhatIfChange::Kind::kPowerCap, .pipeline = ""},
                                          options));
              }),
              HasSubstr("--power-cap 11W"));
}

TEST(WhatIf, KnowsWhatDoesNotFitAsItIs) {
  auto mix = camera();
  mix.pipelines[0].rate_hz = 60.0;
  const auto found = what_if(platform_of(kOneCore), nullptr, mix, {"budget", "qilin"},
                             parse_raise("all.rate_hz", mix), ten_seconds());
  EXPECT_FALSE(found.rows[0].holds);
  EXPECT_EQ(found.rows[0].breaks, 1);
  EXPECT_THAT(bad_input([&] { static_cast<void>(parse_raise("camra.rate_hz", mix)); }),
              HasSubstr("did you mean camera.rate_hz"));
}

TEST(WhatIf, WarnsOfWhatItDoesNotUse) {
  Profile profile = profile_of({row_of("fc8", "cpu", Phase::kCall, from_ms(10)),
                                row_of("fc8", "gpu", Phase::kCall, from_ms(10))});
  profile.phases.back().reasons = {"wrong_output"};
  const auto board = platform_of(
      "platform: board\nunits:\n  cpu: {backend: fake, active_w: 1}\n"
      "  gpu: {backend: fake, active_w: 1}\n");
  const auto mix = mix_of("mix: m\npipelines: {p: {rate_hz: 20, tasks: [{workload: fc8}]}}\n");
  const auto found =
      what_if(board, &profile, mix, {"edf"}, parse_raise("p.rate_hz", mix), ten_seconds());
  EXPECT_THAT(found.rows[0].warnings, testing::Contains(HasSubstr("fc8 on gpu is not used")));
}

// 200 ms at 2 W are 0.4 J; the cap leaves 0.1 J of a second.
TEST(WhatIf, WhatIsNeverBegunDoesNotKeepUp) {
  const auto mix = mix_of(
      "mix: m\npipelines: {p: {closed_loop: {frames: 3}, tasks: [{name: a, service_ms: {cpu: "
      "200}}]}}\n");
  ScheduleOptions options;
  options.mode = "budget";
  options.in_flight = 1;
  options.power_cap_w = 0.6;
  const RunRecord record = run_virtual(platform_of(kOneCore), nullptr, mix, options);
  EXPECT_EQ(record.stalled, 1);
  EXPECT_FALSE(keeps_up(record));
  const auto breakage = breakage_of(record, mix, options.power_cap_w);
  ASSERT_TRUE(breakage);
  EXPECT_EQ(breakage->resource, "power");
  EXPECT_EQ(breakage->what, "1 of 1 tasks are never begun");
}

TEST(WhatIf, ADeadlineDoesNotKeepARateOnOneUnit) {
  // On the GPU alone 384 Hz; with the CPU's cores beside it 755, with the DSP 808.
  const auto mix = mix_of(
      "mix: m\npipelines: {p: {rate_hz: 300, deadline_ms: 40, tasks: [{workload: "
      "convolution}]}}\n");
  auto options = ten_seconds();
  options.duration = std::chrono::seconds(2);
  const auto found = what_if(load_platform("snapdragon820"), nullptr, mix, {"budget"},
                             parse_raise("p.rate_hz", mix), options);
  EXPECT_GT(found.rows[0].holds.value_or(0), 600);
}

TEST(Frontier, HasWhatThePapersModesReachAndMore) {
  ScheduleOptions options;
  const auto runs = run_frontier(load_platform("snapdragon820"), nullptr,
                                 load_mix("convolution-1000"), paper_modes(), options);
  EXPECT_THAT(runs.skipped, IsEmpty());
  EXPECT_GE(runs.runs.size(), 12U);
  EXPECT_EQ(goal_of(runs.runs[0]), "latency");
  const auto beats_throughput = [&](const RunRecord& run) {
    return *run.throughput_per_ms > *runs.runs[1].throughput_per_ms &&
           *run.energy_j < *runs.runs[1].energy_j;
  };
  EXPECT_TRUE(std::ranges::any_of(runs.runs, beats_throughput));
}

}  // namespace
}  // namespace pirt::test
