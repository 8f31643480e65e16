// Many tasks of the runtime library beside a plain model, and the traces that they leave.
#include <atomic>
#include <cmath>
#include <stdexcept>
#include <thread>

#include "tests/scheduler/runtime/runtime_support.h"
#include "tests/scheduler/trace_log.h"
#include "tests/support/long.h"
#include "tests/workloads/inputs/sequence_support.h"
#include "workloads/base/math/random.h"
#include "workloads/catalog/catalog.h"

namespace pirt::test {
namespace {

using testing::HasSubstr;

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
  const auto replayed = replay_file(*options.trace).result;
  EXPECT_FALSE(replayed.difference.has_value());
  EXPECT_GE(replayed.decisions, 100);
  EXPECT_GT(sum.busy(), Nanos::zero());
  EXPECT_THAT(bad_input([&] { runtime.write_trace(); }), HasSubstr("trace"));
}

TEST(Runtime, ATaskThatWasDueBeforeTheBeginIsInTheTraceToo) {
  const ScratchFolder folder;
  auto options = options_with({adding()});
  options.trace = (folder.path() / "trace.json").string();
  Runtime runtime(options);
  constexpr std::chrono::hours kAgo(-1);
  EXPECT_EQ(runtime.submit("add", {number(0), number(1)}, {.deadline = kAgo}).wait(),
            TaskEnd::kCompleted);
  runtime.submit("add", {number(0), number(1)}, {.expires = kAgo}).wait();
  EXPECT_EQ(runtime.statistics().late, 1);
  runtime.write_trace();
  EXPECT_FALSE(replay_file(*options.trace).result.difference.has_value());
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
  EXPECT_FALSE(replay_file(*options.trace).result.difference.has_value());
  // The one that failed, and five after it.
  EXPECT_EQ(std::ranges::count(log.entries, DispatcherInput::Kind::kSubmit,
                               [](const LogEntry& each) { return each.input.kind; }),
            6);
}

TEST(Runtime, APictureIsOneForTheModesThatAsk) {
  const ScratchFolder folder;
  RuntimeOptions options = options_with({adding()});
  options.workloads.emplace_back("sobel");
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

}  // namespace
}  // namespace pirt::test
