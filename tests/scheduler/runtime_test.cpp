// The runtime library: what a program submits is computed once, wherever, and told; whatever fails,
// counts balance and nobody waits for ever. No test looks at how long anything took.
#include "scheduler/runtime/runtime.h"

#include <array>
#include <atomic>
#include <functional>
#include <latch>
#include <mutex>
#include <semaphore>
#include <set>
#include <stdexcept>
#include <thread>

#include "scheduler/runtime/live_units.h"
#include "scheduler/runtime/output_pool.h"
#include "scheduler/trace/replay.h"
#include "tests/scheduler/support.h"
#include "tests/support/errors.h"
#include "tests/support/long.h"
#include "tests/workloads/sequence_support.h"
#include "workloads/backends/registry.h"
#include "workloads/base/math/random.h"
#include "workloads/catalog/catalog.h"
#include "workloads/inputs/pictures/images.h"
#include "workloads/model/host_function.h"
#include "workloads/vision/vision.h"

namespace pirt::test {
namespace {

using namespace std::chrono_literals;
using testing::AllOf;
using testing::HasSubstr;

constexpr const char* kTwoUnits = R"(
platform: two
units:
  cpu: {backend: cpu, cores: all, slots: 1, active_w: 1}
  gpu: {backend: cpu, cores: all, slots: 1, active_w: 1}
)";

constexpr const char* kOneUnit = R"(
platform: one
units:
  cpu: {backend: cpu, cores: all, slots: 1, active_w: 1}
)";

const TensorSpec kNumber{.name = "number", .element = Element::kF64, .shape = {1}};

Tensor number(double value) {
  Tensor tensor(kNumber);
  tensor.as<double>()[0] = value;
  return tensor;
}
double value_of(std::span<const Tensor> tensors) { return tensors[0].as<double>()[0]; }

using Function = std::function<void(std::span<const Tensor>, std::span<Tensor>)>;

/// Of numbers, on both units.
OwnWorkload own(const std::string& name, int inputs, Function function) {
  return {.name = name,
          .inputs = std::vector<TensorSpec>(static_cast<std::size_t>(inputs), kNumber),
          .outputs = {kNumber},
          .kernels = {{"cpu", std::move(function)}}};  // The backend of both.
}
OwnWorkload adding() {
  return own("add", 2, [](std::span<const Tensor> in, std::span<Tensor> out) {
    out[0].as<double>()[0] = in[0].as<double>()[0] + in[1].as<double>()[0];
  });
}

RuntimeOptions options_with(std::vector<OwnWorkload> own, const char* platform = kTwoUnits) {
  RuntimeOptions options;
  options.platform = parse_platform("test.yaml", platform, {}, 2);
  options.own = std::move(own);
  return options;
}

void expect_balance(const RuntimeStatistics& statistics) {
  EXPECT_EQ(statistics.submitted, statistics.completed + statistics.failed + statistics.dropped +
                                      statistics.expired + statistics.cancelled + statistics.live);
}

TEST(Runtime, ComputesWhatIsSubmittedAlongItsData) {
  for (const char* mode : {"ect", "olb", "met", "edf", "latency", "throughput", "energy"}) {
    SCOPED_TRACE(mode);
    auto options = options_with({adding()});
    options.mode = mode;
    Runtime runtime(std::move(options));
    TaskFuture sum = runtime.submit("add", {number(0), number(1)});
    for (int i = 2; i <= 100; ++i) sum = runtime.submit("add", {sum.output(0), number(i)});
    EXPECT_EQ(value_of(sum.get()), 5050);
    const auto statistics = runtime.statistics();
    EXPECT_EQ(statistics.completed, 100);
    expect_balance(statistics);
  }
}

TEST(Runtime, RunsWorkloadsOfTheCatalogueAsTheReferenceDefinesThem) {
  RuntimeOptions options = options_with({});
  options.workloads = {"undistort", "gaussian_blur"};
  Runtime runtime(std::move(options));
  const Workload& undistort = find_workload("undistort");
  const Workload& blur = find_workload("gaussian_blur");
  const auto images = generated_images(5);
  const Data data = undistort.make_data({.seed = 5, .images = images.get()});
  const auto flat = runtime.submit("undistort", {data.inputs[0]});
  const auto blurred = runtime.submit("gaussian_blur", {flat.output(0)}, {.real_time = true});
  const Verdict first = undistort.verify(flat.get(), undistort.reference(data));
  EXPECT_TRUE(first.ok) << first.detail;
  Data next = blur.make_data({.seed = 5, .images = images.get()});
  next.inputs = copy_tensors(flat.get());
  const Verdict second = blur.verify(blurred.get(), blur.reference(next));
  EXPECT_TRUE(second.ok) << second.detail;
}

std::string refusal(RuntimeOptions options) {
  return bad_input([&] { const Runtime runtime(std::move(options)); });
}

/// Like bundle_adjust, it has a function for a kernel; doubles a number, and keeps all it was
/// given.
Workload doubling(std::shared_ptr<std::vector<double>> given) {
  Workload workload;
  workload.name = "double";
  workload.kernel = "bundle_adjust";
  workload.inputs = workload.outputs = {kNumber};
  auto function = std::make_shared<HostFunction>();
  function->prepare = [given = std::move(given)](std::span<const Tensor>) -> KernelFunction {
    return [given](std::span<const Tensor> inputs, std::span<Tensor> outputs) {
      given->push_back(value_of(inputs));
      outputs[0].as<double>()[0] = 2 * value_of(inputs);
    };
  };
  workload.operation = std::move(function);
  workload.make_data = [](const DataRequest&) {
    Data data;
    data.inputs.push_back(number(1));
    return data;
  };
  return workload;
}

