// Mixes run live: what is computed is what a serial run computes, counts balance whatever fails,
// and the trace replays. But for one, no test looks at how long anything took.
#include <atomic>
#include <map>

#include "scheduler/runtime/kernel_unit.h"
#include "scheduler/schedule_live.h"
#include "scheduler/trace/replay.h"
#include "scheduler/virtual/virtual_time.h"
#include "tests/scheduler/support.h"
#include "tests/support/optional_backend.h"
#include "tests/workloads/catalog/workload_support.h"
#include "workloads/backends/registry.h"
#include "workloads/catalog/catalog.h"

namespace pirt::test {
namespace {

using testing::AllOf;
using testing::Contains;
using testing::EndsWith;
using testing::HasSubstr;
using testing::Not;

/// Two units that compute on one core each, as far as there are two, and a paced one.
constexpr const char* kBoard = R"(
platform: board
units:
  gpu: {backend: cpu, cores: first_half, slots: 1, active_w: 1}
  cpu: {backend: cpu, cores: second_half, slots: 1, active_w: 1}
  dsp: {servers: 2, discipline: processor_sharing, active_w: 1}
workloads:
  undistort: {gpu: [{on: gpu, ms: 0.5}], cpu: [{on: cpu, ms: 0.5}]}
  gaussian_blur: {gpu: [{on: gpu, ms: 0.1}], cpu: [{on: cpu, ms: 0.1}]}
  background_model: {gpu: [{on: gpu, ms: 0.2}], cpu: [{on: cpu, ms: 0.2}]}
  sobel: {dsp: [{on: dsp, ms: 0.3}]}
)";

constexpr const char* kMix = R"(
mix: m
image_buffers: 6
pipelines:
  p:
    closed_loop: {frames: 20}
    tasks:
      - {name: undistort, workload: undistort, image_input: true}
      - {name: blur, workload: gaussian_blur, inputs: {image: undistort.image}}
      - {name: late, workload: gaussian_blur, inputs: {image: undistort.image@-1}}
      - {name: model, workload: background_model, inputs: {image: blur.image}}
  q:
    closed_loop: {frames: 10}
    tasks: [{workload: sobel}]
)";

/// By task and firing, the bytes of what it made.
using Outputs = std::map<std::pair<std::uint32_t, std::uint64_t>, std::vector<std::byte>>;

std::vector<std::byte> bytes_of(std::span<const Tensor> tensors) {
  std::vector<std::byte> all;
  for (const Tensor& tensor : tensors) {
    const auto bytes = tensor.used_bytes();
    all.insert(all.end(), bytes.begin(), bytes.end());
  }
  return all;
}

RunRecord live(const Mix& mix, const std::string& mode, Outputs& outputs,
               const std::string& trace = "", const char* board = kBoard,
               bool prepare_first = true) {
  ScheduleOptions options;
  options.mode = mode;
  options.in_flight = 3;
  if (!trace.empty()) options.trace = trace;
  LiveOptions live;
  live.prepare_first = prepare_first;
  live.sink = [&](const Firings::TaskPlace& place, std::span<const Tensor> made) {
    if (place.pipeline == 0) outputs[{place.task, place.firing}] = bytes_of(made);
  };
  return run_live(parse_platform("test.yaml", board, {}, 1), nullptr, mix, options, live);
}

/// One call after the other, on one device.
class Serial {
 public:
  std::vector<Tensor> call(const Workload& workload, std::vector<Tensor> inputs,
                           StateValue* state = nullptr) {
    auto& kernel = kernels_[&workload];
    if (kernel == nullptr) {
      kernel = device_->prepare(workload, data_of_seed_1(workload).parameters);
    }
    std::vector<Tensor> outputs = make_tensors(workload.outputs);
    kernel->bind(inputs, outputs);
    if (state != nullptr) kernel->bind_state(state->committed(), state->next());
    kernel->upload();
    kernel->execute(1);
    kernel->download();
    if (state != nullptr) state->commit(0);
    return outputs;
  }

 private:
  std::unique_ptr<Device> device_ = find_backend("cpu").open(UnitRequest{"cpu", {}, {}, {}});
  std::map<const Workload*, std::unique_ptr<Kernel>> kernels_;
};

std::vector<Tensor> first_of(const std::vector<Tensor>& made) {
  std::vector<Tensor> inputs;
  inputs.push_back(made[0].share());
  return inputs;
}

