// Mode budget on random systems, and on some by hand: what it guarantees is kept, what draws keeps
// the cap, and it keeps up where a mode that plans nothing does.
#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <ctime>

#include "scheduler/budget/planning.h"
#include "scheduler/policies/foresight.h"
#include "scheduler/record/keeping_up.h"
#include "tests/scheduler/support.h"
#include "workloads/base/math/random.h"

namespace pirt::test {
namespace {

/// What a system may have beside units and tasks.
struct Kind {
  bool links = false, contexts = false, transfers = false, own_joules = false;
};

struct System {
  Platform platform;
  Mix mix;
};

class Generator {
 public:
  Generator(std::uint64_t seed, const Kind& kind) : random_(hash_u64(seed, 11)), kind_(kind) {}

  System make() {
    const std::string platform = units();
    return {platform_of(platform), mix_of(pipelines())};
  }

 private:
  bool perhaps(double part) { return random_.uniform(0, 1) < part; }
  double one_of(std::initializer_list<double> values) {
    return values.begin()[static_cast<std::size_t>(
        random_.uniform(0, static_cast<double>(values.size()) - 1e-9))];
  }

  std::string units() {
    names_ = {"cpu", "gpu", "dsp"};
    names_.resize(static_cast<std::size_t>(one_of({1, 1, 2, 3})));
    std::string text = "platform: random\nunits:\n";
    std::string links;
    for (const std::string& name : names_) {
      text += fmt::format("  {0}: {{role: {0}, slots: 1, active_w: {1}, idle_w: 0.1", name,
                          one_of({1, 2, 5}));
      if (kind_.links && perhaps(0.5)) {
        text += ", link: to_" + name;
        links += fmt::format("  to_{}: {{mbit_s: {}, active_w: {}, latency_ms: {}}}\n", name,
                             one_of({100, 1000, 8000}), one_of({0, 1, 3}), one_of({0, 0.1, 1}));
      }
      if (kind_.contexts && perhaps(0.4)) {
        text += fmt::format(", contexts: {{prepare_ms: {}}}", one_of({1, 5, 20}));
      }
      if (kind_.own_joules && perhaps(0.4)) {
        text += fmt::format(", energy: {{call_j: {}}}", one_of({0.01, 0.1}));
      }
      text += "}\n";
    }
    if (!links.empty()) text += "links:\n" + links;
    text += "workloads:\n";
    for (const char* workload : {"alexnet", "bundle_adjust", "describe_scene"}) {
      text += fmt::format("  {}: {{", workload);
      for (const std::string& name : names_) {
        text += fmt::format("{0}: [{{on: {0}, ms: {1}}}], ", name, random_.uniform(5, 110));
      }
      text += "}\n";
    }
    return text;
  }

  std::string pipelines() {
    std::string text = "mix: random\npipelines:\n";
    if (perhaps(0.6)) {
      text +=
          fmt::format("  rec: {{rate_hz: {}, deadline_ms: {}, tasks: [{{workload: alexnet}}]}}\n",
                      one_of({1, 3, 5}), one_of({100, 200, 300}));
    }
    if (perhaps(0.5)) {
      text += fmt::format(
          "  ba: {{rate_hz: {}, real_time: false, tasks: [{{workload: bundle_adjust}}]}}\n",
          one_of({0.5, 1, 5}));
    }
    if (perhaps(0.3)) {
      text +=
          "  sc: {closed_loop: {frames: 50}, real_time: false, tasks: [{workload: "
          "describe_scene}]}\n";
    }
    const int own = static_cast<int>(one_of({1, 2, 3, 4}));
    for (int i = 0; i < own; ++i) text += pipeline(i);
    return text;
  }