TEST(Runtime, PreparesWithInputsLikeThoseToCome) {
  const auto given = std::make_shared<std::vector<double>>();
  const auto options_for = [&](const char* name, std::vector<Tensor> inputs) {
    RuntimeOptions options = options_with({adding()}, kOneUnit);
    options.made = {doubling(given)};
    options.first_inputs[name] = std::make_shared<const std::vector<Tensor>>(std::move(inputs));
    return options;
  };
  const auto seven = [] {
    std::vector<Tensor> inputs;
    inputs.push_back(number(7));
    return inputs;
  };
  {
    Runtime runtime(options_for("double", seven()));
    EXPECT_EQ(*given, std::vector{7.0});
    const auto sixteen = runtime.submit("double", {number(8)});
    EXPECT_EQ(value_of(sixteen.get()), 16);
    EXPECT_EQ(*given, (std::vector{7.0, 8.0}));
  }
  EXPECT_THAT(refusal(options_for("dubble", seven())), HasSubstr("did you mean double"));
  EXPECT_THAT(refusal(options_for("double", {})), HasSubstr("1 inputs, not 0"));
  EXPECT_THAT(refusal(options_for("add", seven())), HasSubstr("of your own"));
  RuntimeOptions lazy = options_for("double", seven());
  lazy.prepare_first = false;
  given->clear();
  Runtime runtime(std::move(lazy));
  EXPECT_EQ(*given, std::vector<double>());
}

/// A background model of its own size and name.
Workload background(const std::string& name, int width, int height) {
  Workload workload = vision::make_background_model(width, height);
  workload.name = name;
  return workload;
}

/// Of sobel, on both units.
Profile profile_of_sobel(bool cpu_valid, bool gpu_valid) {
  Profile profile;
  profile.path = "p.db";
  profile.runs.emplace_back().platform = "two";
  for (const bool gpu : {false, true}) {
    for (const Phase phase : {Phase::kUpload, Phase::kExecute, Phase::kDownload}) {
      PhaseRow& row = profile.phases.emplace_back();
      row.platform = "two";
      row.workload = "sobel";
      row.unit = gpu ? "gpu" : "cpu";
      row.backend = "cpu";
      row.phase = phase;
      row.valid = gpu ? gpu_valid : cpu_valid;
      row.median = 1ms;
      if (!row.valid) row.reasons = {"wrong_output"};
    }
  }
  return profile;
}

TEST(Runtime, WithAProfileUnitsServeWhatTheyHaveValidRowsOf) {
  const auto options_for = [](Profile profile, std::vector<Workload> made = {}) {
    RuntimeOptions options = options_with({adding()});
    options.profile = std::move(profile);
    options.workloads = {"sobel"};
    options.made = std::move(made);
    return options;
  };
  {
    Runtime runtime(options_for(profile_of_sobel(false, true)));
    const auto images = generated_images(1);
    const Data data = find_workload("sobel").make_data({.seed = 1, .images = images.get()});
    for (int i = 0; i < 10; ++i) {
      const auto edges = runtime.submit("sobel", {data.inputs[0]});
      EXPECT_EQ(edges.wait(), TaskEnd::kCompleted);
      EXPECT_EQ(edges.unit(), "gpu");
    }
    // Functions of one's own need no rows.
    const auto three = runtime.submit("add", {number(1), number(2)});
    EXPECT_EQ(value_of(three.get()), 3);
  }
  EXPECT_THAT(refusal(options_for(profile_of_sobel(false, false))),
              AllOf(HasSubstr("sobel"), HasSubstr("wrong_output")));
  auto made = std::vector{background("small", 40, 30)};
  EXPECT_THAT(refusal(options_for(profile_of_sobel(true, true), std::move(made))),
              HasSubstr("'small' is none of the catalogue's"));
}

TEST(Runtime, TasksOfAStateHoldItOneAtATimeInOrder) {
  RuntimeOptions options = options_with({});
  options.workloads = {"background_model"};
  Runtime runtime(std::move(options));
  const Workload& model = find_workload("background_model");
  const auto images = generated_images(1);
  std::vector<Data> frames;
  for (int frame = 0; frame < model.frames; ++frame) {
    frames.push_back(model.make_data({.seed = 1, .images = images.get(), .frame = frame}));
  }
  std::vector<TaskFuture> futures;
  for (const Data& frame : frames) {
    futures.push_back(runtime.submit("background_model", {frame.inputs[0]}));
  }
  const auto expected = reference_of(model, frames);
  for (std::size_t i = 0; i < frames.size(); ++i) {
    const Verdict verdict = model.verify(futures[i].get(), expected[i]);
    EXPECT_TRUE(verdict.ok) << i << ": " << verdict.detail;
  }
}

TEST(Runtime, WorkloadsOfOwnSizesShareAStateByItsName) {
  RuntimeOptions options = options_with({});
  options.made = {background("even", 40, 30), background("odd", 40, 30)};
  Runtime runtime(std::move(options));
  const Workload model = background("both", 40, 30);
  const auto images = generated_images(1);
  std::vector<Data> frames;
  std::vector<TaskFuture> futures;
  for (int frame = 0; frame < model.frames; ++frame) {
    frames.push_back(model.make_data({.seed = 1, .images = images.get(), .frame = frame}));
    futures.push_back(runtime.submit(frame % 2 == 0 ? "even" : "odd", {frames.back().inputs[0]}));
  }
  const auto expected = reference_of(model, frames);
  for (std::size_t i = 0; i < frames.size(); ++i) {
    const Verdict verdict = model.verify(futures[i].get(), expected[i]);
    EXPECT_TRUE(verdict.ok) << i << ": " << verdict.detail;
  }
  // It counts its frames, up to 4.
  EXPECT_EQ(runtime.state("background")[1].as<std::int32_t>()[0], 4);
  EXPECT_THAT(bad_input([&] { static_cast<void>(runtime.state("foreground")); }),
              HasSubstr("foreground"));
  EXPECT_THAT(bad_input([&] {
                auto other = options_with({});
                other.made = {background("small", 40, 30), background("large", 80, 60)};
                const Runtime refused(std::move(other));
              }),
              HasSubstr("small and large"));
}

