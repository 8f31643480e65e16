// Units that hold one program at a time, and sums of figures of several provenances, in virtual
// time.
#include <filesystem>
#include <nlohmann/json.hpp>

#include "scheduler/services/services.h"
#include "tests/scheduler/profile_rows.h"
#include "tests/scheduler/support.h"
#include "workloads/base/text/json.h"
#include "workloads/base/text/text.h"

namespace pirt::test {
namespace {

using testing::AllOf;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::StartsWith;

const std::string kBoard = R"(
platform: board
units: {fpga: {contexts: {prepare_ms: 10}, active_w: 2}}
workloads: {fc8: {fpga: [{on: fpga, ms: 30}]}, pool5: {fpga: [{on: fpga, ms: 5}]}}
)";

const std::string kTwo = "[{name: a, workload: fc8}, {name: b, workload: pool5, after: [a]}]";

RunRecord run(const std::string& platform, const std::string& tasks,
              const std::string& trace = "") {
  ScheduleOptions options;
  options.mode = "throughput";
  if (!trace.empty()) options.trace = trace;
  return run_virtual(
      platform_of(platform), nullptr,
      mix_of("mix: m\npipelines: {p: {closed_loop: {frames: 1}, tasks: " + tasks + "}}\n"),
      options);
}

// fc8 30 ms, loading 10 ms, pool5 5 ms; all of it draws 2 W.
TEST(Contexts, ACallOfAnotherOneThanTheLastPreparesItFirst) {
  const RunRecord record = run(kBoard, kTwo);
  EXPECT_DOUBLE_EQ(record.makespan_s, 0.045);
  EXPECT_EQ(record.units[0].prepares, 1);
  EXPECT_DOUBLE_EQ(record.units[0].prepare_s.value(), 0.010);
  EXPECT_DOUBLE_EQ(record.units[0].busy_s, 0.045);
  EXPECT_NEAR(record.units[0].energy_j.value(), 0.09, 1e-12);
}

// Each task is handed over in 0.4 ms.
TEST(Contexts, AHandOverIsNoPartOfPreparing) {
  Profile profile = profile_of({});
  UnitTimeRow row;
  row.run_id = 1;
  row.unit = "fpga";
  row.samples = 20;
  row.median = row.p95 = from_ms(0.4);
  profile.unit_times = {row};
  ScheduleOptions options;
  options.mode = "throughput";
  const RunRecord record = run_virtual(
      platform_of(kBoard), &profile,
      mix_of("mix: m\npipelines: {p: {closed_loop: {frames: 1}, tasks: " + kTwo + "}}\n"), options);
  EXPECT_NEAR(record.makespan_s, 0.0458, 1e-9);
  EXPECT_EQ(record.units[0].prepares, 1);
  EXPECT_DOUBLE_EQ(record.units[0].prepare_s.value(), 0.010);
}

TEST(Contexts, CallsOfOneDoNotPrepareAgain) {
  const RunRecord record =
      run(kBoard, "[{name: a, workload: fc8}, {name: b, workload: fc8, after: [a]}]");
  EXPECT_DOUBLE_EQ(record.makespan_s, 0.060);
  EXPECT_EQ(record.units[0].prepares, 0);
}

// Two of one program, then one of its own, then back: loaded twice.
TEST(Contexts, WorkloadsOfOneProgramAreLoadedTogether) {
  const RunRecord record = run(R"(
platform: board
units: {fpga: {contexts: {prepare_ms: 10, programs: {layers: [fc8, pool5]}}, active_w: 2}}
workloads: {fc8: {fpga: [{on: fpga, ms: 30}]}, pool5: {fpga: [{on: fpga, ms: 5}]},
            sobel: {fpga: [{on: fpga, ms: 1}]}}
)",
                               "[{name: a, workload: fc8}, {name: b, workload: pool5, after: [a]}, "
                               "{name: c, workload: sobel, after: [b]}, "
                               "{name: d, workload: pool5, after: [c]}]");
  EXPECT_DOUBLE_EQ(record.makespan_s, 0.061);
  EXPECT_EQ(record.units[0].prepares, 2);
}

TEST(Contexts, AreInTheRecordOnlyWhereAUnitHasThem) {
  const RunRecord with = run(kBoard, kTwo);
  EXPECT_EQ(run_record_from_json(to_json(with), "r"), with);
  const RunRecord without = run(R"(
platform: board
units: {fpga: {active_w: 2}}
workloads: {fc8: {fpga: [{on: fpga, ms: 30}]}}
)",
                                "[{name: a, workload: fc8}]");
  EXPECT_EQ(without.units[0].prepares, std::nullopt);
  EXPECT_FALSE(to_json(without)["units"]["fpga"].contains("prepare_s"));
}

