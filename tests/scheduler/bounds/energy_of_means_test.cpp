// Joules of a schedule on measured services: calls add up, so that the mean of their times counts,
// whatever the times are drawn from.
#include <fmt/format.h>

#include <cmath>
#include <random>

#include "characterize/statistics/statistics.h"
#include "tests/scheduler/support.h"

namespace pirt::test {
namespace {

/// A row whose samples are skewed as those of machines are: most are short, some are long.
PhaseRow skewed_row(const std::string& workload, const std::string& unit, Phase phase, double ms,
                    std::mt19937_64& engine) {
  std::lognormal_distribution<double> times(std::log(ms), 0.8);
  PhaseRow row;
  row.platform = "board";
  row.workload = workload;
  row.unit = unit;
  row.backend = "fake";
  row.phase = phase;
  for (int i = 0; i < 101; ++i) row.values.push_back(from_ms(times(engine)));
  row.value_processes.assign(row.values.size(), 0);
  row.median = median(row.values);
  row.p95 = percentile(row.values, 95);
  row.mean = mean(row.values, row.value_processes);
  return row;
}

Profile skewed_profile(std::uint64_t seed) {
  std::mt19937_64 engine(seed);
  Profile profile;
  profile.path = "p.db";
  profile.runs.emplace_back().platform = "board";
  for (const std::string workload : {"sobel", "fc8"}) {
    profile.phases.push_back(skewed_row(workload, "cpu", Phase::kCall, 4, engine));
    profile.phases.push_back(skewed_row(workload, "gpu", Phase::kUpload, 1, engine));
    profile.phases.push_back(skewed_row(workload, "gpu", Phase::kExecute, 2, engine));
  }
  return profile;
}

Platform board() {
  return platform_of(R"(
platform: board
units:
  cpu: {backend: fake, servers: 2, active_w: 4}
  gpu: {backend: fake, active_w: 2, slots: 2}
)");
}

Mix frames(int count) {
  return mix_of(fmt::format(R"(
mix: frames
pipelines:
  p:
    closed_loop: {{frames: {}}}
    tasks: [{{name: a, workload: sobel}}, {{name: b, workload: fc8, after: [a]}}]
)",
                            count));
}

RunRecord run(const Profile& profile, const Mix& mix, const std::string& mode, Draw draw) {
  ScheduleOptions options;
  options.mode = mode;
  options.draw = draw;
  return run_virtual(board(), &profile, mix, options);
}

TEST(EnergyOfMeans, OfNCallsIsNTimesThatOfTheMean) {
  const Profile profile = skewed_profile(1);
  double expected_j = 0;
  for (const std::string workload : {"sobel", "fc8"}) {
    expected_j += 4 * to_s(*profile.find(workload, "cpu", Phase::kCall)->mean);
  }
  ASSERT_GT(*profile.find("sobel", "cpu", Phase::kCall)->mean,
            1.1 * *profile.find("sobel", "cpu", Phase::kCall)->median);
  for (const Draw draw : {Draw::kMedian, Draw::kP95}) {
    const auto record = run(profile, frames(50), "cpu-only", draw);
    EXPECT_NEAR(record.energy_j.value(), 50 * expected_j, 1e-6) << to_string(draw);
  }
  // Of what is drawn, as near as 2000 draws come.
  const auto drawn = run(profile, frames(2000), "cpu-only", Draw::kSamples);
  EXPECT_NEAR(drawn.energy_j.value() / (2000 * expected_j), 1, 0.08);
}

TEST(EnergyOfMeans, NoModeBeatsTheBound) {
  for (std::uint64_t seed = 1; seed <= 10; ++seed) {
    const Profile profile = skewed_profile(seed);
    for (const Draw draw : {Draw::kMedian, Draw::kP95, Draw::kSamples}) {
      for (const auto& policy : policies()) {
        const auto record = run(profile, frames(60), std::string(policy.name), draw);
        ASSERT_TRUE(record.bounds && record.bounds->energy_j) << policy.name;
        EXPECT_GE(record.energy_j.value(), *record.bounds->energy_j * (1 - 1e-6))
            << policy.name << " " << to_string(draw) << " " << seed;
      }
    }
  }
}

}  // namespace
}  // namespace pirt::test
