// Results have intervals: what a run says of itself where what its calls take is not known exactly.
#include "scheduler/services/redraw.h"

#include <cmath>

#include "characterize/statistics/statistics.h"
#include "scheduler/record/interval.h"
#include "tests/scheduler/profile_rows.h"
#include "tests/scheduler/virtual/virtual_support.h"
#include "workloads/base/math/gaussian.h"

namespace pirt::test {
namespace {

using testing::Contains;
using testing::IsEmpty;
using testing::Key;

constexpr const char* kTwoMeasured = R"(
platform: board
units:
  cpu: {backend: fake, slots: 1, active_w: 2, idle_w: 0.5}
  gpu: {backend: fake, slots: 1, active_w: 4, idle_w: 0.5}
)";
constexpr const char* kThreePipelines = R"(
mix: three
pipelines:
  a: {rate_hz: 20, deadline_ms: 40, tasks: [{workload: fc8}]}
  b: {rate_hz: 10, deadline_ms: 80, tasks: [{workload: pool1}]}
  c: {rate_hz: 5, tasks: [{workload: sobel}]}
)";
const std::vector<std::string> kWorkloads = {"fc8", "pool1", "sobel"};

PhaseRow row(const std::string& workload, const std::string& unit, double ms) {
  PhaseRow row = row_of(workload, unit, Phase::kCall, from_ms(ms));
  row.mean.reset();
  return row;
}

/// What calls take, by workload and unit.
double true_ms(std::size_t workload, bool gpu) {
  const double cpu[] = {12, 20, 35};
  const double gpu_ms[] = {9, 28, 20};
  return gpu ? gpu_ms[workload] : cpu[workload];
}

Profile true_profile() {
  std::vector<PhaseRow> rows;
  for (std::size_t w = 0; w < kWorkloads.size(); ++w) {
    for (const bool gpu : {false, true}) {
      rows.push_back(row(kWorkloads[w], gpu ? "gpu" : "cpu", true_ms(w, gpu)));
    }
  }
  return profile_of(std::move(rows));
}

/// What so many processes, each @p sigma off by its own, say of it.
Profile measured_profile(std::uint64_t seed, int processes, double sigma) {
  Gaussian random(seed);
  Profile profile = true_profile();
  for (PhaseRow& each : profile.phases) {
    std::vector<Nanos> medians;
    for (int i = 0; i < processes; ++i) {
      medians.push_back(scaled(*each.median, std::exp(sigma * random.next())));
    }
    each.median = each.p95 = each.p99 = median(medians);
    const auto interval = interval_over_processes(medians);
    if (interval) {
      each.ci_low = interval->low;
      each.ci_high = interval->high;
    }
    each.samples = each.processes = processes;
  }
  return profile;
}

ScheduleOptions short_mode(const std::string& name) { return mode(name, 4); }

TEST(Redraw, AnIntervalHoldsWhatTheTrueProfileGives) {
  const Platform platform = platform_of(kTwoMeasured);
  const Mix mix = mix_of(kThreePipelines);
  const Profile exact = true_profile();
  const RunFigures truth = figures_of(run_virtual(platform, &exact, mix, short_mode("ect")));
  constexpr int kTrials = 40;
  for (const int processes : {4, 7, 10}) {
    std::map<std::string, int> held;
    for (int trial = 0; trial < kTrials; ++trial) {
      const Profile found = measured_profile(
          derive_seed(static_cast<std::uint64_t>(processes), std::to_string(trial)), processes,
          0.15);
      const auto run = run_with_intervals(platform, &found, mix, short_mode("ect"));
      for (const auto& [name, interval] : run.intervals) {
        if (!truth.contains(name)) continue;
        const double rounding = 1e-9 * std::abs(truth.at(name));
        held[name] +=
            truth.at(name) >= interval.low - rounding && truth.at(name) <= interval.high + rounding
                ? 1
                : 0;
      }
    }
    for (const char* name : {"energy_j", "p99_of_deadline", "pipelines.c.p99_ms"}) {
      EXPECT_GE(held[name], 0.9 * kTrials) << name << " from " << processes << " processes";
    }
  }
}

TEST(Redraw, WhatIsExactHasNoInterval) {
  const Profile exact = true_profile();
  const auto run = run_with_intervals(platform_of(kTwoMeasured), &exact, mix_of(kThreePipelines),
                                      mode("ect", 4));
  EXPECT_THAT(run.intervals, IsEmpty());
  EXPECT_THAT(run.redrawn, IsEmpty());
}