/// The pipeline p of kMix.
Outputs serial() {
  const Workload& undistort = find_workload("undistort");
  const Workload& blur = find_workload("gaussian_blur");
  const Workload& model = find_workload("background_model");
  Serial cpu;
  StateValue state(model);
  std::vector<Tensor> before;
  Outputs outputs;
  for (std::uint64_t firing = 0; firing < 20; ++firing) {
    auto undistorted = cpu.call(undistort, data_of_seed_1(undistort).inputs);
    const auto blurred = cpu.call(blur, first_of(undistorted));
    outputs[{0, firing}] = bytes_of(undistorted);
    outputs[{1, firing}] = bytes_of(blurred);
    if (firing > 0) outputs[{2, firing}] = bytes_of(cpu.call(blur, first_of(before)));
    outputs[{3, firing}] = bytes_of(cpu.call(model, first_of(blurred), &state));
    before = std::move(undistorted);
  }
  return outputs;
}

TEST(Live, ComputesWhatASerialRunComputes) {
  Outputs outputs;
  const RunRecord run = live(mix_of(kMix), "ect", outputs);
  EXPECT_EQ(run.time, "live");
  EXPECT_EQ(run.submitted, 90);
  EXPECT_EQ(run.completed, 89);
  EXPECT_EQ(run.no_predecessor, 1);
  EXPECT_TRUE(run.set_up_s.has_value());
  EXPECT_FALSE(run.calls.empty());
  for (const CallResult& call : run.calls) {
    if (!run.find_unit(call.unit)->backend) continue;  // Paced: it makes no calls.
    ASSERT_TRUE(call.upload_ms && call.execute_ms && call.download_ms) << call.workload;
    EXPECT_GT(*call.execute_ms, 0) << call.workload;
    EXPECT_LE(*call.execute_ms, call.p95_ms * 1.01) << call.workload;
  }
  const Outputs expected = serial();
  ASSERT_EQ(outputs.size(), expected.size());
  for (const auto& [which, bytes] : expected) {
    EXPECT_EQ(outputs[which] == bytes, true)
        << "task " << which.first << ", firing " << which.second;
  }
}

/// A core and a cloud, with the robot's own work.
constexpr const char* kRobot = R"(
platform: robot
units:
  cpu: {backend: cpu, cores: first_half, slots: 1, active_w: 1}
  cloud: {role: cloud}
workloads:
  imu_propagate: {cpu: [{on: cpu, ms: 1}]}
  update_pose: {cpu: [{on: cpu, ms: 1}]}
  extend_map: {cpu: [{on: cpu, ms: 1}]}
  plan_path: {cpu: [{on: cpu, ms: 1}]}
  avoid_obstacles: {cpu: [{on: cpu, ms: 1}]}
  detect_objects: {cpu: [{on: cpu, ms: 10}]}
  describe_scene: {cpu: [{on: cpu, ms: 10}], cloud: [{delay_ms: 5, name: offload}]}
  bundle_adjust: {cpu: [{on: cpu, ms: 50}]}
)";

constexpr const char* kRobotMix = R"(
mix: m
pipelines:
  localization:
    closed_loop: {frames: 10}
    tasks:
      - {name: imu, workload: imu_propagate, state: motion}
      - {name: pose, workload: update_pose, state: pose, after: [imu]}
      - {name: map, workload: extend_map, state: map, after: [pose]}
  plans:
    closed_loop: {frames: 9}
    tasks: [{name: plan, workload: plan_path}, {name: avoid, workload: avoid_obstacles}]
  objects:
    closed_loop: {frames: 2}
    tasks: [{name: detect, workload: detect_objects}]
  offline:
    closed_loop: {frames: 2}
    real_time: false
    tasks: [{name: describe, workload: describe_scene}, {name: adjust, workload: bundle_adjust}]
)";

// A recorded step fits the state that it was recorded from, and no other: a filter that has gone on
// follows other tracks.
TEST(Live, SequencesBeginAnewWithTheirStates) {
  for (const char* mode : {"ect", "advanced"}) {
    SCOPED_TRACE(mode);
    std::map<std::pair<std::string, std::uint64_t>, std::vector<std::byte>> outputs;
    const Mix mix = mix_of(kRobotMix);
    ScheduleOptions options;
    options.mode = mode;
    LiveOptions how;
    how.time_limit = std::chrono::minutes(10);  // Sanitizers are slow, and other tests run beside.
    how.sink = [&](const Firings::TaskPlace& place, std::span<const Tensor> made) {
      const MixTask& task = mix.pipelines[place.pipeline].tasks[place.task];
      outputs[{task.name, place.firing}] = bytes_of(made);
    };
    const RunRecord run =
        run_live(parse_platform("test.yaml", kRobot, {}, 1), nullptr, mix, options, how);
    EXPECT_EQ(run.failed, 0) << testing::PrintToString(run.warnings);
    EXPECT_EQ(run.completed, 54);
    const bool advanced = std::string(mode) == "advanced";
    EXPECT_EQ(run.offloaded, advanced ? 2 : 0);
    const auto said = Contains(HasSubstr("offline is not real-time, but no unit of role cloud"));
    EXPECT_EQ(testing::Matches(said)(run.warnings), advanced);
    for (const auto& [task, frames] :
         {std::pair("imu", 8U), {"pose", 1U}, {"map", 1U}, {"plan", 8U}}) {
      EXPECT_EQ((outputs[{task, 0}] == outputs[{task, frames}]), true) << task;
      EXPECT_EQ((outputs[{task, 0}] == outputs[{task, 3}]), frames == 1) << task;
    }
  }
}

