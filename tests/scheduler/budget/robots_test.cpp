// Ten invented robots (robots/): mode budget against every static placement, and its guarantees
// against what is seen.
#include <algorithm>
#include <ctime>
#include <filesystem>
#include <map>

#include "scheduler/budget/guarantees.h"
#include "scheduler/dispatcher/dispatcher.h"
#include "scheduler/record/keeping_up.h"
#include "scheduler/virtual/virtual_time.h"
#include "tests/scheduler/profile_rows.h"
#include "tests/scheduler/support.h"
#include "tests/support/paths.h"
#include "workloads/base/math/random.h"

namespace pirt::test {
namespace {

const std::filesystem::path kRobots =
    std::filesystem::path(kSourceFolder) / "tests/scheduler/budget/robots";

Platform board() { return load_platform((kRobots / "board.yaml").string()); }

std::vector<Mix> robots() {
  std::vector<std::string> files;
  for (const auto& entry : std::filesystem::directory_iterator(kRobots)) {
    if (entry.path().filename() != "board.yaml") files.push_back(entry.path().string());
  }
  std::ranges::sort(files);
  std::vector<Mix> mixes;
  for (const auto& file : files) mixes.push_back(load_mix(file));
  return mixes;
}

ScheduleOptions options_of(const std::string& mode, double duration_s, std::uint64_t seed = 1) {
  ScheduleOptions options;
  options.mode = mode;
  options.duration = from_s(duration_s);
  options.seed = seed;
  return options;
}

bool meets_all(const RunRecord& record) {
  return std::ranges::all_of(record.pipelines, [](const PipelineResult& each) {
    return each.deadline_misses.value_or(0) == 0 && each.dropped == 0;
  });
}

/// Calls @p visit with every mix in which each task may be served by one unit, until it says true.
template <typename Visit>
bool any_placement(const Platform& platform, const Mix& mix, const Visit& visit) {
  ModeSetup setup = set_up_mode(platform, nullptr, mix, options_of("edf", 1));
  Mix placed = mix;
  std::vector<std::pair<MixTask*, UnitMask>> tasks;
  for (std::size_t p = 0; p < mix.pipelines.size(); ++p) {
    for (std::size_t t = 0; t < mix.pipelines[p].tasks.size(); ++t) {
      tasks.emplace_back(&placed.pipelines[p].tasks[t], setup.scenario.classes[p][t].eligible);
    }
  }
  const auto place = [&](const auto& self, std::size_t next) -> bool {
    if (next == tasks.size()) return visit(placed);
    for (UnitId unit = 0; unit < platform.units.size(); ++unit) {
      if (!contains(tasks[next].second, unit)) continue;
      tasks[next].first->eligible = {platform.units[unit].name};
      if (self(self, next + 1)) return true;
    }
    return false;
  };
  return place(place, 0);
}

TEST(Robots, BudgetIsFeasibleWheneverSomeStaticPlacementIs) {
  const Platform platform = board();
  const auto mixes = robots();
  ASSERT_EQ(mixes.size(), 10U);
  int feasible = 0;
  for (const Mix& mix : mixes) {
    std::size_t tasks = 0;
    for (const Pipeline& pipeline : mix.pipelines) tasks += pipeline.tasks.size();
    EXPECT_LE(tasks, 8U) << mix.name;
    const bool placeable = any_placement(platform, mix, [&](const Mix& placed) {
      return meets_all(run_virtual(platform, nullptr, placed, options_of("edf", 3)));
    });
    const RunRecord budget = run_virtual(platform, nullptr, mix, options_of("budget", 3));
    feasible += placeable ? 1 : 0;
    if (placeable) {
      EXPECT_TRUE(meets_all(budget)) << mix.name;
    }
  }
  EXPECT_GE(feasible, 5);
}

/// The longest that a firing of each pipeline took.
struct Seen {
  RunRecord record;
  std::map<std::string, double> longest_ms;
};

Seen watch(const Platform& platform, const Mix& mix, const ScheduleOptions& options) {
  Seen seen;
  const auto driver = [&](const Scenario& scenario, Dispatcher& dispatcher, TraceWriter*) {
    Tally tally = VirtualTime(scenario, dispatcher).run();
    for (std::size_t p = 0; p < mix.pipelines.size(); ++p) {
      const auto longest = tally.pipelines[p].latency.percentile(1);
      seen.longest_ms[mix.pipelines[p].name] = longest ? to_ms(*longest) : 0;
    }
    return tally;
  };
  seen.record = run_mix(platform, nullptr, mix, options, driver, "virtual");
  return seen;
}

TEST(Robots, NoFiringTakesLongerThanGuaranteed) {
  // 1,000 runs: a hundred a robot, each with drawn times up to the worst, and its own offsets.
  constexpr std::uint64_t kSeeds = 100;
  const Platform platform = board();
  int tight = 0;
  int guaranteed = 0;
  for (const Mix& mix : robots()) {
    std::map<std::string, double> bounds, longest;
    for (std::uint64_t seed = 1; seed <= kSeeds; ++seed) {
      Mix drawn = mix;
      Random random(hash_u64(seed, 7));
      for (Pipeline& pipeline : drawn.pipelines) {
        pipeline.offset = from_ms(random.uniform(0, 1e3 / *pipeline.rate_hz));
      }
      const Seen seen = watch(platform, drawn, options_of("budget", 4, seed));
      for (const PipelineResult& result : seen.record.pipelines) {
        if (!result.response_bound_ms) continue;
        const double bound_ms = *result.response_bound_ms;
        // A histogram is off by at most 0.1 %.
        EXPECT_LE(seen.longest_ms.at(result.pipeline), bound_ms * 1.001)
            << mix.name << " " << result.pipeline << " seed " << seed;
        if (*result.guaranteed) {
          EXPECT_EQ(result.deadline_misses, 0) << mix.name << " " << result.pipeline;
        }
        bounds[result.pipeline] = std::max(bounds[result.pipeline], bound_ms);
        auto& worst = longest[result.pipeline];
        worst = std::max(worst, seen.longest_ms.at(result.pipeline));
        guaranteed += *result.guaranteed ? 1 : 0;
      }
    }
    const bool is_tight = !bounds.empty() && std::ranges::all_of(bounds, [&](const auto& each) {
      return each.second <= 2 * longest.at(each.first);
    });
    tight += is_tight ? 1 : 0;
    for (const auto& [pipeline, bound] : bounds) {
      RecordProperty(mix.name + "." + pipeline, std::to_string(bound / longest.at(pipeline)));
    }
  }
  EXPECT_GE(tight, 8) << "robots whose bounds are at most twice what was seen";
  EXPECT_GT(guaranteed, 1000);
}

TEST(Guarantees, AreWhatIsWorkedByHand) {
  // One unit. Planning: 1 ms, 10 Hz, within 6; a job of 4 ms that may have begun; a camera of 2 ms
  // within 50. Planning waits for the job, or the camera: 4 + 1 = 5 ms. The camera waits for the
  // job and, once, for planning: 4 + 1 + 2 = 7.
  const auto platform = platform_of("platform: one\nunits: {cpu: {slots: 1}}\n");
  const auto mix = mix_of(R"(
mix: m
pipelines:
  planning: {rate_hz: 10, deadline_ms: 6, tasks: [{name: a, service_ms: {cpu: 1}}]}
  camera: {rate_hz: 20, deadline_ms: 50, tasks: [{name: a, service_ms: {cpu: 2}}]}
  job: {rate_hz: 1, tasks: [{name: a, service_ms: {cpu: 4}}]}
)");
  const auto record = run_virtual(platform, nullptr, mix, options_of("budget", 2));
  EXPECT_DOUBLE_EQ(*record.pipelines[0].response_bound_ms, 5);
  EXPECT_EQ(record.pipelines[0].guaranteed, true);
  EXPECT_DOUBLE_EQ(*record.pipelines[1].response_bound_ms, 7);
  EXPECT_FALSE(record.pipelines[2].guaranteed);
  EXPECT_FALSE(record.pipelines[2].not_analysed);
}

// job [0, 30), B [30, 35), A [35, 55), job again: between slices the nearest deadline goes first.
TEST(Guarantees, KnowThatAJobIsLeftByDeadline) {
  const auto platform = platform_of(
      "platform: one\nunits: {cpu: {slots: 1, active_w: 1}}\n"
      "workloads: {describe_scene: {cpu: 50}}\n");
  const auto mix = mix_of(
      "mix: m\npipelines:\n"
      "  job: {rate_hz: 5, real_time: false, tasks: [{workload: describe_scene}]}\n"
      "  A: {rate_hz: 5, offset_ms: 1, deadline_ms: 70, tasks: [{name: a, service_ms: {cpu: "
      "20}}]}\n"
      "  B: {rate_hz: 5, offset_ms: 1, deadline_ms: 60, tasks: [{name: b, service_ms: {cpu: "
      "5}}]}\n");
  const auto record = run_virtual(platform, nullptr, mix, options_of("budget", 5));
  EXPECT_DOUBLE_EQ(*record.pipelines[1].response_bound_ms, 55);
  EXPECT_NEAR(*record.pipelines[1].p50_ms, 54, 0.1);
}

// Of 33 slices of 3 ms, eleven calls of 0.2 ms come between or before: each makes the call that
// lets it in 0.1 ms longer, and the call of bundle_adjust may have been let in itself.
TEST(Guarantees, CountWhatLeavingACallTakes) {
  Profile profile = profile_of({row_of("bundle_adjust", "cpu", Phase::kExecute, from_ms(99))});
  UnitTimeRow& leave = profile.unit_times.emplace_back();
  leave.run_id = 1;
  leave.unit = "cpu";
  leave.phase = UnitPhase::kLeave;
  leave.samples = 20;
  leave.median = leave.p95 = from_ms(0.1);
  const auto platform = platform_of("platform: board\nunits: {cpu: {backend: cpu, active_w: 1}}\n");
  const auto mix = mix_of(
      "mix: m\npipelines:\n"
      "  ba: {rate_hz: 2, deadline_ms: 250, tasks: [{workload: bundle_adjust}]}\n"
      "  imu: {rate_hz: 100, deadline_ms: 5, tasks: [{name: i, service_ms: {cpu: 0.2}}]}\n");
  const auto record = run_virtual(platform, &profile, mix, options_of("budget", 5));
  EXPECT_NEAR(*record.pipelines[0].response_bound_ms, 11 * 0.3 + 0.3 + 99.1, 1e-3);
  EXPECT_NEAR(*record.pipelines[1].response_bound_ms, 3.1 + 0.3, 1e-3);
  for (const PipelineResult& each : record.pipelines) {
    EXPECT_LE(*each.p99_ms, *each.response_bound_ms) << each.pipeline;
  }
}

// Ten calls at a time keep the GPU's kernel busy; one at a time are 100 of 200 a second. The cloud
// serves any number, which one at a time would be late.
TEST(Guarantees, TakeNothingFromAUnitWhereThereAreNone) {
  const auto expect_none = [](const std::string& units, const std::string& pipelines, double cap_w,
                              const std::string& why) {
    ScheduleOptions options = options_of("budget", 30);
    if (cap_w > 0) options.power_cap_w = cap_w;
    const auto platform = platform_of("platform: p\n" + units);
    const auto mix = mix_of("mix: m\npipelines: {" + pipelines + "}\n");
    const auto record = run_virtual(platform, nullptr, mix, options);
    EXPECT_EQ(deadline_misses(record), 0);
    EXPECT_EQ(record.pipelines[0].not_analysed, why);
  };
  expect_none(
      "units: {gpu: {active_w: 1}}\n"
      "workloads: {sobel: {gpu: [{delay_ms: 9}, {on: gpu, ms: 1}]}}\n",
      "p: {rate_hz: 200, deadline_ms: 50, tasks: [{workload: sobel}]}", 100,
      "several calls at a time: gpu");
  expect_none(
      "units: {cpu: {slots: 1, active_w: 10}, cloud: {role: cloud}}\n"
      "workloads: {alexnet: {cpu: 3000, cloud: [{delay_ms: {uniform: [2000, 5000]}}]}}\n",
      "rec: {rate_hz: 1, deadline_ms: 10000, real_time: false, tasks: [{workload: alexnet}]}", 0,
      "several calls at a time: cloud");
}

// `far` is 5 to 9.5 s in the cloud, and takes the core for a second when it is wanted back: a
// second before its deadline.
TEST(Guarantees, KnowWhatMayBeWantedBackFromTheCloud) {
  const auto platform = platform_of(
      "platform: two\nunits: {cpu: {slots: 1, active_w: 5}, cloud: {role: cloud}}\n"
      "workloads: {alexnet: {cpu: 1000, cloud: [{delay_ms: {uniform: [5000, 9500]}}]}}\n");
  const auto pipelines = [&](const std::string& arrivals) {
    const auto mix = mix_of(
        "mix: m\npipelines:\n  far: {" + arrivals +
        ", real_time: false, tasks: [{workload: alexnet}]}\n"
        "  near: {rate_hz: 10, deadline_ms: 50, tasks: [{name: n, service_ms: {cpu: 2}}]}\n");
    return run_virtual(platform, nullptr, mix, options_of("budget", 600)).pipelines;
  };
  const auto wanted = pipelines("rate_hz: 0.1, deadline_ms: 10000");
  EXPECT_FALSE(wanted[0].guaranteed.value_or(false));
  EXPECT_EQ(wanted[1].not_analysed, "on a unit of far, which is not");
  const auto back = pipelines("rate_hz: 0.1, deadline_ms: 11000");
  EXPECT_EQ(back[0].guaranteed, true);
  EXPECT_EQ(back[1].guaranteed, true);
  const auto many = pipelines("rate_hz: 1, deadline_ms: 11000");
  EXPECT_EQ(many[0].not_analysed, "several calls at a time: cloud");
  EXPECT_EQ(many[1].guaranteed, true) << "no call in the cloud waits for another";
}

// Each of forty pipelines may wait for all others; of a graph without a rate nothing is asked.
TEST(Guarantees, TakeLittleTimeWithManyPipelinesAndLargeGraphs) {
  const auto platform = platform_of("platform: one\nunits: {cpu: {slots: 1, active_w: 1}}\n");
  const auto clocks_of = [&](const std::string& pipelines, bool analysed) {
    const Mix mix = mix_of("mix: m\npipelines:\n" + pipelines);
    ScheduleOptions options;
    options.mode = "budget";
    const ModeSetup setup = set_up_mode(platform, nullptr, mix, options);
    const std::clock_t begin = std::clock();
    const auto guarantees = guarantees_of(setup.scenario, setup.policy_setup.budget);
    const std::clock_t end = std::clock();
    for (const Guarantee& each : guarantees) EXPECT_EQ(each.analysed, analysed);
    return end - begin;
  };
  std::string many;
  for (int i = 0; i < 40; ++i) {
    const int rate_hz = 10 + 2 * i;
    many += "  p" + std::to_string(i) + ": {rate_hz: " + std::to_string(rate_hz) +
            ", deadline_ms: " + std::to_string(1000 / rate_hz) +
            ", tasks: [{name: t, service_ms: {cpu: 0.4}}]}\n";
  }
  EXPECT_LT(clocks_of(many, true), CLOCKS_PER_SEC) << "of processor time";
  std::string chain = "  p: {closed_loop: {frames: 2}, tasks: [{name: t0, service_ms: {cpu: 1}}";
  for (int i = 1; i < 5000; ++i) {
    chain += ", {name: t" + std::to_string(i) + ", service_ms: {cpu: 1}, after: [t" +
             std::to_string(i - 1) + "]}";
  }
  EXPECT_LT(clocks_of(chain + "]}\n", false), CLOCKS_PER_SEC / 4) << "of processor time";
}

TEST(Guarantees, SayWhatIsNotAnalysed) {
  const auto record = run_virtual(load_platform("snapdragon820-section5"), nullptr,
                                  load_mix("section5"), options_of("budget", 5));
  const auto planning = std::ranges::find(record.pipelines, "planning", &PipelineResult::pipeline);
  ASSERT_TRUE(planning->not_analysed);
  EXPECT_THAT(*planning->not_analysed, testing::HasSubstr("served on another's cores"));
}

}  // namespace
}  // namespace pirt::test
