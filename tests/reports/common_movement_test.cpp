// What many rows move by together: which rows follow the machine, how far, and what that hides.
#include "reports/gate/common_movement.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "characterize/statistics/statistics.h"
#include "reports/gate/between_runs.h"
#include "reports/gate/table_gate.h"

namespace pirt::test {
namespace {

using testing::HasSubstr;

/// Twelve processes of 20 samples each. Their medians lie up to @p spread above and below @p us,
/// and the second half of each one's samples is @p wander above or below its first.
PhaseRow row_of(const std::string& workload, const std::string& unit, double us, double wander,
                double spread = 0.01) {
  PhaseRow row;
  row.workload = workload;
  row.unit = unit;
  row.phase = Phase::kExecute;
  for (int p = 0; p < 12; ++p) {
    const double middle = us * (1 + spread * (p - 5.5) / 5.5);
    for (int i = 0; i < 20; ++i) {
      const double half = (i < 10) == (p % 2 == 0) ? -wander / 2 : wander / 2;
      row.values.push_back(from_ms(middle * std::exp(half) / 1e3 * (1 + 1e-5 * i)));
      row.value_processes.push_back(p);
    }
  }
  row.median = median(row.values);
  row.samples = std::ssize(row.values);
  return row;
}

/// Eight rows that stay as they are while a process runs, and seven that wander by up to 4 % more.
struct Board {
  double factor = 0;   ///< What the machine moves rows by, over their excess.
  double changed = 1;  ///< The program changes "loose3" by this.
  std::string unit = "cpu";

  static constexpr double kSteady = 0.002;
  static double excess(int loose) { return 0.01 + 0.005 * loose; }

  [[nodiscard]] std::vector<PhaseRow> rows() const {
    std::vector<PhaseRow> rows;
    for (int i = 0; i < 8; ++i) {
      rows.push_back(row_of("steady" + std::to_string(i), unit, 1000 + 100 * i, kSteady));
    }
    for (int i = 0; i < 7; ++i) {
      const double moved = std::exp(factor * excess(i)) * (i == 3 ? changed : 1);
      rows.push_back(row_of("loose" + std::to_string(i), unit, 2000 * moved, kSteady + excess(i)));
    }
    return rows;
  }
};

Profile profile_of(std::vector<PhaseRow> rows) {
  Profile profile;
  RunInfo run;
  run.platform = "board";
  run.units = {{"cpu", "opencv", "host", true, {}},
               {"opencl", "opencl", "host", true, {}},
               {"gpu", "opencl", "card", false, {}}};
  profile.runs = {run};
  profile.phases = std::move(rows);
  return profile;
}

/// Both profiles, and what they moved by.
struct Compared {
  Compared(std::vector<PhaseRow> a, std::vector<PhaseRow> b)
      : base(profile_of(std::move(a))),
        candidate(profile_of(std::move(b))),
        diff(diff_profiles(base, candidate)),
        movement(base, pointers(), GateThresholds{}.workloads) {}

  [[nodiscard]] CommonMovement::Pairs pointers() const {
    CommonMovement::Pairs pairs;
    for (const auto& pair : diff.phases) pairs.push_back(&pair);
    return pairs;
  }
  [[nodiscard]] ExpectedMovement expected(const std::string& workload,
                                          const std::string& unit = "cpu") const {
    for (const auto& pair : diff.phases) {
      if (pair.a->workload == workload && pair.a->unit == unit) return movement.expected(pair);
    }
    ADD_FAILURE() << "no row of " << workload << " on " << unit;
    return {};
  }
  [[nodiscard]] GateVerdict verdict(const std::string& workload) const {
    const GateResult result = judge(diff);
    return std::ranges::find(result.rows, workload, &GateRow::workload)->verdict;
  }

