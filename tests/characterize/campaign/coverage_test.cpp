// How often the interval over processes holds the true median, by simulation: few processes, each
// with its own level and noise within, skewed and disturbed ones included.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <numbers>

#include "characterize/campaign/cell.h"
#include "characterize/statistics/statistics.h"
#include "workloads/base/math/random.h"

namespace pirt {
namespace {

constexpr int kRuns = 20'000;
/// Three standard errors of a share of 95 % in kRuns runs.
constexpr double kThreeSigma = 0.0047;

using Draw = std::function<double(Random&)>;

double normal(Random& random) {
  const double radius = std::sqrt(-2 * std::log(1 - random.uniform()));
  return radius * std::cos(2 * std::numbers::pi * random.uniform());
}

/// What process medians look like: relative deviations from 1 ms, in units of 1 %.
struct Shape {
  std::string name;
  Draw draw;
};

std::vector<Shape> shapes() {
  return {{"normal", normal},
          {"skewed", [](Random& r) { return std::exp(0.5 * normal(r)); }},
          {"exponential", [](Random& r) { return -std::log(1 - r.uniform()); }},
          // One process in eight runs beside something else and is up to 20 % slower.
          {"disturbed",
           [](Random& r) {
             const double own = normal(r);
             return r.below(8) == 0 ? own + 20 * r.uniform() : own;
           }},
          // Two layouts, one in three processes gets the slow one.
          {"two layouts", [](Random& r) { return 0.3 * normal(r) + (r.below(3) == 0 ? 3 : 0); }}};
}

Nanos time_of(double deviation) { return Nanos(std::llround(1e6 * (1 + 0.01 * deviation))); }

Nanos true_median(const Draw& draw) {
  Random random(derive_seed(7, "true median"));
  std::vector<Nanos> many;
  for (int i = 0; i < 400'000; ++i) many.push_back(time_of(draw(random)));
  return median(many);
}

struct Found {
  double coverage = 0;
  double half_width = 0;  ///< Mean, relative.
};

Found simulate(const Draw& draw, Nanos truth, int processes) {
  Random random(derive_seed(1, "coverage"));
  int held = 0;
  double width = 0;
  std::vector<Nanos> medians(static_cast<std::size_t>(processes));
  for (int run = 0; run < kRuns; ++run) {
    for (Nanos& t : medians) t = time_of(draw(random));
    const auto interval = interval_over_processes(medians).value();
    held += interval.low <= truth && truth <= interval.high ? 1 : 0;
    width += relative_half_width(interval, truth).value();
  }
  return {static_cast<double>(held) / kRuns, width / kRuns};
}

// Nominally 97 %, which leaves 95 where a cell ends as soon as it is precise (below); from 8 on
// what looks like dependence by chance widens, less with 25.
TEST(IntervalOverProcesses, CoversTheMedianWithSixProcessesOrMoreWhateverTheirDistribution) {
  for (const Shape& shape : shapes()) {
    const Nanos truth = true_median(shape.draw);
    for (const int processes : {6, 8, 10, 15, 25}) {
      const Found found = simulate(shape.draw, truth, processes);
      EXPECT_GE(found.coverage, 0.96 - kThreeSigma) << shape.name << " " << processes;
      EXPECT_LE(found.coverage, 0.99) << shape.name << " " << processes;
    }
  }
}

/// Share of the intervals of @p processes medians that hold the true one, where each follows the
/// one before with correlation @p r (autoregressive, stationary).
double coverage_with_drift(double r, int processes) {
  Random random(derive_seed(1, "drift"));
  int held = 0;
  std::vector<Nanos> medians(static_cast<std::size_t>(processes));
  for (int run = 0; run < kRuns; ++run) {
    double state = normal(random);
    for (Nanos& t : medians) {
      t = time_of(state);
      state = r * state + std::sqrt(1 - r * r) * normal(random);
    }
    const auto interval = interval_over_processes(medians).value();
    held += interval.low <= time_of(0) && time_of(0) <= interval.high ? 1 : 0;
  }
  return static_cast<double>(held) / kRuns;
}

// Medians of processes in a row had r = 0.26 in ten runs on a quiet machine. Observed: 93.7 to 94.9
// %, and 89.3 % (10 processes) to 93.9 % (50) with r = 0.5. Without the factor of dependence these
// would be 0.89 to 0.90 and, with r = 0.5, 0.79 to 0.80.
TEST(IntervalOverProcesses, CoversTheMedianOfAMachineThatDrifts) {
  for (const int processes : {10, 15, 25, 50}) {
    EXPECT_GE(coverage_with_drift(0.26, processes), 0.935 - kThreeSigma) << processes;
    EXPECT_GE(coverage_with_drift(0.5, processes), 0.89 - kThreeSigma) << processes;
  }
}

TEST(DependenceFactor, IsOneForFewAndForThoseThatAlternate) {
  EXPECT_EQ(dependence_factor({}), 1);
  EXPECT_EQ(dependence_factor(std::vector<Nanos>(20, Nanos(5))), 1);
  std::vector<Nanos> rising;
  for (int i = 0; i < 7; ++i) rising.emplace_back(i);
  EXPECT_EQ(dependence_factor(rising), 1);
  std::vector<Nanos> alternating;
  for (int i = 0; i < 20; ++i) alternating.emplace_back(i % 2);
  EXPECT_EQ(dependence_factor(alternating), 1);
}

TEST(DependenceFactor, IsTwoAtMost) {
  std::vector<Nanos> rising;
  for (int i = 0; i < 30; ++i) rising.emplace_back(i);
  EXPECT_DOUBLE_EQ(dependence_factor(rising), 2);
}

// Ranks 0 0 1 1 0 0 1 1 .. around 0.5: of 24, 12 neighbours are alike (+1/4) and 11 not (-1/4), so
// the autocorrelation is (12 - 11) / 24 = 1/24, and r = (1 + 1) / 20 = 0.1.
TEST(DependenceFactor, FollowsFromTheAutocorrelationOfRanks) {
  std::vector<Nanos> pairs;
  for (int i = 0; i < 24; ++i) pairs.emplace_back(i / 2 % 2 == 0 ? 7 : 900);
  EXPECT_NEAR(dependence_factor(pairs), std::sqrt(1.1 / 0.9), 1e-12);
}

// Of n processes all are above the median in 1 of 2^n cases, and no interval begins below the
// fastest: at most 1 - 1/8, 1 - 1/16 and 1 - 1/32 are left, less what Student's t, which supposes
// normal process medians, misses above.
TEST(IntervalOverProcesses, CoversTheMedianLessOftenWithThreeToFiveProcesses) {
  for (const Shape& shape : shapes()) {
    const Nanos truth = true_median(shape.draw);
    for (const auto& [processes, least] : {std::pair{3, 0.83}, {4, 0.87}, {5, 0.90}}) {
      EXPECT_GE(simulate(shape.draw, truth, processes).coverage, least - kThreeSigma)
          << shape.name << " " << processes;
    }
  }
}

/// What a cell does: looks at the interval after each process from kFewestForPrecision on, or from
/// @p needed if these are more, and ends as soon as it is narrow enough, which favours intervals
/// that happen to be narrow, or with the most processes.
double coverage_of_cells(const Shape& shape, int needed, double precision) {
  constexpr int kFewerRuns = 4'000;
  const Nanos truth = true_median(shape.draw);
  Random random(derive_seed(1, "stopping"));
  int held = 0;
  for (int run = 0; run < kFewerRuns; ++run) {
    std::vector<Nanos> medians;
    std::optional<Interval> interval;
    while (static_cast<int>(medians.size()) < kMostProcesses) {
      medians.push_back(time_of(shape.draw(random)));
      if (static_cast<int>(medians.size()) < std::max(needed, kFewestForPrecision)) continue;
      interval = interval_over_processes(medians);
      if (relative_half_width(interval, median(medians)).value() <= precision) break;
    }
    held += interval->low <= truth && truth <= interval->high ? 1 : 0;
  }
  return static_cast<double>(held) / kFewerRuns;
}

// 4 and 10 processes are needed (--quick and not); what processes differ by is 1 %, so that 2 % are
// reached at once, 1 % soon and 0.5 % after many looks. Observed: 95.7 % (normal, 0.5 %) to 98.2 %.
// Ending from 4 processes on, at 95 %, as cells did once, would cover 89.2 to 94.8 %.
TEST(IntervalOverProcesses, HoldsWhatItSaysWhereACellEndsAsSoonAsItIsPrecise) {
  constexpr double kThreeSigmaOfCells = 0.0103;  // of 4,000 runs
  for (const Shape& shape : shapes()) {
    for (const int needed : {4, 10}) {
      for (const double precision : {0.005, 0.01, 0.02}) {
        EXPECT_GE(coverage_of_cells(shape, needed, precision), 0.95 - kThreeSigmaOfCells)
            << shape.name << " " << needed << " " << precision;
      }
    }
  }
}

// Why the interval is over processes: of 10 processes with 50 samples each, noise within as large
// as between, the interval of the 500 samples holds the median in well under 95 % of the runs.
TEST(IntervalOverProcesses, IsWiderThanThatOfTheSamplesWhichCoversTooLittle) {
  constexpr int kFewRuns = 2'000;
  Random random(derive_seed(1, "pooled"));
  int pooled_held = 0;
  int held = 0;
  for (int run = 0; run < kFewRuns; ++run) {
    std::vector<Nanos> samples;
    std::vector<int> processes;
    for (int process = 0; process < 10; ++process) {
      const double level = normal(random);
      for (int i = 0; i < 50; ++i) {
        samples.push_back(time_of(level + normal(random)));
        processes.push_back(process);
      }
    }
    const Nanos truth = time_of(0);
    const auto pooled = median_interval(samples).value();
    const auto over = summarize(samples, processes).interval.value();
    pooled_held += pooled.low <= truth && truth <= pooled.high ? 1 : 0;
    held += over.low <= truth && truth <= over.high ? 1 : 0;
  }
  EXPECT_LT(pooled_held, 0.6 * kFewRuns);
  EXPECT_GT(held, 0.93 * kFewRuns);
}

}  // namespace
}  // namespace pirt
