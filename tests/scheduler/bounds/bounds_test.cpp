// The bounds: known values, and that no mode ever beats them.
#include "scheduler/bounds/bounds.h"

#include <fmt/format.h>

#include <random>

#include "scheduler/bounds/linear_program.h"
#include "tests/scheduler/support.h"
#include "workloads/base/math/random.h"

namespace pirt::test {
namespace {

TEST(LinearProgram, FindsTheMinimum) {
  // Most of 3x + 2y with x + y <= 4, x + 3y <= 6, x <= 3: at (3, 1), 11.
  LinearProgram program;
  const int x = program.add_variable(-3, 3);
  const int y = program.add_variable(-2);
  program.add_row({{x, 1}, {y, 1}}, -LinearProgram::kUnlimited, 4);
  program.add_row({{x, 1}, {y, 3}}, -LinearProgram::kUnlimited, 6);
  EXPECT_NEAR(*program.minimum(), -11, 1e-9);
}

TEST(LinearProgram, GivesTwelveDigits) {
  LinearProgram program;
  const int x = program.add_variable(1);
  program.add_row({{x, 3}}, 2, LinearProgram::kUnlimited);
  const auto solution = program.solve();
  ASSERT_TRUE(solution.has_value());
  EXPECT_EQ(solution->minimum, 0.666666666667);
  EXPECT_EQ(solution->values.at(0), 0.666666666667);
}

TEST(LinearProgram, HasNoneIfRowsContradictOrNothingLimits) {
  LinearProgram contradiction;
  contradiction.add_row({{contradiction.add_variable(1), 1}}, -5, -1);
  EXPECT_FALSE(contradiction.minimum().has_value());
  LinearProgram unlimited;
  unlimited.add_variable(-1);
  EXPECT_FALSE(unlimited.minimum().has_value());
}

/// The platform of the paper's Table V: a frame of convolution on CPU (4 cores), GPU and DSP.
Work snapdragon(double dsp_ms) {
  Work work;
  work.units = {{4, 4}, {1, 4}, {1, 1}};
  TaskWork frame;
  frame.units = {
      {.unit = 0, .server_ms = {6.84, 0, 0}, .total_ms = 6.84, .energy_j = 0.847 * 6.84e-3},
      {.unit = 1,
       .server_ms = {3.80, 2.605, 0},
       .total_ms = 7.105,
       .energy_j = 0.847 * 3.80e-3 + 0.207 * 2.605e-3},
      {.unit = 2, .server_ms = {0, 0, dsp_ms}, .total_ms = dsp_ms, .energy_j = 0.084 * 18.61e-3}};
  work.pipelines = {{{frame}, std::nullopt}};
  return work;
}

TEST(Bounds, ThroughputOfTheFittedSnapdragon) {
  // GPU kernels: 1 / 2.605 = .3839 a ms, whose host part takes 1.4587 of 4 cores; the others do (4
  // - 1.4587) / 6.84 = .3715; the DSP 1 / 18.61 = .0537, or .0518 with the contention of 1.037:
  // .809 or .807 in all.
  EXPECT_NEAR(*most_tasks_per_ms(snapdragon(18.61)), 0.80914, 1e-5);
  EXPECT_NEAR(*most_tasks_per_ms(snapdragon(18.61 * 1.037)), 0.80722, 1e-5);
}

TEST(Bounds, EnergyOfTheFittedSnapdragonAtThePapersRates) {
  const auto at = [](double frames_per_ms) {
    return *least_energy_j(snapdragon(18.61 * 1.037), {1000}, 1000 / frames_per_ms);
  };
  EXPECT_NEAR(at(0.745), 4.45, 0.01);
  EXPECT_NEAR(at(0.467), 3.66, 0.02);
  EXPECT_NEAR(at(0.307), 3.40, 0.02);
}

TEST(Bounds, EnergyThatDoesNotFitIsAbsent) {
  EXPECT_FALSE(least_energy_j(snapdragon(18.61), {1000}, 100).has_value());
}

TEST(Bounds, AreaIsTheInverseOfTheThroughput) {
  EXPECT_NEAR(*area_ms(snapdragon(18.61), {1000}), 1000 / 0.809142, 0.01);
}

TEST(Bounds, OfALongGraphComeQuickly) {
  // 10,000 tasks in a chain, 1 ms on either of two units: the shares that fill both. A search for
  // the variables of each task would not end in sensible time.
  constexpr std::size_t kTasks = 10'000;
  Work work;
  work.units.resize(2);
  work.pipelines.resize(1);
  const auto on = [](UnitId unit, double energy_j) {
    UnitWork each{.unit = unit, .server_ms = {0, 0}, .total_ms = 1, .energy_j = energy_j};
    each.server_ms[unit] = 1;
    return each;
  };
  for (std::size_t t = 0; t < kTasks; ++t) {
    auto& task = work.pipelines[0].tasks.emplace_back();
    task.units = {on(0, 0.001), on(1, 0.002)};
    if (t > 0) task.after = {t - 1};
  }
  EXPECT_NEAR(most_tasks_per_ms(work).value(), 2.0, 1e-6);
  EXPECT_NEAR(area_ms(work, {1.0}).value(), kTasks / 2.0, 1e-3);
  // Within three quarters of the time that one unit takes, it does as many tasks of the cheaper
  // kind.
  EXPECT_NEAR(least_energy_j(work, {1.0}, 0.75 * kTasks).value(),
              0.75 * kTasks * 0.001 + 0.25 * kTasks * 0.002, 1e-6);
}

// Tasks that ask for the same are taken together. Where each asks for a billionth more than
// another, none are: the bounds of both are the same.
TEST(Bounds, AreThoseOfTheTasksOneByOne) {
  for (std::uint64_t seed = 1; seed <= 200; ++seed) {
    SCOPED_TRACE(seed);
    Random random(seed);
    Work work;
    work.units = {{1, std::nullopt}, {2, 3}};
    std::vector<std::vector<UnitWork>> kinds(2);
    for (auto& units : kinds) {
      for (UnitId unit = 0; unit < 2; ++unit) {
        const double ms = random.uniform(0.5, 5);
        units.push_back({.unit = unit, .server_ms = {0, 0}, .total_ms = ms, .energy_j = ms * 1e-3});
        units.back().server_ms[unit] = ms;
      }
    }
    for (int p = 0; p < 2; ++p) {
      PipelineWork& pipeline = work.pipelines.emplace_back();
      if (random.uniform() < 0.5) pipeline.per_ms = random.uniform(0.01, 0.3);
      for (std::size_t t = 0; t < 12; ++t) {
        TaskWork& task = pipeline.tasks.emplace_back();
        task.units = kinds[random.below(2)];
        if (t > 0 && random.uniform() < 0.8) task.after.push_back(random.below(t));
        if (t > 0 && random.uniform() < 0.2) task.after.push_back(t - 1);
      }
    }
    Work apart = work;
    double more = 1;
    for (auto& pipeline : apart.pipelines) {
      for (auto& task : pipeline.tasks) {
        for (UnitWork& each : task.units) each.total_ms *= more += 1e-9;
      }
    }
    const auto expect_near = [](std::optional<double> a, std::optional<double> b) {
      ASSERT_EQ(a.has_value(), b.has_value());
      if (!a) return;
      EXPECT_NEAR(*a, *b, 1e-6 * std::abs(*b));
    };
    expect_near(most_tasks_per_ms(work), most_tasks_per_ms(apart));
    expect_near(area_ms(work, {3, 5}), area_ms(apart, {3, 5}));
    expect_near(least_energy_j(work, {3, 5}, 300), least_energy_j(apart, {3, 5}, 300));
  }
}

TEST(Bounds, CriticalPathTakesTheFastestUnitsAlongTheLongestChain) {
  const auto task = [](double a, double b, std::vector<std::size_t> after) {
    return TaskWork{{{0, {a, 0}, a, 0}, {1, {0, b}, b, 0}}, std::move(after)};
  };
  // 1 (on unit 1), then 2 or 5 side by side, then 3: 1 + 5 + 3.
  const PipelineWork diamond{{task(4, 1, {}), task(2, 9, {0}), task(7, 5, {0}), task(3, 3, {1, 2})},
                             std::nullopt};
  EXPECT_DOUBLE_EQ(critical_path_ms(diamond), 9);
}

/// A platform and a mix of two workloads, open or closed, from a seed.
class RandomRuns : public testing::TestWithParam<int> {
 protected:
  double draw(double low, double high) {
    return std::uniform_real_distribution(low, high)(engine_);
  }
  bool coin() { return draw(0, 1) < 0.5; }

