// Calls that are left between two slices while they run: by the runtime, and by a live run of a
// mix. No test looks at how long anything took.
#include <fmt/core.h>

#include <atomic>
#include <filesystem>
#include <latch>
#include <stop_token>
#include <thread>

#include "scheduler/runtime/kernel_unit.h"
#include "scheduler/schedule_live.h"
#include "scheduler/trace/replay.h"
#include "tests/scheduler/runtime/runtime_support.h"
#include "workloads/model/slices.h"

namespace pirt::test {
namespace {

using namespace std::chrono_literals;

OwnWorkload own(const std::string& name, std::function<void()> function) {
  return {.name = name,
          .inputs = {},
          .outputs = {},
          .kernels = {{"cpu", [function = std::move(function)](auto, auto) { function(); }}}};
}

RuntimeOptions edf_with(std::vector<ServedWorkload> served, std::optional<bool> slices = true) {
  RuntimeOptions options = options_with(std::move(served), kOneUnit);
  options.mode = "edf";
  options.slices = slices;
  return options;
}

std::string trace_path() {
  const std::string name = testing::UnitTest::GetInstance()->current_test_info()->name();
  return (std::filesystem::path(testing::TempDir()) / ("pirt_live_" + name + ".json")).string();
}

/// What a call of `long` and one of `short` did, in order.
struct Order {
  std::mutex mutex;
  std::string text;
  void add(const std::string& what) {
    const std::lock_guard lock(mutex);
    text += what + " ";
  }
};

/// `long` begins, waits until the others are submitted, and ends two slices more.
struct Slow {
  explicit Slow(Order& seen) : order(seen) {}
  Order& order;
  std::latch begun{1}, submitted{1};