TEST(Live, TheTraceOfEveryModeReplays) {
  const std::string trace = testing::TempDir() + "/live_trace.json";
  for (const std::string& mode : policy_names()) {
    SCOPED_TRACE(mode);
    Outputs outputs;
    RunRecord run;
    try {
      run = live(mix_of(kMix), mode, outputs, trace);
    } catch (const Error& error) {
      EXPECT_THAT(error.what(), HasSubstr("mode"));  // It would never place the sobel.
      continue;
    }
    EXPECT_EQ(run.completed + run.dropped, 90);
    const ReplayResult again = replay_file(trace).result;
    EXPECT_FALSE(again.difference) << again.difference->input << ": " << again.difference->recorded
                                   << " / " << again.difference->replayed;
  }
}

TEST(Live, ACallThatThrowsFailsByNameAndNothingIsLost) {
  Outputs outputs;
  const RunRecord run = live(mix_of(R"(
mix: m
pipelines:
  p:
    closed_loop: {frames: 5}
    tasks:
      - {workload: gaussian_blur}
      - {name: next, workload: gaussian_blur, inputs: {image: gaussian_blur.image}}
)"),
                             "met", outputs, "", R"(
platform: board
units:
  cpu: {backend: fake, active_w: 1, script: {clock: wall, fail_execute: [gaussian_blur]}}
workloads:
  gaussian_blur: {cpu: [{on: cpu, ms: 0.1, name: execute}]}
)",
                             false);  // Otherwise it fails before anything is fired.
  EXPECT_EQ(run.failed, 5);
  EXPECT_EQ(run.dropped, 5);
  EXPECT_EQ(run.pipelines[0].dropped, 5);
  EXPECT_THAT(run.warnings, Contains(HasSubstr("failed: gaussian_blur on cpu")));
}

TEST(Live, AListOfALowerCapacityIsTakenWhereAHigherOneFits) {
  PIRT_BACKEND_OR_SKIP("opencl");
  Outputs outputs;
  const RunRecord run = live(mix_of(R"(
mix: m
pipelines:
  p:
    closed_loop: {frames: 3}
    tasks:
      - {name: features, workload: extract_features}
      - {name: track, workload: track_features, inputs: {corners: features.pixels}}
)"),
                             "met", outputs, "", R"(
platform: board
units:
  gpu: {backend: opencl, slots: 1, active_w: 1}
workloads:
  extract_features: {gpu: [{on: gpu, ms: 5}]}
  track_features: {gpu: [{on: gpu, ms: 5}]}
)");
  EXPECT_EQ(run.completed, 6) << testing::PrintToString(run.warnings);
}

/// One unit hangs at its first call, the other computes.
constexpr const char* kHanging = R"(
platform: board
units:
  gpu: {backend: fake, slots: 2, active_w: 1, script: {clock: wall, hang: [background_model]}}
  cpu: {backend: cpu, cores: all, slots: 1, active_w: 1}
workloads:
  background_model: {gpu: [{on: gpu, ms: 0.01, name: execute}], cpu: [{on: cpu, ms: 5}]}
)";
constexpr const char* kHangingMix = R"(
mix: m
pipelines:
  p:
    closed_loop: {frames: 12}
    tasks: [{name: model, workload: background_model}]
)";

/// What firings of kHangingMix made that completed is what a serial run makes of these.
void expect_serial(const Outputs& outputs) {
  const Workload& model = find_workload("background_model");
  Serial cpu;
  StateValue state(model);
  const std::vector<Data> frames = sequence_of(model);
  for (const auto& [which, bytes] : outputs) {
    const auto frame = which.second % frames.size();
    if (frame == 0) state.restart();  // As the sequence does.
    const auto made = cpu.call(model, copy_tensors(frames[frame].inputs), &state);
    EXPECT_TRUE(bytes == bytes_of(made)) << which.second;
  }
}