  std::string stages(const std::string& unit) {
    if (unit == "cpu" || coin())
      return fmt::format("[{{on: {}, ms: {:.3f}}}]", unit, draw(0.5, 20));
    return fmt::format("[{{on: cpu, ms: {:.3f}}}, {{delay_ms: {:.3f}}}, {{on: {}, ms: {:.3f}}}]",
                       draw(0.1, 4), draw(0, 2), unit, draw(0.5, 10));
  }

  Platform platform() {
    std::string yaml = "platform: random\nunits:\n";
    for (const auto* unit : {"cpu", "gpu", "dsp"}) {
      yaml +=
          fmt::format("  {}: {{servers: {}, discipline: {}, active_w: {:.3f}, idle_w: {:.3f}{}}}\n",
                      unit, coin() ? 1 : 3, coin() ? "fifo" : "processor_sharing", draw(0, 5),
                      draw(0, 1), coin() ? ", slots: 2" : "");
    }
    yaml += "workloads:\n";
    for (const auto* workload : {"convolution", "sobel"}) {
      yaml += fmt::format("  {}: {{cpu: {}, gpu: {}, dsp: {}}}\n", workload, stages("cpu"),
                          stages("gpu"), stages("dsp"));
    }
    return platform_of(yaml);
  }

  Mix mix() {
    const std::string tasks =
        "    tasks: [{name: a, workload: sobel}, {name: b, workload: convolution, after: [a]}]\n";
    std::string yaml = "mix: random\npipelines:\n";
    yaml += coin() ? fmt::format("  p:\n    rate_hz: {:.3f}\n", draw(1, 200)) + tasks
                   : fmt::format("  p:\n    closed_loop: {{frames: {}}}\n",
                                 draw(1, 200) < 20 ? 1 : 150) +
                         tasks;
    if (coin()) yaml += fmt::format("  q:\n    rate_hz: {:.3f}\n", draw(1, 100)) + tasks;
    return mix_of(yaml);
  }