TEST(Runtime, ItsTraceReplaysWhateverHappened) {
  const ScratchFolder folder;
  auto options = options_with(
      {adding(), own("throw", 1, [](auto, auto) { throw std::runtime_error("on purpose"); })});
  options.trace = (folder.path() / "trace.json").string();
  Runtime runtime(options);
  TaskFuture sum = runtime.submit("add", {number(0), number(1)});
  for (int i = 2; i <= 50; ++i) {
    sum = runtime.submit("add", {sum.output(0), number(i)});
    const auto thrown = runtime.submit("throw", {sum.output(0)});
    const auto dropped = runtime.submit("add", {thrown.output(0), number(1)});
    if (i % 10 == 0) runtime.cancel(dropped);
  }
  runtime.write_trace();
  const auto replayed = replay(load_trace_log(*options.trace), "trace");
  EXPECT_FALSE(replayed.difference.has_value());
  EXPECT_GE(replayed.decisions, 100);
  EXPECT_GT(sum.busy(), Nanos::zero());
  EXPECT_THAT(bad_input([&] { runtime.write_trace(); }), HasSubstr("trace"));
}

// Of what a turn has decided, who hears of one thing may ask for all: threads tell one by one.
TEST(Runtime, AFutureHasEndedBeforeAnyoneIsToldOfWhatFollows) {
  std::latch submitted(1);
  Runtime runtime(options_with({own("throws", 1,
                                    [&](std::span<const Tensor>, std::span<Tensor>) {
                                      submitted.wait();
                                      throw std::runtime_error("no");
                                    }),
                                adding()}));
  TaskFuture dropped;
  std::optional<TaskEnd> seen;
  const TaskFuture first = runtime.submit(
      "throws", {number(1)}, {}, [&](const TaskFuture&, TaskEnd) { seen = dropped.end(); });
  dropped = runtime.submit("add", {first.output(0), number(1)});
  submitted.count_down();
  runtime.wait_all();
  EXPECT_EQ(seen, TaskEnd::kDropped);
}

TEST(Runtime, CallbacksHearOfEachEndOnceAndMaySubmit) {
  Runtime runtime(options_with({adding()}));
  std::atomic<int> heard = 0;
  std::atomic<int> wrong = 0;
  for (int i = 0; i < 200; ++i) {
    runtime.submit("add", {number(i), number(1)}, {}, [&, i](const TaskFuture& task, TaskEnd end) {
      ++heard;
      if (end != TaskEnd::kCompleted || value_of(task.get()) != i + 1) ++wrong;
      if (task.unit().empty()) ++wrong;
      runtime.submit("add", {task.output(0), number(1)}, {},
                     [&](const TaskFuture&, TaskEnd) { ++heard; });
    });
  }
  runtime.wait_all();
  EXPECT_EQ(heard, 400);
  EXPECT_EQ(wrong, 0);
}

TEST(Runtime, WhoWaitsWhereItWouldWaitForItselfIsTold) {
  Runtime runtime(options_with({adding()}));
  runtime.submit("add", {number(1), number(2)}, {},
                 [&](const TaskFuture&, TaskEnd) { runtime.wait_all(); });
  runtime.wait_all();
  const auto statistics = runtime.statistics();
  ASSERT_EQ(statistics.problems.size(), 1U);
  EXPECT_THAT(statistics.problems[0], HasSubstr("wait for itself"));
}

TEST(Runtime, AKernelThatThrowsFailsByNameAndItsSuccessorsAreDropped) {
  Runtime runtime(options_with(
      {own("fails", 1,
           [](std::span<const Tensor>, std::span<Tensor>) { throw std::runtime_error("no luck"); }),
       adding()}));
  const auto failed = runtime.submit("fails", {number(1)});
  const auto next = runtime.submit("add", {failed.output(0), number(1)});
  const auto after = runtime.submit("add", {number(1), number(1)}, {.after = {next}});
  EXPECT_EQ(failed.wait(), TaskEnd::kFailed);
  EXPECT_THAT(failed.problem(), HasSubstr("fails on"));
  EXPECT_THAT(failed.problem(), HasSubstr("no luck"));
  EXPECT_EQ(next.wait(), TaskEnd::kDropped);
  EXPECT_EQ(after.wait(), TaskEnd::kDropped);
  // Named when its end is long known.
  EXPECT_EQ(runtime.submit("add", {failed.output(0), number(1)}).wait(), TaskEnd::kDropped);
  try {
    static_cast<void>(failed.get());
    FAIL() << "outputs of a task that failed";
  } catch (const Error& error) {
    EXPECT_THAT(error.what(), HasSubstr("no luck"));
  }
  expect_balance(runtime.statistics());
}

