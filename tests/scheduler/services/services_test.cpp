// Services from platform files and from profiles.
#include "scheduler/services/services.h"

#include "scheduler/services/call_plan.h"
#include "scheduler/services/conditions.h"
#include "tests/scheduler/profile_rows.h"
#include "tests/scheduler/support.h"

namespace pirt::test {
namespace {

using testing::AllOf;
using testing::Contains;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

const std::string kPlatform = R"(
platform: board
units:
  cpu: {backend: fake, slots: 1, active_w: 4, energy: {op_pj: 100, byte_pj: 10}}
  gpu: {backend: fake, slots: 1, active_w: 2}
  cloud: {}
workloads:
  fc8:
    gpu: [{on: cpu, ms: 2, name: setup}, {delay_ms: 1}, {on: gpu, ms: {uniform: [4, 8]}, name: execute}]
    cloud: [{delay_ms: 50}]
    call_j: {cloud: 0.25, gpu: 0.5}
    provenance: published
)";

PhaseRow row(const std::string& unit, Phase phase, std::int64_t ns, bool valid = true) {
  PhaseRow row = row_of("fc8", unit, phase, Nanos(ns));
  if (!valid) row.reasons = {"wrong_output"};
  return row;
}

ServiceTable services_of(const Profile* profile, const ServiceOptions& options = {}) {
  return resolve_services(platform_of(kPlatform), profile, {"fc8"}, options);
}

TEST(Services, TakeStagesAndEnergyFromThePlatform) {
  const auto table = services_of(nullptr);
  const Service& gpu = *table.find(0, 1);
  ASSERT_EQ(gpu.stages.size(), 3U);
  EXPECT_EQ(gpu.stages[0].on, UnitId{0});
  EXPECT_FALSE(gpu.stages[1].on);
  EXPECT_EQ(gpu.stages[1].name, "delay");
  EXPECT_EQ(gpu.total(), from_ms(9));  // 2 + 1 + the mean of [4, 8].
  const auto platform = platform_of(kPlatform);
  const CallPlan call = plan_call(platform, table, 0, 1, {});
  EXPECT_EQ(call.takes(Taken::kMean), gpu.total());
  EXPECT_EQ(call.bottleneck(1), from_ms(6));
  EXPECT_EQ(call.bottleneck(0), from_ms(2));
  EXPECT_EQ(gpu.time_provenance, Provenance::kPublished);
  EXPECT_DOUBLE_EQ(gpu.extra_j, 0.5);
  const Service& cloud = *table.find(0, 2);
  // No stage on itself: the longest of all.
  EXPECT_EQ(plan_call(platform, table, 0, 2, {}).bottleneck(2), from_ms(50));
  EXPECT_DOUBLE_EQ(cloud.extra_j, 0.25);
  EXPECT_EQ(table.find(0, 0), nullptr);
  EXPECT_EQ(table.entries[0][0].reason, "no profile given");
  EXPECT_EQ(table.units_of(0), unit_bit(1) | unit_bit(2));
}

TEST(Services, TakeMedianP95OrSamplesOfTheRows) {
  PhaseRow execute = row("cpu", Phase::kExecute, 100);
  execute.p95 = Nanos(190);
  execute.values = {Nanos(90), Nanos(100), Nanos(110), Nanos(200)};
  const Profile profile = profile_of({execute});
  const auto time_of = [&](Draw draw) {
    return services_of(&profile, {.given = {}, .stage_scale = {}, .without = {}, .draw = draw})
        .find(0, 0)
        ->stages.at(0)
        .time;
  };
  EXPECT_EQ(time_of(Draw::kMedian), Distribution::constant(Nanos(100)));
  EXPECT_EQ(time_of(Draw::kP95), Distribution::constant(Nanos(190)));
  const auto samples = time_of(Draw::kSamples);
  EXPECT_EQ(samples.mean(), Nanos(125));  // What policies, plans and weights expect.
  EXPECT_EQ(samples.low, Nanos(90));      // What bounds go by.
  EXPECT_EQ(samples.high, Nanos(200));
  // Even numbers of draws of each sample, and of nothing else.
  std::map<Nanos, int> drawn;
  for (std::uint64_t random = 0; random < 40; ++random) ++drawn[samples.draw(random)];
  EXPECT_EQ(drawn, (std::map<Nanos, int>{
                       {Nanos(90), 10}, {Nanos(100), 10}, {Nanos(110), 10}, {Nanos(200), 10}}));
}

TEST(Services, PowerTheMeanOfARowWhateverIsDrawn) {
  PhaseRow execute = row("cpu", Phase::kExecute, 100);
  execute.p95 = Nanos(250);
  execute.values = {Nanos(50), Nanos(100), Nanos(110), Nanos(240)};
  execute.mean = Nanos(125);
  const auto powered = [&](Draw draw) {
    const Profile profile = profile_of({execute});
    const auto table = services_of(
        &profile, {.given = {}, .stage_scale = {{"cpu.execute", 3}}, .without = {}, .draw = draw});
    const ServiceStage& stage = table.find(0, 0)->stages.at(0);
    return to_s(stage.time.mean()) * stage.energy_scale;
  };
  for (const Draw draw : {Draw::kMedian, Draw::kP95, Draw::kSamples}) {
    EXPECT_NEAR(powered(draw), 125e-9, 1e-15) << to_string(draw);
  }
  execute.mean.reset();
  EXPECT_NEAR(powered(Draw::kMedian), 100e-9, 1e-15) << "nothing else is known";
  EXPECT_EQ(services_of(nullptr).find(0, 1)->stages.at(0).energy_scale, 1) << "as it stands there";
}

TEST(Services, OfStagesOfSeveralProvenancesAreMixturesOfTheWeakest) {
  // Counted cycles between measured transfers, in whatever order the weakest one comes.
  for (const Phase weak : {Phase::kUpload, Phase::kExecute, Phase::kDownload}) {
    std::vector<PhaseRow> rows;
    for (const Phase phase : {Phase::kUpload, Phase::kExecute, Phase::kDownload}) {
      rows.push_back(row("gpu", phase, 100));
      rows.back().provenance = phase == weak ? Provenance::kCounted : Provenance::kMeasured;
    }
    const Profile profile = profile_of(rows);
    const auto table = services_of(&profile);
    EXPECT_EQ(table.find(0, 1)->time_provenance, Origin(Provenance::kCounted, true));
    EXPECT_EQ(table.find(0, 1)->energy_provenance, Origin(Provenance::kModelled, true))
        << "watts are modelled";
  }
  PhaseRow published = row("gpu", Phase::kCall, 100);
  published.provenance = Provenance::kPublished;
  const Profile profile = profile_of({published});
  EXPECT_EQ(services_of(&profile).find(0, 1)->energy_provenance, Provenance::kPublished);
}

TEST(Services, NameTheWaysToDraw) {
  for (const auto& name : draw_names()) EXPECT_EQ(to_string(find_draw(name)), name);
  EXPECT_THAT(bad_input([] { static_cast<void>(find_draw("sample")); }),
              AllOf(HasSubstr("'sample'"), HasSubstr("samples")));
}

TEST(Services, ScaleTimesAndNotEnergy) {
  ServiceOptions options;
  options.stage_scale = {{"gpu.execute", 1.5}};
  const auto table = services_of(nullptr, options);
  EXPECT_EQ(table.find(0, 1)->total(), from_ms(12));
  EXPECT_EQ(table.find(0, 1)->stages[2].time.low, from_ms(4));
}

TEST(Services, TakeTheProfilesPhasesBeforeThePlatformsStages) {
  const Profile profile =
      profile_of({row("gpu", Phase::kUpload, 100), row("gpu", Phase::kLaunch, 20),
                  row("gpu", Phase::kExecute, 3000), row("gpu", Phase::kDownload, 80),
                  row("gpu", Phase::kCall, 3300), row("cpu", Phase::kCall, 5000)});
  const auto table = services_of(&profile);
  const Service& gpu = *table.find(0, 1);
  ASSERT_EQ(gpu.stages.size(), 4U);
  EXPECT_EQ(gpu.stages[2].name, "execute");
  EXPECT_EQ(gpu.stages[2].on, UnitId{1});
  EXPECT_EQ(gpu.total(), Nanos(3200));
  EXPECT_EQ(gpu.time_provenance, Provenance::kMeasured);
  EXPECT_DOUBLE_EQ(gpu.extra_j, 0.5);  // The platform's call_j still counts.
  const Service& cpu = *table.find(0, 0);
  ASSERT_EQ(cpu.stages.size(), 1U);
  EXPECT_EQ(cpu.stages[0].name, "call");
  // fc8: 8192000 operations at 100 pJ = 0.8192 mJ; bytes at 10 pJ: input 4096, weights 4096000,
  // bias 1000, output 1000 floats = 4102096 * 4 = 16408384 bytes = 0.16408384 mJ.
  EXPECT_NEAR(cpu.extra_j, 0.8192e-3 + 0.16408384e-3, 1e-12);
  EXPECT_THAT(table.warnings, IsEmpty());
}

TEST(Services, RefuseInvalidRowsWithAWarning) {
  const Profile profile =
      profile_of({row("gpu", Phase::kExecute, 3000, false), row("cpu", Phase::kCall, 5000)});
  const auto table = services_of(&profile);
  EXPECT_EQ(table.find(0, 1),
            nullptr);  // Not even by the platform's stages: its figures are known to be wrong.
  EXPECT_THAT(table.entries[0][1].reason, AllOf(HasSubstr("execute"), HasSubstr("wrong_output")));
  EXPECT_THAT(table.warnings, Contains(AllOf(HasSubstr("fc8 on gpu"), HasSubstr("not used"))));
}

TEST(Services, BelieveTheCallAsAWholeWhenItSaysThatTheOutputIsWrong) {
  const Profile profile =
      profile_of({row("gpu", Phase::kExecute, 3000), row("gpu", Phase::kCall, 3100, false)});
  const auto table = services_of(&profile);
  EXPECT_EQ(table.find(0, 1), nullptr);
  EXPECT_THAT(table.entries[0][1].reason, HasSubstr("call row is invalid"));
}

TEST(Services, TakeNoCallFromTransfersAlone) {
  // An upload without its execute is not a call; the platform's stages remain.
  const Profile profile = profile_of({row("gpu", Phase::kUpload, 100)});
  EXPECT_EQ(services_of(&profile).find(0, 1)->total(), from_ms(9));
}

/// With an interval from @p low to @p high times its median.
PhaseRow doubted(PhaseRow row, double low, double high) {
  row.doubts = {"contended"};
  row.ci_low = scaled(*row.median, low);
  row.ci_high = scaled(*row.median, high);
  row.p95 = scaled(*row.median, 1.1);
  return row;
}

TEST(Services, UseDoubtedRowsAndSayHowFarTheyAreKnown) {
  const Profile profile = profile_of(
      {doubted(row("gpu", Phase::kCall, 3000), 0.5, 1.5), row("cpu", Phase::kCall, 100)});
  const auto table = services_of(&profile);
  const Service& service = *table.find(0, 1);
  EXPECT_EQ(service.total(), Nanos(3000));
  EXPECT_THAT(service.doubts, ElementsAre("contended"));
  EXPECT_DOUBLE_EQ(service.spread.low, 0.5);
  EXPECT_DOUBLE_EQ(service.spread.high, 1.5);
  EXPECT_EQ(service.stages.front().usual(), Nanos(4500)) << "where its median may be";
  EXPECT_TRUE(table.find(0, 0)->doubts.empty());
  ServiceOptions options;
  options.strict = true;
  const auto strict = services_of(&profile, options);
  EXPECT_EQ(strict.find(0, 1), nullptr);
  EXPECT_THAT(strict.entries[0][1].reason,
              HasSubstr("doubted (contended), which --strict refuses"));
}

TEST(Services, UseWhatSaysNothingOfTheOrderOfUnitsWhereNothingElseServes) {
  const auto wild = doubted(row("gpu", Phase::kCall, 3000), 0.4, 2);
  EXPECT_TRUE(wild.is_wild());
  const Profile profile = profile_of({wild, row("cpu", Phase::kCall, 100'000)});
  const Platform platform = platform_of(kPlatform);
  const Mix mix = parse_mix("mix.yaml",
                            "mix: m\npipelines:\n  a: {rate_hz: 1, tasks: [{workload: fc8}]}\n"
                            "  b: {rate_hz: 1, tasks: [{workload: fc8, eligible: [gpu]}]}\n");
  const auto scenario = make_scenario(platform, &profile, mix, {}, CloudUse::kAll);
  // The cloud is not asked for its time; gpu is left where the mix wants it and nothing else.
  EXPECT_EQ(scenario.classes[0][0].eligible, unit_bit(0) | unit_bit(2));
  EXPECT_EQ(scenario.classes[1][0].eligible, unit_bit(1));
  EXPECT_THAT(scenario.services.warnings, Contains(HasSubstr("fc8 on gpu is not used")));
}

TEST(Services, SayWhatStrictCountsAsNothing) {
  Profile profile = profile_of({row("cpu", Phase::kCall, 3000)});
  UnitTimeRow handover;
  handover.unit = "cpu";
  handover.phase = UnitPhase::kHandover;
  handover.median = Nanos(1000);
  handover.doubts = {"contended"};
  profile.unit_times = {handover};
  PhaseRow cold = doubted(row("gpu", Phase::kExecute, 4000), 0.5, 1.5);
  cold.condition = Condition::kColdCache;
  profile.conditions = {cold};
  ServiceOptions options;
  EXPECT_THAT(services_of(&profile, options).warnings, IsEmpty());
  options.strict = true;
  EXPECT_THAT(services_of(&profile, options).warnings,
              ElementsAre(HasSubstr("counted as nothing: 2, of cpu, gpu")));
}

TEST(Services, DoNotTakeAnExceededPeakForWhatACallWaitsFor) {
  PhaseRow steady = row("cpu", Phase::kExecute, 4000);
  steady.ops = 1;
  steady.bytes = 1000;
  Profile profile = profile_of({steady});
  steady.condition = Condition::kColdCache;
  profile.conditions = {steady};
  for (const PeakKind kind : {PeakKind::kBandwidthMemory, PeakKind::kF32}) {
    PeakRow peak;
    peak.unit = "cpu";
    peak.kind = kind;
    peak.per_second = 1e9;
    profile.peaks.push_back(peak);
  }
  const auto streams = [&] {
    return call_conditions(profile, "fc8", "cpu", 1000, Draw::kMedian, false).value().streams;
  };
  EXPECT_TRUE(streams());
  profile.peaks.front().reasons = {"exceeded by fc8"};
  EXPECT_FALSE(streams());
}

TEST(Services, ModelEnergyAnewButBelieveAMeter) {
  EnergyRow modelled;
  modelled.workload = "fc8";
  modelled.unit = "cpu";
  modelled.energy_j = 99;
  EnergyRow metered = modelled;
  metered.unit = "gpu";
  metered.energy_j = 0.125;
  metered.provenance = Provenance::kMeasured;
  Profile profile = profile_of({row("cpu", Phase::kCall, 5000), row("gpu", Phase::kCall, 5000)});
  profile.energies = {modelled, metered};
  const auto table = services_of(&profile);
  EXPECT_FALSE(table.find(0, 0)->metered_j);
  EXPECT_EQ(table.find(0, 0)->energy_provenance, Provenance::kModelled);
  EXPECT_EQ(table.find(0, 1)->metered_j, 0.125);
  EXPECT_EQ(table.find(0, 1)->energy_provenance, Provenance::kMeasured);
}

TEST(Services, SayHowFarAMetersJoulesAreKnown) {
  EnergyRow metered;
  metered.workload = "fc8";
  metered.unit = "gpu";
  metered.energy_j = 0.125;
  metered.ci_low_j = 0.0625;
  metered.ci_high_j = 0.25;
  metered.provenance = Provenance::kMeasured;
  metered.doubts = {"unstable: 5 W idle before and 9 W after"};
  Profile profile = profile_of({row("gpu", Phase::kCall, 5000)});
  profile.energies = {metered};
  ServiceOptions options;
  const auto table = services_of(&profile, options);
  EXPECT_EQ(table.find(0, 1)->joules.low, 0.5);
  EXPECT_EQ(table.find(0, 1)->joules.high, 2);
  EXPECT_THAT(table.find(0, 1)->doubts, IsEmpty()) << "its time is not doubted";
  EXPECT_THAT(table.warnings,
              Contains("1 figures of metered energy are uncertain (unstable), and used as they "
                       "are: of gpu"));
  options.strict = true;
  EXPECT_THAT(services_of(&profile, options).warnings,
              Contains(HasSubstr("its metered energy is not used")));
}

TEST(Services, RefuseAProfileOfAnotherPlatform) {
  Profile profile = profile_of({row("gpu", Phase::kCall, 1)});
  profile.runs[0].platform = "elsewhere";
  EXPECT_THAT(bad_input([&] { static_cast<void>(services_of(&profile)); }),
              AllOf(HasSubstr("elsewhere"), HasSubstr("board")));
}

}  // namespace
}  // namespace pirt::test