  std::mt19937_64 engine_{static_cast<std::uint64_t>(GetParam())};
};

TEST_P(RandomRuns, NoModeBeatsTheBounds) {
  const auto on = platform();
  const auto what = mix();
  int ran = 0;
  for (const auto& policy : policies()) {
    ScheduleOptions options;
    options.mode = policy.name;
    if (what.open_loop()) options.duration = from_s(2);
    const auto run = run_virtual(on, nullptr, what, options);
    ASSERT_TRUE(run.bounds.has_value());
    const auto& bounds = *run.bounds;
    constexpr double kRoom = 1e-6;  // what the solver may be off by
    EXPECT_LE(*run.throughput_per_ms, *bounds.throughput_per_ms * (1 + kRoom)) << policy.name;
    ASSERT_TRUE(bounds.energy_j.has_value()) << policy.name;
    EXPECT_GE(run.energy_j.value(), *bounds.energy_j * (1 - kRoom)) << policy.name;
    if (bounds.makespan_s) {
      EXPECT_GE(run.makespan_s, *bounds.makespan_s * (1 - kRoom)) << policy.name;
    }
    for (const auto& pipeline : run.pipelines) {
      constexpr double kHistogram = 1e-3;
      if (pipeline.p50_ms) {
        EXPECT_GE(*pipeline.p50_ms,
                  bounds.critical_path_ms.at(pipeline.pipeline) * (1 - kHistogram))
            << policy.name;
      }
    }
    ++ran;
  }
  EXPECT_GE(ran, 10);
}

INSTANTIATE_TEST_SUITE_P(Bounds, RandomRuns, testing::Range(1, 41));

}  // namespace
}  // namespace pirt::test
