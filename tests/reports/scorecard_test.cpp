// The paper's claims against profiles that are made up so that each finding comes out.
#include "reports/paper/scorecard.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>

namespace pirt {
namespace {

using testing::HasSubstr;

PhaseRow row(const std::string& workload, const std::string& unit, Phase phase, State state,
             double ms) {
  PhaseRow row;
  row.workload = workload;
  row.unit = unit;
  row.phase = phase;
  row.state = state;
  row.samples = 20;
  row.median = from_ms(ms);
  row.ci_low = from_ms(ms * 0.99);
  row.ci_high = from_ms(ms * 1.01);
  return row;
}

/// A call of @p ms and a cold set-up on a unit.
void add(Profile& profile, const std::string& workload, const std::string& unit, double ms,
         double prepare_ms) {
  profile.phases.push_back(row(workload, unit, Phase::kCall, State::kSteady, ms));
  profile.phases.push_back(row(workload, unit, Phase::kExecute, State::kSteady, ms));
  profile.phases.push_back(row(workload, unit, Phase::kDeviceInit, State::kCold, 0));
  profile.phases.push_back(row(workload, unit, Phase::kPrepare, State::kCold, prepare_ms + ms));
}

/// A board with a CPU and a GPU, which only stands in for one if @p gpu_is_cpu.
Profile board(double cpu_ms, double gpu_ms, bool gpu_is_cpu = false) {
  Profile profile;
  profile.path = "p.db";
  RunInfo run;
  run.platform = "board";
  run.units = {{"cpu", "cpu", "A CPU", true, {}}, {"gpu", "opencl", "A device", gpu_is_cpu, {}}};
  profile.runs = {run};
  add(profile, "convolution", "cpu", cpu_ms, 0);
  add(profile, "convolution", "gpu", gpu_ms, 100);
  return profile;
}

Claim find(const std::vector<Claim>& claims, const std::string& part) {
  const auto found = std::ranges::find_if(
      claims, [&](const Claim& claim) { return claim.claim.find(part) != std::string::npos; });
  EXPECT_NE(found, claims.end()) << part;
  return found == claims.end() ? Claim{} : *found;
}

std::vector<Claim> claims_of(const Profile& profile) {
  return observation_claims({.profile = &profile});
}

TEST(Scorecard, CountsTheOperationsOfTableOne) {
  const auto claims = operation_claims();
  ASSERT_EQ(claims.size(), 11U);
  // Printed 895.5 M where its shape gives 895.795: the paper's slip, and the only one.
  for (const Claim& claim : claims) {
    const bool slip = claim.claim.find("conv2") != std::string::npos;
    EXPECT_EQ(claim.finding, slip ? Finding::kRefuted : Finding::kByConstruction) << claim.claim;
  }
}

TEST(Scorecard, AsksForTheUnitThatThePaperPrefers) {
  const auto faster = find(claims_of(board(3, 1)), "convolution prefers the GPU by time");
  EXPECT_EQ(faster.finding, Finding::kConfirmed);
  EXPECT_EQ(faster.here, "gpu");
  const auto slower = find(claims_of(board(1, 3)), "convolution prefers the GPU by time");
  EXPECT_EQ(slower.finding, Finding::kRefuted);
  const auto tie = find(claims_of(board(1, 1.01)), "convolution prefers the GPU by time");
  EXPECT_EQ(tie.finding, Finding::kNotTestable);
}

TEST(Scorecard, TakesAnOpenClDeviceOnTheHostsCoresForNoGpu) {
  const auto claim = find(claims_of(board(3, 1, true)), "convolution prefers the GPU by time");
  EXPECT_EQ(claim.finding, Finding::kNotTestable);
  EXPECT_THAT(claim.why, HasSubstr("no real GPU"));
}

// The same processor under two names says nothing of what several units do.
TEST(Scorecard, ObservationsOfSeveralUnitsNeedTwoRealOnes) {
  for (const char* part : {"no single unit", "significant part", "with set-up counted"}) {
    const auto claim = find(claims_of(board(3, 1, true)), part);
    EXPECT_EQ(claim.finding, Finding::kNotTestable) << part;
    EXPECT_THAT(claim.why, HasSubstr("real")) << part;
  }
}

TEST(Scorecard, BestOfTheThreeNeedsTwoRealUnitsAndKnownWatts) {
  RunRecord run;
  run.mode = "energy";
  run.energy_j = 1;
  run.average_power_w = 5;
  run.units.resize(1);
  run.units[0].energy_provenance = {"modelled"};
  run.units[0].unit = "gpu";
  run.units[0].completed = 1;
  ModeRuns runs;
  runs.runs = {run};
  Platform platform;
  platform.units.resize(2);
  platform.units[0].name = "cpu";
  platform.units[0].role = Role::kCpu;
  platform.units[1].name = "gpu";
  platform.units[1].role = Role::kGpu;
  const auto in_joules = [&](const Profile& profile) {
    const auto claims =
        scheduling_claims({.profile = &profile, .platform = &platform, .table5 = &runs});
    return find(claims, "energy mode: best of the three in J, on this machine");
  };
  EXPECT_THAT(in_joules(board(3, 1, true)).why, HasSubstr("two real units"));
  EXPECT_THAT(in_joules(board(3, 1)).why, HasSubstr("assumed watts"));
  platform.units[1].energy_source = "the board's manual, page 7";
  EXPECT_EQ(in_joules(board(3, 1)).finding, Finding::kConfirmed);
}

TEST(Scorecard, TestsNothingAboutEnergyOnAssumedWatts) {
  auto profile = board(3, 1);
  profile.energies = {{.run_id = 1,
                       .workload = "convolution",
                       .unit = "cpu",
                       .energy_j = 1,
                       .provenance = Provenance::kModelled,
                       .source = "model",
                       .reasons = {}}};
  const auto claim = find(claims_of(profile), "convolution prefers the GPU by energy");
  EXPECT_EQ(claim.finding, Finding::kNotTestable);
  EXPECT_THAT(claim.why, HasSubstr("assumed watts"));
}

TEST(Scorecard, SetUpDecidesWhereTheFasterUnitStartsLater) {
  // 100 ms of set-up for a call of 1 ms: 99 % of it; the CPU is first with its 3 ms.
  const auto claims = claims_of(board(3, 1));
  const auto matters = find(claims, "significant part");
  EXPECT_EQ(matters.finding, Finding::kConfirmed);
  EXPECT_EQ(matters.here, "gpu 99.0 %");
  const auto decides = find(claims, "with set-up counted");
  EXPECT_EQ(decides.finding, Finding::kConfirmed);
  EXPECT_EQ(decides.here, "gpu, then cpu");
  EXPECT_EQ(find(claims_of(board(1, 3)), "with set-up counted").finding, Finding::kRefuted);
}

TEST(Scorecard, NeedsNoProfileForWhatIsArithmeticOrFitted) {
  const auto cells = paper_cells();
  const auto claims = scorecard({.cells = &cells});
  const auto count = [&](Finding finding) {
    return std::ranges::count(claims, finding, &Claim::finding);
  };
  EXPECT_EQ(count(Finding::kFitted), 13);
  EXPECT_EQ(count(Finding::kByConstruction), 10);
  EXPECT_EQ(count(Finding::kConfirmed) + count(Finding::kRefuted), 1 + 6);  // conv2, fitted board
  for (const Claim& claim : claims) {
    EXPECT_NE(claim.here, "") << claim.claim;
    EXPECT_TRUE(claim.finding != Finding::kNotTestable || !claim.why.empty()) << claim.claim;
  }
  // The bound of the fitted board is 0.807 frames/ms; throughput mode reaches 0.751.
  EXPECT_EQ(find(claims, "throughput-optimal").finding, Finding::kRefuted);
}

TEST(Scorecard, SaysOfSectionFiveWhatIsFittedAndWhatIsPredicted) {
  const auto section = run_section5();
  const auto claims = section5_claims({.section5 = &section});
  const auto fitted = find(claims, "15.0 localizations a second, on the CPU alone");
  EXPECT_EQ(fitted.finding, Finding::kFitted);
  EXPECT_EQ(fitted.from, "fitted");
  EXPECT_THAT(fitted.why, HasSubstr("were fitted to it"));
  EXPECT_EQ(find(claims, "10.0 W, on the CPU alone").finding, Finding::kFitted);
  // 25 frames of 3 x 60.93 ms need 4.57 of the four cores, and the GPU, whose host_setup takes a
  // core too, does not make up for it; a path waits behind frames of 60.93 ms.
  for (const char* claim : {"25.0 localizations", "3.00 recognitions", "within 6.00 ms (p99)"}) {
    const auto predicted = find(claims, claim);
    EXPECT_EQ(predicted.finding, Finding::kRefuted) << claim;
    EXPECT_EQ(predicted.from, "virtual time, fitted");
    EXPECT_THAT(predicted.paper, testing::StartsWith("+"));
    EXPECT_THAT(predicted.here, testing::StartsWith("^"));
    EXPECT_THAT(predicted.why, HasSubstr("best in this alone: "));
  }
  // Four cores at 2.63 W and a GPU at 0.64 W.
  EXPECT_EQ(find(claims, "11.0 W, in throughput mode").finding, Finding::kConfirmed);
  EXPECT_EQ(find(claims, "placed as Section V says").finding, Finding::kRefuted);
  EXPECT_EQ(find(claims, "on this machine").finding, Finding::kNotTestable);
}

TEST(Scorecard, ShowsSectionFiveAsATableAndJson) {
  const auto section = run_section5();
  const auto table = section5_table(section);
  EXPECT_EQ(table.rows[0], (std::vector<std::string>{"without the runtime", "the paper", "+15.0",
                                                     "+0.667", "-", "-", "+10.0"}));
  EXPECT_THAT(table.rows[1][0], HasSubstr("FITTED"));
  for (const auto& row : table.rows) EXPECT_EQ(row.size(), table.columns.size());
  // Every mode that ran is in some row.
  for (const auto& prediction : section.predictions) {
    EXPECT_TRUE(std::ranges::any_of(table.rows, [&](const auto& row) {
      return (", " + row[1] + ",").find(", " + prediction.mode + ",") != std::string::npos;
    })) << prediction.mode;
  }
  const auto json = section5_json(section);
  EXPECT_EQ(json["predictions"].size(), section.predictions.size());
  EXPECT_EQ(json["paper_with"]["localization_fps"], 25);
  EXPECT_FALSE(json["paper_without"].contains("planning_p99_ms"));
}

TEST(Scorecard, IsATableAndJsonOfTheSameClaims) {
  const auto claims = operation_claims();
  EXPECT_EQ(scorecard_table(claims).rows.size(), claims.size());
  const auto table = scorecard_table(claims);
  EXPECT_EQ(table.title, "The paper's claims: 0 confirmed, 1 refuted, 0 not testable here");
  EXPECT_THAT(table.footnotes.front(), HasSubstr("10 that hold by construction"));
  const auto under = [&](const std::string& header) {
    const auto column = std::ranges::find(table.columns, header, &Column::header);
    EXPECT_NE(column, table.columns.end()) << header;
    return table.rows[0].at(static_cast<std::size_t>(column - table.columns.begin()));
  };
  EXPECT_THAT(under("found"), HasSubstr("refuted"));
  EXPECT_EQ(under("claim"), claims[4].claim);
  EXPECT_EQ(under("paper"), claims[4].paper);
  EXPECT_EQ(under("here"), claims[4].here);
  EXPECT_EQ(under("ours is"), claims[4].from);
  EXPECT_EQ(under("because"), claims[4].why);
  EXPECT_EQ(under("where"), "Table I");
  const auto json = scorecard_json(claims);
  ASSERT_EQ(json.size(), claims.size());
  EXPECT_EQ(json[4]["finding"], "refuted");
  EXPECT_GE(contradictions_table().rows.size(), 5U);
}

}  // namespace
}  // namespace pirt
