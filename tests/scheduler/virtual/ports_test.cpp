// What tasks hand to each other: ports of a mix, data of earlier firings, states, and tasks that a
// unit gives back.
#include "scheduler/trace/replay.h"
#include "tests/scheduler/support.h"
#include "workloads/base/math/random.h"

namespace pirt::test {
namespace {

using testing::HasSubstr;

Mix localization(const std::string& tasks, const std::string& more = "") {
  return mix_of("mix: m\n" + more + "pipelines:\n  p:\n    closed_loop: {frames: 4}\n    tasks:\n" +
                tasks);
}

TEST(Ports, ResolveToPositionsAndBytes) {
  // Out of file order: blur stands before what it takes.
  const Mix mix = localization(
      "      - {name: blur, workload: gaussian_blur, inputs: {image: u.image}}\n"
      "      - {name: u, workload: undistort}\n"
      "      - {name: flow, workload: optical_flow,\n"
      "         inputs: {previous: u.image@-1, image: u.image}, after: [blur]}\n");
  const auto& tasks = mix.pipelines[0].tasks;
  ASSERT_EQ(tasks[0].name, "u");
  ASSERT_EQ(tasks[1].name, "blur");
  EXPECT_EQ(tasks[1].inputs, (std::vector<PortInput>{{0, 0, 0, false}}));
  EXPECT_EQ(tasks[1].edges[0].bytes, 640 * 480);
  EXPECT_EQ(tasks[2].inputs, (std::vector<PortInput>{{0, 0, 0, true}, {1, 0, 0, false}}));
  // After blur without data, after u for its image; what @-1 takes is no edge.
  EXPECT_EQ(tasks[2].after, (std::vector<std::size_t>{1, 0}));
  EXPECT_FALSE(tasks[2].edges[0].bytes);
  EXPECT_EQ(tasks[2].edges[1].bytes, 640 * 480);
  EXPECT_TRUE(tasks[0].read_later);
  EXPECT_EQ(tasks[0].handed_on, std::vector<std::size_t>{0});
  EXPECT_TRUE(mix.reads_earlier());
}

struct BadPorts {
  std::string tasks, message;
};

TEST(Ports, WhatDoesNotFitIsRefusedWithItsPlace) {
  const std::string u = "      - {name: u, workload: undistort}\n";
  const std::vector<BadPorts> cases = {
      {u + "      - {workload: sobel, inputs: {imag: u.image}}\n",
       "test.yaml:7: pipelines.p.tasks[1].inputs.imag: sobel has no input 'imag' (did you mean "
       "image?)"},
      {u + "      - {workload: gaussian_blur, inputs: {image: u.imag}}\n",
       "undistort has no output 'imag' (did you mean image?)"},
      {u + "      - {workload: gaussian_blur, inputs: {image: v.image}}\n",
       "no task 'v' in this pipeline"},
      {u + "      - {workload: sobel, inputs: {image: u.image}}\n",
       "undistort makes image u8[480,640], but sobel takes image u8[1080,1920]"},
      {u + "      - {workload: gaussian_blur, inputs: {image: image}}\n",
       "'image' is not of the form TASK.OUTPUT"},
      {u + "      - {workload: gaussian_blur, inputs: {image: u.image@-2}}\n",
       "is not of the form TASK.OUTPUT"},
      {u + "      - {workload: gaussian_blur, inputs: {image: u.image, image: u.image}}\n",
       "inputs.image: given twice"},
      {u + "      - {workload: gaussian_blur, inputs: {image: [u.image]}}\n", "inputs.image"},
      {u + "      - {workload: gaussian_blur, after: [{task: u, bytes: 1}], inputs: {image: "
           "u.image}}\n",
       "the bytes from 'u' follow from `inputs`"},
      {"      - {name: a, service_ms: {cpu: 1}}\n"
       "      - {workload: gaussian_blur, inputs: {image: a.image}}\n",
       "has service_ms and makes no tensors"},
      {u + "      - {name: a, service_ms: {cpu: 1}, inputs: {image: u.image}}\n",
       "a task with service_ms has no tensors"},
      {"      - {name: a, workload: gaussian_blur, inputs: {image: b.image}}\n"
       "      - {name: b, workload: gaussian_blur, inputs: {image: a.image}}\n",
       "wait for each other: a -> b -> a"},
      {"      - {name: a, workload: gaussian_blur, inputs: {image: b.image}}\n"
       "      - {name: b, workload: gaussian_blur, inputs: {image: a.image@-1}}\n",
       "a -> b -> a, through @-1: no firing could be the first"},
      {"      - {name: a, workload: gaussian_blur, inputs: {image: a.image@-1}}\n",
       "a -> a, through @-1"},
      {u + "      - {workload: gaussian_blur, state: s}\n", "has no state"},
  };
  for (const auto& [tasks, message] : cases) {
    EXPECT_THAT(bad_input([&text = tasks] { localization(text); }), HasSubstr(message)) << tasks;
  }
}

TEST(Ports, ImagesThatAreKeptNeedABufferMore) {
  const std::string tasks =
      "      - {name: u, workload: undistort, image_input: true}\n"
      "      - {name: b, workload: gaussian_blur, inputs: {image: u.image@-1}}\n";
  EXPECT_THAT(bad_input([&] { localization(tasks, "image_buffers: 1\n"); }),
              AllOf(HasSubstr("test.yaml:2: image_buffers: "), HasSubstr("at least 2")));
  EXPECT_EQ(localization(tasks, "image_buffers: 2\n").image_buffers, 2);
}

NamedTask with(TaskId id, std::optional<StateId> state, std::optional<SeriesId> series = {},
               std::span<const SeriesId> reads = {}) {
  NamedTask task = task_of(id, {.eligible = kLocal});
  task.state = state;
  task.series = series;
  task.reads = reads;
  return task;
}

PolicySetup for_olb() {
  PolicySetup setup = setup_of(1, 1, 1);
  setup.servers = {4, 4, 4, 4};
  return setup;
}

Script wide() { return {policy_of("olb", for_olb()), {4, 4, 4, 4}}; }

TEST(States, AreHeldByOneTaskAtATimeInOrder) {
  Script script = wide();
  EXPECT_EQ(script.submit_all(1, {with(1, 0)}), "G1");
  EXPECT_EQ(script.submit_all(2, {with(2, 0)}), "");
  EXPECT_EQ(script.submit_all(3, {with(3, 1)}), "G3");  // Another state.
  EXPECT_EQ(script.submit_all(4, {with(4, 0)}), "");
  EXPECT_EQ(script.complete(kGpu, 1), "G2");
  EXPECT_EQ(script.complete(kGpu, 2), "G4");
}

TEST(States, AreNotTakenOutOfTurnByWhoIsReadyEarlier) {
  Script script = wide();
  const std::vector<TaskId> after = {1};
  NamedTask second = with(2, 0);
  second.after = after;
  EXPECT_EQ(script.submit_all(1, {with(1, {}), second}), "G1");
  EXPECT_EQ(script.submit_all(2, {with(3, 0)}), "");  // Ready, but 2 is before it.
  EXPECT_EQ(script.complete(kGpu, 1), "G2");
  EXPECT_EQ(script.complete(kGpu, 2), "G3");
}

TEST(States, PassOnWhateverBecomesOfWhoWaitsForThem) {
  Script script = wide();
  EXPECT_EQ(script.submit_all(1, {with(1, 0)}), "G1");
  EXPECT_EQ(script.submit_all(2, {with(2, 0)}), "");
  EXPECT_EQ(script.submit_all(3, {with(3, 0)}), "");
  EXPECT_EQ(script.cancel(2), "-2");  // In the middle.
  EXPECT_EQ(script.complete(kGpu, 1, Outcome::kFailed), "G3");
  EXPECT_EQ(script.submit_all(4, {with(4, 0)}), "");
  EXPECT_EQ(script.cancel(3), "-3");  // It still runs, and still holds it.
  EXPECT_EQ(script.complete(kGpu, 3), "G4");
}

TEST(EarlierFirings, TheNearestThatCompletedIsRead) {
  Script script = wide();
  const std::vector<SeriesId> reads = {0};
  // The first firing finds nothing; the rest of it runs.
  EXPECT_EQ(script.submit_all(1, {with(1, {}, 0), with(11, {}, {}, reads)}), "G1 ?11");
  EXPECT_EQ(script.submit_all(2, {with(2, {}, 0), with(12, {}, {}, reads)}), "G2");
  EXPECT_EQ(script.submit_all(3, {with(3, {}, 0), with(13, {}, {}, reads)}), "G3");
  // 12 reads 1, 13 waits for 2. When 2 fails, 13 reads 1 too, which completes later.
  EXPECT_EQ(script.complete(kGpu, 2, Outcome::kFailed), "");
  EXPECT_EQ(script.complete(kGpu, 1), "G12 G13");
  // The newest that is there is enough, whatever an older one does.
  EXPECT_EQ(script.submit_all(4, {with(4, {}, 0)}), "G4");
  EXPECT_EQ(script.complete(kGpu, 4), "");
  EXPECT_EQ(script.submit_all(5, {with(15, {}, {}, reads)}), "G15");
}

TEST(EarlierFirings, WithoutAnyTheTaskAndItsSuccessorsAreDropped) {
  Script script = wide();
  const std::vector<SeriesId> reads = {0};
  const std::vector<TaskId> after = {11};
  NamedTask successor = with(12, {});
  successor.after = after;
  EXPECT_EQ(script.submit_all(1, {with(1, {}, 0)}), "G1");
  EXPECT_EQ(script.submit_all(2, {with(11, {}, {}, reads), successor}), "");
  EXPECT_EQ(script.complete(kGpu, 1, Outcome::kFailed), "?11 ?12");
}

TEST(GivenBack, GoesToAnotherUnitAndFailsWithTheLast) {
  Script script = wide();
  EXPECT_EQ(script.submit(1), "G1");
  EXPECT_EQ(script.complete(kGpu, 1, Outcome::kReturned), "D1");
  EXPECT_EQ(script.complete(kDsp, 1, Outcome::kReturned), "C1");
  EXPECT_EQ(script.complete(kCpu, 1, Outcome::kReturned), "x1");  // Three tries.
  EXPECT_EQ(script.submit(2, {.eligible = unit_bit(kDsp)}), "D2");
  EXPECT_EQ(script.complete(kDsp, 2, Outcome::kReturned), "x2");  // No other may.
}

TEST(GivenBack, KeepsItsPlaceInLine) {
  PolicySetup setup = for_olb();
  setup.servers = {1, 1, 1, 1};
  Script script(policy_of("olb", setup), {1, 1, 1, 1});
  const TaskClass kind{.eligible = unit_bit(kGpu) | unit_bit(kDsp)};
  EXPECT_EQ(script.submit(1, kind), "G1");
  EXPECT_EQ(script.submit(2, kind), "D2");
  EXPECT_EQ(script.submit(3, kind), "");
  // 1 is older than 3, but the GPU is not for it any more; on the DSP it comes first.
  EXPECT_EQ(script.complete(kGpu, 1, Outcome::kReturned), "G3");
  EXPECT_EQ(script.submit(4, kind), "");
  EXPECT_EQ(script.complete(kDsp, 2), "D1");
}

TEST(GivenBack, StillExpires) {
  Script script(policy_of("olb", for_olb()), {1, 1, 1, 1});
  EXPECT_EQ(script.submit(1, {.eligible = unit_bit(kDsp)}), "D1");
  EXPECT_EQ(script.submit(2, {.eligible = unit_bit(kGpu) | unit_bit(kDsp)}, {}, Nanos(10)), "G2");
  EXPECT_EQ(script.complete(kGpu, 2, Outcome::kReturned), "");  // The DSP is busy.
  EXPECT_EQ(script.wake(Nanos(10)), "!2");
}

/// Pipelines with ports, states and deadlines, on units with links.
std::string random_mix(Random& random) {
  std::string text =
      "mix: random\nimage_buffers: " + std::to_string(4 + random.below(6)) + "\npipelines:\n";
  const std::uint64_t pipelines = 1 + random.below(3);
  for (std::uint64_t p = 0; p < pipelines; ++p) {
    text += "  p" + std::to_string(p) + ":\n";
    text += random.below(2) == 0 ? "    rate_hz: " + std::to_string(20 + random.below(200)) + "\n"
                                 : "    closed_loop: {frames: 30}\n";
    if (random.below(2) == 0) text += "    deadline_ms: 30\n";
    if (random.below(3) == 0) text += "    expires_ms: 20\n";
    text += "    tasks:\n";
    const std::uint64_t tasks = 1 + random.below(4);
    std::vector<bool> has_state;
    for (std::uint64_t t = 0; t < tasks; ++t) {
      text += "      - {name: t" + std::to_string(t) + ", workload: ";
      const auto other = [&](std::uint64_t which) {
        return "t" + std::to_string(which) + (has_state[which] ? ".mask" : ".image") +
               (random.below(2) == 0 ? "@-1" : "");
      };
      const bool stateful = random.below(3) == 0;
      has_state.push_back(stateful);
      text += stateful ? "background_model" : "undistort";
      if (stateful && random.below(3) == 0) text += ", state: shared";
      if (t > 0 && !stateful && random.below(3) != 0) {
        text += ", inputs: {image: " + other(random.below(t)) + "}";
      }
      if (random.below(2) == 0) text += ", image_input: true";
      text += "}\n";
    }
  }
  return text;
}

constexpr const char* kBoard = R"(
platform: board
units:
  gpu: {servers: 1, discipline: fifo, slots: 2, active_w: 1}
  dsp: {servers: 1, discipline: fifo, slots: 1, active_w: 1}
  cpu: {servers: 2, discipline: processor_sharing, active_w: 1}
  cloud: {servers: 4, discipline: fifo, link: uplink}
links: {uplink: {mbit_s: 800, latency_ms: {uniform: [1, 3]}, active_w: 1}}
workloads:
  undistort:
    gpu: [{on: gpu, ms: 2}]
    dsp: [{on: dsp, ms: 4}]
    cpu: [{on: cpu, ms: 3}]
    cloud: [{on: cloud, ms: 1}]
  background_model:
    gpu: [{on: gpu, ms: 1}]
    cpu: [{on: cpu, ms: 5}]
    cloud: [{on: cloud, ms: 1}]
)";

TEST(Ports, RandomMixesWithFaultsLoseNothingAndReplay) {
  const Platform board = platform_of(kBoard);
  const std::vector<std::string> modes = {"latency", "throughput", "energy", "advanced", "ect",
                                          "edf",     "olb",        "met",    "heft"};
  const std::string trace = testing::TempDir() + "/ports_trace.json";
  std::int64_t returned = 0, without_predecessor = 0, failed = 0;
  for (std::uint64_t seed = 0; seed < 1000; ++seed) {
    Random random(seed);
    const std::string text = random_mix(random);
    ScheduleOptions options;
    options.mode = modes[random.below(modes.size())];
    SCOPED_TRACE("seed " + std::to_string(seed) + ", mode " + options.mode + "\n" + text);
    options.seed = seed;
    const Mix mix = mix_of(text);
    if (mix.open_loop()) options.duration = from_ms(200);
    options.faults = Faults{.seed = seed, .failing = 0.05, .returning = 0.1};
    if (seed % 10 == 0) options.trace = trace;
    const RunRecord run = run_virtual(board, nullptr, mix, options);
    ASSERT_EQ(run.submitted, run.completed + run.dropped + run.expired + run.failed + run.queued);
    ASSERT_EQ(run.stalled, 0);
    ASSERT_EQ(run.no_predecessor.has_value(), mix.reads_earlier());
    for (const auto& pipeline : run.pipelines) {
      ASSERT_EQ(pipeline.fired, pipeline.completed + pipeline.dropped + pipeline.unfinished);
    }
    if (options.trace) {
      const ReplayResult again = replay_file(trace).result;
      ASSERT_FALSE(again.difference)
          << again.difference->input << ": " << again.difference->recorded << " / "
          << again.difference->replayed;
    }
    returned += run.returned.value_or(0);
    failed += run.failed;
    without_predecessor += run.no_predecessor.value_or(0);
  }
  // The mixes have in them what is tested.
  EXPECT_GT(returned, 1000);
  EXPECT_GT(failed, 1000);
  EXPECT_GT(without_predecessor, 300);
}

}  // namespace
}  // namespace pirt::test
