// Units that hold one program at a time, live beside virtual time: the same calls load another one,
// as a phase of their own in record and trace.
#include <filesystem>

#include "scheduler/schedule_live.h"
#include "scheduler/trace/replay.h"
#include "scheduler/trace/trace_document.h"
#include "tests/scheduler/support.h"
#include "workloads/base/text/text.h"

namespace pirt::test {
namespace {

using testing::ElementsAre;

const std::string kWorkloads = R"(
workloads:
  gaussian_blur: {fpga: [{on: fpga, ms: 3, name: execute}]}
  sobel: {fpga: [{on: fpga, ms: 1, name: execute}]}
)";
const std::string kPaced =
    "platform: board\nunits: {fpga: {contexts: {prepare_ms: 2}, active_w: 2}}\n" + kWorkloads;
const std::string kComputed =
    "platform: board\nunits: {fpga: {backend: fake, contexts: {prepare_ms: 2}, active_w: 2}}\n" +
    kWorkloads;

/// Two calls of gaussian_blur and one of sobel, one after the other.
constexpr const char* kMix = R"(
mix: m
pipelines:
  p:
    closed_loop: {frames: 3}
    tasks:
      - {name: a, workload: gaussian_blur}
      - {name: b, workload: gaussian_blur, after: [a]}
      - {name: c, workload: sobel, after: [b]}
)";

struct Outcomes {
  RunRecord record;
  std::vector<std::string> prepared;  ///< Workloads of the slices `prepare`, in order.
};

/// @param live  Null = in virtual time.
Outcomes run(const std::string& board, const char* mix, const LiveOptions* live,
             std::optional<Faults> faults = {}) {
  const auto path = std::filesystem::path(testing::TempDir()) / "pirt_live_contexts.json";
  ScheduleOptions options;
  options.mode = "ect";
  options.in_flight = 1;
  options.faults = faults;
  options.trace = path.string();
  const Platform platform = platform_of(board);
  Outcomes result;
  result.record = live != nullptr ? pirt::run_live(platform, nullptr, mix_of(mix), options, *live)
                                  : run_virtual(platform, nullptr, mix_of(mix), options);
  EXPECT_FALSE(replay_file(path).result.difference);
  const Json trace = parse_trace(read_file(path.string()));
  std::filesystem::remove(path);
  for (const Json& event : trace.at("traceEvents")) {
    if (event.value("name", "") == "prepare") result.prepared.push_back(event.at("cat"));
  }
  return result;
}

// What is there at first is of the mix's first task: blur blur SOBEL, BLUR blur SOBEL, twice more.
TEST(LiveContexts, TheSameCallsLoadAnotherOneAsInVirtualTime) {
  for (const std::string& board : {kPaced, kComputed}) {
    SCOPED_TRACE(board);
    const LiveOptions how;
    const Outcomes virtually = run(board, kMix, nullptr);
    const Outcomes lively = run(board, kMix, &how);
    for (const Outcomes& each : {virtually, lively}) {
      EXPECT_EQ(each.record.completed, 9);
      EXPECT_EQ(each.record.units[0].prepares, 5);
      EXPECT_THAT(each.prepared,
                  ElementsAre("sobel", "gaussian_blur", "sobel", "gaussian_blur", "sobel"));
      EXPECT_GT(each.record.units[0].prepare_s.value(), 0);
      EXPECT_LT(each.record.units[0].prepare_s.value(), each.record.units[0].busy_s);
      EXPECT_EQ(run_record_from_json(to_json(each.record), "r"), each.record);
    }
    // Five times the file's 2 ms; who computes, prepares as long as that takes.
    EXPECT_DOUBLE_EQ(virtually.record.units[0].prepare_s.value(), 0.010);
    if (board == kPaced) {
      EXPECT_DOUBLE_EQ(lively.record.units[0].prepare_s.value(), 0.010);
    }
  }
}

constexpr const char* kPrograms = "prepare_ms: 2, programs: {vision: [gaussian_blur, sobel]}";

