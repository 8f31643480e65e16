// Task graphs as mixes: own services and transfers, plans that run as planned, and the generator.
#include <algorithm>
#include <cmath>

#include "scheduler/mix/dag_generator.h"
#include "scheduler/planner/mix_plan.h"
#include "scheduler/services/eligibility.h"
#include "tests/scheduler/support.h"
#include "workloads/base/math/random.h"

namespace pirt::test {
namespace {

using std::chrono::milliseconds;
using testing::AllOf;
using testing::HasSubstr;

constexpr const char* kThreeUnits = R"(
platform: three
units:
  cpu: {servers: 1, discipline: fifo, active_w: 1}
  gpu: {servers: 1, discipline: fifo, active_w: 2}
  dsp: {servers: 1, discipline: fifo}
)";

RunRecord run(const std::string& mode, const Platform& platform, const Mix& mix) {
  ScheduleOptions options;
  options.mode = mode;
  return run_virtual(platform, nullptr, mix, options);
}

RunRecord run(const std::string& mode, const std::string& tasks,
              const std::string& platform = kThreeUnits,
              const std::string& fires = "closed_loop: {frames: 1}") {
  return run(mode, platform_of(platform),
             mix_of("mix: g\npipelines:\n  p:\n    " + fires + "\n    tasks:\n" + tasks));
}

/// The diamond of planner_test.cpp: HEFT plans 9 ms, CPOP 15 ms.
constexpr const char* kDiamond = R"(
      - {name: a, service_ms: {cpu: 2, gpu: 4}}
      - {name: b, service_ms: {cpu: 3, gpu: 5}, after: [{task: a, transfer_ms: 4}]}
      - {name: c, service_ms: {cpu: 6, gpu: 2}, after: [{task: a, transfer_ms: 1}]}
      - {name: d, service_ms: {cpu: 4, gpu: 2}, after: [{task: b, transfer_ms: 2}, {task: c, transfer_ms: 6}]}
)";

TEST(TaskGraph, RunsThePlanAsWorkedByHand) {
  const auto heft = run("heft", kDiamond);
  EXPECT_EQ(heft.planned_makespan_s, 0.009);
  EXPECT_EQ(heft.makespan_s, 0.009);
  // a and b on the CPU for 5 ms at 1 W, c and d on the GPU for 4 ms at 2 W.
  EXPECT_DOUBLE_EQ(heft.energy_j.value(), 0.013);
  EXPECT_EQ(run("cpop", kDiamond).makespan_s, 0.015);
  const std::vector<PlanRow> plan = {{"p", "a", "cpu", 0, 2},
                                     {"p", "b", "cpu", 2, 5},
                                     {"p", "c", "gpu", 3, 5},
                                     {"p", "d", "gpu", 7, 9}};
  EXPECT_EQ(heft.plan, plan);
  EXPECT_TRUE(run("ect", kDiamond).plan.empty()) << "decides as it goes";
}

TEST(TaskGraph, DelaysDataBetweenUnitsUnderAnyMode) {
  // MET: a, b on the CPU, c, d on the GPU. a 0-2, b 2-5, c from 2+1: 3-5, d from 5+2: 7-9.
  EXPECT_EQ(run("met", kDiamond).makespan_s, 0.009);
  // All on the CPU: nothing moves. 2 + 3 + 6 + 4.
  EXPECT_EQ(run("cpu-only", kDiamond).makespan_s, 0.015);
}

TEST(TaskGraph, MovesBytesOverTheLinksOfBothUnits) {
  // 1000 bytes at 8 Mbit/s are 1 ms, and 2 ms of latency. a 0-1 on the CPU; b on the GPU from 1+3:
  // 4-5; c on the CPU from 5+3: 8-9; d there, too, from 9: 9-10.
  const std::string platform = R"(
platform: linked
units:
  cpu: {servers: 1, discipline: fifo}
  gpu: {servers: 1, discipline: fifo, link: bus}
links: {bus: {mbit_s: 8, latency_ms: 2, active_w: 3}}
)";
  const std::string tasks = R"(
      - {name: a, service_ms: {cpu: 1}}
      - {name: b, service_ms: {gpu: 1}, after: [{task: a, bytes: 1000}]}
      - {name: c, service_ms: {cpu: 1}, after: [{task: b, bytes: 1000}]}
      - {name: d, service_ms: {cpu: 1}, after: [{task: c, bytes: 1000}]}
)";
  for (const char* mode : {"heft", "met"}) {
    const auto record = run(mode, tasks, platform);
    EXPECT_EQ(record.makespan_s, 0.010) << mode;
    // The link sends for 2 x 1 ms at 3 W; latency costs nothing.
    EXPECT_NEAR(record.energy_j.value(), 0.006, 1e-12) << mode;
  }
  EXPECT_EQ(run("heft", tasks, platform).planned_makespan_s, 0.010);
}