  OwnWorkload workload() {
    return own("long", [this] {
      order.add("long");
      begun.count_down();
      submitted.wait();
      between_slices();
      order.add("goes on");
      between_slices();
      order.add("ends");
    });
  }
};

TEST(LiveSlices, AnUrgentTaskRunsBetweenTwoSlicesOfALongOne) {
  for (const bool slices : {true, false}) {
    Order order;
    Slow slow(order);
    auto options = edf_with({slow.workload(), own("short", [&] { order.add("short"); })}, slices);
    options.trace = trace_path();
    Runtime runtime(std::move(options));
    const auto task = runtime.submit("long", {}, {.deadline = 10s});
    slow.begun.wait();
    const auto late = runtime.submit("short", {}, {.deadline = 20s});
    const auto urgent = runtime.submit("short", {}, {.deadline = 1s});
    slow.submitted.count_down();
    runtime.wait_all();
    EXPECT_EQ(task.wait(), TaskEnd::kCompleted);
    EXPECT_EQ(order.text,
              slices ? "long short goes on ends short " : "long goes on ends short short ");
    const auto statistics = runtime.statistics();
    EXPECT_EQ(statistics.left, slices ? 1 : 0);
    EXPECT_EQ(statistics.completed, 3);
    runtime.write_trace();
    const auto replayed = replay_file(trace_path());
    EXPECT_FALSE(replayed.result.difference);
  }
}

TEST(LiveSlices, NestAsDeadlinesDo) {
  Order order;
  Slow slow(order);
  std::latch nested{1}, deepest{1};
  Runtime runtime(edf_with({slow.workload(),
                            own("middle",
                                [&] {
                                  order.add("middle");
                                  nested.count_down();
                                  deepest.wait();
                                  between_slices();
                                  order.add("middle ends");
                                }),
                            own("short", [&] { order.add("short"); })}));
  const auto first = runtime.submit("long", {}, {});
  slow.begun.wait();
  const auto second = runtime.submit("middle", {}, {.deadline = 10s});
  slow.submitted.count_down();
  nested.wait();
  const auto third = runtime.submit("short", {}, {.deadline = 1s});
  deepest.count_down();
  runtime.wait_all();
  EXPECT_EQ(order.text, "long middle short middle ends goes on ends ");
  EXPECT_EQ(runtime.statistics().left, 2);
}

TEST(LiveSlices, WhatIsLeftCanBeCancelledAndHearsOfItWhenItGoesOn) {
  std::latch begun{1}, submitted{1}, let_in{1}, cancelled{1};
  std::atomic<bool> before = true, after = false, inner = true;
  Runtime runtime(edf_with({own("long",
                                [&] {
                                  const std::stop_token stop = stop_of_call();
                                  before = stop.stop_requested();
                                  begun.count_down();
                                  submitted.wait();
                                  between_slices();
                                  after = stop.stop_requested() && stop_of_call().stop_requested();
                                }),
                            own("short", [&] {
                              let_in.count_down();
                              cancelled.wait();
                              inner = stop_of_call().stop_requested();
                            })}));
  const auto task = runtime.submit("long", {}, {});
  begun.wait();
  const auto urgent = runtime.submit("short", {}, {.deadline = 1s});
  submitted.count_down();
  let_in.wait();
  runtime.cancel(task);
  cancelled.count_down();
  EXPECT_EQ(task.wait(), TaskEnd::kCancelled);
  EXPECT_EQ(urgent.wait(), TaskEnd::kCompleted);
  runtime.wait_all();
  while (!after) std::this_thread::yield();
  EXPECT_FALSE(before);
  EXPECT_FALSE(inner) << "it was the other one that was cancelled";
}

TEST(LiveSlices, WhatIsLetInMayFailAndTheOtherGoesOn) {
  Order order;
  Slow slow(order);
  Runtime runtime(
      edf_with({slow.workload(), own("short", [] { throw std::runtime_error("no such luck"); })}));
  const auto task = runtime.submit("long", {}, {});
  slow.begun.wait();
  const auto urgent = runtime.submit("short", {}, {.deadline = 1s});
  slow.submitted.count_down();
  EXPECT_EQ(urgent.wait(), TaskEnd::kFailed);
  EXPECT_EQ(task.wait(), TaskEnd::kCompleted);
}

// The long call is not what hangs; its time limit does not count the other's. Both are lost with
// the unit, whose thread may end them when nobody knows of them any more.
TEST(LiveSlices, AHungCallTakesWhatItWasLetIntoWithIt) {
  auto ends = std::make_shared<std::latch>(1);
  auto gone = std::make_shared<std::latch>(1);
  auto begun = std::make_shared<std::latch>(1);
  auto submitted = std::make_shared<std::latch>(1);
  {
    auto options = edf_with({own("long",
                                 [=] {
                                   begun->count_down();
                                   submitted->wait();
                                   between_slices();
                                   gone->count_down();
                                 }),
                             own("short", [=] { ends->wait(); }), own("third", [] {})});
    options.time_limit = 300ms;
    options.trace = trace_path();
    Runtime runtime(std::move(options));
    const auto task = runtime.submit("long", {}, {});
    begun->wait();
    const auto urgent = runtime.submit("short", {}, {.deadline = 10s});
    submitted->count_down();
    EXPECT_EQ(urgent.wait(), TaskEnd::kFailed);
    EXPECT_EQ(task.wait(), TaskEnd::kFailed);
    EXPECT_THAT(task.problem(), testing::HasSubstr("left for short, which hangs"));
    EXPECT_GT(task.busy(), Nanos::zero()) << "what it computed before";
    EXPECT_FALSE(runtime.statistics().units[0].in_service);
    runtime.bring_back("cpu");
    EXPECT_TRUE(runtime.statistics().units[0].in_service);
    EXPECT_EQ(runtime.submit("third", {}, {}).wait(), TaskEnd::kCompleted);
    runtime.write_trace();
    EXPECT_FALSE(replay_file(trace_path()).result.difference);
  }
  ends->count_down();
  gone->wait();
}

TEST(LiveSlices, ARuntimeMayEndInTheMiddle) {
  for (int i = 0; i < 20; ++i) {
    Order order;
    Slow slow(order);
    {
      Runtime runtime(edf_with({slow.workload(), own("short", [&] { order.add("short"); })}));
      const auto task = runtime.submit("long", {}, {});
      slow.begun.wait();
      const auto urgent = runtime.submit("short", {}, {.deadline = 1s});
      slow.submitted.count_down();
    }
    EXPECT_THAT(order.text, testing::HasSubstr("ends"));
  }
}

// Whatever is submitted, from several threads and from callbacks: each task ends once.
TEST(LiveSlices, ManyTasksFromManyThreadsEndOnce) {
  std::atomic<int> runs = 0;
  const auto slices = [&runs](int count) {
    return [&runs, count] {
      for (int i = 0; i < count; ++i) between_slices();
      ++runs;
    };
  };
  auto options = edf_with({own("a", slices(5)), own("b", slices(3)), own("c", slices(0))});
  options.trace = trace_path();
  Runtime runtime(std::move(options));
  std::vector<std::jthread> threads;
  for (int t = 0; t < 3; ++t) {
    threads.emplace_back([&, t] {
      for (int i = 0; i < 300; ++i) {
        const char* const names[] = {"a", "b", "c"};
        runtime.submit(names[(i + t) % 3], {}, {.deadline = Nanos(1s) / (1 + (i * 7 + t) % 5)});
      }
    });
  }
  threads.clear();
  runtime.wait_all();
  const auto statistics = runtime.statistics();
  EXPECT_EQ(statistics.completed, 900);
  EXPECT_EQ(runs, 900);
  runtime.write_trace();
  EXPECT_FALSE(replay_file(trace_path()).result.difference);
}

Platform mapping_board(int slots) {
  return parse_platform("test.yaml",
                        fmt::format(R"(
platform: one
units:
  cpu: {{backend: cpu, cores: all, slots: {}, active_w: 1, idle_w: 0}}
workloads:
  bundle_adjust: {{cpu: [{{on: cpu, ms: 60}}]}}
  avoid_obstacles: {{cpu: [{{on: cpu, ms: 0.1}}]}}
)",
                                    slots),
                        {}, 2);
}

constexpr const char* kPlanningBesideMapping = R"(
mix: m
pipelines:
  planning: {rate_hz: 20, deadline_ms: 50, tasks: [{workload: avoid_obstacles}]}
  mapping: {rate_hz: 4, tasks: [{workload: bundle_adjust}]}
)";

