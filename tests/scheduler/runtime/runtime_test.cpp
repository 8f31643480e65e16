// The runtime library: what a program submits is computed once, wherever, and told. No test looks
// at how long anything took.
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

#include "scheduler/runtime/output_pool.h"
#include "tests/scheduler/runtime/runtime_support.h"
#include "workloads/catalog/catalog.h"
#include "workloads/inputs/pictures/images.h"

namespace pirt::test {
namespace {

using namespace std::chrono_literals;
using testing::AllOf;
using testing::HasSubstr;

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

// Of what a turn has decided, who hears of one thing may ask for all: threads tell one by one.
TEST(Runtime, AFutureHasEndedBeforeAnyoneIsToldOfWhatFollows) {
  std::latch submitted(1);
  Runtime runtime(options_with({own("throws", 1,
                                    [&](auto, auto) {
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

TEST(Runtime, CallbacksRunOnItsOwnThreadsAlone) {
  std::binary_semaphore go(0);
  Runtime runtime(
      options_with({own("waits", 1, [&](auto, auto) { go.acquire(); }), adding()}, kOneUnit));
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

TEST(Runtime, WhoWaitsWhereItWouldWaitForItselfIsTold) {
  Runtime runtime(options_with({adding()}));
  runtime.submit("add", {number(1), number(2)}, {},
                 [&](const TaskFuture&, TaskEnd) { runtime.wait_all(); });
  runtime.wait_all();
  const auto statistics = runtime.statistics();
  ASSERT_EQ(statistics.problems.size(), 1U);
  EXPECT_THAT(statistics.problems[0], HasSubstr("wait for itself"));
}

TEST(Runtime, WaitsForAsLongAsItIsToldAndSaysHowLongATaskTook) {
  std::binary_semaphore go(0);
  Runtime runtime(
      options_with({own("waits", 1, [&](auto, auto) { go.acquire(); }), adding()}, kOneUnit));
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

// Who gives a buffer back is in no turn of the runtime's, and waits for no room.
TEST(Runtime, WhoHearsThatABufferIsFreeMaySubmitTheNextAndAsk) {
  struct alignas(Tensor::kAlignment) Buffer {
    double value = 0;
  };
  static std::array<Buffer, 5> buffers;
  std::counting_semaphore<8> submitted(0);
  std::latch all(std::ssize(buffers));
  auto options = options_with({own("look", 1, [&](auto, auto) { submitted.acquire(); })}, kOneUnit);
  options.most_tasks = 1;
  Runtime runtime(std::move(options));
  std::function<void(std::size_t)> submit_from;
  submit_from = [&](std::size_t i) {
    const auto* const bytes = reinterpret_cast<const std::byte*>(&buffers.at(i));
    runtime.submit("look", {Tensor::over(kNumber, bytes, [&, i] {
                     static_cast<void>(runtime.statistics());
                     if (i + 1 < buffers.size()) submit_from(i + 1);
                     all.count_down();
                   })});
    submitted.release();  // Not before: the last that holds the buffer is the task.
  };
  submit_from(0);
  all.wait();
  runtime.wait_all();
  EXPECT_EQ(runtime.statistics().completed, std::ssize(buffers));
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

}  // namespace
}  // namespace pirt::test
