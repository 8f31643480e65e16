#include "scheduler/record/run_record.h"

#include <filesystem>
#include <fstream>

#include "scheduler/record/interval.h"
#include "tests/scheduler/support.h"
#include "workloads/base/text/json.h"
#include "workloads/base/text/text.h"

namespace pirt::test {
namespace {

using testing::AllOf;
using testing::HasSubstr;

RunRecord sample() {
  ScheduleOptions options;
  options.mode = "advanced";
  options.duration = from_s(3);
  auto record = run_virtual(load_platform("fake"), nullptr, load_mix("full-robot"), options);
  record.warnings = {"a \"warning\"\nof two lines"};
  return record;
}

TEST(RunRecord, SurvivesTheWayThroughJson) {
  const auto record = sample();
  const auto json = to_json(record);
  EXPECT_EQ(run_record_from_json(parse_json(json_text(json)), "x"), record);
}

TEST(RunRecord, HasTheKeysThatOtherToolsRead) {
  const auto json = to_json(sample());
  for (const auto& key :
       split("schema_version mode platform mix time seed makespan_s drain_s stalled submitted "
             "completed dropped expired failed queued offloaded throughput_per_ms mean_latency_ms "
             "p99_latency_ms energy_j average_power_w units pipelines calls bounds gaps",
             ' ')) {
    EXPECT_TRUE(json.contains(key)) << key;
  }
  for (const char* key :
       {"completed", "mean_latency_ms", "p99_latency_ms", "busy_s", "utilization", "energy_j"}) {
    EXPECT_TRUE(json["units"]["gpu"].contains(key)) << key;
  }
  for (const char* key : {"fired", "completed", "dropped", "rate_hz", "p50_ms", "p95_ms", "p99_ms",
                          "unfinished", "deadline_misses"}) {
    EXPECT_TRUE(json["pipelines"]["localization"].contains(key)) << key;
  }
  EXPECT_EQ(json["time"], "virtual");
  EXPECT_EQ(json["basic"], "throughput");
  // What does not apply is absent.
  EXPECT_FALSE(json.contains("in_flight"));
  EXPECT_FALSE(json.contains("platform_file"));
  EXPECT_FALSE(json.contains("mix_file"));
  EXPECT_FALSE(json.contains("profile"));
  EXPECT_FALSE(json["bounds"].contains("makespan_s"));
  EXPECT_FALSE(json["pipelines"]["map_generation"].contains("deadline_misses"));
}

TEST(RunRecord, SaysWhichFilesPlatformAndMixWereReadFrom) {
  const auto folder = std::filesystem::path(testing::TempDir());
  const auto platform = folder / "pirt_run_record_test_platform.yaml";
  const auto mix = folder / "pirt_run_record_test_mix.yaml";
  std::ofstream(platform) << load_platform("snapdragon820").text;
  std::ofstream(mix) << "mix: mine\npipelines:\n"
                        "  p: {closed_loop: {frames: 3}, tasks: [{workload: convolution}]}\n";
  ScheduleOptions options;
  options.mode = "olb";
  const auto record = run_virtual(load_platform(platform.string()), nullptr,
                                  load_mix(std::filesystem::relative(mix).string()), options);
  EXPECT_EQ(record.platform_file, std::filesystem::absolute(platform).string());
  ASSERT_TRUE(record.mix_file);
  EXPECT_TRUE(std::filesystem::path(*record.mix_file).is_absolute()) << *record.mix_file;
  EXPECT_TRUE(std::filesystem::equivalent(*record.mix_file, mix)) << *record.mix_file;
  EXPECT_EQ(run_record_from_json(parse_json(json_text(to_json(record))), "x"), record);
  for (const auto& file : {platform, mix}) std::filesystem::remove(file);
}

TEST(RunRecord, SaysWhatChangedItsMachine) {
  ScheduleOptions options;
  options.mode = "olb";
  const auto mix = load_mix("convolution-1000");
  const auto plain = run_virtual(load_platform("snapdragon820"), nullptr, mix, options);
  options.without = {"gpu"};
  options.faults.emplace().seed = 7;
  options.faults->failing = 0.5;
  options.faults->returning = 0;
  options.slices = false;
  const auto changed =
      run_virtual(load_platform("snapdragon820", {{"cpu.active_w", "15"}}), nullptr, mix, options);
  EXPECT_TRUE(plain.settings.empty() && plain.besides.empty() && !plain.slices);
  EXPECT_EQ(changed.settings, std::vector<std::string>{"cpu.active_w=15"});
  EXPECT_EQ(changed.besides,
            (std::vector<std::string>{"--without gpu", "--faults seed=7,fail=0.5,return=0"}));
  EXPECT_EQ(changed.slices, false);
  EXPECT_TRUE(plain.platform_hash && changed.platform_hash);
  EXPECT_NE(plain.platform_hash, changed.platform_hash);
  EXPECT_EQ(run_record_from_json(to_json(changed), "x"), changed);
  auto cloud = load_platform("snapdragon820");
  cloud.settings = {"cloud.server=nats://me:secret@host"};
  EXPECT_EQ(run_virtual(cloud, nullptr, mix, options).settings,
            std::vector<std::string>{"cloud.server=nats://USER:PASSWORD@host"});
}

TEST(RunRecord, SaysWhatCallsTookOnAUnitThatNobodyElseUses) {
  // One frame at a time; on the GPU 3.80 + 0.70 + 2.605 ms.
  ScheduleOptions options;
  options.mode = "olb";
  options.in_flight = 1;
  const auto record =
      run_virtual(load_platform("snapdragon820"), nullptr, load_mix("convolution-1000"), options);
  std::int64_t completed = 0;
  for (const CallResult& call : record.calls) {
    EXPECT_EQ(call.workload, "convolution");
    const double alone_ms = call.unit == "cpu" ? 6.84 : call.unit == "gpu" ? 7.105 : 18.61;
    EXPECT_NEAR(call.p50_ms, alone_ms, 0.001 * alone_ms) << call.unit;
    EXPECT_NEAR(call.p95_ms, alone_ms, 0.001 * alone_ms) << call.unit;
    completed += call.completed;
  }
  EXPECT_EQ(completed, record.completed);
}

TEST(RunRecord, OfBeforeCallsWereCountedHasNone) {
  auto json = to_json(sample());
  json.erase("calls");
  EXPECT_TRUE(run_record_from_json(json, "x").calls.empty());
}

TEST(RunRecord, RefusesOtherVersionsAndOtherJson) {
  auto json = to_json(sample());
  const auto refused = [](const Json& each) {
    return bad_input([&] { static_cast<void>(run_record_from_json(each, "r.json")); });
  };
  json["schema_version"] = RunRecord::kSchemaVersion - 1;
  EXPECT_THAT(refused(json), AllOf(HasSubstr("r.json"), HasSubstr("schema_version 1")));
  json["schema_version"] = "2";
  EXPECT_THAT(refused(json), HasSubstr("not the result of a run"));
  EXPECT_THAT(refused(Json::array()), HasSubstr("not the result of a run"));
  json["schema_version"] = RunRecord::kSchemaVersion;
  json.erase("makespan_s");
  EXPECT_THAT(refused(json), AllOf(HasSubstr("not a complete"), HasSubstr("makespan_s")));
  json["makespan_s"] = "much";
  EXPECT_THAT(refused(json), HasSubstr("not a complete"));
  json = to_json(sample());
  json["time"] = "local";
  EXPECT_THAT(refused(json), AllOf(HasSubstr("time 'local'"), HasSubstr("virtual time or live")));
}

TEST(RunRecord, LoadsFromAFileAndSaysWhatIsWrongWithIt) {
  const auto path = std::filesystem::path(testing::TempDir()) / "pirt_run_record_test.json";
  std::ofstream(path) << json_text(to_json(sample()), 2);
  EXPECT_EQ(load_run_record(path), sample());
  std::ofstream(path) << "{\"mode\": ";
  EXPECT_THAT(bad_input([&] { static_cast<void>(load_run_record(path)); }),
              AllOf(HasSubstr(path.string()), HasSubstr("not JSON")));
  std::ofstream(path) << "{\"mode\": 1e999}";
  EXPECT_THAT(bad_input([&] { static_cast<void>(load_run_record(path)); }),
              AllOf(HasSubstr(path.string()), HasSubstr("1e999")));
  std::filesystem::remove(path);
  EXPECT_THAT(bad_input([&] { static_cast<void>(load_run_record(path)); }),
              HasSubstr(path.string()));
}

TEST(IntervalsOf, AFigureThatTheFirstRedrawDoesNotHaveHasOneToo) {
  const std::vector<RunFigures> redrawn = {{}, {{"a", 1.0}}, {{"a", 3.0}}};
  EXPECT_EQ(intervals_of(redrawn).at("a"), (FigureInterval{1, 3}));
}

}  // namespace
}  // namespace pirt::test