  Profile base, candidate;
  ProfileDiff diff;
  CommonMovement movement;
};

std::vector<PhaseRow> both(std::vector<PhaseRow> a, const std::vector<PhaseRow>& b) {
  a.insert(a.end(), b.begin(), b.end());
  return a;
}

TEST(Wander, IsWhatProcessesMoveByWhileTheyRun) {
  EXPECT_NEAR(*wander_of(row_of("w", "cpu", 1000, 0.03, 0)), 0.03, 1e-3);
  EXPECT_NEAR(*wander_of(row_of("w", "cpu", 1000, 0.03, 0.2)), 0.03, 1e-3)
      << "processes that differ do not wander";
  PhaseRow single = row_of("w", "cpu", 1000, 0.03);
  for (std::size_t i = 0; i < single.values.size(); ++i) {
    single.value_processes[i] = static_cast<std::int32_t>(i / 7);
  }
  EXPECT_FALSE(wander_of(single)) << "seven samples a process say nothing";
  EXPECT_FALSE(wander_of(PhaseRow{}));
}

TEST(CommonMovement, MovesRowsInProportionToWhatTheyWander) {
  const Compared compared(Board{}.rows(), Board{.factor = 4}.rows());
  EXPECT_NEAR(compared.expected("steady0").shift, 0, 1e-3);
  for (const int loose : {0, 3, 6}) {
    const auto expected = compared.expected("loose" + std::to_string(loose));
    EXPECT_NEAR(expected.shift, 4 * Board::excess(loose), 2e-3);
    EXPECT_GT(expected.sd, compared.expected("steady0").sd) << "what moves more is less certain";
    EXPECT_LT(expected.sd, expected.shift);
    EXPECT_EQ(expected.drift, Drift::kOfOneRow);
  }
  EXPECT_EQ(compared.verdict("loose6"), GateVerdict::kSame) << "16 % slower, as are its like";
}

TEST(CommonMovement, IsCertainWhereNothingMoved) {
  const Compared compared(Board{}.rows(), Board{}.rows());
  for (const int loose : {0, 3, 6}) {
    const auto expected = compared.expected("loose" + std::to_string(loose));
    EXPECT_EQ(expected.shift, 0);
    EXPECT_EQ(expected.sd, 0);
    EXPECT_EQ(expected.drift, Drift::kOfOneRow) << "of which nothing is left";
  }
}

TEST(CommonMovement, FindsTheProgramThatChangedAmongRowsThatMoved) {
  const Compared compared(Board{}.rows(), Board{.factor = 4, .changed = 1.25}.rows());
  EXPECT_NEAR(compared.expected("loose3").shift, 4 * Board::excess(3), 2e-3)
      << "its own rows have no say";
  EXPECT_EQ(compared.verdict("loose3"), GateVerdict::kSlower);
  EXPECT_EQ(compared.verdict("loose2"), GateVerdict::kSame);
  const Compared back(Board{.factor = 4}.rows(), Board{.changed = 1.25}.rows());
  EXPECT_EQ(back.verdict("loose3"), GateVerdict::kSlower) << "hidden by a machine that got better";
}

TEST(CommonMovement, DoesNotMoveARowWhoseProcessesDifferWithoutWandering) {
  auto a = Board{}.rows();
  auto b = Board{.factor = 4}.rows();
  a.push_back(row_of("layout", "cpu", 500, Board::kSteady, 0.2));
  b.push_back(row_of("layout", "cpu", 500, Board::kSteady, 0.2));
  EXPECT_NEAR(Compared(a, b).expected("layout").shift, 0, 1e-3);
}

TEST(CommonMovement, IsBoundedByWhatMachinesDo) {
  // What wanders 1 to 4 % in excess moved by 40 times that: no hour of a machine does it.
  const Compared compared(Board{}.rows(), Board{.factor = 40}.rows());
  EXPECT_NEAR(compared.expected("loose0").shift, 10 * Board::excess(0), 2e-3);
  EXPECT_EQ(compared.verdict("loose0"), GateVerdict::kSlower);
}

TEST(CommonMovement, IsSharedByUnitsOfOneMemory) {
  // Two workloads of another unit that wander tell nothing by themselves.
  const auto few = [](const std::string& unit, double factor) {
    std::vector<PhaseRow> rows = Board{.unit = unit}.rows();
    rows.resize(8);
    for (int i = 0; i < 2; ++i) {
      rows.push_back(row_of("loose" + std::to_string(i), unit,
                            500 * std::exp(factor * Board::excess(i)),
                            Board::kSteady + Board::excess(i)));
    }
    return rows;
  };
  const Compared host(both(Board{}.rows(), few("opencl", 0)),
                      both(Board{.factor = 4}.rows(), few("opencl", 4)));
  EXPECT_NEAR(host.expected("loose1", "opencl").shift, 4 * Board::excess(1), 2e-3);
  const Compared card(both(Board{}.rows(), few("gpu", 0)),
                      both(Board{.factor = 4}.rows(), few("gpu", 0)));
  EXPECT_NEAR(card.expected("loose1", "gpu").shift, 0, 1e-3) << "a memory of its own";
  EXPECT_EQ(card.expected("loose1", "gpu").drift, Drift::kWhole);
  EXPECT_NEAR(card.expected("loose1").shift, 4 * Board::excess(1), 2e-3);
}

TEST(CommonMovement, NeedsEnoughWorkloads) {
  const auto six = [](const Board& board) {
    const auto rows = board.rows();
    return std::vector<PhaseRow>(rows.begin() + 5, rows.begin() + 11);
  };
  const auto expected = Compared(six({}), six({.factor = 4})).expected("loose2");
  EXPECT_EQ(expected.sd, 0) << "five others";
  EXPECT_EQ(expected.drift, Drift::kWhole);
}

TEST(CommonMovement, IsARowOfItsOwnWhereItIsLarge) {
  const Compared compared(
      both(Board{}.rows(), Board{.unit = "opencl"}.rows()),
      both(Board{.factor = 6}.rows(), Board{.factor = 6, .unit = "opencl"}.rows()));
  const GateResult result = judge(compared.diff);
  const auto all = std::ranges::find(result.rows, "unsteady", &GateRow::phase);
  ASSERT_NE(all, result.rows.end());
  EXPECT_EQ(all->workload, "all");
  EXPECT_EQ(all->unit, "cpu+opencl");
  EXPECT_EQ(all->verdict, GateVerdict::kInconclusive);
  EXPECT_THAT(all->reason, HasSubstr("--baseline-program"));
  EXPECT_NEAR(*all->ratio, std::exp(6 * Board::excess(4)), 0.03);
  EXPECT_EQ(result.count(GateVerdict::kSlower), 0);

  const GateResult small = judge(Compared(Board{}.rows(), Board{.factor = 2}.rows()).diff);
  EXPECT_EQ(std::ranges::find(small.rows, "unsteady", &GateRow::phase), small.rows.end());
}

}  // namespace
}  // namespace pirt::test