  std::string pipeline(int number) {
    const double rate_hz = one_of({5, 10, 20, 25, 50, 100});
    const double period_ms = 1000 / rate_hz;
    std::string text = fmt::format("  p{}: {{rate_hz: {}", number, rate_hz);
    text += perhaps(0.85) ? fmt::format(", deadline_ms: {}", period_ms * one_of({0.5, 1, 1, 1}))
                          : std::string(", real_time: false");
    if (perhaps(0.4)) text += fmt::format(", jitter_ms: {}", period_ms * one_of({0.05, 0.1}));
    if (perhaps(0.4)) text += fmt::format(", offset_ms: {}", random_.uniform(0, period_ms));
    text += ", tasks: [";
    const int tasks = static_cast<int>(one_of({1, 2, 3}));
    for (int t = 0; t < tasks; ++t) {
      text += fmt::format("{{name: t{}, service_ms: {{", t);
      const std::size_t first = static_cast<std::size_t>(random_.uniform(0, 2.99)) % names_.size();
      for (std::size_t u = 0; u < names_.size(); ++u) {
        if (u != first && perhaps(0.5)) continue;
        text += fmt::format("{}: {}, ", names_[u], random_.uniform(0.02, 0.35) * period_ms / tasks);
      }
      text += "}";
      if (t > 0 && perhaps(0.8)) {
        text += fmt::format(", after: [{{task: t{}, transfer_ms: {}}}]", t - 1,
                            kind_.transfers ? one_of({0, 0.5, 2}) * period_ms / 50 : 0);
      }
      text += "}, ";
    }
    return text + "]}\n";
  }