TEST(Contexts, PreparingIsASliceOfItsOwnInTheTrace) {
  const auto path = std::filesystem::path(testing::TempDir()) / "pirt_contexts_trace.json";
  static_cast<void>(run(kBoard, kTwo, path.string()));
  const auto events = nlohmann::json::parse(read_file(path.string()));
  std::filesystem::remove(path);
  std::vector<nlohmann::json> slices;
  for (const auto& event : events) {
    if (event.value("name", "") == "prepare") slices.push_back(event);
  }
  ASSERT_EQ(slices.size(), 1U);
  EXPECT_EQ(slices[0]["cat"], "pool5");
  EXPECT_EQ(slices[0]["ts"], 30000.0);
  EXPECT_EQ(slices[0]["dur"], 10000.0);
}

TEST(Contexts, NeedOneServerAndOneSlot) {
  const auto refused = [](const std::string& unit) {
    return bad_input(
        [&] { static_cast<void>(platform_of("platform: p\nunits:\n  fpga: " + unit + "\n")); });
  };
  EXPECT_THAT(refused("{servers: 2, contexts: {}}"),
              AllOf(StartsWith("test.yaml:3: units.fpga.contexts"), HasSubstr("one server")));
  EXPECT_THAT(refused("{slots: 4, contexts: {}}"), HasSubstr("take `slots` out"));
  EXPECT_THAT(refused("{contexts: {prepare: 1}}"), HasSubstr("prepare_ms"));
  EXPECT_THAT(refused("{contexts: {programs: {a: [fc8], b: [sobel, fc8]}}}"),
              AllOf(StartsWith("test.yaml:3: units.fpga.contexts.programs.b"),
                    HasSubstr("fc8 is in program a already")));
  EXPECT_EQ(platform_of("platform: p\nunits: {fpga: {contexts: {}}}\n").unit("fpga").slots, 1);
}

PhaseRow row(Phase phase, State state, double ms, Origin origin) {
  PhaseRow row = row_of("fc8", "dsp", phase, from_ms(ms));
  row.state = state;
  row.provenance = origin;
  return row;
}

/// Counted cycles between published copies: 1 + 4 + 1 ms; preparing ends with a call of 6 ms.
Profile counted() {
  Profile profile =
      profile_of({row(Phase::kPrepare, State::kWarm, 26, Provenance::kCounted),
                  row(Phase::kUpload, State::kSteady, 1, Provenance::kPublished),
                  row(Phase::kExecute, State::kSteady, 4, Provenance::kCounted),
                  row(Phase::kDownload, State::kSteady, 1, Provenance::kPublished),
                  row(Phase::kCall, State::kSteady, 6, Origin(Provenance::kPublished, true))});
  profile.runs[0].units = {{"dsp", "fake", "a dsp", false, {}}};
  return profile;
}

constexpr const char* kMeasured =
    "platform: board\nunits: {dsp: {backend: fake, active_w: 2, contexts: {}}}\n";

TEST(ForeignServices, ACallOfSeveralProvenancesIsAMixture) {
  const Profile profile = counted();
  const auto table = resolve_services(platform_of(kMeasured), &profile, {"fc8"}, {});
  const Service& service = table.entries[0][0].service.value();
  EXPECT_EQ(service.time_provenance, Origin(Provenance::kPublished, true));
  EXPECT_EQ(service.energy_provenance, Origin(Provenance::kPublished, true));
  EXPECT_EQ(service.total(), from_ms(6));
  EXPECT_EQ(service.prepare, from_ms(20));
}

TEST(ForeignServices, TheRunSaysThatItsTimesAreMixtures) {
  const Profile profile = counted();
  ScheduleOptions options;
  options.mode = "throughput";
  const RunRecord record = run_virtual(
      platform_of(kMeasured), &profile,
      mix_of("mix: m\npipelines: {p: {closed_loop: {frames: 2}, tasks: [{workload: fc8}]}}\n"),
      options);
  EXPECT_EQ(record.units[0].mixture, true);
  EXPECT_THAT(record.units[0].provenance, ElementsAre("published"));
  EXPECT_EQ(run_record_from_json(to_json(record), "r"), record);
}

TEST(ForeignServices, WhatNobodyKnowsThePreparationOfCannotBeLoadedAgain) {
  Profile profile = counted();
  profile.phases[0].median.reset();
  profile.phases[0].reasons = {"unknown: loading is not modelled"};
  const auto table = resolve_services(platform_of(kMeasured), &profile, {"fc8"}, {});
  EXPECT_FALSE(table.entries[0][0].service);
  EXPECT_THAT(
      table.entries[0][0].reason,
      AllOf(HasSubstr("prepare is unknown: loading is not modelled"), HasSubstr("prepare_ms")));
  const auto given = resolve_services(
      platform_of("platform: board\nunits: {dsp: {backend: fake, contexts: {prepare_ms: 3}}}\n"),
      &profile, {"fc8"}, {});
  EXPECT_EQ(given.entries[0][0].service.value().prepare, from_ms(3));
}

TEST(ForeignServices, APhaseThatNobodyKnowsLeavesNoCall) {
  Profile profile = counted();
  profile.phases[1].median.reset();
  profile.phases[1].reasons = {"unknown: no link"};
  const auto table = resolve_services(platform_of(kMeasured), &profile, {"fc8"}, {});
  EXPECT_EQ(table.entries[0][0].reason, "its upload is unknown: no link");
}

}  // namespace
}  // namespace pirt::test
