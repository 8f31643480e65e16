// A trace that another thread writes is the one that is written on the spot, however far that
// thread is behind.
#include "scheduler/trace/trace_thread.h"

#include <filesystem>

#include "scheduler/policies/setup.h"
#include "scheduler/trace/replay.h"
#include "scheduler/virtual/virtual_time.h"
#include "tests/scheduler/support.h"
#include "workloads/base/text/text.h"

namespace pirt::test {
namespace {

/// Data along ports and from earlier firings, a state, expiry, contexts, calls that are given back.
constexpr const char* kBoard = R"(
platform: board
units:
  gpu: {slots: 2, active_w: 1}
  fpga: {contexts: {prepare_ms: 1}, active_w: 1}
  dsp: {servers: 2, discipline: processor_sharing, active_w: 1, link: bus}
links: {bus: {mbit_s: 1000, latency_ms: 0.1, active_w: 1}}
workloads:
  undistort: {gpu: [{on: gpu, ms: 0.5}], fpga: [{on: fpga, ms: 1}], dsp: [{on: dsp, ms: 2}]}
  gaussian_blur: {gpu: [{on: gpu, ms: 0.5}], fpga: [{on: fpga, ms: 1}], dsp: [{on: dsp, ms: 2}]}
  background_model: {gpu: [{on: gpu, ms: 0.5}], dsp: [{on: dsp, ms: 2}]}
)";
constexpr const char* kMix = R"(
mix: m
image_buffers: 6
pipelines:
  p:
    closed_loop: {frames: 3000}
    tasks:
      - {name: undistort, workload: undistort, image_input: true}
      - {name: late, workload: gaussian_blur, inputs: {image: undistort.image@-1}}
      - {name: model, workload: background_model, inputs: {image: undistort.image}}
)";

std::string trace_of(bool thread) {
  const auto path = std::filesystem::path(testing::TempDir()) / "pirt_trace_thread.json";
  const Platform platform = platform_of(kBoard);
  const Mix mix = mix_of(kMix);
  ScheduleOptions options;
  options.mode = "ect";
  options.in_flight = 5;
  options.faults = Faults{.seed = 5};
  ModeSetup setup = set_up_mode(platform, nullptr, mix, options);
  Dispatcher dispatcher(setup.slots, std::move(setup.policy));
  TraceWriter writer(path, setup.scenario,
                     {&setup.mode.policy, platform.unit_names(), setup.slots, setup.policy_setup});
  if (thread) {
    TraceThread aside(writer);
    dispatcher.observe(&aside);
    writer.finish([&] {
      const Tally tally = VirtualTime(setup.scenario, dispatcher, &aside).run();
      aside.finish();
      return tally;
    }());
  } else {
    dispatcher.observe(&writer);
    writer.finish(VirtualTime(setup.scenario, dispatcher, &writer).run());
  }
  EXPECT_FALSE(replay(load_trace_log(path), path).difference);
  std::string text = read_file(path.string(), kAnySize);
  std::filesystem::remove(path);
  return text;
}

TEST(TraceThread, WritesWhatIsWrittenOnTheSpot) {
  const std::string here = trace_of(false);
  EXPECT_GT(here.size(), 4'000'000U);  // More events than are ever kept.
  EXPECT_EQ(here == trace_of(true), true);
}

TEST(TraceThread, LeavesNothingBehindIfTheRunDoesNotEnd) {
  const auto folder = std::filesystem::path(testing::TempDir()) / "pirt_trace_thread";
  std::filesystem::create_directories(folder);
  const Platform platform = platform_of(kBoard);
  const Mix mix = mix_of(kMix);
  ScheduleOptions options;
  options.mode = "ect";
  ModeSetup setup = set_up_mode(platform, nullptr, mix, options);
  Dispatcher dispatcher(setup.slots, std::move(setup.policy));
  {
    TraceWriter writer(
        folder / "t.json", setup.scenario,
        {&setup.mode.policy, platform.unit_names(), setup.slots, setup.policy_setup});
    TraceThread aside(writer);
    dispatcher.observe(&aside);
    VirtualTime time(setup.scenario, dispatcher, &aside);
    time.begin();
    for (int i = 0; i < 100; ++i) EXPECT_TRUE(time.advance());
  }
  EXPECT_TRUE(std::filesystem::is_empty(folder));
  std::filesystem::remove_all(folder);
}

}  // namespace
}  // namespace pirt::test