TEST(Runtime, AUnitThatCannotGivesItsTasksToAnother) {
  OwnWorkload task = own("task", 1, {});
  task.kernels = {{"cpu", [](std::span<const Tensor>,
                             std::span<Tensor>) { throw_environment("the device is lost"); }},
                  {"gpu", [](std::span<const Tensor> in, std::span<Tensor> out) {
                     out[0].as<double>()[0] = in[0].as<double>()[0];
                   }}};
  Runtime runtime(options_with({task}, R"(
platform: two
units:
  cpu: {backend: fake, slots: 1, active_w: 1}
  gpu: {backend: fake, slots: 1, active_w: 1}
)"));
  std::vector<TaskFuture> futures;
  for (int i = 0; i < 20; ++i) futures.push_back(runtime.submit("task", {number(i)}));
  for (int i = 0; i < 20; ++i) {
    EXPECT_EQ(value_of(futures[static_cast<std::size_t>(i)].get()), i);
    EXPECT_EQ(futures[static_cast<std::size_t>(i)].unit(), "gpu");
  }
  const auto alone = runtime.submit("task", {number(1)}, {.eligible = {"cpu"}});
  const auto statistics = runtime.statistics();
  EXPECT_GE(statistics.returned, 1);
  EXPECT_EQ(statistics.units[0].completed, 0);
  expect_balance(statistics);
  runtime.cancel(alone);  // Its unit may be out of service by now.
  EXPECT_NE(alone.wait(), TaskEnd::kCompleted);
}

TEST(Runtime, AUnitThatHangsIsTakenOutOfService) {
  // Static: the call never comes back, and what it waits for must outlive the test.
  static std::binary_semaphore never(0);
  static std::atomic<int> hung = 0;
  hung = 0;
  auto options =
      options_with({own("maybe", 1, [](std::span<const Tensor> in, std::span<Tensor> out) {
        if (in[0].as<double>()[0] < 0 && hung++ == 0) never.acquire();
        out[0].as<double>()[0] = in[0].as<double>()[0];
      })});
  options.time_limit = 300ms;
  Runtime runtime(std::move(options));
  const auto bad = runtime.submit("maybe", {number(-1)});
  std::vector<TaskFuture> good;
  for (int i = 0; i < 50; ++i) good.push_back(runtime.submit("maybe", {number(i)}));
  for (int i = 0; i < 50; ++i) EXPECT_EQ(value_of(good[static_cast<std::size_t>(i)].get()), i);
  EXPECT_EQ(bad.wait(), TaskEnd::kFailed);
  EXPECT_THAT(bad.problem(), HasSubstr("out of service"));
  const auto statistics = runtime.statistics();
  EXPECT_EQ(std::ranges::count(statistics.units, false, &RuntimeStatistics::Unit::in_service), 1);
  expect_balance(statistics);
}

TEST(Runtime, CancelledTasksEndAndWhatComesAfterThemIsDropped) {
  std::binary_semaphore go(0);
  std::latch started(1);
  Runtime runtime(options_with({own("waits", 1,
                                    [&](std::span<const Tensor>, std::span<Tensor>) {
                                      started.count_down();
                                      go.acquire();
                                    }),
                                adding()},
                               kOneUnit));
  const auto running = runtime.submit("waits", {number(1)});
  started.wait();
  const auto queued = runtime.submit("add", {number(1), number(1)});
  const auto behind = runtime.submit("add", {queued.output(0), number(1)});
  runtime.cancel(queued);
  EXPECT_EQ(queued.wait(), TaskEnd::kCancelled);
  EXPECT_EQ(behind.wait(), TaskEnd::kDropped);
  runtime.cancel(running);
  EXPECT_EQ(running.wait(), TaskEnd::kCancelled);
  const auto next = runtime.submit("add", {number(2), number(3)});
  go.release();
  EXPECT_EQ(value_of(next.get()), 5);
  runtime.cancel(next);  // Of no effect.
  EXPECT_EQ(next.wait(), TaskEnd::kCompleted);
  expect_balance(runtime.statistics());
}

TEST(Runtime, WhatHasNotStartedInTimeExpires) {
  std::binary_semaphore go(0);
  Runtime runtime(options_with(
      {own("waits", 1, [&](std::span<const Tensor>, std::span<Tensor>) { go.acquire(); }),
       adding()},
      kOneUnit));
  const auto first = runtime.submit("waits", {number(1)});
  const auto late = runtime.submit("add", {number(1), number(1)}, {.expires = 10ms});
  EXPECT_EQ(late.wait(), TaskEnd::kExpired);
  go.release();
  EXPECT_EQ(first.wait(), TaskEnd::kCompleted);
}

TEST(Runtime, HasNoMoreTasksThanItMay) {
  auto options = options_with({adding()});
  options.most_tasks = 4;
  Runtime runtime(std::move(options));
  std::atomic<int> most = 0;
  {
    std::vector<std::jthread> threads;
    for (int t = 0; t < 3; ++t) {
      threads.emplace_back([&, t] {
        for (int i = 0; i < 300; ++i) {
          runtime.submit("add", {number(i), number(t)});
          const int live = static_cast<int>(runtime.statistics().live);
          for (int before = most; live > before && !most.compare_exchange_weak(before, live);) {
          }
        }
      });
    }
  }
  runtime.wait_all();
  EXPECT_LE(most, 4 + 3);  // One more a thread that was let through at the same moment.
  EXPECT_EQ(runtime.statistics().completed, 900);
}

TEST(Runtime, ItsEndCancelsWhatHasNotStarted) {
  std::vector<TaskFuture> futures;
  std::binary_semaphore go(0);
  {
    Runtime runtime(options_with({own("waits", 1,
                                      [&](std::span<const Tensor>, std::span<Tensor>) {
                                        go.acquire();
                                        go.release();
                                      }),
                                  adding()}));
    for (int i = 0; i < 10; ++i) futures.push_back(runtime.submit("waits", {number(i)}));
    go.release();
  }
  for (const TaskFuture& future : futures) EXPECT_TRUE(future.end().has_value());
}

TEST(Runtime, ManyThreadsSubmitDependAndCancelAndCountsBalance) {
  Runtime runtime(
      options_with({own("random", 2, [](std::span<const Tensor> in, std::span<Tensor> out) {
        const double sum = in[0].as<double>()[0] + in[1].as<double>()[0];
        if (std::fmod(sum, 97) == 0) throw std::runtime_error("97");
        out[0].as<double>()[0] = sum;
      })}));
  std::atomic<std::int64_t> ended = 0;
  constexpr int kTasks = 1'500;
  {
    std::vector<std::jthread> threads;
    for (int t = 0; t < 3; ++t) {
      threads.emplace_back([&, t] {
        Random random(static_cast<std::uint64_t>(t));
        std::vector<TaskFuture> mine;
        for (int i = 0; i < kTasks; ++i) {
          const auto input = [&]() -> TaskInput {
            if (mine.empty() || random.uniform(0, 1) < 0.7) return number(i);
            return mine[mine.size() - 1 -
                        static_cast<std::size_t>(
                            random.uniform(0, 1) *
                            std::min<double>(20, static_cast<double>(mine.size())))]
                .output(0);
          };
          std::vector<TaskInput> inputs;
          inputs.push_back(input());
          inputs.push_back(input());
          mine.push_back(runtime.submit("random", std::move(inputs), {},
                                        [&](const TaskFuture&, TaskEnd) { ++ended; }));
          if (random.uniform(0, 1) < 0.05) runtime.cancel(mine.back());
          if (mine.size() > 50) mine.erase(mine.begin(), mine.begin() + 25);
        }
      });
    }
  }
  runtime.wait_all();
  EXPECT_EQ(ended, 3 * kTasks);
  const auto statistics = runtime.statistics();
  EXPECT_EQ(statistics.submitted, 3 * kTasks);
  EXPECT_EQ(statistics.live, 0);
  EXPECT_GT(statistics.failed, 0);
  EXPECT_GT(statistics.completed, kTasks);
  expect_balance(statistics);
}

/// What becomes of a task by a plain model: a number, or none.
struct Modelled {
  TaskFuture task;
  std::optional<double> value;
  bool certain = true;  ///< Nothing before it, nor itself, was cancelled, maybe too late.
};

// Tasks of random others while records are used again and again: ends and values are those of a
// plain model, and every decision replays.
TEST(Runtime, IsWhatAPlainModelSaysHoweverOftenRecordsAreUsedAgain) {
  const ScratchFolder folder;
  auto options =
      options_with({own("random", 2, [](std::span<const Tensor> in, std::span<Tensor> out) {
        const double sum = in[0].as<double>()[0] + in[1].as<double>()[0];
        if (std::fmod(sum, 97) == 0) throw std::runtime_error("97");
        out[0].as<double>()[0] = std::fmod(sum, 10'007);
      })});
  options.trace = (folder.path() / "trace.json").string();
  Runtime runtime(options);
  const WorkloadHandle workload = runtime.workload("random");
  Random random(43);
  std::vector<Modelled> known;
  const int tasks = repeats(20'000, 1'000'000);
  for (int i = 0; i < tasks; ++i) {
    Modelled next{.task = {}, .value = 0.0, .certain = true};
    std::vector<TaskInput> inputs;
    for (int input = 0; input < 2; ++input) {
      if (known.empty() || random.uniform(0, 1) < 0.5) {
        inputs.emplace_back(number(i % 1009));
        if (next.value) *next.value += i % 1009;
        continue;
      }
      const Modelled& before = known[static_cast<std::size_t>(
          random.uniform(0, 1) * static_cast<double>(known.size() - 1))];
      inputs.emplace_back(before.task.output(0));
      next.certain = next.certain && before.certain;
      next.value =
          next.value && before.value ? std::optional(*next.value + *before.value) : std::nullopt;
    }
    if (next.value && std::fmod(*next.value, 97) == 0) next.value = std::nullopt;
    if (next.value) next.value = std::fmod(*next.value, 10'007);
    next.task = runtime.submit(workload, std::move(inputs));
    if (random.uniform(0, 1) < 0.02) {
      runtime.cancel(next.task);
      next.certain = false;
    }
    known.push_back(std::move(next));
    if (known.size() < 200) continue;
    for (int gone = 0; gone < 100; ++gone) {
      const auto at =
          static_cast<std::size_t>(random.uniform(0, 1) * static_cast<double>(known.size() - 1));
      const Modelled& each = known[at];
      // Most go while they have not ended.
      if (each.certain && random.uniform(0, 1) < 0.2) {
        ASSERT_EQ(each.task.wait() == TaskEnd::kCompleted, each.value.has_value()) << i;
        if (each.value) {
          ASSERT_EQ(value_of(each.task.get()), *each.value) << i;
        }
      }
      known.erase(known.begin() + static_cast<std::ptrdiff_t>(at));
    }
  }
  runtime.write_trace();
  const auto statistics = runtime.statistics();
  EXPECT_EQ(statistics.submitted, tasks);
  EXPECT_GT(statistics.completed, tasks / 10);
  EXPECT_GT(statistics.cancelled, 0);
  expect_balance(statistics);
  EXPECT_FALSE(replay_file(*options.trace).result.difference.has_value());
}

TEST(Runtime, RefusesOptionsThatMakeNoSense) {
  EXPECT_THAT(refusal(options_with({})), HasSubstr("needs workloads"));
  auto options = options_with({adding()});
  options.mode = "heft";
  EXPECT_THAT(refusal(options), HasSubstr("plans a whole mix ahead"));
  options.mode = "etc";
  EXPECT_THAT(refusal(options), HasSubstr("did you mean"));
  options.mode = "ect";
  options.workloads = {"gausian_blur"};
  EXPECT_THAT(refusal(options), HasSubstr("gaussian_blur"));
  options.workloads = {"sobel", "sobel"};
  EXPECT_THAT(refusal(options), HasSubstr("twice"));
  options.workloads = {};
  options.most_tasks = 0;
  EXPECT_THAT(refusal(options), HasSubstr("most_tasks"));
  options.most_tasks = 1;
  options.own[0].kernels = {{"npu", [](std::span<const Tensor>, std::span<Tensor>) {}}};
  EXPECT_THAT(refusal(options),
              HasSubstr("two can run add (cpu: no kernel was given for it; gpu: "));
}

TEST(Runtime, AWorkloadIsFoundOnceAndSubmittedOften) {
  Runtime runtime(options_with({adding()}));
  const WorkloadHandle add = runtime.workload("add");
  const TaskFuture sum = runtime.submit(add, {number(1), number(2)});
  EXPECT_EQ(value_of(sum.get()), 3);
  EXPECT_THAT(bad_input([&] { static_cast<void>(runtime.workload("ad")); }),
              HasSubstr("did you mean add"));
  Runtime second(options_with({adding()}));
  for (const WorkloadHandle handle : {add, WorkloadHandle()}) {
    EXPECT_THAT(bad_input([&] {
                  second.submit(handle, {number(1), number(2)});
                }),
                HasSubstr("handle"));
  }
}

// A future is of its own task, however often others' records were used since.
TEST(Runtime, FuturesStayOfTheirTasksWhileRecordsAreUsedAgain) {
  Runtime runtime(options_with({adding()}));
  const WorkloadHandle add = runtime.workload("add");
  std::vector<TaskFuture> kept;
  TaskFuture sum = runtime.submit(add, {number(0), number(0)});
  for (int i = 1; i <= 3000; ++i) {
    TaskFuture next = runtime.submit(add, {sum.output(0), number(1)});
    if (i % 3 == 0) kept.push_back(sum);  // Of i - 1.
    sum = std::move(next);
    if (i % 500 == 0) runtime.wait_all();
  }
  EXPECT_EQ(value_of(sum.get()), 3000);
  for (std::size_t i = 0; i < kept.size(); ++i) {
    EXPECT_EQ(value_of(kept[i].get()), 3.0 * static_cast<double>(i) + 2);
  }
}

TEST(Runtime, RefusesTasksThatDoNotFit) {
  Runtime runtime(options_with({adding()}));
  const auto refused = [&](std::string_view name, std::vector<TaskInput> inputs,
                           TaskOptions options = {}) {
    return bad_input([&] { runtime.submit(name, std::move(inputs), std::move(options)); });
  };
  EXPECT_THAT(refused("ad", {number(1), number(2)}), HasSubstr("did you mean add"));
  EXPECT_THAT(refused("add", {number(1)}), HasSubstr("2 inputs"));
  const Tensor other({.name = "x", .element = Element::kF32, .shape = {1}});
  EXPECT_THAT(refused("add", {number(1), other}), HasSubstr("f32[1]"));
  const auto sum = runtime.submit("add", {number(1), number(2)});
  EXPECT_THAT(refused("add", {number(1), sum.output(1)}), HasSubstr("not there"));
  Runtime second(options_with({adding()}));
  EXPECT_THAT(bad_input([&] {
                second.submit("add", {number(1), sum.output(0)});
              }),
              HasSubstr("another runtime"));
  EXPECT_THAT(refused("add", {number(1), number(2)}, {.eligible = {"dsp"}}), HasSubstr("dsp"));
  EXPECT_EQ(runtime.statistics().submitted, 1);
}

// Outputs that a tensor shares are its own, whatever becomes of the future.
TEST(Runtime, OverwritesNothingThatATensorShares) {
  Runtime runtime(options_with({adding()}, kOneUnit));
  std::vector<Tensor> kept;
  std::vector<TaskFuture> sums;
  for (int i = 0; i < 50; ++i) {
    const auto task = runtime.submit("add", {number(i), number(0)});
    kept.push_back(task.get()[0].share());
    // As a callback would that submits what it was given, and lets its future go.
    sums.push_back(runtime.submit("add", {task.get()[0], number(1000)}));
  }
  for (int i = 0; i < 50; ++i) {
    EXPECT_EQ(kept[static_cast<std::size_t>(i)].as<double>()[0], i);
    EXPECT_EQ(value_of(sums[static_cast<std::size_t>(i)].get()), 1000 + i);
  }
}

TEST(OutputPool, WritesAgainWhatComesBackAndKeepsNothingForWhoDoesNotLetGo) {
  Workload workload;
  workload.outputs = {kNumber};
  OutputPool pool;
  std::vector<OutputPool::Outputs> kept;
  for (int i = 0; i < 8; ++i) kept.push_back(pool.take(workload));
  std::set<const std::byte*> places;
  for (int i = 0; i < 100; ++i) places.insert((*pool.take(workload))[0].data());
  EXPECT_EQ(places.size(), 1U);
  auto set = pool.take(workload);
  const Tensor shared = (*set)[0].share();
  set = nullptr;
  const auto next = pool.take(workload);
  EXPECT_NE((*next)[0].data(), shared.data());
}

TEST(Runtime, TasksThatNoUnitIsLeftForFailAlsoThoseToCome) {
  static std::binary_semaphore never(0);  // Static: the call never comes back.
  auto options =
      options_with({own("hangs", 1, [](auto, auto) { never.acquire(); }), adding()}, kOneUnit);
  options.time_limit = 100ms;
  Runtime runtime(std::move(options));
  const auto bad = runtime.submit("hangs", {number(1)});
  const auto behind = runtime.submit("add", {number(1), number(2)});
  const auto after = runtime.submit("add", {behind.output(0), number(2)});
  runtime.wait_all();
  EXPECT_EQ(bad.wait(), TaskEnd::kFailed);
  EXPECT_EQ(behind.wait(), TaskEnd::kFailed);
  EXPECT_EQ(after.wait(), TaskEnd::kDropped);
  const auto late = runtime.submit("add", {number(1), number(2)});
  EXPECT_EQ(late.wait(), TaskEnd::kFailed);
  EXPECT_THAT(late.problem(), HasSubstr("no unit is left"));
  expect_balance(runtime.statistics());
}

// Where real-time priorities are permitted, units have them; elsewhere it is said.
TEST(Runtime, ComputesAtAPriorityOrSaysThatItIsNotPermitted) {
  auto options = options_with({adding()});
  options.priority = 10;
  Runtime runtime(std::move(options));
  TaskFuture sum = runtime.submit("add", {number(0), number(1)});
  for (int i = 2; i <= 1000; ++i) sum = runtime.submit("add", {sum.output(0), number(i)});
  EXPECT_EQ(value_of(sum.get()), 500500);
  for (const std::string& problem : runtime.statistics().problems) {
    EXPECT_THAT(problem, HasSubstr("no real-time priority 10"));
  }
}

TEST(Runtime, TakesADriversBufferWithoutACopyAndSaysWhenItIsFree) {
  alignas(Tensor::kAlignment) static std::array<double, 8> buffer;
  const auto* const bytes = reinterpret_cast<const std::byte*>(buffer.data());
  std::atomic<int> released = 0;
  std::atomic<const std::byte*> seen = nullptr;
  Runtime runtime(options_with({own("look", 1, [&](auto in, auto out) {
    seen = in[0].data();
    out[0].template as<double>()[0] = value_of(in);
  })}));
  for (int i = 0; i < 3; ++i) {
    buffer[0] = i;
    {
      const auto task = runtime.submit("look", {Tensor::over(kNumber, bytes, [&] { ++released; })});
      EXPECT_EQ(value_of(task.get()), i);
    }
    runtime.wait_all();
    EXPECT_EQ(seen, bytes);
    EXPECT_EQ(released, i + 1);  // The driver may fill it again.
  }
  {
    const Tensor one = Tensor::over(kNumber, bytes, [&] { ++released; });
    const Tensor other = one.share();
    EXPECT_EQ(released, 3);
  }
  EXPECT_EQ(released, 4);
  EXPECT_THAT(bad_input([&] { static_cast<void>(Tensor::over(kNumber, bytes + 8)); }),
              HasSubstr("aligned to 64 bytes"));
  EXPECT_THAT(bad_input([&] { static_cast<void>(Tensor::over(kNumber, nullptr)); }),
              HasSubstr("no memory"));
}

TEST(Runtime, AUnitThatWasLostCanBeBroughtBack) {
  static std::binary_semaphore never(0);  // Static: the call never comes back.
  auto options =
      options_with({own("hangs", 1, [](auto, auto) { never.acquire(); }), adding()}, kOneUnit);
  options.time_limit = 100ms;
  Runtime runtime(std::move(options));
  for (int i = 0; i < 2; ++i) {
    EXPECT_EQ(runtime.submit("hangs", {number(1)}).wait(), TaskEnd::kFailed);
    EXPECT_EQ(runtime.submit("add", {number(1), number(2)}).wait(), TaskEnd::kFailed);
    EXPECT_FALSE(runtime.statistics().units[0].in_service);
    runtime.bring_back("cpu");
    EXPECT_TRUE(runtime.statistics().units[0].in_service);
    const auto sum = runtime.submit("add", {number(1), number(2)});
    EXPECT_EQ(value_of(sum.get()), 3);
  }
  runtime.bring_back("cpu");  // It serves all it can.
  EXPECT_THAT(bad_input([&] { runtime.bring_back("npu"); }), HasSubstr("npu"));
  expect_balance(runtime.statistics());
}

TEST(Runtime, WhatAUnitGaveBackTooOftenItIsAskedForAgainOnceBroughtBack) {
  static std::atomic<bool> broken;
  broken = true;
  const auto fickle = own("fickle", 1, [](auto in, auto out) {
    if (broken) throw_environment("not now");
    out[0].template as<double>()[0] = value_of(in);
  });
  Runtime runtime(options_with({fickle, adding()}, kOneUnit));
  for (int i = 0; i < LiveUnits::kMostReturns; ++i) runtime.submit("fickle", {number(1)}).wait();
  broken = false;
  runtime.bring_back("cpu");
  const auto task = runtime.submit("fickle", {number(7)});
  EXPECT_EQ(value_of(task.get()), 7);
}

TEST(Runtime, AFunctionHearsThatNobodyWantsItsResult) {
  static std::latch* begun = nullptr;
  static std::atomic<bool> waits;
  const auto patient = own("patient", 1, [](auto in, auto out) {
    out[0].template as<double>()[0] = value_of(in);
    if (waits) begun->count_down();
    while (waits && !stop_of_this_call().stop_requested()) std::this_thread::yield();
  });
  EXPECT_FALSE(stop_of_this_call().stop_possible());
  Runtime runtime(options_with({patient}, kOneUnit));
  for (int i = 0; i < 3; ++i) {
    std::latch one(1);
    begun = &one;
    waits = true;
    const auto cancelled = runtime.submit("patient", {number(1)});
    one.wait();
    runtime.cancel(cancelled);
    EXPECT_EQ(cancelled.wait(), TaskEnd::kCancelled);
    waits = false;
    const auto next = runtime.submit("patient", {number(i)});
    EXPECT_EQ(value_of(next.get()), i);  // It was not asked to.
  }
  std::latch last(1);
  begun = &last;
  waits = true;
  runtime.submit("patient", {number(1)});
  last.wait();  // And the runtime ends.
}

TEST(Runtime, AUnitThatCannotRunOneWorkloadStillRunsTheOthers) {
  OwnWorkload picky = own("picky", 1, {});
  picky.kernels = {
      {"cpu", [](auto, auto) { throw_environment("not this one"); }},
      {"gpu", [](auto in, auto out) { out[0].template as<double>()[0] = value_of(in); }}};
  Runtime runtime(options_with({picky, adding()}));
  for (int i = 0; i < 20; ++i) {
    const auto task = runtime.submit("picky", {number(i)});
    EXPECT_EQ(value_of(task.get()), i);
    EXPECT_EQ(task.unit(), "gpu");
  }
  const auto there = runtime.submit("add", {number(1), number(2)}, {.eligible = {"cpu"}});
  EXPECT_EQ(value_of(there.get()), 3);
  const auto statistics = runtime.statistics();
  EXPECT_TRUE(statistics.units[0].in_service);
  EXPECT_LE(statistics.returned, LiveUnits::kMostReturns);
}

TEST(Runtime, FuturesAndTensorsOutliveIt) {
  TaskFuture completed, failed;
  {
    Runtime runtime(options_with(
        {adding(), own("fails", 1, [](auto, auto) { throw std::runtime_error("no luck"); })}));
    completed = runtime.submit("add", {number(1), number(2)});
    failed = runtime.submit("fails", {number(1)});
    runtime.wait_all();
  }
  EXPECT_EQ(value_of(completed.get()), 3);
  try {
    static_cast<void>(failed.get());
    FAIL() << "outputs of a task that failed";
  } catch (const Error& error) {
    EXPECT_THAT(error.what(), AllOf(HasSubstr("fails has no outputs"), HasSubstr("no luck")));
  }
  EXPECT_THROW(static_cast<void>(TaskFuture().end()), std::logic_error);
  Runtime second(options_with({adding()}));
  EXPECT_THAT(bad_input([&] {
                second.submit("add", {completed.output(0), number(1)});
              }),
              HasSubstr("another runtime"));
  EXPECT_THAT(bad_input([&] {
                second.submit("add", {number(1), number(1)}, {.after = {completed}});
              }),
              HasSubstr("no task of this runtime"));
}

TEST(Runtime, CallbacksRunOnItsOwnThreadsAlone) {
  std::binary_semaphore go(0);
  Runtime runtime(options_with(
      {own("waits", 1, [&](std::span<const Tensor>, std::span<Tensor>) { go.acquire(); }),
       adding()},
      kOneUnit));
  const auto us = std::this_thread::get_id();
  std::atomic<int> heard = 0, here = 0;
  const auto callback = [&](const TaskFuture&, TaskEnd) {
    ++heard;
    if (std::this_thread::get_id() == us) ++here;
  };
  runtime.submit("waits", {number(1)}, {}, callback);
  const auto cancelled = runtime.submit("add", {number(1), number(1)}, {}, callback);
  runtime.submit("add", {cancelled.output(0), number(1)}, {}, callback);
  runtime.cancel(cancelled);
  EXPECT_EQ(cancelled.wait(), TaskEnd::kCancelled);
  runtime.submit("add", {cancelled.output(0), number(1)}, {}, callback);  // Doomed as it comes.
  go.release();
  runtime.wait_all();
  EXPECT_EQ(heard, 4);
  EXPECT_EQ(here, 0);
}

TEST(Runtime, WhatACallbackThrowsIsAProblemWhateverItIs) {
  std::mutex mutex;
  std::vector<std::string> said;
  auto options = options_with({adding()});
  options.problem = [&](const std::string& line) {
    const std::lock_guard lock(mutex);
    said.push_back(line);
  };
  {
    Runtime runtime(std::move(options));
    runtime.submit("add", {number(1), number(2)}, {}, [](auto&, auto) { throw 42; });
    runtime.wait_all();
    ASSERT_EQ(runtime.statistics().problems.size(), 1U);
    EXPECT_THAT(runtime.statistics().problems[0], HasSubstr("unknown type"));
  }
  EXPECT_THAT(said, testing::ElementsAre(HasSubstr("unknown type")));
}

TEST(Runtime, ACallbackThatAlwaysSubmitsDoesNotKeepItFromEnding) {
  std::function<void()> again;
  std::atomic<int> refused = 0;
  Runtime runtime(options_with({adding()}));
  again = [&] {
    try {
      runtime.submit("add", {number(1), number(2)}, {}, [&](auto&, auto) { again(); });
    } catch (const Error&) {
      ++refused;
      throw;
    }
  };
  again();
  again();
  // Its end comes here.
}

TEST(Runtime, WaitsForAsLongAsItIsToldAndSaysHowLongATaskTook) {
  std::binary_semaphore go(0);
  Runtime runtime(options_with(
      {own("waits", 1, [&](std::span<const Tensor>, std::span<Tensor>) { go.acquire(); }),
       adding()},
      kOneUnit));
  const auto first = runtime.submit("waits", {number(1)}, {.deadline = Nanos(1)});
  const auto second = runtime.submit("add", {number(1), number(1)}, {.deadline = Nanos::max()});
  EXPECT_FALSE(first.wait_for(2ms));
  go.release();
  EXPECT_EQ(first.wait_for(1h), TaskEnd::kCompleted);
  EXPECT_EQ(second.wait_for(Nanos::max()), TaskEnd::kCompleted);
  EXPECT_GE(first.latency(), Nanos(2ms));
  EXPECT_GE(second.waited(), Nanos(2ms));
  EXPECT_GE(second.latency(), second.waited());
  EXPECT_EQ(runtime.statistics().late, 1);
}

TEST(Runtime, TasksAfterOneThatIsLongOverAreInTheTraceToo) {
  const ScratchFolder folder;
  auto options = options_with(
      {adding(), own("fails", 1, [](auto, auto) { throw std::runtime_error("on purpose"); })});
  options.trace = (folder.path() / "trace.json").string();
  Runtime runtime(options);
  const auto failed = runtime.submit("fails", {number(1)});
  runtime.wait_all();
  for (int i = 0; i < 5; ++i) {
    EXPECT_EQ(runtime.submit("add", {failed.output(0), number(1)}).wait(), TaskEnd::kDropped);
  }
  runtime.write_trace();
  const auto log = load_trace_log(*options.trace);
  EXPECT_FALSE(replay(log, "trace").difference.has_value());
  // The one that failed, five after it, and the one that stands for what is over.
  EXPECT_EQ(std::ranges::count(log.entries, DispatcherInput::Kind::kSubmit,
                               [](const LogEntry& each) { return each.input.kind; }),
            7);
}

TEST(Runtime, APictureIsOneForTheModesThatAsk) {
  const ScratchFolder folder;
  RuntimeOptions options = options_with({adding()});
  options.workloads = {"sobel"};
  options.trace = (folder.path() / "trace.json").string();
  Runtime runtime(options);
  Tensor picture(find_workload("sobel").inputs[0]);
  runtime.submit("sobel", {picture}).wait();
  runtime.submit("sobel", {picture}, {.image_input = false}).wait();
  runtime.submit("add", {number(1), number(1)}).wait();
  runtime.write_trace();
  std::vector<bool> images;
  for (const LogEntry& each : load_trace_log(*options.trace).entries) {
    for (const Task& task : each.tasks) images.push_back(task.kind.image_input);
  }
  EXPECT_EQ(images, (std::vector<bool>{true, false, false}));
}

TEST(Runtime, RefusesUnitsThatAreNotWhatAThreadIs) {
  EXPECT_THAT(refusal(options_with({adding()}, R"(
platform: wide
units:
  cpu: {backend: cpu, cores: all, servers: 4, active_w: 1}
)")),
              AllOf(HasSubstr("4 servers"), HasSubstr("one call after the other")));
}

}  // namespace
}  // namespace pirt::test
