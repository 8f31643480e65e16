// The real coordinator and real worker processes, measuring scripted units: what is stored when all
// goes well, and when it does not.
#include "characterize/campaign/campaign.h"

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/wait.h>

#include "characterize/campaign/live_rows.h"
#include "characterize/machine/environment_keys.h"
#include "characterize/profile/identity.h"
#include "characterize/profile/own_rows.h"
#include "characterize/profile/profile.h"
#include "characterize/profile/roofline.h"
#include "characterize/profile/store/reader.h"
#include "tests/characterize/campaign/campaign_support.h"
#include "tests/characterize/support.h"
#include "tests/support/data.h"
#include "workloads/base/system/caches.h"
#include "workloads/catalog/catalog.h"
#include "workloads/catalog/own_list.h"
#include "workloads/inputs/pictures/images.h"
#include "workloads/own/definition.h"

namespace pirt {
namespace {

using test::Campaign;
using test::error_of;
using test::row;
using ::testing::AllOf;
using ::testing::Contains;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::IsSupersetOf;
using ::testing::Not;
using ::testing::SizeIs;
using ::testing::StartsWith;
using ::testing::UnorderedElementsAre;

// The mean over the frames: track_features has 4, with all, 3/4, half and a quarter of the corners.
TEST_F(Campaign, PlaysTheSequencesOfStatesAndLists) {
  const std::string streams = "^(track_features|background_model)$";
  const Profile profile = measure(options({{"gpu", ""}}, streams));
  EXPECT_EQ(summary.cells, 2);
  EXPECT_EQ(summary.rows_invalid, 0);
  const PhaseRow& background = row(profile, "background_model", Phase::kCall);
  EXPECT_THAT(background.notes, Contains("sequence of 8 frames"));
  EXPECT_EQ(background.ops, 4 * 640 * 480);
  EXPECT_EQ(background.bytes, find_workload("background_model").bytes());
  const PhaseRow& tracking = row(profile, "track_features", Phase::kCall);
  EXPECT_THAT(tracking.notes, Contains("sequence of 4 frames"));
  EXPECT_LT(tracking.bytes, find_workload("track_features").bytes());
  const Workload& workload = find_workload("track_features");
  const auto images = generated_images(1);
  std::int64_t ops = 0;
  for (int frame = 0; frame < 4; ++frame) {
    ops += workload.ops_of(workload.make_data({.seed = 1, .images = images.get(), .frame = frame}));
  }
  EXPECT_NEAR(static_cast<double>(tracking.ops.value()), static_cast<double>(ops) / 4, 1);
}

// Each frame is looked at, before timing and after it: calls 30 and on are wrong.
TEST_F(Campaign, JudgesSequencesBeforeAndAfterTiming) {
  const Profile before =
      measure(options({{"gpu", "wrong_output: [background_model]"}}, "background"));
  EXPECT_THAT(row(before, "background_model", Phase::kCall).reasons, Contains("wrong_output"));
  const Profile after =
      measure(options({{"gpu", "wrong_output_after: {background_model: 30}"}}, "background"));
  EXPECT_THAT(row(after, "background_model", Phase::kCall).reasons, Contains("wrong_output"));
}

TEST_F(Campaign, StoresEveryPhaseAsScripted) {
  const Profile profile = measure(options({{"gpu", R"(
device: scripted gpu
device_init_ms: 3
prepare_ms: {cold: 20, warm: 4}
stages:
  pool2: [{name: upload, ms: 0.5}, {name: launch, ms: 0.25}, {name: execute, ms: 2}, {name: download, ms: 1}]
)"}}));
  EXPECT_EQ(summary.cells, 2);
  EXPECT_EQ(summary.rows_valid, 18);  // 2 cells of 2 phases x 2 states + 5
  EXPECT_EQ(summary.rows_invalid, 0);
  EXPECT_FALSE(summary.interrupted);
  EXPECT_THAT(warnings, IsEmpty());

  // A call is 0.5 + 0.25 + 2 + 1 = 3.75 ms; preparing ends after one call: 20 + 3.75 and 4 + 3.75.
  EXPECT_EQ(row(profile, "pool2", Phase::kDeviceInit, State::kCold).median, from_ms(3));
  EXPECT_EQ(row(profile, "pool2", Phase::kDeviceInit, State::kWarm).median, from_ms(3));
  EXPECT_EQ(row(profile, "pool2", Phase::kPrepare, State::kCold).median, from_ms(23.75));
  EXPECT_EQ(row(profile, "pool2", Phase::kPrepare, State::kWarm).median, from_ms(7.75));
  EXPECT_EQ(row(profile, "pool2", Phase::kUpload).median, from_ms(0.5));
  EXPECT_EQ(row(profile, "pool2", Phase::kLaunch).median, from_ms(0.25));
  EXPECT_EQ(row(profile, "pool2", Phase::kExecute).median, from_ms(2));
  EXPECT_EQ(row(profile, "pool2", Phase::kDownload).median, from_ms(1));
  EXPECT_EQ(row(profile, "pool2", Phase::kCall).median, from_ms(3.75));
  for (const PhaseRow& r : profile.phases) {
    EXPECT_TRUE(is_valid(r));
    EXPECT_EQ(r.provenance, Provenance::kModelled);
    EXPECT_EQ(r.backend, "fake");
    EXPECT_THAT(r.notes, IsEmpty());
    EXPECT_GE(r.samples, r.state == State::kSteady ? 20 : 2);
  }
  // active_w 2 for 3.75 ms.
  EXPECT_DOUBLE_EQ(profile.find_energy("pool2", "gpu")->energy_j.value(), 2 * 0.00375);
  EXPECT_EQ(profile.find_unit("gpu")->device, "scripted gpu");
  EXPECT_NE(profile.runs.front().finished, "");
  const auto& facts = profile.runs.front().environment;
  EXPECT_EQ(facts.at("mode"), "quick");
  EXPECT_EQ(facts.at("images"), "generated, seed 1");
  EXPECT_THAT(facts,
              IsSupersetOf({std::pair<const std::string, std::string>("filter", "^pool[25]$")}));
}

TEST_F(Campaign, TakesTheStagesOfThePlatform) {
  auto o = options({{"gpu", "prepare_ms: 0"}}, "^pool5$");
  Stage execute{"", "gpu", {Distribution::Kind::kConstant, from_ms(7), from_ms(7)}};
  o.platform.workloads["pool5"].stages["gpu"] = {execute};
  const Profile profile = measure(o);
  EXPECT_EQ(row(profile, "pool5", Phase::kCall).median, from_ms(7));
  EXPECT_EQ(profile.find("pool5", "gpu", Phase::kUpload), nullptr);  // not among its stages
  o.platform.workloads["pool5"].stages["gpu"][0].name = "dma";
  EXPECT_THAT(error_of(ErrorCode::kBadInput, [&] { return plan_campaign(o); }),
              HasSubstr("stage 'dma' of a fake unit"));
}

TEST_F(Campaign, RepeatsExactlyFromTheSameSeed) {
  const std::string jitter = "stages: {pool5: [{name: execute, ms: {uniform: [1, 2]}}]}";
  auto o = options({{"gpu", jitter}}, "^pool5$");
  measure(o);
  measure(o);
  const auto first = load_samples(o.database, 1);
  const auto second = load_samples(o.database, 2);
  ASSERT_EQ(first.size(), second.size());
  for (std::size_t i = 0; i < first.size(); ++i) EXPECT_EQ(first[i].samples, second[i].samples);
}

TEST_F(Campaign, RowsOfALiveRunNeedTheMemoryThatTheOldOnesNeeded) {
  LiveRow live;
  live.replaced.workload = "pool5";
  live.replaced.unit = "gpu";
  live.replaced.host_memory_bytes = 10'000'000;
  live.replaced.device_memory_bytes = 2'000'000;
  live.samples[Phase::kCall] = test::ramp(1'000'000, 20);
  DeviceInfo device;
  device.name = "scripted";
  {
    ProfileWriter writer(folder / "p.db");
    write_live_rows(writer, test::fake_platform({{"gpu", ""}}), {{"gpu", device}}, 1, {&live, 1});
  }
  const Profile profile = load_profile(folder / "p.db");
  EXPECT_EQ(row(profile, "pool5", Phase::kCall).host_memory_bytes, 10'000'000);
  EXPECT_EQ(row(profile, "pool5", Phase::kCall).device_memory_bytes, 2'000'000);
}

TEST_F(Campaign, RowsOfALiveRunAreDoubtedWhenTheirCodeIsBuiltAnew) {
  own::Definition definition;
  definition.name = "my.live";
  definition.digest = "of then";
  definition.outputs = {own::tensor_from("out", "u8[4]")};
  definition.backends = {"cpu"};
  std::vector<Workload> one;
  one.push_back(own::to_workload(definition));
  make_known(std::move(one));
  LiveRow live;
  live.replaced.workload = "my.live";
  live.replaced.unit = "gpu";
  live.metered = true;
  live.samples[Phase::kCall] = test::ramp(1'000'000, 20);
  DeviceInfo device;
  device.name = "scripted";
  {
    ProfileWriter writer(folder / "p.db");
    write_live_rows(writer, test::fake_platform({{"gpu", ""}}), {{"gpu", device}}, 1, {&live, 1});
  }
  Profile profile = load_profile(folder / "p.db");
  EXPECT_EQ(doubt_changed(profile, {"my.live"}, "of then"), "");
  EXPECT_EQ(doubt_changed(profile, {"my.live"}, "of now"), "my.live");
  EXPECT_THAT(row(profile, "my.live", Phase::kCall).doubts, Contains(kChanged));
}

TEST_F(Campaign, MarksWrongOutputInvalidBeforeTiming) {
  const Profile profile = measure(options({{"gpu", "wrong_output: [pool2]"}}));
  for (const Phase phase :
       {Phase::kUpload, Phase::kLaunch, Phase::kExecute, Phase::kDownload, Phase::kCall}) {
    const PhaseRow& r = row(profile, "pool2", phase);
    EXPECT_FALSE(is_valid(r));
    EXPECT_THAT(r.reasons, ElementsAre("wrong_output"));
    EXPECT_EQ(r.samples, 0);  // a wrong computation is not timed
  }
  EXPECT_FALSE(is_valid(row(profile, "pool2", Phase::kPrepare, State::kWarm)));
  EXPECT_TRUE(is_valid(row(profile, "pool2", Phase::kDeviceInit, State::kWarm)));
  EXPECT_FALSE(is_valid(*profile.find_energy("pool2", "gpu")));
  EXPECT_TRUE(is_valid(row(profile, "pool5", Phase::kCall)));
  EXPECT_THAT(warnings, ElementsAre(AllOf(HasSubstr("pool2 on gpu: not valid"),
                                          HasSubstr("wrong_output"), HasSubstr("before timing"))));
}

TEST_F(Campaign, MarksWrongOutputInvalidAfterTiming) {
  // Preparing is the first call and verifying the second; the outputs go wrong in the midst of the
  // warm-up.
  const Profile profile = measure(options({{"gpu", "wrong_output_after: {pool5: 30}"}}, "^pool5$"));
  const PhaseRow& call = row(profile, "pool5", Phase::kCall);
  EXPECT_FALSE(is_valid(call));
  EXPECT_THAT(call.reasons, ElementsAre("wrong_output"));
  EXPECT_GE(call.samples, 20);   // timed already, kept and shown
  EXPECT_EQ(call.processes, 1);  // and no more of it
  EXPECT_EQ(row(profile, "pool5", Phase::kDeviceInit, State::kWarm).samples, 2);
}

TEST_F(Campaign, MarksNanAsWrongOutput) {
  const Profile profile = measure(options({{"gpu", "nan_output: [fc8]"}}, "^fc8$"));
  EXPECT_THAT(row(profile, "fc8", Phase::kCall).reasons, ElementsAre("wrong_output"));
}

TEST_F(Campaign, LosesOneCellToACrash) {
  const Profile profile = measure(options({{"gpu", "crash: [pool2]"}}));
  EXPECT_THAT(row(profile, "pool2", Phase::kCall).reasons,
              ElementsAre("error: worker crashed (SIGABRT) while preparing"));
  EXPECT_EQ(row(profile, "pool2", Phase::kCall).median, std::nullopt);
  EXPECT_FALSE(is_valid(row(profile, "pool2", Phase::kPrepare, State::kCold)));
  EXPECT_FALSE(is_valid(*profile.find_energy("pool2", "gpu")));
  EXPECT_TRUE(is_valid(row(profile, "pool5", Phase::kCall)));
  EXPECT_EQ(summary.rows_invalid, 9);
}

TEST_F(Campaign, LosesOneCellToAHang) {
  auto o = options({{"gpu", "hang: [pool2]"}});
  o.job_limit = std::chrono::seconds(3);
  const Profile profile = measure(o);
  EXPECT_THAT(row(profile, "pool2", Phase::kCall).reasons,
              ElementsAre("error: worker timed out after 3 s while preparing"));
  EXPECT_TRUE(is_valid(row(profile, "pool5", Phase::kCall)));
}

TEST_F(Campaign, TellsWhatTheBackendSaid) {
  const Profile profile =
      measure(options({{"gpu", "fail_prepare: [pool2]\nfail_execute: [pool5]"}}));
  EXPECT_THAT(row(profile, "pool2", Phase::kCall).reasons,
              ElementsAre("error: pool2: preparation fails as its script says (while preparing)"));
  EXPECT_THAT(row(profile, "pool5", Phase::kCall).reasons,
              ElementsAre(HasSubstr("pool5: execution fails as its script says")));
  // The device was opened all the same, once; two openings were asked for.
  const PhaseRow& init = row(profile, "pool2", Phase::kDeviceInit, State::kCold);
  EXPECT_FALSE(is_valid(init));
  EXPECT_EQ(init.samples, 1);
}

TEST_F(Campaign, SaysFewSamplesWhenTimeRunsOut) {
  auto o = options({{"gpu", "machine_ms: 200"}}, "^pool5$");
  o.job_limit = std::chrono::milliseconds(1600);
  const Profile profile = measure(o);
  // Half the limit is for sampling, on this machine's clock: 4 calls pass 0.8 s at the latest, in
  // each of 4 processes.
  EXPECT_LE(row(profile, "pool5", Phase::kCall).samples, 16);
  EXPECT_THAT(row(profile, "pool5", Phase::kCall).doubts, ElementsAre("few_samples"));
}

TEST_F(Campaign, NotesWhatDoesNotInvalidate) {
  auto o =
      options({{"gpu", "samples_ms: {pool5: [1, 1.3]}\nprocess_factors: [1, 1.04]"}}, "^pool5$");
  o.platform.units[0].shares_cores = true;
  o.precision_time = Nanos(1);
  const Profile profile = measure(o);
  const PhaseRow& call = row(profile, "pool5", Phase::kCall);
  EXPECT_TRUE(is_valid(call));
  EXPECT_THAT(call.notes, ElementsAre("precision_not_reached", "bimodal", "shared_core"));
  EXPECT_THAT(row(profile, "pool5", Phase::kPrepare, State::kCold).notes,
              ElementsAre("shared_core"));
}

TEST_F(Campaign, NotesThatPicturesWereResized) {
  PIRT_DATA_OR_SKIP(photos, "photos-darknet");
  auto o = options({{"gpu", ""}}, "^gaussian_blur$");
  o.images = photos;
  const Profile profile = measure(o);
  EXPECT_THAT(row(profile, "gaussian_blur", Phase::kCall).notes, Contains("input_resized"));
  EXPECT_THAT(row(profile, "gaussian_blur", Phase::kDeviceInit, State::kCold).notes, IsEmpty());
  EXPECT_THAT(profile.runs.front().environment.at("images"), HasSubstr("photos-darknet"));
}

TEST_F(Campaign, AppendsRunsAndTakesTheNewest) {
  measure(options({{"gpu", ""}}));
  const Profile profile = measure(options({{"gpu", "samples_ms: {pool5: [5]}"}}, "^pool5$"));
  EXPECT_EQ(row(profile, "pool5", Phase::kExecute).median, from_ms(5));
  EXPECT_EQ(row(profile, "pool5", Phase::kExecute).run_id, 2);
  EXPECT_EQ(row(profile, "pool2", Phase::kExecute).run_id, 1);
}

TEST_F(Campaign, LeavesNothingBehindButTheDatabase) {
  std::filesystem::create_directory(folder / "tmp");
  ::setenv("TMPDIR", (folder / "tmp").c_str(), 1);
  auto o = options({{"gpu", "crash: [pool2]"}});
  measure(o);
  ::unsetenv("TMPDIR");
  EXPECT_TRUE(std::filesystem::is_empty(folder / "tmp"));
  EXPECT_THAT(folder.entries(), ElementsAre("p.db", "tmp"));
  EXPECT_EQ(::waitpid(-1, nullptr, WNOHANG), -1);  // no child is left
}

TEST_F(Campaign, SkipsAUnitThatIsNotThere) {
  auto o = options({{"gpu", "fail_open: no such board, plug it in"}, {"cpu", ""}}, "^pool5$");
  const auto plan = plan_campaign(o);
  ASSERT_EQ(plan.skipped.size(), 1U);
  EXPECT_EQ(plan.skipped[0].unit, "gpu");
  EXPECT_EQ(plan.skipped[0].workload, "");
  EXPECT_THAT(plan.skipped[0].reason, StartsWith("no such board, plug it in"));
  ASSERT_EQ(plan.cells.size(), 1U);
  EXPECT_EQ(plan.cells[0].unit, "cpu");
  EXPECT_EQ(plan.units.size(), 1U);

  o.units = {"gpu"};  // named: then it is an error
  EXPECT_THAT(error_of(ErrorCode::kEnvironment, [&] { return plan_campaign(o); }),
              AllOf(HasSubstr("unit 'gpu' is not available"), HasSubstr("plug it in")));
  o.units.clear();
  o.platform.units.pop_back();  // nothing left: too
  EXPECT_THAT(error_of(ErrorCode::kEnvironment, [&] { return plan_campaign(o); }),
              HasSubstr("nothing can be measured: gpu: no such board"));
}

TEST_F(Campaign, SkipsWhatAUnitDoesNotSupport) {
  auto o = options({{"gpu", "unsupported: [pool2]"}});
  const auto plan = plan_campaign(o);
  ASSERT_EQ(plan.skipped.size(), 1U);
  EXPECT_EQ(plan.skipped[0].workload, "pool2");
  EXPECT_EQ(plan.skipped[0].reason, "excluded by the unit's script");
  EXPECT_EQ(plan.cells.size(), 1U);
  o.filter = "^pool2$";
  EXPECT_THAT(error_of(ErrorCode::kEnvironment, [&] { return plan_campaign(o); }),
              HasSubstr("nothing can be measured: pool2 on gpu: excluded"));
}

TEST_F(Campaign, RefusesBadArgumentsAndMakesNoDatabase) {
  const auto refused = [&](const std::function<void(CampaignOptions&)>& change) {
    auto o = options({{"gpu", ""}});
    UnitModel modelled;
    modelled.name = "cloud";
    o.platform.units.push_back(modelled);
    change(o);
    const auto message = error_of(ErrorCode::kBadInput, [&] { return plan_campaign(o); });
    EXPECT_THAT(folder.entries(), IsEmpty()) << message;
    return message;
  };
  EXPECT_THAT(refused([](auto& o) { o.filter = "sobl"; }),
              AllOf(HasSubstr("matches no workload"), HasSubstr("sobel")));
  EXPECT_THAT(refused([](auto& o) { o.filter = "["; }), HasSubstr("not a regular expression"));
  EXPECT_THAT(refused([](auto& o) { o.units = {"gpv"}; }), HasSubstr("gpu"));
  EXPECT_THAT(refused([](auto& o) { o.units = {"cloud"}; }), HasSubstr("nothing to measure"));
  EXPECT_THAT(refused([](auto& o) { o.platform.units.erase(o.platform.units.begin()); }),
              HasSubstr("has no unit to measure"));
  EXPECT_THAT(refused([](auto& o) { o.images = "/no/such/folder"; }), HasSubstr("/no/such/folder"));
  EXPECT_THAT(refused([](auto& o) { o.platform.units[0].backend = "fkae"; }), HasSubstr("fake"));
  EXPECT_THAT(refused([](auto& o) { o.platform.units[0].script = "devic: x"; }),
              AllOf(HasSubstr("devic"), HasSubstr("device")));
  for (const double precision : {0.0, 1.0, -0.1, std::nan("")}) {
    EXPECT_THAT(refused([&](auto& o) { o.precision = precision; }), HasSubstr("--precision"));
  }
}

TEST_F(Campaign, DoesNotTouchAFileThatIsNoDatabase) {
  const auto o = options({{"gpu", ""}});
  test::write_bytes(o.database, "my thesis");
  const auto plan = plan_campaign(o);
  EXPECT_THAT(error_of(ErrorCode::kBadInput, [&] { return run_campaign(o, plan); }),
              HasSubstr("not a profile database"));
  EXPECT_EQ(test::read_bytes(o.database), "my thesis");
}

TEST_F(Campaign, SaysThatNoWorkerCanBeStarted) {
  auto o = options({{"gpu", ""}});
  o.program = "/no/such/pirt";
  EXPECT_THAT(error_of(ErrorCode::kEnvironment, [&] { return plan_campaign(o); }),
              HasSubstr("cannot start '/no/such/pirt'"));
}

TEST_F(Campaign, MeasuresThisMachine) {
  auto o = options({}, "^pool5$");
  UnitModel cpu;
  cpu.name = "cpu";
  cpu.role = Role::kCpu;
  cpu.backend = "cpu";
  cpu.cores = {usable_cores().front()};
  cpu.active_w = 10;
  o.platform.units = {cpu};
  const Profile profile = measure(o);
  // How long it takes, and whether others disturb it, is not for a test to say; that it is right,
  // complete and marked is.
  const PhaseRow& call = row(profile, "pool5", Phase::kCall, State::kSteady, "cpu");
  EXPECT_EQ(call.provenance, Provenance::kMeasured);
  EXPECT_GE(call.samples, 20);
  EXPECT_GT(call.median.value(), Nanos(0));
  EXPECT_THAT(call.reasons, Not(Contains("wrong_output")));
  EXPECT_THAT(row(profile, "pool5", Phase::kPrepare, State::kCold, "cpu").notes,
              Contains("no_kernel_cache"));
  EXPECT_EQ(profile.find("pool5", "cpu", Phase::kUpload), nullptr);
  EXPECT_EQ(profile.find_energy("pool5", "cpu")->provenance, Provenance::kModelled);
  EXPECT_TRUE(profile.find_unit("cpu")->device_is_cpu);
  // Nobody else uses the core's own caches, as far as the machine tells their size.
  const PhaseRow* cold = profile.find_condition("pool5", "cpu", Condition::kColdCache);
  EXPECT_EQ(cold != nullptr, own_cache_bytes(cpu.cores).has_value());
  if (cold != nullptr) {
    EXPECT_GE(cold->samples, 20);
  }
}

// On a machine with one core there is nobody to be beside.
TEST_F(Campaign, MeasuresBesideTheUnitsOfTheSameMemory) {
  const auto cores = usable_cores();
  if (cores.size() < 2) GTEST_SKIP() << "one core";
  auto o = options({}, "^pool5$");
  UnitModel cpu;
  cpu.name = "cpu";
  cpu.role = Role::kCpu;
  cpu.backend = "cpu";
  cpu.memory = "dram";
  cpu.cores = {cores[0]};
  UnitModel other = cpu;
  other.name = "other";
  other.cores = {cores[1]};
  o.platform.units = {cpu, other};
  o.units = {"cpu"};
  const Profile alone = measure(o);
  EXPECT_EQ(alone.find_condition("pool5", "cpu", Condition::kBesideMemory), nullptr);
  o.interference = true;
  const Profile profile = measure(o);
  for (const Condition condition : {Condition::kBesideMemory, Condition::kBesideCompute}) {
    const PhaseRow* row = profile.find_condition("pool5", "cpu", condition);
    ASSERT_NE(row, nullptr) << to_string(condition);
    EXPECT_GE(row->samples, 20);
    EXPECT_EQ(row->phase, Phase::kExecute);
  }
  EXPECT_EQ(profile.find("pool5", "cpu", Phase::kExecute)->condition, Condition::kSteady);
}

TEST_F(Campaign, MeasuresTheLimitsOfEachUnit) {
  // fc8 has 8192000 operations: 8.192 ms at 1e9 a second; its 16 MB take 0.16 ms.
  const Profile profile = measure(options({{"gpu", R"(
cache_kb: 1000000
stages: {fc8: [{name: execute, ms: 16.384}]}
peaks_g_s: {f32: 1, bandwidth_l2: 100, bandwidth_memory: 50}
)"}},
                                          "^fc8$"));
  ASSERT_NE(profile.find_peak("gpu", PeakKind::kF32), nullptr);
  EXPECT_NEAR(*profile.find_peak("gpu", PeakKind::kF32)->per_second, 1e9, 1e3);
  EXPECT_EQ(profile.find_peak("gpu", PeakKind::kF32)->provenance, Provenance::kModelled);
  EXPECT_TRUE(is_valid(*profile.find_peak("gpu", PeakKind::kBandwidthMemory)));
  const PeakRow* int8 = profile.find_peak("gpu", PeakKind::kInt8);
  EXPECT_FALSE(int8->per_second.has_value());
  EXPECT_THAT(int8->reasons, ElementsAre("unavailable: the unit's script gives none"));
  const auto roofs = rooflines(profile);
  EXPECT_NEAR(roofs.find("fc8", "gpu")->fraction.value(), 0.5, 1e-6);
  EXPECT_THAT(warnings, IsEmpty());
}

TEST_F(Campaign, StoresAPeakThatACellExceedsAsNotValid) {
  const Profile profile = measure(options({{"gpu", R"(
stages: {fc8: [{name: execute, ms: 2}]}
peaks_g_s: {f32: 1, bandwidth_l2: 100}
)"}},
                                          "^fc8$"));
  const PeakRow* peak = profile.find_peak("gpu", PeakKind::kF32);
  EXPECT_FALSE(is_valid(*peak));
  EXPECT_THAT(peak->reasons, ElementsAre("exceeded by fc8"));
  EXPECT_TRUE(is_valid(*profile.find_peak("gpu", PeakKind::kBandwidthL2)));
  EXPECT_THAT(warnings, ElementsAre(HasSubstr("the f32 peak is not valid: exceeded by fc8")));
  EXPECT_FALSE(rooflines(profile).find("fc8", "gpu")->fraction.has_value());
}

TEST_F(Campaign, EndsWhereAUnitHasAnotherDeviceAndKeepsWhatWasMeasured) {
  auto o = options({}, "^pool5$");
  o.platform_argument = "fake";
  o.platform = load_platform("fake");
  o.units = {"gpu"};
  CampaignPlan plan = plan_campaign(o);
  ProgressSink sink;
  sink.progress = [&plan](const Progress& progress) {
    if (progress.step.starts_with("process 3")) plan.devices.front().version = "0";
  };
  EXPECT_THAT(error_of(ErrorCode::kEnvironment, [&] { return run_campaign(o, plan, sink); }),
              AllOf(HasSubstr("unit gpu has version '1' in place of '0' since run 1 began"),
                    HasSubstr("--resume")));
  EXPECT_THAT(find_unfinished_run(o.database).value().visits, SizeIs(2));
  // A peak is one of the device, too.
  plan = plan_campaign(o);
  plan.cells.clear();
  plan.devices.front().version = "0";
  EXPECT_THAT(error_of(ErrorCode::kEnvironment, [&] { return run_campaign(o, plan, {}); }),
              HasSubstr("unit gpu has version '1' in place of '0' since run 2 began"));
}

TEST_F(Campaign, EveryRecordedFactHasItsKind) {
  auto o = options({{"gpu", "cache_kb: 8"}});
  o.platform.assumptions = "watts";
  const RunInfo run = measure(o).runs.front();
  EXPECT_EQ(run.environment.at("unit.gpu.cache_bytes"), "8192");
  EXPECT_TRUE(run.environment.contains("end.load_1m"));  // written when the run ended
  for (const auto& [key, value] : run.environment) {
    EXPECT_NE(find_environment_key(key), nullptr) << key << " is not in environment_keys.cpp";
    EXPECT_NE(value, "") << key;
    EXPECT_EQ(run.identity.contains(key), fact_kind(key) == FactKind::kIdentity) << key;
  }
  EXPECT_THAT(compare_identity(run, run), IsEmpty());
}

}  // namespace
}  // namespace pirt
