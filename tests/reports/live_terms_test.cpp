// Which term explains that live calls took longer than their row.
#include "reports/run/live_terms.h"

#include <gtest/gtest.h>

namespace pirt {
namespace {

PhaseRow execute(Condition condition, double ms) {
  PhaseRow row;
  row.workload = "sobel";
  row.unit = "cpu";
  row.phase = Phase::kExecute;
  row.condition = condition;
  row.median = from_ms(ms);
  return row;
}

/// Of a row of 10 ms that calls of that long contradict.
std::string explained(double live_ms, const Profile& profile) {
  RowCheck check;
  check.live.workload = "sobel";
  check.live.unit = "cpu";
  check.live.p50_ms = live_ms;
  check.median_ms = 10;
  check.finding = RowFinding::kContradicted;
  return explanation_of(check, profile);
}

// 10 % of the row either way is what medians may differ by.
TEST(LiveTerms, TheSmallestThatIsEnoughExplainsIt) {
  Profile profile;
  profile.phases = {execute(Condition::kSteady, 10)};
  EXPECT_EQ(explained(20, profile), "not known: no row of cold_cache or beside_memory");
  profile.conditions = {execute(Condition::kColdCache, 14), execute(Condition::kBesideMemory, 16)};
  EXPECT_EQ(explained(14.9, profile), "cold caches");
  EXPECT_EQ(explained(16.9, profile), "a busy neighbour");
  EXPECT_EQ(explained(20.9, profile), "cold caches and a busy neighbour");
  EXPECT_EQ(explained(22, profile),
            "more than its rows of other conditions: the operating system, or the clock");
  EXPECT_EQ(explained(8, profile), "nothing: faster than its row");
}

TEST(LiveTerms, OfASequenceItMayBeTheFrames) {
  Profile profile;
  profile.phases = {execute(Condition::kSteady, 10), execute(Condition::kSteady, 10)};
  PhaseRow& call = profile.phases.back();
  call.phase = Phase::kCall;
  call.p95 = from_ms(20);
  EXPECT_EQ(explained(20, profile), "not known: no row of cold_cache or beside_memory");
  call.notes = {"sequence of 4 frames"};
  EXPECT_EQ(explained(20, profile), "its data: within 95 % of its row's samples");
  EXPECT_EQ(explained(25, profile), "not known: no row of cold_cache or beside_memory");
  profile.conditions = {execute(Condition::kColdMemory, 14)};
  EXPECT_EQ(explained(14, profile), "cold caches");
}

TEST(LiveTerms, APhaseThatIsMostOfTheDifferenceIsNamed) {
  Profile profile;
  PhaseRow upload = execute(Condition::kSteady, 1);
  upload.phase = Phase::kUpload;
  profile.phases = {execute(Condition::kSteady, 9), upload};
  RowCheck check;
  check.live = {.workload = "sobel", .unit = "cpu", .p50_ms = 14, .upload_ms = 4, .execute_ms = 10};
  check.median_ms = 10;
  check.finding = RowFinding::kContradicted;
  EXPECT_EQ(explanation_of(check, profile), "its upload: 4.00 ms, 1.00 in its row");
  check.live.upload_ms = 2;
  EXPECT_EQ(explanation_of(check, profile), "not known: no row of cold_cache or beside_memory");
  check.live.p50_ms = 8.5;
  EXPECT_EQ(explanation_of(check, profile), "nothing: faster than its row");
  check.live.upload_ms = 0.1;
  EXPECT_EQ(explanation_of(check, profile), "its upload: 0.100 ms, 1.00 in its row");
}

TEST(LiveTerms, NothingIsSaidOfARowThatAgrees) {
  RowCheck check;
  check.median_ms = 10;
  check.finding = RowFinding::kAgrees;
  EXPECT_EQ(explanation_of(check, Profile()), "");
}

}  // namespace
}  // namespace pirt
