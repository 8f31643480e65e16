// Units whose clock is not this machine's: phases that are accounted for in different ways, figures
// that repeat exactly, and devices that are slow on this machine.
#include <gmock/gmock.h>

#include "characterize/campaign/cell.h"
#include "characterize/worker/job.h"
#include "tests/characterize/campaign/campaign_support.h"
#include "workloads/backends/registry.h"
#include "workloads/catalog/catalog.h"

namespace pirt::test {
namespace {

using ::testing::AllOf;
using ::testing::Contains;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;
using ::testing::StartsWith;

constexpr const char* kCounted = R"(
device_init_ms: 1
prepare_ms: 5
accounts: {device_init: counted, prepare: {unknown: loading is not modelled}, upload: published,
  launch: published, execute: counted, download: published}
deterministic: true
stages:
  pool2: [{name: upload, ms: 0.5}, {name: launch, ms: 0.25}, {name: execute, ms: 2, bound_ms: 1.5}, {name: download, ms: 1}]
)";

class ForeignTime : public Campaign {};

// 0.5 + 0.25 + 2 + 1 = 3.75 ms; at least 0.5 + 0.25 + 1.5 + 1 = 3.25 ms.
TEST_F(ForeignTime, EachPhaseHasAProvenanceOfItsOwnAndTheCallIsAMixture) {
  const Profile profile = measure(options({{"gpu", kCounted}}, "^pool2$"));
  EXPECT_EQ(row(profile, "pool2", Phase::kDeviceInit, State::kCold).provenance,
            Provenance::kCounted);
  EXPECT_EQ(row(profile, "pool2", Phase::kUpload).provenance, Provenance::kPublished);
  const PhaseRow& execute = row(profile, "pool2", Phase::kExecute);
  EXPECT_EQ(execute.provenance, Provenance::kCounted);
  EXPECT_EQ(execute.median, from_ms(2));
  EXPECT_EQ(execute.bound, from_ms(1.5));
  const PhaseRow& call = row(profile, "pool2", Phase::kCall);
  EXPECT_EQ(call.provenance, Origin(Provenance::kPublished, true));
  EXPECT_EQ(call.median, from_ms(3.75));
  EXPECT_EQ(call.bound, from_ms(3.25));
  EXPECT_EQ(profile.find_energy("pool2", "gpu")->provenance, Origin(Provenance::kPublished, true));
}

TEST_F(ForeignTime, AnUnknownPhaseIsAbsentWithItsReasonAndNoWarning) {
  const Profile profile = measure(options({{"gpu", kCounted}}, "^pool2$"));
  for (const State state : {State::kCold, State::kWarm}) {
    const PhaseRow& prepare = row(profile, "pool2", Phase::kPrepare, state);
    EXPECT_EQ(prepare.median, std::nullopt);
    EXPECT_FALSE(is_valid(prepare));
    EXPECT_THAT(prepare.reasons, ElementsAre("unknown: loading is not modelled"));
    EXPECT_EQ(prepare.unknown(), "loading is not modelled");
  }
  EXPECT_THAT(warnings, IsEmpty());
  EXPECT_EQ(summary.rows_invalid, 0);
  EXPECT_EQ(summary.rows_valid, 7);  // device_init twice, and five of a call
}

TEST_F(ForeignTime, ACallIsUnknownIfAPhaseOfItIs) {
  const Profile profile = measure(options(
      {{"gpu", "accounts: {download: {unknown: nobody has measured the link}}"}}, "^pool2$"));
  EXPECT_THAT(row(profile, "pool2", Phase::kCall).reasons,
              ElementsAre("unknown: its download is: nobody has measured the link"));
  EXPECT_EQ(row(profile, "pool2", Phase::kExecute).median, from_ms(1));
  EXPECT_EQ(profile.find_energy("pool2", "gpu")->energy_j, std::nullopt);
}

TEST_F(ForeignTime, OneCallInTwoProcessesIsEnoughForWhatRepeats) {
  const Profile profile = measure(options({{"gpu", kCounted}}, "^pool2$"));
  EXPECT_EQ(summary.processes, 2);
  for (const PhaseRow& each : profile.phases) {
    if (each.phase == Phase::kPrepare) continue;
    EXPECT_EQ(each.samples, 1) << to_string(each.phase);
    EXPECT_TRUE(is_valid(each)) << to_string(each.phase);
    EXPECT_THAT(each.notes, Contains("deterministic"));
    EXPECT_TRUE(each.is_deterministic());
    EXPECT_EQ(each.ci_low, each.median);
    EXPECT_EQ(each.ci_high, each.median);
  }
}

TEST_F(ForeignTime, ASequenceThatRepeatsIsPlayedOnce) {
  const Profile profile = measure(
      options({{"gpu", "deterministic: true\naccounts: {execute: counted}"}}, "^track_features$"));
  const PhaseRow& call = row(profile, "track_features", Phase::kCall);
  EXPECT_EQ(call.samples, find_workload("track_features").frames);
  EXPECT_THAT(call.notes, AllOf(Contains("deterministic"), Contains("sequence of 4 frames")));
}

// The second process takes 1.5 times as long.
TEST_F(ForeignTime, ASecondProcessChecksThatTheCountIsTheSame) {
  const Profile profile =
      measure(options({{"gpu", std::string(kCounted) + "process_factors: [1, 1.5]\n"}}, "^pool2$"));
  const PhaseRow& execute = row(profile, "pool2", Phase::kExecute);
  EXPECT_THAT(execute.reasons, ElementsAre(StartsWith("counts_differ: 2000000 ns to 3000000 ns")));
  EXPECT_EQ(execute.samples, 2);
  EXPECT_FALSE(warnings.empty());
}

// The machine's clock tells the uploads: they sleep 2 ms, at least.
TEST_F(ForeignTime, MeasuredCopiesStandBesideCountedCycles) {
  const Profile profile = measure(options({{"gpu", R"(
deterministic: true
accounts: {upload: measured, execute: counted}
stages: {pool2: [{name: upload, ms: 2}, {name: execute, ms: 3}]}
)"}},
                                          "^pool2$"));
  const PhaseRow& upload = row(profile, "pool2", Phase::kUpload);
  EXPECT_EQ(upload.provenance, Provenance::kMeasured);
  EXPECT_GE(upload.median, from_ms(2));
  EXPECT_GE(upload.processes, 4);
  EXPECT_FALSE(upload.is_deterministic());
  const PhaseRow& execute = row(profile, "pool2", Phase::kExecute);
  EXPECT_EQ(execute.median, from_ms(3));
  EXPECT_EQ(execute.processes, 1);  // the others have the same
  EXPECT_TRUE(execute.is_deterministic());
  const PhaseRow& call = row(profile, "pool2", Phase::kCall);
  EXPECT_EQ(call.provenance, Origin(Provenance::kCounted, true));
  EXPECT_GE(call.median, from_ms(5));
  EXPECT_FALSE(call.is_deterministic());
  // 10 ms cold, the first call's 3 ms, and its upload.
  const PhaseRow& prepare = row(profile, "pool2", Phase::kPrepare, State::kCold);
  EXPECT_GE(prepare.median, from_ms(15));
  EXPECT_EQ(prepare.provenance, Origin(Provenance::kModelled, true));
}

// Each execute takes 300 ms of the machine: five of them take longer than the limit.
TEST_F(ForeignTime, ASlowEmulatorIsNotKilledForBeingSlowAndSaysWhatItDoes) {
  auto o = options({{"gpu", "machine_ms: 300"}}, "^pool5$");
  o.job_limit = std::chrono::milliseconds(1200);
  o.max_time = std::chrono::seconds(5);  // One process.
  std::vector<std::string> steps;
  ProgressSink sink;
  sink.progress = [&](const Progress& progress) { steps.push_back(progress.step); };
  run_campaign(o, plan_campaign(o), sink);
  const Profile profile = load_profile(o.database);
  EXPECT_EQ(row(profile, "pool5", Phase::kExecute).median, from_ms(1));
  EXPECT_THAT(row(profile, "pool5", Phase::kCall).reasons, Not(Contains(HasSubstr("timed out"))));
  EXPECT_THAT(steps, Contains(AllOf(HasSubstr("sampling"), HasSubstr("samples in"))));
}

TEST_F(ForeignTime, OneThatHangsIsKilledAllTheSame) {
  auto o = options({{"gpu", "hang: [pool5]\ndeterministic: true\naccounts: {execute: counted}"}},
                   "^pool5$");
  o.job_limit = std::chrono::seconds(1);
  const Profile profile = measure(o);
  EXPECT_THAT(row(profile, "pool5", Phase::kCall).reasons, Contains(HasSubstr("timed out")));
}

TEST_F(ForeignTime, RefusesAccountsThatItDoesNotKnow) {
  const auto script = [](const char* text) {
    return error_of(ErrorCode::kBadInput, [&] {
      return find_backend("fake").supports_on({"gpu", {}, "", text}, find_workload("pool5"));
    });
  };
  EXPECT_THAT(script("accounts: {execute: guessed}"),
              HasSubstr("accounts.execute: 'guessed' is not one of measured"));
  EXPECT_THAT(script("accounts: {call: counted}"), HasSubstr("accounts.call: unknown key"));
  EXPECT_THAT(script("accounts: {execute: {why: 1}}"),
              HasSubstr("accounts.execute.why: unknown key"));
  EXPECT_THAT(script("deterministic: maybe"), HasSubstr("true or false"));
  EXPECT_THAT(script("stages: {pool5: [{name: execute, ms: 1, bound_ms: 2}]}"),
              HasSubstr("bound_ms is above ms"));
  EXPECT_THAT(script("{clock: wall, accounts: {execute: counted}}"),
              HasSubstr("leave out accounts"));
}

TEST(Origins, ASumIsAMixtureAndHasTheWeakestProvenance) {
  constexpr Origin kMeasured = Provenance::kMeasured;
  constexpr Origin kCountedOne = Provenance::kCounted;
  EXPECT_EQ(sum_of(kMeasured, kMeasured), kMeasured);
  EXPECT_EQ(sum_of(kMeasured, kCountedOne), Origin(Provenance::kCounted, true));
  EXPECT_EQ(sum_of(sum_of(kMeasured, Provenance::kPublished), Provenance::kPublished),
            Origin(Provenance::kPublished, true));
  EXPECT_EQ(weakest(kMeasured, kCountedOne), kCountedOne);
  EXPECT_EQ(weakest(kMeasured, sum_of(kMeasured, kCountedOne)), Origin(Provenance::kCounted, true));
}

TEST(Records, CarryAccountsBoundsAndProgress) {
  JobResult result;
  result.deterministic = true;
  result.accounts = {{Phase::kExecute, {Provenance::kCounted}},
                     {Phase::kPrepare, {Provenance::kCounted, "no model"}}};
  result.phases = {{Phase::kExecute, {Nanos(5)}, 1, Nanos(4)}};
  const std::string text = to_record(result) + "\n" + progress_record("sampling, 3") + "\n";
  const JobResult read = last_record(text);
  EXPECT_TRUE(read.deterministic);
  EXPECT_EQ(read.accounting(Phase::kExecute).provenance, Provenance::kCounted);
  EXPECT_EQ(read.unknown(Phase::kPrepare), "no model");
  EXPECT_EQ(read.phases.front().bound, Nanos(4));
  EXPECT_TRUE(read.repeats(Phase::kCall));
  EXPECT_EQ(last_progress(text), "sampling, 3");
  EXPECT_EQ(last_progress("pirt-progress cut o"), "");
}

}  // namespace
}  // namespace pirt::test
