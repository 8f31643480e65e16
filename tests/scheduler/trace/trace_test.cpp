// Traces: tracks, flows and counters as Perfetto reads them; replays that decide alike; and files
// that are not traces.
#include <fmt/format.h>

#include <filesystem>
#include <fstream>
#include <map>
#include <nlohmann/json.hpp>

#include "scheduler/trace/replay.h"
#include "scheduler/trace/trace_document.h"
#include "scheduler/trace/trace_file.h"
#include "tests/scheduler/support.h"
#include "tests/scheduler/trace_log.h"
#include "workloads/base/math/random.h"
#include "workloads/base/text/text.h"

namespace pirt::test {
namespace {

using nlohmann::json;
using testing::AllOf;
using testing::HasSubstr;

class Traces : public testing::Test {
 protected:
  Traces() {
    folder_ = std::filesystem::path(testing::TempDir()) /
              ("pirt_trace_" +
               std::string(testing::UnitTest::GetInstance()->current_test_info()->name()));
    std::filesystem::remove_all(folder_);
    std::filesystem::create_directories(folder_);
  }
  ~Traces() override { std::filesystem::remove_all(folder_); }

  RunRecord run(const Platform& platform, const Mix& mix, const std::string& mode,
                ScheduleOptions options = {}) {
    options.mode = mode;
    if (mix.open_loop() && !options.duration) options.duration = from_s(0.5);
    options.trace = path();
    return run_virtual(platform, nullptr, mix, options);
  }
  std::string path() const { return (folder_ / "t.json").string(); }
  /// As one value, as parse_trace has it.
  json trace() const { return json::parse(json_text(parse_trace(read_file(path())))); }
  ReplayResult replay_of(const std::string& text) const {
    write_file(path(), text);
    return replay_file(path()).result;
  }
  std::size_t files() const {
    return static_cast<std::size_t>(
        std::distance(std::filesystem::directory_iterator(folder_), {}));
  }