TEST(TaskGraph, FollowsTheInsertedOrderEvenIfAnotherTaskIsReady) {
  // x is planned into the GPU's gap 0-3 before b, which is ready at 1 and whose data comes at 6.
  const auto record = run("heft", R"(
      - {name: a, service_ms: {cpu: 1}}
      - {name: b, service_ms: {gpu: 4}, after: [{task: a, transfer_ms: 5}]}
      - {name: x, service_ms: {gpu: 3}}
)");
  EXPECT_EQ(record.makespan_s, 0.010);
}

TEST(TaskGraph, GoesThroughThePlanAgainAtEachFiring) {
  const auto closed = run("heft", kDiamond, kThreeUnits, "closed_loop: {frames: 50}");
  EXPECT_EQ(closed.completed, 200);
  EXPECT_FALSE(closed.planned_makespan_s);
  // The CPU works 5 ms a firing, so that 50 take 250 ms at least; one after the other they take
  // 450.
  EXPECT_GE(closed.makespan_s, 0.250);
  EXPECT_LE(closed.makespan_s, 0.450);
  const auto open = run("peft", kDiamond, kThreeUnits, "rate_hz: 50");
  EXPECT_EQ(open.completed, 60 * 50 * 4);
}

TEST(TaskGraph, PassesOverDroppedTasks) {
  // 1000 firings a second of what takes 9 ms: most expire, some between their tasks, and the plan
  // never waits for those.
  const auto record = run("heft", kDiamond, kThreeUnits, "rate_hz: 1000\n    expires_ms: 12");
  EXPECT_GT(record.expired, 0);
  EXPECT_GT(record.completed, 1000);
  EXPECT_EQ(record.stalled, 0);
}

TEST(TaskGraph, RunsRandomGraphsAsPlanned) {
  const Platform platform = platform_of(kThreeUnits);
  for (std::uint64_t seed = 0; seed < 100; ++seed) {
    DagParameters parameters;
    Random random(seed);
    parameters.seed = seed;
    parameters.tasks = 20 + static_cast<int>(random.below(81));
    parameters.ccr = random.uniform(0.1, 5);
    parameters.shape = random.uniform(0.5, 2);
    parameters.heterogeneity = random.uniform(0.1, 1.5);
    const Mix mix = mix_of(generate_dag(parameters));
    for (const char* mode : {"heft", "cpop", "peft", "etf", "shortest"}) {
      const auto record = run(mode, platform, mix);
      EXPECT_EQ(record.planned_makespan_s, record.makespan_s) << mode << ", seed " << seed;
      EXPECT_EQ(record.completed, parameters.tasks);
    }
  }
}

TEST(TaskGraph, TakesRolesForUnits) {
  const std::string platform = R"(
platform: renamed
units:
  little: {role: cpu, servers: 1, discipline: fifo}
  big: {role: cpu, servers: 1, discipline: fifo}
)";
  // `big` by its own name, `little` by its role.
  EXPECT_EQ(run("met", "      - {name: a, service_ms: {cpu: 5, big: 2}}\n", platform).makespan_s,
            0.002);
  EXPECT_EQ(run("met", "      - {name: a, service_ms: {cpu: 5, gpu: 2}}\n", platform).makespan_s,
            0.005);
}