TEST(Redraw, DrawsTheSameForAllModes) {
  const Platform platform = platform_of(kTwoMeasured);
  const Profile found = measured_profile(3, 5, 0.1);
  const auto a = run_with_intervals(platform, &found, mix_of(kThreePipelines), mode("ect", 4));
  const auto b = run_with_intervals(platform, &found, mix_of(kThreePipelines), mode("ect", 4));
  EXPECT_EQ(a.redrawn.size(), static_cast<std::size_t>(kRedraws));
  EXPECT_EQ(a, b);
  EXPECT_TRUE(cannot_tell(a, b, "energy_j")) << "each difference is 0";
  const auto slower =
      run_with_intervals(platform, &found, mix_of(kThreePipelines), mode("cpu-only", 4));
  EXPECT_THAT(slower.intervals, Contains(Key("pipelines.a.p99_ms")));
}

TEST(Redraw, OneFactorAUnitMoreWhereOthersTookItsCores) {
  ServiceTable table;
  table.workloads = {"a", "b"};
  const Platform platform = platform_of(kTwoMeasured);
  for (int workload = 0; workload < 2; ++workload) {
    auto& entries = table.entries.emplace_back(2);
    for (ServiceEntry& entry : entries) {
      entry.service.emplace();
      entry.service->of_rows = true;
      entry.service->stages.push_back(
          {.name = "call", .on = 0, .time = Distribution::constant(from_ms(1))});
    }
    entries[0].service->spread = {0.5, 1.2};
    entries[0].service->taken = 0.4;
  }
  EXPECT_TRUE(is_uncertain(table));
  double both_longer = 0;
  constexpr int kDraws = 400;
  for (int i = 0; i < kDraws; ++i) {
    ServiceTable drawn = table;
    redraw(platform, {.number = i}, drawn);
    const auto longer = [&](WorkloadId w) { return drawn.find(w, 0)->total() > from_ms(1); };
    both_longer += longer(0) == longer(1) ? 1 : 0;
    EXPECT_EQ(drawn.find(0, 1)->total(), from_ms(1)) << "what is exact stays";
  }
  EXPECT_GT(both_longer / kDraws, 0.55) << "they share a factor";
}

// 10 and 10.5 mJ, each known to 2 mJ: which unit draws less cannot be told.
TEST(Redraw, JoulesThatAMeterShowedHaveTheirInterval) {
  Profile profile = true_profile();
  for (const std::string& workload : kWorkloads) {
    for (const auto& [unit, energy_j] : {std::pair("cpu", 0.010), {"gpu", 0.0105}}) {
      EnergyRow& energy = profile.energies.emplace_back();
      energy.workload = workload;
      energy.unit = unit;
      energy.energy_j = energy_j;
      energy.ci_low_j = energy_j - 0.002;
      energy.ci_high_j = energy_j + 0.002;
      energy.provenance = Provenance::kMeasured;
    }
  }
  const auto without = [&](const std::string& unit) {
    ScheduleOptions options = mode("ect", 4);
    options.without = {unit};
    return run_with_intervals(platform_of(kTwoMeasured), &profile, mix_of(kThreePipelines),
                              options);
  };
  const auto cpu = without("gpu");
  const auto gpu = without("cpu");
  ASSERT_THAT(cpu.intervals, Contains(Key("energy_j")));
  EXPECT_LT(cpu.intervals.at("energy_j").low, cpu.energy_j.value());
  EXPECT_GT(cpu.intervals.at("energy_j").high, cpu.energy_j.value());
  EXPECT_TRUE(cannot_tell(cpu, gpu, "energy_j"));
  const FigureInterval tail = cpu.intervals.at("p99_of_deadline");
  EXPECT_EQ(tail.low, tail.high) << "times are exact";
}

TEST(Redraw, LongRunsAreShortened) {
  const Profile found = measured_profile(5, 5, 0.1);
  ScheduleOptions options = mode("ect", 60);
  options.duration = std::chrono::hours(2);  // 252,000 tasks
  const auto run =
      run_with_intervals(platform_of(kTwoMeasured), &found, mix_of(kThreePipelines), options);
  ASSERT_THAT(run.intervals, Contains(Key("energy_j")));
  EXPECT_LT(run.intervals.at("energy_j").low, run.energy_j.value());
  EXPECT_GT(run.intervals.at("energy_j").high, run.energy_j.value());
}

}  // namespace
}  // namespace pirt::test