TEST(LiveContexts, WorkloadsOfOneProgramAreLoadedTogetherAsInVirtualTime) {
  constexpr const char* kThree = R"(
mix: m
pipelines:
  p:
    closed_loop: {frames: 2}
    tasks:
      - {name: a, workload: gaussian_blur}
      - {name: b, workload: sobel, after: [a]}
      - {name: c, workload: fc8, after: [b]}
)";
  for (const std::string& board : {kPaced, kComputed}) {
    std::string with = board + "  fc8: {fpga: [{on: fpga, ms: 1, name: execute}]}\n";
    with.replace(with.find("prepare_ms: 2"), std::string("prepare_ms: 2").size(), kPrograms);
    LiveOptions how;
    const Outcomes lively = run(with, kThree, &how);
    const Outcomes virtually = run(with, kThree, nullptr);
    EXPECT_THAT(virtually.prepared, ElementsAre("fc8", "gaussian_blur", "fc8"));
    EXPECT_EQ(virtually.prepared, lively.prepared);
  }
}

// 3 ms and 1 ms, whether or not 2 ms of loading came before.
TEST(LiveContexts, WhatACallTakesIsWithoutItsLoading) {
  const LiveOptions how;
  for (const Outcomes& each : {run(kPaced, kMix, nullptr), run(kPaced, kMix, &how)}) {
    ASSERT_EQ(each.record.calls.size(), 2U);
    EXPECT_EQ(each.record.calls[1].workload, "sobel");
    EXPECT_GE(each.record.calls[1].p50_ms, 0.999);
  }
  EXPECT_NEAR(run(kPaced, kMix, nullptr).record.calls[1].p95_ms, 1, 0.001);
}

TEST(LiveContexts, WithoutPreparingBeforehandTheFirstCallLoadsToo) {
  LiveOptions how;
  how.prepare_first = false;
  const Outcomes run = test::run(kComputed, kMix, &how);
  EXPECT_EQ(run.record.units[0].prepares, 6);
  EXPECT_THAT(run.prepared, ElementsAre("gaussian_blur", "sobel", "gaussian_blur", "sobel",
                                        "gaussian_blur", "sobel"));
}

// A call that is given back or fails has loaded all the same, and the next one finds it there.
TEST(LiveContexts, CallsThatDoNotCompleteLoadAsWell) {
  const LiveOptions how;
  const Faults faults{.seed = 3, .failing = 0.2, .returning = 0.3};
  for (const std::string& board : {kPaced, kComputed}) {
    const Outcomes virtually = run(board, kMix, nullptr, faults);
    const Outcomes lively = run(board, kMix, &how, faults);
    EXPECT_GT(virtually.record.failed + virtually.record.returned.value(), 0);
    EXPECT_EQ(virtually.record.failed, lively.record.failed);
    EXPECT_EQ(virtually.record.returned, lively.record.returned);
    EXPECT_EQ(virtually.prepared, lively.prepared);
  }
}

/// What each call of the workload with a state made.
std::vector<std::vector<std::byte>> models(const std::string& contexts) {
  std::vector<std::vector<std::byte>> made;
  LiveOptions how;
  how.sink = [&](const Firings::TaskPlace& place, std::span<const Tensor> outputs) {
    if (place.task != 0) return;
    const auto bytes = outputs[0].used_bytes();
    made.emplace_back(bytes.begin(), bytes.end());
  };
  const Outcomes run =
      test::run("platform: board\nunits: {fpga: {backend: fake, slots: 1, " + contexts +
                    "active_w: 2}}\nworkloads:\n"
                    "  background_model: {fpga: [{on: fpga, ms: 3, name: execute}]}\n"
                    "  sobel: {fpga: [{on: fpga, ms: 1, name: execute}]}\n",
                R"(
mix: m
pipelines:
  p:
    closed_loop: {frames: 4}
    tasks: [{name: model, workload: background_model}, {workload: sobel, after: [model]}]
)",
                &how);
  EXPECT_EQ(run.record.completed, 8);
  return made;
}

TEST(LiveContexts, AStateOutlivesTheLoadingOfAnotherOne) {
  const auto held = models("");
  const auto loaded = models("contexts: {prepare_ms: 2}, ");
  EXPECT_EQ(held.size(), 4U);
  EXPECT_EQ((held == loaded), true);
}

}  // namespace
}  // namespace pirt::test