TEST(TaskGraph, RefusesWhatCannotRun) {
  const auto refused = [](const std::string& task, const std::string& mode = "heft") {
    return bad_input([&] { run(mode, "      - " + task + "\n"); });
  };
  EXPECT_THAT(refused("{name: a, service_ms: {gpuu: 1}}"),
              AllOf(HasSubstr("test.yaml:6: pipelines.p.tasks[0].service_ms"), HasSubstr("'gpuu'"),
                    HasSubstr("did you mean gpu")));
  EXPECT_THAT(
      refused("{name: a, service_ms: {fpga: 1}}"),
      AllOf(HasSubstr("test.yaml:6"), HasSubstr("platform three"), HasSubstr("cpu, gpu, dsp")));
  for (const char* time : {"0", "-1", ".nan", ".inf", "fast", "1e-7"}) {
    EXPECT_THAT(refused("{name: a, service_ms: {cpu: " + std::string(time) + "}}"),
                HasSubstr("test.yaml:6: pipelines.p.tasks[0].service_ms.cpu"))
        << time;
  }
  EXPECT_THAT(refused("{name: a, service_ms: {}}"), HasSubstr("at least one unit"));
  EXPECT_THAT(refused("{service_ms: {cpu: 1}}"), HasSubstr("name"));
  EXPECT_THAT(refused("{name: a}"), HasSubstr("one of workload"));
  EXPECT_THAT(refused("{name: a, workload: fc8, service_ms: {cpu: 1}}"),
              HasSubstr("one of workload"));
  EXPECT_THAT(refused("{name: a, service_ms: {cpu: 1}, eligible: [gpu]}"),
              HasSubstr("leaves no unit"));
  EXPECT_THAT(refused("{name: a, service_ms: {cpu: 1}}\n      - {name: b, service_ms: {cpu: 1}, "
                      "after: [{task: a, transfer_ms: -1}]}"),
              HasSubstr("test.yaml:7"));
  EXPECT_THAT(refused("{name: a, service_ms: {cpu: 1}, after: [b]}\n"
                      "      - {name: b, service_ms: {cpu: 1}, after: [a]}"),
              HasSubstr("a -> b -> a"));
  EXPECT_THAT(refused("{name: a, service_ms: {gpu: 1}}", "cpu-only"),
              AllOf(HasSubstr("would never place it"), HasSubstr("gpu")));
}

TEST(TaskGraph, RefusesAModeWhoseRoleThePlatformLacks) {
  const std::string platform = "platform: p\nunits: {gpu: {servers: 1, discipline: fifo}}\n";
  EXPECT_THAT(
      bad_input([&] { run("cpu-only", "      - {name: a, service_ms: {gpu: 1}}\n", platform); }),
      AllOf(HasSubstr("cpu-only needs a unit of role cpu"), HasSubstr("gpu (gpu)")));
}

TEST(TaskGraph, RefusesWeightsForModesWithoutThem) {
  ScheduleOptions options;
  options.mode = "ect";
  options.weights = {{"cpu", 1}};
  EXPECT_THAT(bad_input([&] {
                static_cast<void>(run_virtual(load_platform("snapdragon820"), nullptr,
                                              load_mix("convolution-1000"), options));
              }),
              HasSubstr("mode ect has no weights"));
}

TEST(Qilin, EndsADivisibleWorkloadOnAllUnitsTogether) {
  // Rates 1/2, 1/3 and 1/6 a ms: 600 frames are 300, 200 and 100, all 600 ms.
  const auto record = run("qilin", "      - {name: f, service_ms: {cpu: 2, gpu: 3, dsp: 6}}\n",
                          kThreeUnits, "closed_loop: {frames: 600}");
  EXPECT_EQ(record.units[0].completed, 300);
  EXPECT_EQ(record.units[1].completed, 200);
  EXPECT_EQ(record.units[2].completed, 100);
  // All would end at 600 ms; few are in flight, so that the last ones may come a frame later.
  EXPECT_GE(record.makespan_s, 0.6);
  EXPECT_LE(record.makespan_s, 0.606);
}

TEST(Schedule, RunsEveryModeOnTheRobotsMix) {
  for (const auto& info : policies()) {
    const auto record =
        run(std::string(info.name), load_platform("snapdragon820"), load_mix("convolution-1000"));
    EXPECT_EQ(record.completed, 1000) << info.name;
  }
}

TEST(DagGenerator, GivesTheSameBytesForTheSameSeedOnly) {
  DagParameters parameters;
  const auto first = generate_dag(parameters);
  EXPECT_EQ(first, generate_dag(parameters));
  parameters.seed = 2;
  EXPECT_NE(first, generate_dag(parameters));
}