  Random random_;
  Kind kind_;
  std::vector<std::string> names_;
};

constexpr Kind kPlain = {};
constexpr Kind kAllKinds = {.links = true, .contexts = true, .transfers = true, .own_joules = true};

RunRecord run(const System& system, const std::string& mode, std::optional<double> cap_w = {}) {
  ScheduleOptions options;
  options.mode = mode;
  options.duration = from_s(5);
  options.power_cap_w = cap_w;
  return run_virtual(system.platform, nullptr, system.mix, options);
}

TEST(RandomSystems, WhatIsGuaranteedIsNeverLate) {
  int guaranteed = 0;
  for (const Kind& kind : {kPlain, kAllKinds}) {
    for (std::uint64_t seed = 0; seed < 150; ++seed) {
      const RunRecord record = run(Generator(seed, kind).make(), "budget");
      for (const PipelineResult& pipeline : record.pipelines) {
        if (pipeline.response_bound_ms && pipeline.p99_ms) {
          // A histogram is off by at most 0.1 %.
          EXPECT_LE(*pipeline.p99_ms, *pipeline.response_bound_ms * 1.001)
              << "seed " << seed << ", " << pipeline.pipeline;
        }
        if (!pipeline.guaranteed.value_or(false)) continue;
        ++guaranteed;
        EXPECT_EQ(pipeline.deadline_misses, 0) << "seed " << seed << ", " << pipeline.pipeline;
      }
    }
  }
  EXPECT_GT(guaranteed, 100);
}

TEST(RandomSystems, NoSecondIsAboveTheCapUnseen) {
  int capped = 0;
  for (std::uint64_t seed = 0; seed < 200; ++seed) {
    const double cap_w = 0.5 * static_cast<double>(1 + seed % 12);
    const RunRecord record = run(Generator(seed, kAllKinds).make(), "budget", cap_w);
    if (record.over_cap.value_or(0) > 0) continue;
    ++capped;
    EXPECT_LE(*record.power_highest_w, cap_w * (1 + 1e-9)) << "seed " << seed;
  }
  EXPECT_GT(capped, 50);
}

TEST(RandomSystems, WhereAModeThatPlansNothingKeepsUpItDoesToo) {
  int kept = 0;
  for (std::uint64_t seed = 0; seed < 150; ++seed) {
    const System system = Generator(seed, kPlain).make();
    if (!keeps_up(run(system, "edf")) && !keeps_up(run(system, "ect"))) continue;
    ++kept;
    EXPECT_TRUE(keeps_up(run(system, "budget"))) << "seed " << seed;
  }
  EXPECT_GT(kept, 30);
}

RunRecord run_for(double seconds, const std::string& platform, const std::string& pipelines,
                  ScheduleOptions options = {}) {
  if (options.mode.empty()) options.mode = "budget";
  options.duration = from_s(seconds);
  return run_virtual(platform == "fake" ? load_platform(platform) : platform_of(platform), nullptr,
                     mix_of("mix: m\npipelines:\n" + pipelines), options);
}

/// Of 80 ms, `job` does not fit between q and r, which three times bear to wait for less than 30.
const std::string kChain =
    ", tasks: [{name: t1, service_ms: {cpu: 1}}, {name: t2, service_ms: {cpu: 1}, after: [t1]}, "
    "{name: t3, service_ms: {cpu: 1}, after: [t2]}]}\n";
const std::string kChains = "  q: {rate_hz: 10, deadline_ms: 95" + kChain +
                            "  r: {rate_hz: 10, offset_ms: 50, deadline_ms: 95" + kChain;
const std::string kJob = "  job: {rate_hz: 2, tasks: [{name: j, service_ms: {cpu: 80}}]}\n";
const std::string kImu =
    "  imu: {rate_hz: 1000, deadline_ms: 1, tasks: [{name: i, service_ms: {dsp: 0.1}}]}\n";
const std::string kCpuAndDsp =
    "platform: two\nunits: {cpu: {slots: 1, active_w: 1}, dsp: {slots: 1, active_w: 1}}\n";
const std::string kAbc =
    "platform: three\nunits: {a: {slots: 1, active_w: 1}, b: {slots: 1, active_w: 2}, "
    "c: {slots: 1, active_w: 1}}\n";

TEST(Budget, DoesNotStarveWhatHasNoDeadline) {
  const auto keeps = [&](const std::string& pipelines, const std::string& mode,
                         std::optional<Objective> objective) {
    ScheduleOptions options;
    options.mode = mode;
    options.objective = objective;
    return keeps_up(run_for(5, kCpuAndDsp, pipelines, options));
  };
  EXPECT_TRUE(keeps(kChains + kJob, "edf", {}));
  EXPECT_TRUE(keeps(kChains + kJob, "budget", Objective::kEnergy));
  EXPECT_TRUE(keeps(kChains + kJob + kImu, "edf", {}));
  EXPECT_TRUE(keeps(kChains + kJob + kImu, "budget", {}));
}

// The plan would never run it, which takes the least joules a task.
TEST(Budget, ForEnergyItRunsWhatMayWait) {
  ScheduleOptions options;
  options.objective = Objective::kEnergy;
  const RunRecord record = run_for(5, kCpuAndDsp,
                                   kChains +
                                       "  job: {rate_hz: 2, real_time: false, tasks: [{name: j, "
                                       "service_ms: {cpu: 80}}]}\n",
                                   options);
  EXPECT_EQ(record.pipelines[2].never_ran, std::nullopt);
  EXPECT_EQ(real_time_losses(record), 0);
}

// Of `job`, j1 has room between q and r, and j2 none.
TEST(Budget, WhatBeginsAndNeverEndsIsNotServed) {
  const std::string job =
      "  job: {rate_hz: 2, real_time: false, tasks: [{name: j1, service_ms: {cpu: 1}}, {name: j2, "
      "service_ms: {cpu: 80}, after: [j1]}]}\n";
  ScheduleOptions options;
  options.objective = Objective::kEnergy;
  const RunRecord frugal = run_for(5, kCpuAndDsp, kChains + job, options);
  const RunRecord fast = run_for(5, kCpuAndDsp, kChains + job + kImu);
  for (const RunRecord& record : {frugal, fast}) {
    EXPECT_GT(record.pipelines[2].completed, 0);
    EXPECT_EQ(real_time_losses(record), 0);
  }
}

// edf, which serves `job`, is late for q and r once `big` has begun.
TEST(Budget, PlansForWhatFiresRarely) {
  const RunRecord record = run_for(9, kCpuAndDsp,
                                   kChains + kJob + kImu +
                                       "  big: {rate_hz: 0.1, offset_ms: 6000, real_time: false, "
                                       "tasks: [{name: b, service_ms: {cpu: 2000}}]}\n");
  EXPECT_EQ(real_time_losses(record), 0);
}

// Both fit on c, one after the other: y would end after 1.8 s. The loop asks for short trials.
TEST(Budget, ATrialLastsUntilADeadlineHasPassed) {
  const std::string task =
      ": {rate_hz: 0.5, deadline_ms: 1500, tasks: [{name: t, service_ms: {b: 900, c: 900}}]}\n";
  const RunRecord record = run_for(
      10,
      "platform: three\nunits: {a: {slots: 1, active_w: 1}, b: {slots: 1, active_w: 2}, c: "
      "{slots: 1, active_w: 1}}\n",
      "  loop: {closed_loop: {frames: 1000}, real_time: false, tasks: [{name: l, service_ms: {a: "
      "0.02}}]}\n  x" +
          task + "  y" + task);
  EXPECT_EQ(real_time_losses(record), 0);
}

// The loop is over after 1 ms. On `a`, which takes less energy, y would end after 900 ms.
TEST(Budget, ATrialLastsBeyondALoopThatIsSoonOver) {
  const std::string task =
      ": {rate_hz: 1, deadline_ms: 800, tasks: [{name: t, service_ms: {a: 450, b: 450}}]}\n";
  const RunRecord record = run_for(
      10, kAbc,
      "  loop: {closed_loop: {frames: 1000}, real_time: false, tasks: [{name: l, service_ms: {c: "
      "0.001}}]}\n  x" +
          task + "  y" + task);
  EXPECT_EQ(real_time_losses(record), 0);
}

// x and y fire after 15 s, of which a trial of the plan has 10: y would be late on `a`, behind x.
TEST(Budget, PlansForADeadlineThatComesRarely) {
  const std::string rare =
      ": {rate_hz: 0.05, offset_ms: 15000, deadline_ms: 10, tasks: [{name: t, service_ms: {a: 8, "
      "b: 8}}]}\n";
  const std::string pipelines =
      "  imu: {rate_hz: 1000, deadline_ms: 1, tasks: [{name: i, service_ms: {c: 0.1}}]}\n  x" +
      rare + "  y" + rare;
  ScheduleOptions capped;
  capped.power_cap_w = 100;
  EXPECT_EQ(real_time_losses(run_for(16, kAbc, pipelines, capped)), 0);
  const RunRecord record = run_for(16, kAbc, pipelines);
  EXPECT_EQ(real_time_losses(record), 0);
  EXPECT_EQ(record.pipelines[0].guaranteed, true);
}

// The first firing of `cam` has no image of an earlier one. On both units z would wait for nobody,
// and nothing could be said of any.
TEST(Budget, AFirstFiringWithoutAPredecessorIsNoReasonToMove) {
  const RunRecord record = run_for(
      2,
      "platform: two\nunits: {a: {slots: 1, active_w: 1}, b: {slots: 1, active_w: 1}}\n"
      "workloads: {undistort: {a: 5}, track_features: {a: 5}}\n",
      "  cam: {rate_hz: 10, deadline_ms: 90, tasks: [{name: undistort, workload: undistort}, "
      "{name: track, workload: track_features, inputs: {image: undistort.image, previous: "
      "undistort.image@-1}}]}\n"
      "  y: {rate_hz: 10, offset_ms: 50, deadline_ms: 90, tasks: [{name: y, service_ms: {b: "
      "10}}]}\n"
      "  z: {rate_hz: 20, offset_ms: 6, deadline_ms: 50, tasks: [{name: z, service_ms: {a: 10, b: "
      "10}}]}\n");
  for (const PipelineResult& each : record.pipelines) {
    EXPECT_EQ(each.guaranteed, true) << each.pipeline;
  }
}

// Begun at 100 ms, a call of `job` has the cpu until 109: p, of 105 ms, would end at 119.
TEST(Budget, ForeseesThatCallsWaitForAnotherUnitsServers) {
  const RunRecord record =
      run_for(5,
              "platform: two\nunits: {cpu: {slots: 1, active_w: 1}, gpu: {active_w: 1}}\n"
              "workloads: {sobel: {gpu: [{on: cpu, ms: 9}, {on: gpu, ms: 1}]}}\n",
              "  p: {rate_hz: 10, offset_ms: 5, deadline_ms: 12, tasks: [{workload: sobel}]}\n"
              "  job: {rate_hz: 50, real_time: false, tasks: [{workload: sobel}]}\n");
  EXPECT_EQ(deadline_misses(record), 0);
  EXPECT_GE(record.pipelines[1].completed, 240);
}

// On `a`, which takes less energy, y would end 16 ms after its firing.
TEST(Budget, ForLatencyWhatWaitsInTheDispatcherCounts) {
  const std::string task =
      ": {rate_hz: 10, deadline_ms: 50, tasks: [{name: t, service_ms: {a: 8, b: 8}}]}\n";
  ScheduleOptions options;
  options.objective = Objective::kLatency;
  const RunRecord record =
      run_for(5, "platform: two\nunits: {a: {slots: 1, active_w: 1}, b: {slots: 1, active_w: 2}}\n",
              "  x" + task + "  y" + task, options);
  EXPECT_NEAR(record.pipelines[0].p50_ms.value(), 8, 0.1);
  EXPECT_NEAR(record.pipelines[1].p50_ms.value(), 8, 0.1);
}

// The cloud serves any number of calls at a time: one more makes nothing late that is to come. So
// it is where a call has a link for 50 of its 2050 ms.
TEST(Budget, WhatIsForeseenInTheCloudKeepsNothingFromIt) {
  ScheduleOptions options;
  options.power_cap_w = 50;
  for (const std::string there : {"}}\n", ", link: radio}}\nlinks: {radio: {mbit_s: 100}}\n"}) {
    const RunRecord record = run_for(
        60,
        "platform: two\nunits: {cpu: {slots: 1, active_w: 10}, cloud: {role: cloud" + there +
            "workloads: {alexnet: {cloud: [{delay_ms: 2000}]}, bundle_adjust: {cloud: [{delay_ms: "
            "{uniform: [2000, 5000]}}]}}\n",
        "  rec: {rate_hz: 1, deadline_ms: 10000, real_time: false, tasks: [{workload: alexnet}]}\n"
        "  map: {rate_hz: 0.1, real_time: false, tasks: [{workload: bundle_adjust}]}\n",
        options);
    EXPECT_EQ(deadline_misses(record), 0) << there;
    EXPECT_GE(record.pipelines[1].completed, 5) << there;
    EXPECT_EQ(record.pipelines[1].never_ran, std::nullopt) << there;
  }
}

// One call at a time would guarantee p, and serve 100 of 260 a second; likewise in the cloud, and
// one scene in 3.5 s.
TEST(Budget, KeepsSeveralCallsAtATimeWhereOneIsTooSlow) {
  ScheduleOptions options;
  options.power_cap_w = 100;
  std::string pipelines = "  p: {rate_hz: 10, deadline_ms: 50, tasks: [{workload: sobel}]}\n";
  for (int i = 0; i < 5; ++i) {
    pipelines += fmt::format("  v{}: {{rate_hz: 50, tasks: [{{workload: sobel}}]}}\n", i);
  }
  const RunRecord queues = run_for(10,
                                   "platform: p\nunits: {gpu: {active_w: 1}}\n"
                                   "workloads: {sobel: {gpu: [{delay_ms: 9}, {on: gpu, ms: 1}]}}\n",
                                   pipelines, options);
  const RunRecord scenes = run_for(
      60, "fake",
      "  rec: {rate_hz: 0.05, deadline_ms: 12000, real_time: false, tasks: [{workload: alexnet, "
      "eligible: [cloud]}]}\n"
      "  scene: {rate_hz: 1, real_time: false, tasks: [{workload: describe_scene, eligible: "
      "[cloud]}]}\n",
      options);
  for (const RunRecord& record : {queues, scenes}) {
    EXPECT_THAT(record.pipelines[0].not_analysed.value_or(""),
                testing::HasSubstr("several calls at a time"));
    EXPECT_EQ(real_time_queued(record), 0);
    EXPECT_EQ(deadline_misses(record), 0);
  }
  EXPECT_GE(scenes.pipelines[1].completed, 48);
}

// x and y, of 8 of their 10 ms each, fit on two units, and fire for the first time after 10 s.
TEST(Budget, PlansForWhatBeginsLate) {
  const std::string late =
      ": {rate_hz: 10, offset_ms: 10000, deadline_ms: 10, tasks: [{name: t, service_ms: {a: 8, b: "
      "8}}]}\n";
  const Platform platform = platform_of(
      "platform: three\nunits: {a: {slots: 1, active_w: 1}, b: {slots: 1, active_w: 2}, c: {slots: "
      "1, active_w: 1}}\n");
  const Mix mix = mix_of(
      "mix: m\npipelines:\n"
      "  imu: {rate_hz: 1000, deadline_ms: 1, tasks: [{name: i, service_ms: {c: 0.1}}]}\n  x" +
      late + "  y" + late);
  ScheduleOptions options;
  options.mode = "budget";
  options.duration = from_s(12);
  const RunRecord record = run_virtual(platform, nullptr, mix, options);
  EXPECT_EQ(record.pipelines[2].completed, 20);
  EXPECT_EQ(real_time_losses(record), 0);
}

const std::string kOne = "platform: one\nunits: {cpu: {slots: 1, active_w: 1}}\n";
const std::string kSliced = kOne + "workloads: {bundle_adjust: {cpu: 99}}\n";
const std::string kSlicedJob =
    "  job: {rate_hz: 1, real_time: false, tasks: [{workload: bundle_adjust}]}\n";

// By the analysis imu may wait for `cam` for 8 ms, and has 5. A slice of `job` takes 3 of them.
TEST(Budget, WhatCannotBeGuaranteedKeepsNoSliceFromItsUnit) {
  const RunRecord record =
      run_for(10, kSliced,
              "  imu: {rate_hz: 100, deadline_ms: 5, tasks: [{name: i, service_ms: {cpu: 1}}]}\n"
              "  cam: {rate_hz: 20, deadline_ms: 44, tasks: [{name: c, service_ms: {cpu: 8}}]}\n" +
                  kSlicedJob);
  EXPECT_EQ(record.pipelines[0].guaranteed, false);
  EXPECT_EQ(record.pipelines[1].guaranteed, true);
  EXPECT_GE(record.pipelines[2].completed, 9);
  EXPECT_EQ(real_time_losses(record), 0);
}

// imu may wait for `cam` for 8 ms anyway: a slice of `job` takes 3 of them. `log` has no room.
TEST(Budget, WhatMayWaitForARivalMayAsLongForASlice) {
  for (const int deadline_ms : {10, 5}) {
    const RunRecord record = run_for(
        10, kSliced,
        fmt::format("  imu: {{rate_hz: 100, deadline_ms: {}, tasks: [{{name: i, service_ms: {{cpu: "
                    "1}}}}]}}\n",
                    deadline_ms) +
            "  cam: {rate_hz: 20, deadline_ms: 44, tasks: [{name: c, service_ms: {cpu: 8}}]}\n" +
            kSlicedJob +
            "  log: {rate_hz: 1, real_time: false, tasks: [{name: o, service_ms: {cpu: 40}}]}\n");
    EXPECT_EQ(record.pipelines[0].guaranteed, deadline_ms == 10);
    EXPECT_EQ(record.pipelines[1].guaranteed, true) << deadline_ms;
    EXPECT_GE(record.pipelines[2].completed, 9) << deadline_ms;
    EXPECT_EQ(real_time_losses(record), 0) << deadline_ms;
  }
}

// Behind `job` of 0 ms, y is served from 10 on, and from 14.2 on behind x: it would end at 20 of
// 16.5. (By z neither is guaranteed.)
TEST(Foresight, WhatIsPutOffMeetsWhatIsMoreUrgentAndComesLater) {
  const std::string pipelines =
      "  x: {rate_hz: 10, offset_ms: 10.2, deadline_ms: 6, tasks: [{name: t, service_ms: {cpu: "
      "4}}]}\n"
      "  y: {rate_hz: 10, offset_ms: 1.5, deadline_ms: 15, tasks: [{name: t, service_ms: {cpu: "
      "6}}]}\n"
      "  z: {rate_hz: 1, offset_ms: 50, deadline_ms: 900, tasks: [{name: t, service_ms: {cpu: "
      "15}}]}\n"
      "  job: {rate_hz: 10, real_time: false, tasks: [{name: j, service_ms: {cpu: 10}}]}\n";
  const Platform platform = platform_of(kOne);
  const Mix mix = mix_of("mix: m\npipelines:\n" + pipelines);
  ScheduleOptions options;
  options.mode = "budget";
  const ModeSetup setup = set_up_mode(platform, nullptr, mix, options);
  Foresight foresight(setup.policy_setup.budget);
  EXPECT_TRUE(foresight.conflict(3, 0, Nanos(0)));
  const RunRecord record = run_for(5, kOne, pipelines);
  EXPECT_EQ(real_time_losses(record), 0);
  EXPECT_GE(record.pipelines[3].completed, 49);
}

// Beside `job`, b of 50 ms is served from 54 on, between c of 50 and of 60. Behind c of 90, it
// would end at 98 of 97 ms.
TEST(Foresight, WhatComesServesThePausesOfWhatIsMoreUrgent) {
  const RunRecord record =
      run_for(10, kSliced,
              "  c: {rate_hz: 100, deadline_ms: 6, tasks: [{name: t, service_ms: {cpu: 1}}]}\n"
              "  b: {rate_hz: 20, deadline_ms: 47, tasks: [{name: t, service_ms: {cpu: 4}}]}\n" +
                  kSlicedJob);
  EXPECT_GE(record.pipelines[2].completed, 9);
  EXPECT_EQ(real_time_losses(record), 0);
}

// Idle for 1 ms: b [1, 9), c [9, 10), a [10, 20). Behind a, b would end at 19 of 17.9 ms.
TEST(Foresight, WhatHasAPauseBeforeWhatIsMoreUrgentIsNotLateAnyway) {
  const RunRecord record = run_for(
      5, kOne,
      "  a: {rate_hz: 10, deadline_ms: 90, tasks: [{name: t, service_ms: {cpu: 10}}]}\n"
      "  b: {rate_hz: 10, offset_ms: 1, deadline_ms: 16.9, tasks: [{name: t, service_ms: {cpu: "
      "8}}]}\n"
      "  c: {rate_hz: 10, offset_ms: 9, deadline_ms: 8.8, tasks: [{name: t, service_ms: {cpu: "
      "1}}]}\n");
  EXPECT_EQ(real_time_losses(record), 0);
}

// `job` of 0 would end at 80 ms, and x of 50 at 85 of 60. It waits until 55.
TEST(Budget, ForeseesOnAUnitWithMoreServersThanSlots) {
  const RunRecord record = run_for(
      5, "platform: one\nunits: {cpu: {servers: 2, slots: 1, active_w: 1}}\n",
      "  x: {rate_hz: 10, offset_ms: 50, deadline_ms: 10, tasks: [{name: t, service_ms: {cpu: "
      "5}}]}\n"
      "  job: {rate_hz: 5, real_time: false, tasks: [{name: j, service_ms: {cpu: 80}}]}\n");
  EXPECT_EQ(deadline_misses(record), 0);
  EXPECT_GE(record.pipelines[1].completed, 24);
}

RunRecord run_closed(const std::string& platform, const std::string& mix) {
  ScheduleOptions options;
  options.mode = "budget";
  return run_virtual(platform_of(platform), nullptr, mix_of("mix: m\n" + mix), options);
}

// The cloud serves any number of frames. Of four image buffers `cam` needs one.
TEST(Budget, ALoopHasNoMoreFramesInFlightThanImageBuffersAreLeft) {
  const std::string platform =
      "platform: two\nunits: {cpu: {slots: 1, active_w: 1}, cloud: {role: cloud}}\n"
      "workloads: {alexnet: {cloud: [{delay_ms: 1000}]}}\n";
  const auto loop = [](int frames) {
    return fmt::format(
        "  loop: {{closed_loop: {{frames: {}}}, real_time: false, tasks: [{{workload: alexnet, "
        "image_input: true}}]}}\n",
        frames);
  };
  const RunRecord beside =
      run_closed(platform,
                 "image_buffers: 4\npipelines:\n"
                 "  cam: {rate_hz: 10, deadline_ms: 50, tasks: [{name: c, service_ms: {cpu: 10}, "
                 "image_input: true}]}\n" +
                     loop(100'000));
  EXPECT_EQ(beside.pipelines[0].dropped, 0);
  EXPECT_EQ(beside.in_flight, 3);
  const RunRecord alone = run_closed(platform, "image_buffers: 4\npipelines:\n" + loop(1000));
  EXPECT_EQ(alone.pipelines[0].completed, 1000);
  EXPECT_EQ(alone.in_flight, 4);
}

// A static plan begins with the longer b: a would end at 14 ms.
TEST(Budget, AMixThatFiresOnceMeetsItsDeadline) {
  const RunRecord record = run_closed(
      kOne,
      "pipelines:\n"
      "  a: {closed_loop: {frames: 1}, deadline_ms: 5, tasks: [{name: t, service_ms: {cpu: 4}}]}\n"
      "  b: {closed_loop: {frames: 1}, tasks: [{name: t, service_ms: {cpu: 10}}]}\n");
  EXPECT_EQ(deadline_misses(record), 0);
  EXPECT_EQ(record.planned_makespan_s, std::nullopt);
}

// A redrawn run follows what was planned for the run as it is.
TEST(Budget, WhatIsPlannedForAMixThatFiresOnceIsKept) {
  const Platform platform = platform_of(kOne);
  const Mix mix = mix_of(
      "mix: m\npipelines:\n"
      "  a: {closed_loop: {frames: 1}, deadline_ms: 5, tasks: [{name: t, service_ms: {cpu: 4}}]}\n"
      "  b: {closed_loop: {frames: 1}, tasks: [{name: t, service_ms: {cpu: 10}}]}\n");
  ScheduleOptions options;
  options.mode = "budget";
  std::optional<PlannedBudget> planned;
  ASSERT_FALSE(run_virtual(platform, nullptr, mix, options, &planned).tried.empty());
  ASSERT_TRUE(planned);
  planned->tried.front().name = "kept";
  const RunRecord again = run_virtual(platform, nullptr, mix, options, &planned);
  ASSERT_FALSE(again.tried.empty());
  EXPECT_EQ(again.tried.front().name, "kept");
  EXPECT_EQ(deadline_misses(again), 0);
}

TEST(Budget, ALargeGraphThatMissesItsDeadlineIsPlannedInLittleTime) {
  std::string tasks;
  for (int i = 0; i < 1000; ++i) tasks += fmt::format("{{name: t{}, service_ms: {{cpu: 1}}}}, ", i);
  const Platform platform = platform_of(kOne);
  const Mix mix =
      mix_of("mix: m\npipelines: {p: {closed_loop: {frames: 1}, deadline_ms: 1, tasks: [" + tasks +
             "]}}\n");
  ScheduleOptions options;
  options.mode = "budget";
  const std::clock_t begin = std::clock();
  const ModeSetup setup = set_up_mode(platform, nullptr, mix, options);
  EXPECT_EQ(plan_once(setup, options).plan.entries.size(), 1000U);
  EXPECT_LT(std::clock() - begin, 2 * CLOCKS_PER_SEC) << "of processor time";
}

// x first, on b, would be the 20 ms of edf; x on c, beside y, are 11.
TEST(Budget, AMixThatFiresOnceKeepsThePlanThatMeetsItsDeadline) {
  const RunRecord record = run_closed(
      kAbc,
      "pipelines: {p: {closed_loop: {frames: 1}, deadline_ms: 12, tasks: [{name: x, service_ms: "
      "{b: 10, c: 11}}, {name: y, service_ms: {b: 10, c: 30}}]}}\n");
  EXPECT_EQ(deadline_misses(record), 0);
  EXPECT_NEAR(record.planned_makespan_s.value_or(0), 0.011, 1e-9);
}

}  // namespace
}  // namespace pirt::test