  std::filesystem::path folder_;
};

/// Chains, deadlines, expiry and image buffers, so that tasks are dropped and expire as well.
Mix busy_mix() {
  return mix_of(R"(
mix: busy
image_buffers: 6
pipelines:
  vision:
    rate_hz: 90
    expires_ms: 45
    tasks:
      - {name: a, workload: undistort, image_input: true}
      - {name: b, workload: gaussian_blur, after: [a], image_input: true}
      - {name: c, workload: feature_detect, after: [a]}
      - {name: d, workload: fc8, after: [b, c]}
  frames: {closed_loop: {frames: 30}, tasks: [{workload: convolution}]}
  planner: {rate_hz: 40, deadline_ms: 20, tasks: [{workload: fc8}]}
)");
}

/// One unit with one slot, on which a task takes so many milliseconds.
Platform one_slot(int ms) {
  return platform_of(
      fmt::format("platform: p\nunits: {{cpu: {{slots: 1}}}}\n"
                  "workloads: {{fc8: {{cpu: [{{on: cpu, ms: {}}}]}}}}",
                  ms));
}

std::int64_t ns(const json& us) { return std::llround(us.get<double>() * 1e3); }

struct Slice {
  std::int64_t begin = 0, end = 0;
};
using Track = std::pair<int, int>;  ///< Process and thread.

std::map<Track, std::vector<Slice>> slices_of(const json& trace) {
  std::map<Track, std::vector<Slice>> tracks;
  for (const auto& event : trace["traceEvents"]) {
    if (event["ph"] != "X") continue;
    const auto begin = ns(event["ts"]);
    tracks[{event["pid"], event["tid"]}].push_back({begin, begin + ns(event["dur"])});
  }
  for (auto& [track, slices] : tracks) std::ranges::sort(slices, {}, &Slice::begin);
  return tracks;
}

TEST_F(Traces, HaveATrackASlotWithoutOverlaps) {
  for (const auto& mode : policy_names()) {
    const auto platform = load_platform("fake");
    const auto record = run(platform, busy_mix(), mode);
    std::int64_t slices = 0;
    for (const auto& [track, list] : slices_of(trace())) {
      // Units with one slot have one track.
      const auto& unit = platform.units.at(static_cast<std::size_t>(track.first) - 1);
      EXPECT_LT(track.second, unit.slots.value_or(1'000'000)) << unit.name;
      for (std::size_t i = 0; i < list.size(); ++i) {
        const auto before = i == 0 ? 0 : list[i - 1].end;
        ASSERT_LE(before, list[i].begin) << mode << " on " << unit.name;
        ++slices;
      }
    }
    // What was unfinished at the duration ran in the drain, or expired.
    EXPECT_GE(slices, record.completed) << mode;
    EXPECT_LE(slices, record.completed + record.queued) << mode;
  }
}

TEST_F(Traces, ShareTheSlotsOfAUnit) {
  // Four slots, and in throughput mode four frames on the GPU.
  run(load_platform("snapdragon820"), load_mix("convolution-1000"), "throughput");
  const auto tracks = slices_of(trace());
  EXPECT_EQ(tracks.size(), 3U + 4U);  // CPU 3, GPU 4; no DSP.
}

TEST_F(Traces, HaveAFlowForEachDependencyWithinTheSlices) {
  const auto record = run(load_platform("fake"), busy_mix(), "ect");
  const auto all = trace();
  const auto tracks = slices_of(all);
  std::map<int, int> begins, ends;
  for (const auto& event : all["traceEvents"]) {
    if (event["ph"] != "s" && event["ph"] != "f") continue;
    const bool begin = event["ph"] == "s";
    const auto at = ns(event["ts"]);
    ++(begin ? begins : ends)[event["id"]];
    const auto& slices = tracks.at({event["pid"], event["tid"]});
    const bool inside = std::ranges::any_of(slices, [&](const Slice& slice) {
      return begin ? slice.begin <= at && at < slice.end : slice.begin == at;
    });
    EXPECT_TRUE(inside) << event;
  }
  EXPECT_EQ(begins, ends);
  for (const auto& [id, count] : begins) EXPECT_EQ(count, 1) << id;
  // Four edges a firing of `vision` that completed; those that expired half-way have fewer.
  EXPECT_GE(begins.size(), 4 * static_cast<std::size_t>(record.pipelines[0].completed));
  EXPECT_GT(record.pipelines[0].completed, 10);
  EXPECT_LE(begins.size(), 4 * static_cast<std::size_t>(record.pipelines[0].fired));
}

TEST_F(Traces, HaveAPowerCounterWhoseAreaIsTheEnergy) {
  const auto area_j = [](const json& trace) {
    double sum = 0;
    double watts = 0;
    double since_us = 0;
    for (const auto& event : trace["traceEvents"]) {
      if (event["ph"] != "C" || event["name"] != "power W") continue;
      const double at_us = event["ts"];
      sum += watts * (at_us - since_us) * 1e-6;
      since_us = at_us;
      watts = 0;
      for (const auto& [unit, value] : event["args"].items()) watts += value.get<double>();
    }
    EXPECT_EQ(watts, 0) << "the run has an end";
    return sum;
  };
  // Shared cores, stages on other units, delays; energy mode scales a stage at constant energy.
  for (const char* mode : {"throughput", "energy"}) {
    auto platform = load_platform("snapdragon820");
    platform.units[2].idle_w = 0.01;
    const auto record = run(platform, load_mix("convolution-1000"), mode);
    EXPECT_NEAR(area_j(trace()), record.energy_j.value(), 1e-6 * *record.energy_j) << mode;
  }
}

TEST_F(Traces, CountTheTasksThatWait) {
  // One unit, one slot, three frames at once, weight 2: one runs, one is queued, one held.
  ScheduleOptions options;
  options.in_flight = 3;
  run(one_slot(10),
      mix_of("mix: m\npipelines: {p: {closed_loop: {frames: 3}, tasks: [{workload: fc8}]}}"),
      "throughput", options);
  std::vector<std::string> depths;
  const auto all = trace();
  for (const auto& event : all["traceEvents"]) {
    if (event["name"] != "queue depth") continue;
    depths.push_back(std::to_string(ns(event["ts"]) / 1'000'000) +
                     " ms: " + std::to_string(event["args"]["cpu"].get<int>()) + " queued, " +
                     std::to_string(event["args"]["in no queue"].get<int>()) + " in none");
  }
  EXPECT_EQ(depths,
            (std::vector<std::string>{"0 ms: 1 queued, 1 in none", "10 ms: 1 queued, 0 in none",
                                      "20 ms: 0 queued, 0 in none"}));
}

// What mode budget foresees, waits for and keeps to comes from its inputs alone.
TEST_F(Traces, ReplayTheForesightOfABudget) {
  ScheduleOptions options;
  options.duration = from_s(5);
  options.power_cap_w = 1;
  const auto platform = parse_platform(
      "one.yaml", "platform: one\nunits: {cpu: {slots: 1, active_w: 2, idle_w: 0.5}}\n", {}, 4);
  const auto mix = parse_mix("m.yaml", R"(
mix: m
pipelines:
  planning:
    rate_hz: 10
    jitter_ms: 20
    deadline_ms: 6
    tasks: [{name: a, service_ms: {cpu: 1}}]
  mapping: {rate_hz: 100, tasks: [{name: a, service_ms: {cpu: 8}}]}
)");
  const auto record = run(platform, mix, "budget", options);
  EXPECT_GT(record.completed, 150);
  EXPECT_EQ(record.pipelines[0].deadline_misses, 0);
  const auto log = load_trace_log(path());
  EXPECT_TRUE(log.setup.policy.budget.window_j);
  const auto wakes = std::ranges::count_if(log.entries, [](const LogEntry& entry) {
    return entry.input.kind == DispatcherInput::Kind::kWake;
  });
  EXPECT_GT(wakes, 10);
  const auto result = replay_file(path()).result;
  EXPECT_FALSE(result.difference);
  EXPECT_GT(result.decisions, 150);
}

TEST_F(Traces, ReplayToTheSameDecisionsInEveryMode) {
  std::int64_t ends = 0;
  for (const auto& mode : policy_names()) {
    const auto record = run(load_platform("fake"), busy_mix(), mode);
    const auto log = load_trace_log(path());
    for (const auto& entry : log.entries)
      ends += static_cast<std::int64_t>(entry.effects.ended.size());
    const auto result = replay_file(path()).result;
    EXPECT_FALSE(result.difference) << mode;
    EXPECT_EQ(result.inputs, static_cast<std::int64_t>(log.entries.size()));
    EXPECT_GE(result.decisions, record.completed) << mode;
    EXPECT_GT(record.completed, 50) << mode;
    // Laid out anew, the same.
    write_file(path(), trace().dump(1));
    const FileReplay again = replay_file(path());
    EXPECT_FALSE(again.result.difference) << mode;
    EXPECT_EQ(again.result.decisions, result.decisions);
    EXPECT_EQ(again.size, log.entries.size());
  }
  EXPECT_GT(ends, 0) << "nothing was dropped or expired, so that was not compared";
}

TEST_F(Traces, DoNotChangeTheRun) {
  const auto platform = load_platform("fake");
  ScheduleOptions options;
  options.mode = "advanced";
  options.duration = from_s(0.5);
  const auto without = run_virtual(platform, nullptr, busy_mix(), options);
  EXPECT_EQ(run(platform, busy_mix(), "advanced"), without);
}

TEST_F(Traces, ReplayFindsAnAlteredDecision) {
  run(load_platform("fake"), busy_mix(), "throughput");
  const auto good = trace();
  auto altered = good;
  auto& log = altered["pirt"]["log"];
  std::size_t at = log.size() / 2;
  while (!log[at].contains("start")) ++at;
  auto& unit = log[at]["start"][0][1];
  unit = (unit.get<int>() + 1) % 3;
  auto result = replay_of(altered.dump());
  ASSERT_TRUE(result.difference);
  EXPECT_EQ(result.difference->entry, at);
  EXPECT_NE(result.difference->recorded, result.difference->replayed);
  EXPECT_THAT(result.difference->recorded, HasSubstr("starts task"));

  // A decision that is missing, and weights that are not those of the run.
  altered = good;
  altered["pirt"]["log"][at].erase("start");
  result = replay_of(altered.dump());
  ASSERT_TRUE(result.difference);
  EXPECT_EQ(result.difference->recorded, "nothing");
  altered = good;
  for (auto& row : altered["pirt"]["policy"]["weights"]) row = {1, 0, 1, 0};
  EXPECT_TRUE(replay_of(altered.dump()).difference);
}

TEST_F(Traces, ThatAreDamagedAreRefused) {
  run(load_platform("fake"), busy_mix(), "edf");
  const auto refused = [&](const std::string& each) {
    return bad_input([&] { static_cast<void>(replay_of(each)); });
  };
  const auto text = trace().dump();
  EXPECT_THAT(refused(text.substr(0, text.size() / 2)), HasSubstr("t.json"));
  EXPECT_THAT(refused("{}"), AllOf(HasSubstr("t.json"), HasSubstr("--trace")));
  EXPECT_THAT(refused("{\"traceEvents\": [], \"pirt\": 3}"), HasSubstr("not a complete trace"));
  const auto with = [&](const auto& change) {
    auto each = json::parse(text);
    change(each["pirt"]);
    return refused(each.dump());
  };
  EXPECT_THAT(with([](json& part) { part["schema_version"] = 9; }), HasSubstr("schema_version 9"));
  EXPECT_THAT(with([](json& part) { part["mode"] = "edff"; }), HasSubstr("edf"));
  EXPECT_THAT(with([](json& part) { part.erase("slots"); }), HasSubstr("slots"));
  EXPECT_THAT(with([](json& part) { part["slots"] = json::array(); }), HasSubstr("slots"));
  EXPECT_THAT(with([](json& part) { part["policy"]["costs"][0].erase(0); }), HasSubstr("costs"));
  EXPECT_THAT(with([](json& part) { part["log"].erase(part["log"].size() - 1); }),
              HasSubstr("as long"));
  EXPECT_THAT(with([](json& part) { part["log"][0]["in"] = "sumbit"; }), HasSubstr("sumbit"));
  EXPECT_THAT(with([](json& part) { part["log"][3]["at"] = -1; }),
              AllOf(HasSubstr("input 4"), HasSubstr("before the begin")));
  EXPECT_THAT(with([](json& part) { part["log"][0]["tasks"][0]["deadline"] = -5; }),
              HasSubstr("before the begin"));
  EXPECT_THAT(with([](json& part) {
                part["policy"]["costs"][0][0] = {-1, -1, 0, "modelled"};
              }),
              HasSubstr("before the begin"));
  EXPECT_THAT(with([](json& part) { part["log"][0]["ids"][0] = -7; }),
              HasSubstr("no whole number"));
  const auto with_class = [&](std::size_t position, std::uint64_t value) {
    return with([=](json& part) { part["log"][0]["tasks"][0]["class"][position] = value; });
  };
  EXPECT_THAT(with_class(1, 1U << 20), HasSubstr("no unit"));
  EXPECT_THAT(with_class(0, 99), HasSubstr("no workload"));
  EXPECT_THAT(with_class(0, std::uint64_t{1} << 32), HasSubstr("no whole number"));
}

TEST_F(Traces, ReplayFindsAnInputThatIsRefused) {
  run(load_platform("fake"), busy_mix(), "edf");
  auto altered = trace();
  auto& log = altered["pirt"]["log"];
  std::size_t at = 0;
  while (log[at]["in"] != "complete") ++at;
  log[at]["unit"] = 7;
  auto result = replay_of(altered.dump());
  ASSERT_TRUE(result.difference);
  EXPECT_EQ(result.difference->entry, at);
  EXPECT_EQ(result.difference->replayed, "refuses it");
  // And one that a driver saw refused is replayed as that.
  for (const char* key : {"start", "end"}) log[at].erase(key);
  log[at]["refused"] = true;
  result = replay_of(altered.dump());
  ASSERT_TRUE(result.difference);
  EXPECT_GT(result.difference->entry, at);
}

TEST_F(Traces, RunThroughTheDrainAndMarkTheDuration) {
  // 100 Hz for 50 ms of 30 ms each: the five end at 150 ms.
  ScheduleOptions options;
  options.duration = from_s(0.05);
  const auto record =
      run(one_slot(30), mix_of("mix: m\npipelines: {p: {rate_hz: 100, tasks: [{workload: fc8}]}}"),
          "throughput", options);
  EXPECT_EQ(record.completed, 1);
  const auto all = trace();
  std::int64_t last = 0;
  std::vector<std::int64_t> marks;
  for (const auto& event : all["traceEvents"]) {
    if (event["ph"] == "X") last = std::max(last, ns(event["ts"]) + ns(event["dur"]));
    if (event["ph"] == "i" && event["s"] == "g") marks.push_back(ns(event["ts"]));
  }
  EXPECT_EQ(last, 150'000'000);
  EXPECT_EQ(marks, std::vector<std::int64_t>{50'000'000});
}

TEST_F(Traces, HoldNamesThatAreNotUtf8) {
  // A platform that was put together by a program.
  auto platform = one_slot(30);
  platform.name = "p\xff";
  run(platform,
      mix_of("mix: m\npipelines: {p: {closed_loop: {frames: 2}, tasks: [{workload: fc8}]}}"),
      "throughput");
  EXPECT_FALSE(replay_file(path()).result.difference);
}

TEST_F(Traces, AreNeverHalfWritten) {
  std::ofstream(path()) << "what was there";
  // The run is refused after the options were read: no such weights.
  ScheduleOptions options;
  options.weights = {{"npu", 1}};
  EXPECT_THAT(bad_input([&] { run(load_platform("fake"), busy_mix(), "throughput", options); }),
              HasSubstr("npu"));
  EXPECT_EQ(read_file(path()), "what was there");
  {
    TraceFile file(path(), Json::object());
    file.event("{}");  // And then something throws.
  }
  EXPECT_EQ(read_file(path()), "what was there");
  EXPECT_EQ(files(), 1U);
  const auto refused = [](const std::filesystem::path& path) {
    return bad_input([&] { TraceFile(path, Json::object()); });
  };
  EXPECT_THAT(refused(folder_ / "none" / "t.json"), HasSubstr("none"));
  EXPECT_THAT(refused("/dev/full"), HasSubstr("/dev/full"));
  run(load_platform("fake"), busy_mix(), "ect");
  EXPECT_EQ(files(), 1U);
  EXPECT_TRUE(trace().contains("pirt"));
}

TEST_F(Traces, ThatCannotBeCompletedSayIt) {
  std::filesystem::create_directories(folder_ / "sub");
  TraceFile file(folder_ / "sub" / "t.json", Json::object({{"a", 1}}));
  file.event("{}");
  std::filesystem::remove_all(folder_ / "sub");
  EXPECT_THAT(bad_input([&] { file.finish(); }), HasSubstr("t.json"));
}

}  // namespace
}  // namespace pirt::test