TEST(Live, AUnitThatHangsIsTakenOutOfServiceAndItsStateIsThatOfBefore) {
  Outputs outputs;
  ScheduleOptions options;
  options.mode = "met";  // First to the unit that hangs.
  options.in_flight = 4;
  const std::string trace = testing::TempDir() + "/hang_trace.json";
  options.trace = trace;
  LiveOptions how;
  how.prepare_first = false;
  how.time_limit = std::chrono::milliseconds(200);
  how.sink = [&](const Firings::TaskPlace& place, std::span<const Tensor> made) {
    outputs[{place.task, place.firing}] = bytes_of(made);
  };
  const Mix mix = mix_of(kHangingMix);
  const RunRecord run =
      run_live(parse_platform("test.yaml", kHanging, {}, 1), nullptr, mix, options, how);
  EXPECT_EQ(run.failed, 1);
  EXPECT_EQ(run.completed, 11);
  EXPECT_THAT(run.warnings, Contains(HasSubstr("background_model on gpu: no end after")));
  // The first call committed nothing, so that the second begins with the state of before it.
  EXPECT_FALSE(outputs.contains({0, 0}));
  expect_serial(outputs);
  EXPECT_FALSE(replay_file(trace).result.difference);
}

// In the midst of its sequence: the other unit begins with the state that the first one did.
TEST(Live, ACallThatIsGivenBackHasTheStateOfBeforeIt) {
  constexpr std::uint64_t kReturned = 3;
  Faults faults{.failing = 0, .returning = 0.1};
  const auto returns_only_that = [&] {
    for (std::uint64_t firing = 0; firing < 12; ++firing) {
      const bool returns = faults.outcome(0, firing, 0, 0) == Outcome::kReturned;
      if (returns != (firing == kReturned)) return false;
    }
    return faults.outcome(0, kReturned, 0, 1) == Outcome::kCompleted;
  };
  while (!returns_only_that()) ++faults.seed;
  ScheduleOptions options;
  options.mode = "ect";
  options.faults = faults;
  Outputs outputs;
  LiveOptions how;
  how.sink = [&](const Firings::TaskPlace& place, std::span<const Tensor> made) {
    outputs[{place.task, place.firing}] = bytes_of(made);
  };
  const RunRecord run = run_live(parse_platform("test.yaml", kBoard, {}, 1), nullptr,
                                 mix_of(kHangingMix), options, how);
  EXPECT_EQ(run.returned, 1);
  EXPECT_EQ(run.completed, 12);
  expect_serial(outputs);
}

TEST(Live, WhatWaitedBehindAHungCallIsServedElsewhereWithItsOwnInputs) {
  const auto platform = parse_platform("test.yaml", R"(
platform: board
units:
  gpu: {backend: fake, slots: 2, active_w: 1, script: {clock: wall, hang: [gaussian_blur]}}
  cpu: {backend: cpu, cores: all, slots: 1, active_w: 1}
workloads:
  gaussian_blur: {gpu: [{on: gpu, ms: 0.01, name: execute}], cpu: [{on: cpu, ms: 5}]}
)",
                                       {}, 1);
  ScheduleOptions options;
  options.mode = "met";  // First to the unit that hangs, which takes two.
  options.in_flight = 4;
  LiveOptions how;
  how.prepare_first = false;
  how.time_limit = std::chrono::milliseconds(200);
  const RunRecord run =
      run_live(platform, nullptr,
               mix_of("mix: m\npipelines: {p: {closed_loop: {frames: 12}, tasks: [{workload: "
                      "gaussian_blur}]}}\n"),
               options, how);
  EXPECT_EQ(run.failed, 1) << testing::PrintToString(run.warnings);
  EXPECT_EQ(run.completed, 11);
  EXPECT_EQ(run.returned, 1);
}

// A process that was stopped for a while: its firings come late, and their clocks ran on.
TEST(Live, AFiringsClockBeginsWhenItWasDue) {
  const auto platform = platform_of(
      "platform: one\nunits: {cpu: {slots: 1}}\nworkloads: {fc8: {cpu: [{on: cpu, ms: 1}]}}\n");
  const auto mix =
      mix_of("mix: m\npipelines: {a: {rate_hz: 20, deadline_ms: 20, tasks: [{workload: fc8}]}}\n");
  ScheduleOptions options;
  options.mode = "edf";
  options.duration = from_s(2);
  const auto driver = [](const Scenario& scenario, Dispatcher& dispatcher, TraceWriter*) {
    VirtualTime time(scenario, dispatcher);
    time.begin();
    // Nobody looks from 0.5 to 1.5 s.
    while (time.next() != Nanos::max()) {
      const bool stopped = time.next() > from_s(0.5) && time.next() < from_s(1.5);
      time.advance(stopped ? from_s(1.5) : time.next());
    }
    return time.finish();
  };
  const RunRecord record = run_mix(platform, nullptr, mix, options, driver, "virtual");
  // 0.55, 0.6, ... 1.45 s, of which each took 20 ms and more; 1.5 s itself waits for them.
  EXPECT_GE(record.pipelines[0].deadline_misses, 19);
  EXPECT_GT(*record.pipelines[0].p99_ms, 900);
}

