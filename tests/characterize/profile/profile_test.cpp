
#include "characterize/profile/profile.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "characterize/profile/own_rows.h"
#include "characterize/profile/records.h"
#include "characterize/profile/store/reader.h"
#include "characterize/profile/store/writer.h"
#include "characterize/statistics/statistics.h"
#include "tests/characterize/profile/database_support.h"
#include "workloads/own/definition.h"

namespace pirt {
namespace {

using test::error_of;
using test::small_cell;
using test::small_run;
using test::TemporaryFolder;
using test::write_one_run;
using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

// Runs on several units are one profile; what was edited between them does not stand beside itself.
TEST(Profile, DoubtsWhatWasMeasuredOfAnotherFileThanTheNewestRun) {
  const TemporaryFolder folder;
  own::Definition definition;
  definition.name = "my.changing";
  definition.source = "/robot/w.yaml";
  definition.outputs = {own::tensor_from("out", "u8[4]")};
  definition.backends = {"cpu"};
  {
    ProfileWriter writer(folder / "p.db");
    for (const char* unit : {"gpu", "cpu"}) {
      definition.digest = std::string("digest of ") + unit;
      RunHeader header = small_run();
      header.environment.merge(own_facts(own::to_workload(definition)));
      const auto run = writer.begin_run(header);
      writer.write_cell(run, small_cell("my.changing", unit));
      writer.finish_run(run, "2024-01-02T03:05:00Z");
    }
  }
  const Profile profile = load_profile(folder / "p.db");
  for (const char* unit : {"gpu", "cpu"}) {
    SCOPED_TRACE(unit);
    const auto count = unit == std::string("gpu") ? 1 : 0;
    const PhaseRow* const call = profile.find("my.changing", unit, Phase::kCall);
    const EnergyRow* const energy = profile.find_energy("my.changing", unit);
    ASSERT_TRUE(call != nullptr && energy != nullptr);
    EXPECT_EQ(std::ranges::count(call->doubts, kChanged), count);
    EXPECT_EQ(std::ranges::count(energy->doubts, kChanged), count);
  }
}

TEST(Profile, AFileDoesNotHaveWhatWasMeasuredOfAnotherSince) {
  Profile profile;  // The newest run comes first.
  for (const char* file : {"/robot/v.yaml", "/robot/w.yaml"}) {
    own::Definition definition;
    definition.name = "my.moved";
    definition.source = definition.digest = file;
    definition.outputs = {own::tensor_from("out", "u8[4]")};
    definition.backends = {"cpu"};
    profile.runs.emplace_back().environment = own_facts(own::to_workload(definition));
  }
  EXPECT_THAT(measured_of(profile, "/robot/v.yaml", ""), ElementsAre("my.moved"));
  EXPECT_THAT(measured_of(profile, "/robot/w.yaml", ""), ::testing::IsEmpty());
}

TEST(Profile, RoundTripsEveryField) {
  const TemporaryFolder folder;
  CellRecord cell = small_cell("sobel", "gpu");
  cell.ops.reset();
  cell.phases.push_back({Phase::kUpload,
                         State::kSteady,
                         Provenance::kMeasured,
                         {"error: it broke"},
                         {"shared_core"},
                         {}});
  cell.energy = EnergyRecord{
      std::nullopt, Provenance::kModelled, "model: none", {"no_power"}, "package", false};
  cell.phases[1].processes = {0, 0, 0, 0, 0, 0, 0, 1, 1, 1, 1, 1, 1, 2, 2, 2, 2, 2, 2, 2};
  {
    ProfileWriter writer(folder / "p.db");
    const auto run = writer.begin_run(small_run());
    writer.write_cell(run, cell);
    const PeakRecord f32{"gpu", PeakKind::kF32, 1.5e11, "fma, 8 wide", Provenance::kMeasured, {}};
    const PeakRecord unknown{"gpu", PeakKind::kInt8,       std::nullopt,
                             "",    Provenance::kMeasured, {"error: none"}};
    writer.write_peaks(run, std::vector{f32, unknown});
    writer.write_peaks(run, std::vector{f32});  // takes the place of the first
    writer.finish_run(run, "2024-01-02T03:05:00Z");
  }
  const Profile profile = load_profile(folder / "p.db");
  EXPECT_EQ(profile.path, (folder / "p.db").string());
  EXPECT_EQ(profile.platform(), "board");

  const PhaseRow* call = profile.find("sobel", "gpu", Phase::kCall);
  ASSERT_NE(call, nullptr);
  EXPECT_EQ(call->backend, "fake");
  EXPECT_EQ(call->provenance, Provenance::kModelled);
  EXPECT_TRUE(is_valid(*call));
  EXPECT_THAT(call->notes, ElementsAre("bimodal"));
  EXPECT_EQ(call->samples, 20);
  // Samples 1000..1019 of processes with medians 1003, (1009 + 1010)/2 and 1016: median 1009;
  // deviations from it are 0, 1 1, ... 9 9, 10: the 10th and 11th smallest are both 5; p95 is the
  // 19th, p99 the 20th. Interval of three medians with mean 1009.33 and deviation 6.51:
  // 4.303 * 6.51 / sqrt(3) = 16.17 above it, and not below the fastest.
  EXPECT_EQ(call->median, Nanos(1009));
  EXPECT_EQ(call->mad, Nanos(5));
  EXPECT_EQ(call->p95, Nanos(1018));
  EXPECT_EQ(call->p99, Nanos(1019));
  EXPECT_EQ(call->ci_low, Nanos(1003));
  EXPECT_EQ(call->ci_high, Nanos(1025));
  EXPECT_EQ(call->ops, std::nullopt);
  EXPECT_EQ(call->bytes, 1000);
  EXPECT_EQ(call->processes, 3);
  const auto samples = load_samples(folder / "p.db", 1);
  ASSERT_EQ(samples.size(), 2U);
  EXPECT_THAT(samples[0].processes, ElementsAre(0, 1));  // set-up: each its own
  EXPECT_EQ(samples[1].processes, cell.phases[1].processes);
  EXPECT_EQ(call->mean, mean(samples[1].samples, samples[1].processes));

  const PhaseRow* cold = profile.find("sobel", "gpu", Phase::kPrepare, State::kCold);
  ASSERT_NE(cold, nullptr);
  EXPECT_EQ(cold->median, Nanos(1000));
  EXPECT_EQ(cold->ci_low, std::nullopt);  // two samples have no 95 % interval

  const PhaseRow* upload = profile.find("sobel", "gpu", Phase::kUpload);
  ASSERT_NE(upload, nullptr);
  EXPECT_FALSE(is_valid(*upload));
  EXPECT_THAT(upload->reasons, ElementsAre("error: it broke"));
  EXPECT_EQ(upload->samples, 0);
  EXPECT_EQ(upload->median, std::nullopt);
  EXPECT_EQ(upload->mean, std::nullopt);

  const EnergyRow* energy = profile.find_energy("sobel", "gpu");
  ASSERT_NE(energy, nullptr);
  EXPECT_EQ(energy->energy_j, std::nullopt);
  EXPECT_FALSE(is_valid(*energy));
  EXPECT_THAT(energy->reasons, ElementsAre("no_power"));
  EXPECT_EQ(energy->domain, "package");
  EXPECT_FALSE(energy->idle_subtracted);

  const PeakRow* peak = profile.find_peak("gpu", PeakKind::kF32);
  ASSERT_NE(peak, nullptr);
  EXPECT_TRUE(is_valid(*peak));
  EXPECT_EQ(peak->per_second, 1.5e11);
  EXPECT_EQ(peak->variant, "fma, 8 wide");
  const PeakRow* int8 = profile.find_peak("gpu", PeakKind::kInt8);
  ASSERT_NE(int8, nullptr);
  EXPECT_EQ(int8->per_second, std::nullopt);
  EXPECT_THAT(int8->reasons, ElementsAre("error: none"));
  EXPECT_EQ(profile.peaks.size(), 2U);

  ASSERT_EQ(profile.runs.size(), 1U);
  EXPECT_EQ(profile.runs[0].seed, 18'446'744'073'709'551'615U);
  EXPECT_EQ(profile.runs[0].started, "2024-01-02T03:04:05Z");
  EXPECT_EQ(profile.runs[0].finished, "2024-01-02T03:05:00Z");
  EXPECT_EQ(profile.runs[0].environment.at("cpu_model"), "test cpu");
  EXPECT_THAT(profile.runs[0].identity, ElementsAre("cpu_model"));
  const UnitRecord* unit = profile.find_unit("cpu");
  ASSERT_NE(unit, nullptr);
  EXPECT_TRUE(unit->device_is_cpu);
  EXPECT_THAT(unit->cores, ElementsAre(0, 1));
  EXPECT_TRUE(profile.find_unit("gpu")->cores.empty());
}

TEST(Profile, FindsTheNewestRunThatDidNotEnd) {
  const TemporaryFolder folder;
  {
    ProfileWriter writer(folder / "p.db");
    writer.begin_run(small_run());  // without a plan
    EXPECT_EQ(find_unfinished_run(folder / "p.db"), std::nullopt);
    RunHeader planned = small_run();
    for (const char* plan : {R"({"n": 2})", R"({"n": 3})", R"({"n": 4})"}) {
      planned.plan = plan;
      writer.begin_run(planned);
    }
    writer.finish_run(4, "2024-01-02T03:05:00Z");
    writer.write_cell(3, small_cell("sobel", "gpu"));
    writer.write_cell(3, small_cell("conv1", "cpu"));
    EXPECT_THAT(error_of(ErrorCode::kBadInput,
                         [&] { writer.write_cell(3, small_cell("conv1", "cpu", 7)); }),
                HasSubstr("has conv1 on cpu in run 3 already"));
  }
  const auto found = find_unfinished_run(folder / "p.db");
  ASSERT_TRUE(found);
  EXPECT_EQ(found->run.run_id, 3);
  EXPECT_EQ(found->run.platform, "board");
  EXPECT_EQ(found->plan, R"({"n": 3})");
  EXPECT_THAT(found->done, ElementsAre(CellName{"sobel", "gpu"}, CellName{"conv1", "cpu"}));
}

TEST(Profile, FindsNothingWhereThereIsNothing) {
  const Profile profile;
  EXPECT_EQ(profile.find("sobel", "cpu", Phase::kCall), nullptr);
  EXPECT_EQ(profile.find_energy("sobel", "cpu"), nullptr);
  EXPECT_EQ(profile.find_unit("cpu"), nullptr);
  EXPECT_TRUE(profile.workloads().empty());
}

TEST(Profile, TakesEachRowFromTheNewestRunThatHasIt) {
  const TemporaryFolder folder;
  {
    ProfileWriter writer(folder / "p.db");
    const auto old_run = writer.begin_run(small_run());
    writer.write_cell(old_run, small_cell("sobel", "cpu", 1000));
    writer.write_cell(old_run, small_cell("conv1", "cpu", 2000));
    const auto new_run = writer.begin_run(small_run());
    CellRecord cell = small_cell("sobel", "cpu", 5000);
    cell.phases[1].reasons = {"unstable"};   // the newest counts, valid or not
    cell.phases.erase(cell.phases.begin());  // and has no prepare row
    writer.write_cell(new_run, cell);
  }
  const Profile profile = load_profile(folder / "p.db");
  EXPECT_EQ(profile.find("sobel", "cpu", Phase::kCall)->run_id, 2);
  EXPECT_FALSE(is_valid(*profile.find("sobel", "cpu", Phase::kCall)));
  EXPECT_EQ(profile.find("sobel", "cpu", Phase::kPrepare, State::kCold)->run_id, 1);
  EXPECT_EQ(profile.find("conv1", "cpu", Phase::kCall)->run_id, 1);
  EXPECT_EQ(profile.find_energy("sobel", "cpu")->run_id, 2);
  ASSERT_EQ(profile.runs.size(), 2U);
  EXPECT_EQ(profile.runs[0].run_id, 2);  // newest first
  EXPECT_EQ(profile.runs[0].finished, "");
}

// An interrupted run wrote sobel on cpu as far as it was, and conv1, which nobody else has; and a
// cell of a platform that is not complete anywhere.
TEST(Profile, AnUnfinishedCellDisplacesNoCompleteOne) {
  const TemporaryFolder folder;
  {
    ProfileWriter writer(folder / "p.db");
    const auto whole = writer.begin_run(small_run());
    writer.write_cell(whole, small_cell("sobel", "cpu", 1000));
    const auto cut = writer.begin_run(small_run());
    for (const char* workload : {"sobel", "conv1"}) {
      writer.write_visit(cut, {workload, "cpu"}, {0, State::kCold, "record"});
      CellRecord cell = small_cell(workload, "cpu", 5000);
      for (PhaseRecord& row : cell.phases) row.reasons = {"few_samples"};
      cell.phases.push_back(
          {Phase::kExecute, State::kSteady, Provenance::kModelled, {}, {}, test::ramp(1, 20)});
      writer.write_interrupted_cell(cut, cell);
    }
    writer.write_cell(cut, small_cell("sobel", "gpu", 7000));  // this one was complete
    const auto elsewhere = writer.begin_run(small_run("other"));
    writer.write_visit(elsewhere, {"sobel", "cpu"}, {0, State::kCold, "record"});
    writer.write_interrupted_cell(elsewhere, small_cell("sobel", "cpu"));
  }
  const Profile profile = load_profile(folder / "p.db");
  EXPECT_EQ(profile.platform(), "board");
  EXPECT_EQ(profile.find("sobel", "cpu", Phase::kCall)->run_id, 1);
  EXPECT_TRUE(is_valid(*profile.find("sobel", "cpu", Phase::kCall)));
  EXPECT_EQ(profile.find("sobel", "cpu", Phase::kPrepare, State::kCold)->run_id, 1);
  EXPECT_EQ(profile.find("sobel", "cpu", Phase::kExecute), nullptr);  // rows of one cell only
  EXPECT_EQ(profile.find_energy("sobel", "cpu")->run_id, 1);
  EXPECT_EQ(profile.find("sobel", "gpu", Phase::kCall)->run_id, 2);
  EXPECT_EQ(profile.find("conv1", "cpu", Phase::kCall)->run_id, 2);
  EXPECT_EQ(load_profile(folder / "p.db", "other").find("sobel", "cpu", Phase::kCall)->run_id, 3);
}

TEST(Profile, ReadsOnePlatformAtATime) {
  const TemporaryFolder folder;
  {
    ProfileWriter writer(folder / "p.db");
    writer.write_cell(writer.begin_run(small_run("host")), small_cell("sobel", "cpu"));
    writer.write_cell(writer.begin_run(small_run("board")), small_cell("conv1", "cpu"));
    writer.begin_run(small_run("empty"));  // interrupted before its first cell
  }
  EXPECT_EQ(load_profile(folder / "p.db").platform(), "board");
  EXPECT_THAT(load_profile(folder / "p.db").workloads(), ElementsAre("conv1"));
  EXPECT_THAT(load_profile(folder / "p.db", "host").workloads(), ElementsAre("sobel"));
  EXPECT_THAT(error_of(ErrorCode::kBadInput, [&] { return load_profile(folder / "p.db", "hots"); }),
              AllOf(HasSubstr("no run of platform 'hots'"), HasSubstr("host")));
}

TEST(Profile, OrdersRowsAsTablesShowThem) {
  const TemporaryFolder folder;
  {
    ProfileWriter writer(folder / "p.db");
    const auto run = writer.begin_run(small_run());
    for (const char* workload : {"unheard_of", "conv1", "sobel"}) {
      for (const char* unit : {"gpu", "cpu"}) writer.write_cell(run, small_cell(workload, unit));
    }
  }
  const Profile profile = load_profile(folder / "p.db");
  EXPECT_THAT(profile.workloads(),
              ElementsAre("sobel", "conv1", "unheard_of"));  // the catalog's order
  EXPECT_THAT(profile.units(), ElementsAre("cpu", "gpu"));   // the platform's
  EXPECT_EQ(profile.phases.front().phase, Phase::kPrepare);
  EXPECT_EQ(profile.phases[1].phase, Phase::kCall);
}

TEST(Profile, ReadsTheSamplesOfEachRowFromItsRun) {
  const TemporaryFolder folder;
  {
    ProfileWriter writer(folder / "p.db");
    // The newest run measured sobel anew; blur stays from the first.
    auto first = writer.begin_run(small_run());
    writer.write_cell(first, small_cell("sobel", "gpu"));
    CellRecord blur = small_cell("gaussian_blur", "gpu");
    for (auto& phase : blur.phases) phase.samples = {Nanos(7), Nanos(5)};
    writer.write_cell(first, blur);
    const auto second = writer.begin_run(small_run());
    CellRecord sobel = small_cell("sobel", "gpu");
    for (auto& phase : sobel.phases) phase.samples = {Nanos(3), Nanos(1), Nanos(2)};
    writer.write_cell(second, sobel);
  }
  const ProfileReader reader(folder / "p.db");
  Profile profile = reader.read();
  EXPECT_TRUE(profile.find("sobel", "gpu", Phase::kCall)->values.empty());
  EXPECT_EQ(profile.find("sobel", "gpu", Phase::kCall)->mean, Nanos(2)) << "of the newest run";
  EXPECT_EQ(profile.find("gaussian_blur", "gpu", Phase::kCall)->mean, Nanos(6));
  reader.read_samples(profile);
  EXPECT_THAT(profile.find("sobel", "gpu", Phase::kCall)->values,
              ElementsAre(Nanos(3), Nanos(1), Nanos(2)));
  EXPECT_THAT(profile.find("gaussian_blur", "gpu", Phase::kCall)->values,
              ElementsAre(Nanos(7), Nanos(5)));
}

// A cell that --resume replaces between the two.
TEST(ProfileReader, TakesNoSamplesOfAnotherStateThanTheRows) {
  const TemporaryFolder folder;
  ProfileWriter writer(folder / "p.db");
  const auto run = writer.begin_run(small_run());
  writer.write_visit(run, {"sobel", "gpu"}, {0, State::kCold, "record"});
  writer.write_interrupted_cell(run, small_cell("sobel", "gpu"));
  const ProfileReader reader(folder / "p.db");
  Profile profile = reader.read();
  CellRecord whole = small_cell("sobel", "gpu");
  whole.phases[1].samples = test::ramp(1000, 400);
  writer.write_cell(run, whole);
  EXPECT_THAT(error_of(ErrorCode::kEnvironment,
                       [&] {
                         reader.read_samples(profile);
                         return 0;
                       }),
              HasSubstr("sobel on gpu has other samples now"));
}

TEST(ProfileReader, DoesNotKeepARunFromBeingAppendedAndSeesIt) {
  const TemporaryFolder folder;
  write_one_run(folder / "p.db");
  const ProfileReader reader(folder / "p.db");
  const std::string platform = reader.read().platform();
  EXPECT_THAT(reader.finished_runs(platform), ElementsAre(1));
  {
    ProfileWriter writer(folder / "p.db", Nanos(0));
    const auto run = writer.begin_run(small_run());
    writer.write_cell(run, small_cell("conv1", "gpu"));
    EXPECT_THAT(reader.finished_runs(platform), ElementsAre(1));
    writer.finish_run(run, "2024-01-02T04:00:00Z");
  }
  EXPECT_THAT(reader.finished_runs(platform), ElementsAre(2, 1));
  EXPECT_THAT(reader.read().workloads(), ElementsAre("sobel", "conv1"));
  EXPECT_THAT(reader.read(platform, {1, 1}).workloads(), ElementsAre("sobel"));
}

}  // namespace
}  // namespace pirt
