// Offloading time and crossovers, with numbers worked by hand.
#include "reports/profile/setup_report.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "workloads/base/text/json.h"

namespace pirt {
namespace {

using ::testing::Contains;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

CallCosts cost(double first_call_ms, double call_ms) {
  return {from_ms(first_call_ms), from_ms(call_ms)};
}

PhaseRow row(const std::string& unit, Phase phase, State state, double ms) {
  PhaseRow row;
  row.platform = "board";
  row.workload = "sobel";
  row.unit = unit;
  row.phase = phase;
  row.state = state;
  row.median = from_ms(ms);
  return row;
}

/// Device 2 and prepare 4 on cpu, of which a call is 3; on gpu 100 and 51 cold or 100 and 11 warm,
/// a call 1 = upload 0.25 + execute 0.5 + download 0.25.
Profile two_units() {
  Profile profile;
  profile.runs.emplace_back().platform = "board";
  for (const State state : {State::kCold, State::kWarm}) {
    profile.phases.push_back(row("cpu", Phase::kDeviceInit, state, 2));
    profile.phases.push_back(row("cpu", Phase::kPrepare, state, 4));
    profile.phases.push_back(row("gpu", Phase::kDeviceInit, state, 100));
  }
  profile.phases.push_back(row("gpu", Phase::kPrepare, State::kCold, 51));
  profile.phases.push_back(row("gpu", Phase::kPrepare, State::kWarm, 11));
  profile.phases.push_back(row("cpu", Phase::kCall, State::kSteady, 3));
  profile.phases.push_back(row("cpu", Phase::kExecute, State::kSteady, 3));
  profile.phases.push_back(row("gpu", Phase::kCall, State::kSteady, 1));
  profile.phases.push_back(row("gpu", Phase::kUpload, State::kSteady, 0.25));
  profile.phases.push_back(row("gpu", Phase::kExecute, State::kSteady, 0.5));
  profile.phases.push_back(row("gpu", Phase::kDownload, State::kSteady, 0.25));
  return profile;
}

TEST(CrossoverOf, CountsCallsUntilTheSetUpIsPaidBack) {
  // 10 + 3(n-1) against 30 + 1(n-1): 20 < 2(n-1) from n-1 = 11, n = 12; with n = 11 both take 40.
  const auto a = cost(10, 3);
  const auto b = cost(30, 1);
  EXPECT_EQ(crossover(a, b), (Crossover{Crossover::Kind::kFrom, 12}));
  EXPECT_EQ(a.total(11), b.total(11));
  EXPECT_LT(b.total(12), a.total(12));
  // The other way round a is ahead up to n = 10 (37 against 39).
  EXPECT_EQ(crossover(b, a), (Crossover{Crossover::Kind::kUpTo, 10}));
  EXPECT_LT(a.total(10), b.total(10));
}

TEST(CrossoverOf, TakesTheNextWholeCall) {
  // 21 < 2(n-1) from n-1 = 11 on too: 11 is above 10.5.
  EXPECT_EQ(crossover(cost(10, 3), cost(31, 1)), (Crossover{Crossover::Kind::kFrom, 12}));
  EXPECT_EQ(crossover(cost(31, 1), cost(10, 3)), (Crossover{Crossover::Kind::kUpTo, 11}));
  // Equal at the first call, faster from the second on; slower from the second on.
  EXPECT_EQ(crossover(cost(10, 3), cost(10, 1)), (Crossover{Crossover::Kind::kFrom, 2}));
  EXPECT_EQ(crossover(cost(11, 1), cost(10, 3)), (Crossover{Crossover::Kind::kUpTo, 1}));
}

TEST(CrossoverOf, IsNeverOrFromTheFirstWhereOneUnitIsBetterInBoth) {
  EXPECT_EQ(crossover(cost(10, 1), cost(30, 3)).kind, Crossover::Kind::kNever);
  EXPECT_EQ(crossover(cost(30, 3), cost(10, 1)).kind, Crossover::Kind::kFromFirst);
  EXPECT_EQ(crossover(cost(10, 1), cost(10, 1)).kind, Crossover::Kind::kNever);
  EXPECT_EQ(crossover(cost(10, 1), cost(12, 1)).kind, Crossover::Kind::kNever);
  EXPECT_EQ(crossover(cost(12, 1), cost(10, 1)).kind, Crossover::Kind::kFromFirst);
}

TEST(CrossoverOf, AgreesWithCountingCallByCall) {
  for (const int first : {5, 8, 13}) {
    for (const int call : {1, 2, 3, 5}) {
      const auto a = cost(9, 2);
      const auto b = cost(first, call);
      const Crossover found = crossover(a, b);
      for (std::int64_t n = 1; n <= 40; ++n) {
        const bool said = found.kind == Crossover::Kind::kFromFirst ||
                          (found.kind == Crossover::Kind::kFrom && n >= found.calls) ||
                          (found.kind == Crossover::Kind::kUpTo && n <= found.calls);
        EXPECT_EQ(said, b.total(n) < a.total(n)) << first << " " << call << " " << n;
      }
    }
  }
}

TEST(Offloading, SplitsTheFirstCallIntoItsPhases) {
  const auto costs = offloading_costs(two_units());
  ASSERT_EQ(costs.costs.size(), 4U);
  EXPECT_TRUE(costs.missing.empty());
  const auto& gpu = *costs.find("sobel", "gpu", State::kCold);
  EXPECT_EQ(gpu.set_up(), from_ms(150));  // 100 + 51 - 1
  EXPECT_EQ(gpu.calls().total(1), from_ms(151));
  EXPECT_EQ(gpu.calls().total(10), from_ms(160));
  EXPECT_EQ(gpu.launch, std::nullopt);
  const auto table = offloading_table(costs);
  EXPECT_THAT(table.rows.at(2), ElementsAre("sobel", "gpu", "cold", "100", "50.0", "0.250", "-",
                                            "0.500", "0.250", "151", "99.3%", "1.00"));
  EXPECT_THAT(table.rows.at(1), ElementsAre("sobel", "cpu", "warm", "2.00", "1.00", "-", "-",
                                            "3.00", "-", "6.00", "50.0%", "3.00"));
}

TEST(Offloading, AFigureOfADoubtedRowIsMarked) {
  auto profile = two_units();
  for (auto& r : profile.phases) {
    if (r.unit == "gpu" && r.phase == Phase::kPrepare) r.doubts = {"contended"};
  }
  const auto chart = offloading_chart(offloading_costs(profile));
  EXPECT_EQ(chart.table.rows.at(0)[3], "2.00");
  EXPECT_EQ(chart.table.rows.at(2)[3], "100?");
  EXPECT_EQ(chart.marks.at(2).doubt, "?");
}

TEST(Offloading, ShowsTheCrossoverColdAndWarm) {
  const auto costs = offloading_costs(two_units());
  // Cold: 6 + 3(n-1) against 151 + (n-1): 145 < 2(n-1) from 73, n = 74. Warm: 111 - 6 = 105:
  // 53, 54.
  const auto table = crossover_table(costs);
  ASSERT_EQ(table.rows.size(), 1U);
  EXPECT_THAT(table.rows[0],
              ElementsAre("sobel", "cpu", "gpu", "from 74 calls", "from 54 calls", "yes"));
  const auto json = setup_json(costs);
  EXPECT_EQ(json_text(json["crossovers"][0]["cold"]), R"({"wins":"from","calls":74})");
  EXPECT_EQ(json["crossovers"][0]["warm"]["calls"], 54);
  EXPECT_DOUBLE_EQ(json["offloading"][2]["first_call_ms"].get<double>(), 151);
  EXPECT_FALSE(json["offloading"][0].contains("upload_ms"));
}

/// Every row's interval: its median +/- @p percent.
Profile with_intervals(Profile profile, double percent) {
  for (auto& row : profile.phases) {
    row.ci_low = from_ms(to_ms(*row.median) * (1 - percent / 100));
    row.ci_high = from_ms(to_ms(*row.median) * (1 + percent / 100));
  }
  return profile;
}

TEST(Offloading, SaysBetweenWhichNumbersACrossoverLies) {
  const auto costs = offloading_costs(with_intervals(two_units(), 10));
  // Cold: 6.6 + 3.3(n-1) against 135.9 + 0.9(n-1): 129.3 < 2.4(n-1) from 54, n = 55; and
  // 5.4 + 2.7(n-1) against 166.1 + 1.1(n-1): 160.7 < 1.6(n-1) from 101, n = 102.
  const auto range = crossover_range(*costs.find("sobel", "cpu", State::kCold),
                                     *costs.find("sobel", "gpu", State::kCold));
  ASSERT_TRUE(range.has_value());
  EXPECT_EQ(range->soonest, (Crossover{Crossover::Kind::kFrom, 55}));
  EXPECT_EQ(range->latest, (Crossover{Crossover::Kind::kFrom, 102}));
  const auto row = crossover_table(costs).rows.at(0);
  EXPECT_EQ(row[3], "from 74 calls (55 to 102)");
  EXPECT_EQ(row[5], "yes");
  const auto json = setup_json(costs);
  EXPECT_EQ(json["crossovers"][0]["cold"]["soonest"]["calls"], 55);
  EXPECT_EQ(json["crossovers"][0]["cold"]["latest"]["calls"], 102);
}

TEST(Offloading, ACrossoverThatIntervalsDoNotShowMayNeverCome) {
  // 3 ms and 1 ms, each +/- 60 %: 1.2 to 4.8 and 0.4 to 1.6 overlap.
  const auto row = crossover_table(offloading_costs(with_intervals(two_units(), 60))).rows.at(0);
  EXPECT_THAT(row[3], ::testing::StartsWith("from 74 calls (from "));
  EXPECT_THAT(row[3], ::testing::EndsWith(" calls, or never)"));
  EXPECT_EQ(row[5], "equal");
}

TEST(Offloading, ACrossoverThatMediansDoNotHaveMayCome) {
  auto profile = two_units();
  for (auto& row : profile.phases) {
    if (row.phase == Phase::kCall) row.median = from_ms(3);  // the same on both
  }
  const auto row = crossover_table(offloading_costs(with_intervals(profile, 10))).rows.at(0);
  EXPECT_THAT(row[3], ::testing::MatchesRegex("never \\(or from [0-9]+ calls\\)"));
}

TEST(Offloading, TheTrueCrossoverLiesWithinItsRange) {
  const auto costs = offloading_costs(with_intervals(two_units(), 20));
  const auto& a = *costs.find("sobel", "cpu", State::kWarm);
  const auto& b = *costs.find("sobel", "gpu", State::kWarm);
  const auto range = crossover_range(a, b).value();
  // Corners and middles of both units' boxes; all of them cross, since the calls' intervals are
  // apart.
  const auto between = [](Nanos low, Nanos high, int step) {
    return low + (high - low) * step / 2;
  };
  for (int corner = 0; corner < 81; ++corner) {
    const CallCosts x{between(a.least->first, a.most->first, corner % 3),
                      between(a.least->further, a.most->further, corner / 3 % 3)};
    const CallCosts y{between(b.least->first, b.most->first, corner / 9 % 3),
                      between(b.least->further, b.most->further, corner / 27)};
    const auto found = crossover(x, y);
    ASSERT_EQ(found.kind, Crossover::Kind::kFrom);
    EXPECT_GE(found.calls, range.soonest.calls);
    EXPECT_LE(found.calls, range.latest.calls);
  }
}

TEST(Offloading, LeavesOutWhatIsNotValidAndSaysWhy) {
  auto profile = two_units();
  for (auto& r : profile.phases) {
    if (r.unit == "gpu" && r.phase == Phase::kPrepare && r.state == State::kCold) {
      r.reasons = {"few_samples"};
    }
  }
  const auto costs = offloading_costs(profile);
  EXPECT_EQ(costs.find("sobel", "gpu", State::kCold), nullptr);
  ASSERT_EQ(costs.missing.size(), 1U);
  EXPECT_EQ(costs.missing[0].reason, "prepare is not valid: few_samples");
  EXPECT_THAT(crossover_table(costs).rows.at(0),
              ElementsAre("sobel", "cpu", "gpu", "-", "from 54 calls", "yes"));
  EXPECT_THAT(offloading_table(costs).footnotes,
              Contains(HasSubstr("sobel on gpu, cold: prepare is not valid")));
  EXPECT_FALSE(setup_json(costs)["crossovers"][0].contains("cold"));
}

}  // namespace
}  // namespace pirt