// A mix live: plans come while a map is adjusted, and are let in; seldom enough that there is time
// to adjust between them where all takes fifty times as long. A unit with several slots is given
// the next call while one runs: it leaves none. The trace replays.
TEST(LiveSlices, ALiveRunLeavesCallsTooWhereAUnitHasOneSlot) {
  for (const int slots : {1, 2}) {
    SCOPED_TRACE(slots);
    const auto platform = mapping_board(slots);
    EXPECT_EQ(can_suspend_calls(platform.units[0]), slots == 1);
    ScheduleOptions options;
    options.mode = "edf";
    options.slices = true;
    options.duration = from_s(slots == 1 ? 2 : 1);
    options.trace = trace_path();
    LiveOptions live;
    live.time_limit = 100s;  // However busy the machine is.
    const auto record = run_live(platform, nullptr, mix_of(kPlanningBesideMapping), options, live);
    EXPECT_EQ(record.suspensions.value_or(0) > 0, slots == 1);
    EXPECT_EQ(record.submitted, record.completed + record.dropped + record.queued);
    EXPECT_EQ(record.failed, 0) << testing::PrintToString(record.warnings);
    EXPECT_FALSE(replay_file(trace_path()).result.difference);
  }
}

}  // namespace
}  // namespace pirt::test