TEST(DagGenerator, KeepsItsParameters) {
  DagParameters parameters;
  parameters.tasks = 2000;
  parameters.ccr = 2;
  parameters.heterogeneity = 0.4;
  parameters.mean_ms = 5;
  const Mix mix = mix_of(generate_dag(parameters));
  const auto& tasks = mix.pipelines.at(0).tasks;
  ASSERT_EQ(tasks.size(), 2000U);
  double service = 0, transfer = 0;
  std::size_t edges = 0;
  std::vector<int> degree(tasks.size(), 0);
  std::vector<int> level(tasks.size(), 1);
  for (std::size_t t = 0; t < tasks.size(); ++t) {
    std::vector<double> times;
    for (const auto& [unit, time] : tasks[t].service) times.push_back(to_ms(time));
    ASSERT_EQ(times.size(), 3U);
    const auto [low, high] = std::ranges::minmax(times);
    EXPECT_LE(high / low, 1.2 / 0.8 + 1e-3);  // 1 -+ 0.4 / 2
    service += (times[0] + times[1] + times[2]) / 3;
    for (std::size_t i = 0; i < tasks[t].after.size(); ++i, ++edges) {
      transfer += to_ms(tasks[t].edges[i].transfer);
      ++degree[tasks[t].after[i]];
      level[t] = std::max(level[t], level[tasks[t].after[i]] + 1);
    }
  }
  // Means of thousands of uniform draws: standard errors are about 1.3 % and 0.9 %; five of them.
  EXPECT_NEAR(service / 2000, 5, 5 * 0.065);
  EXPECT_NEAR(transfer / static_cast<double>(edges), 10, 5 * 0.1);
  EXPECT_EQ(std::ranges::max(level), std::llround(std::sqrt(2000)));
  const auto above = std::ranges::count_if(degree, [](int count) { return count > 3; });
  EXPECT_LT(above, 100);  // Where a level is too narrow for the next.
}

TEST(DagGenerator, MakesOneLevelOrAChainOfExtremeShapes) {
  DagParameters parameters;
  parameters.tasks = 9;
  parameters.shape = 100;
  const auto level = mix_of(generate_dag(parameters)).pipelines[0].tasks;
  EXPECT_EQ(level.size(), 9U);
  for (const auto& task : level) {
    EXPECT_TRUE(task.after.empty());
  }
  parameters.shape = 0.01;
  const auto chain = mix_of(generate_dag(parameters)).pipelines[0].tasks;
  for (std::size_t t = 1; t < chain.size(); ++t) {
    EXPECT_NE(std::ranges::find(chain[t].after, t - 1), chain[t].after.end());
  }
  parameters.tasks = 1;
  EXPECT_EQ(mix_of(generate_dag(parameters)).pipelines[0].tasks.size(), 1U);
}

TEST(DagGenerator, NamesTheParameterThatIsOutOfRange) {
  const auto refused = [](auto change) {
    DagParameters parameters;
    change(parameters);
    return bad_input([&] { static_cast<void>(generate_dag(parameters)); });
  };
  EXPECT_THAT(refused([](auto& p) { p.tasks = 0; }), HasSubstr("--tasks is 0"));
  EXPECT_THAT(refused([](auto& p) { p.shape = 0; }), HasSubstr("--shape is 0"));
  EXPECT_THAT(refused([](auto& p) { p.shape = NAN; }), HasSubstr("--shape is nan"));
  EXPECT_THAT(refused([](auto& p) { p.out_degree = 0; }), HasSubstr("--out-degree"));
  EXPECT_THAT(refused([](auto& p) { p.ccr = -0.1; }), HasSubstr("--ccr"));
  EXPECT_THAT(refused([](auto& p) { p.ccr = INFINITY; }), HasSubstr("--ccr"));
  EXPECT_THAT(refused([](auto& p) { p.heterogeneity = 2.1; }), HasSubstr("--heterogeneity"));
  EXPECT_THAT(refused([](auto& p) { p.mean_ms = 0; }), HasSubstr("--mean-ms"));
  EXPECT_THAT(refused([](auto& p) { p.units = {}; }), HasSubstr("--units"));
  EXPECT_THAT(refused([](auto& p) { p.units = {"cpu", "cpu"}; }), HasSubstr("named twice"));
  EXPECT_THAT(refused([](auto& p) { p.units = {"a: b"}; }), HasSubstr("no name of a unit"));
}

}  // namespace
}  // namespace pirt::test