TEST(Live, AUnitThatServesNothingIsNotOpened) {
  const auto platform = parse_platform("board.yaml", R"(
platform: board
units:
  gpu: {backend: cpu, device: there is none, slots: 1, active_w: 1}
  cpu: {backend: cpu, cores: all, slots: 1, active_w: 1}
workloads:
  gaussian_blur: {gpu: [{on: gpu, ms: 0.1}], cpu: [{on: cpu, ms: 0.1}]}
)",
                                       {}, 2);
  const auto mix = mix_of(R"(
mix: m
pipelines: {p: {closed_loop: {frames: 5}, tasks: [{workload: gaussian_blur}]}}
)");
  ScheduleOptions options;
  options.mode = "ect";
  EXPECT_THROW(static_cast<void>(run_live(platform, nullptr, mix, options, {})), Error);
  options.without = {"gpu"};
  EXPECT_EQ(run_live(platform, nullptr, mix, options, {}).completed, 5);
}

TEST(Live, SaysWhichUnitsTellTimeByAClockOfTheirOwn) {
  const auto warnings_with = [](const std::string& script) {
    std::string board = kHanging;
    const std::string hanging = "clock: wall, hang: [background_model]";
    board.replace(board.find(hanging), hanging.size(), script);
    ScheduleOptions options;
    options.mode = "olb";
    return run_live(parse_platform("test.yaml", board, {}, 1), nullptr, mix_of(kHangingMix),
                    options, {})
        .warnings;
  };
  const auto says_so = Contains(AllOf(HasSubstr("a clock of their own"), EndsWith(": gpu")));
  EXPECT_THAT(warnings_with("clock: simulated"), says_so);
  EXPECT_THAT(warnings_with("clock: wall"), Not(says_so));
}

// The loop of 0.5 us is always due: carrying out one of its events takes longer.
TEST(Live, AUnitThatComputesIsHeardWherePacedOnesAreNeverCaughtUpWith) {
  const auto platform = parse_platform("test.yaml", R"(
platform: board
units:
  fast: {slots: 1}
  cpu: {backend: cpu, cores: all, slots: 1, active_w: 1}
workloads:
  sobel: {fast: [{on: fast, ms: 0.0005}]}
  pool5: {cpu: [{on: cpu, ms: 1}]}
)",
                                       {}, 1);
  ScheduleOptions options;
  options.mode = "ect";
  options.duration = std::chrono::milliseconds(200);
  const RunRecord run = run_live(platform, nullptr, mix_of(R"(
mix: m
pipelines:
  loop: {closed_loop: {frames: 10000000}, tasks: [{workload: sobel}]}
  p: {rate_hz: 100, tasks: [{workload: pool5}]}
)"),
                                 options, {});
  EXPECT_GT(run.pipelines[1].completed, 3) << "of 20";
}

TEST(Live, StopsWhenItIsAskedTo) {
  for (const int times : {1, 2}) {
    const Mix mix = mix_of(R"(
mix: m
pipelines:
  p:
    rate_hz: 50
    tasks: [{workload: gaussian_blur}]
  q:
    closed_loop: {frames: 1000000}
    tasks: [{workload: sobel}]
)");
    ScheduleOptions options;
    options.mode = "ect";
    options.duration = std::chrono::hours(1);
    LiveOptions how;
    std::atomic<int> made = 0;
    how.sink = [&](const Firings::TaskPlace&, std::span<const Tensor>) { ++made; };
    how.stop = [&] { return made < 100 ? 0 : times; };
    const RunRecord run =
        run_live(parse_platform("test.yaml", kBoard, {}, 1), nullptr, mix, options, how);
    EXPECT_THAT(run.warnings, Contains(HasSubstr("stopped")));
    EXPECT_LT(run.makespan_s, 60);
    EXPECT_EQ(run.duration_s.value(), run.makespan_s);
    EXPECT_GT(run.completed, 0);
    EXPECT_EQ(run.submitted, run.completed + run.failed + run.dropped + run.expired + run.queued);
  }
}

}  // namespace
}  // namespace pirt::test
