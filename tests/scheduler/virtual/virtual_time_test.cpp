// Whole runs in virtual time, small enough to be worked by hand.
#include "scheduler/virtual/virtual_time.h"

#include "scheduler/record/summary.h"
#include "scheduler/services/scenario.h"
#include "tests/scheduler/virtual/virtual_support.h"
#include "workloads/base/math/random.h"
#include "workloads/base/text/json.h"

namespace pirt::test {
namespace {

using testing::HasSubstr;

TEST(VirtualTime, ExpiresTasksThatDoNotStartInTime) {
  // 100 Hz for 50 ms, 30 ms each, to be started within 25 ms: 0 runs [0, 30); 1 (fired 10) would
  // start at 30, in time; 2 (fired 20) at 60, expires at 45.
  const auto record = run(platform_of(kOneModelled), mix_of(R"(
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
  ScheduleOptions options = mode("throughput", 0, 3);
  options.weights = {{"gpu", 2}, {"cpu", 1}};
  const auto record = run(platform, closed(3, "convolution"), options);
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
    const auto mix = closed(1'000'000);
    EXPECT_THAT(bad_input([&] { static_cast<void>(run(platform, mix, mode("olb", 0, 1000))); }),
                HasSubstr("20 years"));
  }
}

TEST(VirtualTime, ScaledStagesTakeLongerAndCostTheSame) {
  auto platform = platform_of(kOneModelled);
  platform.modes["throughput"].stage_scale = {{"cpu.execute", 1.5}};
  platform.units[0].idle_w = 0;
  const auto record = run(platform, closed(2), mode("throughput"));
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

// A driver with a clock slept past the end: what was due before has been fired.
TEST(VirtualTime, CountsWhatWasDueBeforeTheEndHoweverLate) {
  const auto platform = platform_of(R"(
platform: p
units: {cpu: {slots: 1, active_w: 1}, shared: {servers: 1, discipline: processor_sharing, active_w: 1}}
workloads: {sobel: {cpu: [{on: cpu, ms: 1}], shared: [{on: shared, ms: 1}]}}
)");
  const auto mix = mix_of(R"(
mix: m
pipelines: {p: {rate_hz: 100, tasks: [{workload: sobel}]}}
)");
  const auto driver = [](const Scenario& scenario, Dispatcher& dispatcher, TraceWriter*) {
    VirtualTime time(scenario, dispatcher);
    time.begin();
    while (time.next() < from_s(0.9)) static_cast<void>(time.advance(time.next()));
    while (time.next() <= from_s(1.2)) static_cast<void>(time.advance(from_s(1.2)));
    while (time.advance()) continue;
    return time.finish();
  };
  const auto record = run_mix(platform, nullptr, mix, mode("ect", 1), driver, "virtual");
  EXPECT_EQ(record.submitted, 100);
  EXPECT_EQ(record.completed, 90) << "nothing that began after the end";
  EXPECT_EQ(record.queued, 10) << "begun or not";
  EXPECT_NEAR(unit(record, "cpu").busy_s + unit(record, "shared").busy_s, 0.09, 1e-9);
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

TEST(VirtualTime, SaysWhichTasksNothingIsEverGoingToStart) {
  // A policy that takes two tasks and then refuses for ever.
  class TakesTwo final : public Policy {
   public:
    Placement place(const TaskClass&, const UnitsView&) override {
      return taken_++ < 2 ? Placement::on(0) : Placement::hold();
    }
    UnitMask takers(const TaskClass& task, UnitMask) const override { return task.eligible; }

   private:
    int taken_ = 0;
  };
  const auto platform = platform_of(kOneModelled);
  const auto mix = closed(5);
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

/// Calls end when the test says so.
class Handed final : public Executor {
 public:
  void start(JobIndex job, UnitId /*unit*/, bool /*let_in*/) override { jobs.push_back(job); }
  void resume(JobIndex /*job*/, UnitId /*unit*/) override {}
  void recall(JobIndex /*job*/, UnitId /*unit*/) override {}

  std::vector<JobIndex> jobs;
};

// Two tasks from 0 on, of which the unit computes one after the other: it is busy for 1 s by then,
// at 10 W. Of 2 s, and a joule, the first call has had half, or has ended at 0.9, so that the
// second has had 0.1.
TEST(VirtualTime, ATaskThatWaitsForItsUnitsCallIsNotBusyWhenTheRunEnds) {
  const auto platform = platform_of(R"(
platform: one
units: {cpu: {slots: 2, active_w: 10, energy: {call_j: 1}}}
workloads: {fc8: {cpu: [{on: cpu, ms: 2000}]}}
)");
  for (const bool ends : {false, true}) {
    const auto driver = [ends](const Scenario& scenario, Dispatcher& dispatcher, TraceWriter*) {
      Handed executor;
      VirtualTime time(scenario, dispatcher, {}, &executor, unit_bit(0));
      time.begin();
      while (time.next() == Nanos::zero()) time.advance();
      EXPECT_EQ(executor.jobs.size(), 2U);
      if (ends) time.finished(executor.jobs.at(0), {.busy = from_s(0.9)}, from_s(0.9));
      time.stop(from_s(1));
      return time.finish();
    };
    const RunRecord record =
        run_mix(platform, nullptr, closed(2), mode("met", 0, 2), driver, "virtual");
    EXPECT_NEAR(unit(record, "cpu").busy_s, 1, 1e-9);
    EXPECT_NEAR(record.energy_j.value(), 10 + (ends ? 1 + 0.1 / 2 : 1.0 / 2), 1e-9);
  }
}

TEST(VirtualTime, AnImageOnTheJetsonTakesWhatTableFourPrints) {
  const Mix mix = closed(10, "alexnet");
  for (const auto& [name, ms, joules] :
       {std::tuple("cpu-only", 400.0, 0.8), std::tuple("throughput", 33.0, 0.132)}) {
    ScheduleOptions options = mode(name, 0, 1);
    if (name == std::string("throughput")) options.weights = {{"gpu", 1}};
    const RunRecord record = run(load_platform("jetson-tx1"), mix, options);
    EXPECT_NEAR(record.makespan_s, 10 * ms / 1e3, 1e-9) << name;
    EXPECT_NEAR(record.energy_j.value(), 10 * joules, 1e-9) << name;
  }
}

}  // namespace
}  // namespace pirt::test
