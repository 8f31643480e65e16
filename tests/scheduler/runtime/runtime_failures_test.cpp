// What goes wrong with tasks of the runtime library, and with its units: everything ends, by name,
// and nobody waits for ever.
#include <atomic>
#include <latch>
#include <semaphore>
#include <stdexcept>
#include <thread>

#include "scheduler/runtime/engine.h"
#include "tests/scheduler/runtime/runtime_support.h"

namespace pirt::test {
namespace {

using namespace std::chrono_literals;
using testing::HasSubstr;

constexpr const char* kCpuAndCloud = R"(
platform: two
units:
  cpu: {backend: fake, slots: 1, active_w: 1}
  cloud: {backend: fake, role: cloud, active_w: 1}
)";

OwnWorkload adding_everywhere() {
  OwnWorkload add = adding();
  add.kernels = {{"fake", add.kernels.at("cpu")}};
  return add;
}

TEST(Runtime, AKernelThatThrowsFailsByNameAndItsSuccessorsAreDropped) {
  Runtime runtime(options_with(
      {own("fails", 1, [](auto, auto) { throw std::runtime_error("no luck"); }), adding()}));
  const auto failed = runtime.submit("fails", {number(1)});
  const auto next = runtime.submit("add", {failed.output(0), number(1)});
  const auto after = runtime.submit("add", {number(1), number(1)}, {.after = {next}});
  EXPECT_EQ(failed.wait(), TaskEnd::kFailed);
  EXPECT_THAT(failed.problem(), HasSubstr("fails on"));
  EXPECT_THAT(failed.problem(), HasSubstr("no luck"));
  EXPECT_EQ(next.wait(), TaskEnd::kDropped);
  EXPECT_EQ(after.wait(), TaskEnd::kDropped);
  EXPECT_THAT(next.problem(), HasSubstr("add: dropped, since fails on"));
  EXPECT_THAT(after.problem(), HasSubstr("add: dropped, since fails on"));
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

TEST(Runtime, SaysHowLongAFunctionMayTakeThatSaysNothing) {
  std::vector<std::string> said;
  auto options = options_with({adding()});
  options.progress = [&said](const std::string& line) { said.push_back(line); };
  { const Runtime runtime(options); }
  EXPECT_THAT(said, testing::Contains(HasSubstr("add on gpu does not say what it is expected to "
                                                "take: a call that has not ended after 10 s")));
  said.clear();
  options.platform = parse_platform("test.yaml", kCpuAndCloud, {}, 2);
  options.workloads = {adding_everywhere()};
  { const Runtime runtime(options); }
  EXPECT_THAT(said, testing::Contains(HasSubstr("add on cpu does not say")));
  EXPECT_THAT(said, testing::Not(testing::Contains(HasSubstr("add on cloud does not say"))));
  said.clear();
  options.time_limit = std::chrono::seconds(1);
  { const Runtime runtime(options); }
  EXPECT_THAT(said, testing::Not(testing::Contains(HasSubstr("does not say"))));
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
  EXPECT_LE(statistics.returned, runtime::kMostReturns);
}

TEST(Runtime, RefusesATaskThatItsModeWouldGiveToNobody) {
  const auto refused = [](RuntimeOptions options, const char* mode, TaskOptions task) {
    options.mode = mode;
    Runtime runtime(std::move(options));
    return bad_input([&] { runtime.submit("add", {number(1), number(2)}, task); });
  };
  const auto beside_cloud = options_with({adding_everywhere()}, kCpuAndCloud);
  EXPECT_THAT(refused(beside_cloud, "ect", {.eligible = {"cloud"}}),
              HasSubstr("add: mode ect would never place this task: only cloud may serve it"));
  for (const char* mode : {"advanced", "budget"}) {
    EXPECT_THAT(refused(beside_cloud, mode, {.real_time = true, .eligible = {"cloud"}}),
                HasSubstr("would never place this task, which is real-time"));
  }
  OwnWorkload slow_here = adding();
  slow_here.expected = {{"cpu", 20ms}, {"gpu", 1ms}};  // A tenth of the fastest has no weight.
  EXPECT_THAT(refused(options_with({slow_here}), "throughput", {.eligible = {"cpu"}}),
              HasSubstr("mode throughput would never place"));
}

// What comes later is no worse off than the first ones.
TEST(Runtime, WhatTheOnlyUnitThatTheModeUsesGivesBackFailsHoweverOften) {
  const auto gives_back = [](auto, auto) { throw_environment("not this one"); };
  const auto adds = adding().kernels.at("cpu");
  OwnWorkload picky = adding();
  picky.name = "picky";
  picky.kernels = {{"cpu", gives_back}, {"cloud", adds}};
  OwnWorkload slow_here = adding();
  slow_here.name = "picky";
  slow_here.kernels = {{"cpu", adds}, {"gpu", gives_back}};
  slow_here.expected = {{"cpu", 20ms}, {"gpu", 1ms}};
  auto throughput = options_with({slow_here, adding()});
  throughput.mode = "throughput";
  for (const auto& options : {options_with({picky, adding()}, kCpuAndCloud), throughput}) {
    SCOPED_TRACE(options.mode);
    Runtime runtime(options);
    for (int i = 0; i < 2 * runtime::kMostReturns; ++i) {
      const auto task = runtime.submit("picky", {number(1), number(2)});
      ASSERT_EQ(task.wait_for(20s), TaskEnd::kFailed) << i;
      EXPECT_THAT(task.problem(), HasSubstr("not this one"));
    }
    EXPECT_EQ(runtime.submit("add", {number(1), number(2)}).wait(), TaskEnd::kCompleted);
  }
}

TEST(Runtime, WhatIsNotRealTimeMayBeTheCloudsAlone) {
  OwnWorkload far = adding();
  far.name = "far";
  far.kernels = {{"cloud", far.kernels.at("cpu")}};
  for (const char* mode : {"advanced", "budget"}) {
    auto options = options_with({far}, kCpuAndCloud);
    options.mode = mode;
    Runtime runtime(std::move(options));
    const auto task = runtime.submit("far", {number(1), number(2)});
    EXPECT_EQ(value_of(task.get()), 3);
    EXPECT_EQ(task.unit(), "cloud");
    EXPECT_THAT(bad_input([&] {
                  runtime.submit("far", {number(1), number(2)}, {.real_time = true});
                }),
                HasSubstr("real-time"));
  }
  auto options = options_with({far}, kCpuAndCloud);
  options.mode = "ect";
  EXPECT_THAT(refusal(std::move(options)), HasSubstr("can serve far"));
}

// The cpu, which is the first, is held until a task has ended elsewhere.
TEST(Runtime, ModeBudgetGivesTheCloudWhatIsNotRealTimeAlone) {
  std::counting_semaphore<> go(0);
  OwnWorkload waits = own("waits", 1, {});
  waits.kernels = {{"cpu", [&](auto, auto) { go.acquire(); }}, {"cloud", [](auto, auto) {}}};
  auto options = options_with({waits}, kCpuAndCloud);
  options.mode = "budget";
  Runtime runtime(std::move(options));
  const auto here = runtime.submit("waits", {number(1)}, {.real_time = true});
  const auto urgent = runtime.submit("waits", {number(1)}, {.real_time = true});
  const auto there = runtime.submit("waits", {number(1)});
  EXPECT_EQ(there.wait_for(20s), TaskEnd::kCompleted);
  EXPECT_EQ(there.unit(), "cloud");
  go.release(3);
  for (const TaskFuture& task : {here, urgent}) {
    EXPECT_EQ(task.wait(), TaskEnd::kCompleted);
    EXPECT_EQ(task.unit(), "cpu");
  }
}

TEST(Runtime, WhatAUnitGaveBackTooOftenItIsAskedForAgainOnceBroughtBack) {
  static std::atomic<bool> broken;
  broken = true;
  const auto fickle = own("fickle", 1, [](auto in, auto out) {
    if (broken) throw_environment("not now");
    out[0].template as<double>()[0] = value_of(in);
  });
  Runtime runtime(options_with({fickle, adding()}, kOneUnit));
  for (int i = 0; i < runtime::kMostReturns; ++i) runtime.submit("fickle", {number(1)}).wait();
  broken = false;
  runtime.bring_back("cpu");
  const auto task = runtime.submit("fickle", {number(7)});
  EXPECT_EQ(value_of(task.get()), 7);
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

// Of a task that was cancelled meanwhile, its call alone holds the buffer.
TEST(Runtime, WhatWaitedBehindAHungCallGivesItsBufferBackToWhoAsks) {
  static std::binary_semaphore never(0);  // Static: the call never comes back.
  alignas(Tensor::kAlignment) static double buffer = 0;
  std::binary_semaphore begun(0), freed(0);
  auto options = options_with({own("hangs", 1,
                                   [&](auto, auto) {
                                     begun.release();
                                     never.acquire();
                                   }),
                               adding()},
                              R"(
platform: one
units: {cpu: {backend: fake, slots: 2, active_w: 1}}
)");
  options.time_limit = 200ms;
  Runtime runtime(std::move(options));
  const auto hung = runtime.submit("hangs", {number(1)});
  begun.acquire();
  const auto* const bytes = reinterpret_cast<const std::byte*>(&buffer);
  const auto behind = runtime.submit("add", {number(1), Tensor::over(kNumber, bytes, [&] {
                                               static_cast<void>(runtime.statistics());
                                               freed.release();
                                             })});
  runtime.cancel(behind);
  EXPECT_EQ(behind.wait(), TaskEnd::kCancelled);
  EXPECT_TRUE(freed.try_acquire_for(20s));
  EXPECT_EQ(hung.wait(), TaskEnd::kFailed);
}

// Calls that a hung one kept from beginning are given back by nobody.
TEST(Runtime, WhatWaitedBehindAHungCallCountsAgainstNoUnit) {
  static std::binary_semaphore never(0);  // Static: the call never comes back.
  auto options = options_with({own("hangs", 1, [](auto, auto) { never.acquire(); }), adding()},
                              R"(
platform: one
units: {cpu: {backend: fake, slots: 4, active_w: 1}}
)");
  options.time_limit = 100ms;
  Runtime runtime(std::move(options));
  runtime.submit("hangs", {number(1)});
  for (int i = 0; i < runtime::kMostReturns; ++i) runtime.submit("add", {number(1), number(2)});
  runtime.wait_all();
  EXPECT_THAT(runtime.statistics().problems,
              testing::Not(testing::Contains(HasSubstr("not asked for add"))));
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

TEST(Runtime, CancelledTasksEndAndWhatComesAfterThemIsDropped) {
  std::binary_semaphore go(0);
  std::latch started(1);
  Runtime runtime(options_with({own("waits", 1,
                                    [&](auto, auto) {
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

// What a call makes of that counts against nobody.
TEST(Runtime, AFunctionThatFailsForItsCancellingIsAskedForAgain) {
  static std::latch* begun = nullptr;
  static std::atomic<bool> waits;
  const auto impatient = own("impatient", 1, [](auto in, auto out) {
    out[0].template as<double>()[0] = value_of(in);
    if (!waits) return;
    begun->count_down();
    while (!stop_of_this_call().stop_requested()) std::this_thread::yield();
    throw_environment("was stopped");
  });
  Runtime runtime(options_with({impatient}, kOneUnit));
  waits = true;
  for (int i = 0; i < runtime::kMostReturns; ++i) {
    std::latch one(1);
    begun = &one;
    const auto cancelled = runtime.submit("impatient", {number(1)});
    one.wait();
    runtime.cancel(cancelled);
    EXPECT_EQ(cancelled.wait(), TaskEnd::kCancelled);
  }
  waits = false;
  const auto next = runtime.submit("impatient", {number(7)});
  EXPECT_EQ(value_of(next.get()), 7);
  EXPECT_THAT(runtime.statistics().problems, testing::IsEmpty());
}

TEST(Runtime, ProgressHearsOfTheStartAloneAndWhatComesLaterMayAsk) {
  std::atomic<bool> broken = true, started = false, late = false;
  std::atomic<Runtime*> asked = nullptr;
  std::binary_semaphore ready(0);
  auto options = options_with({own("fickle", 1,
                                   [&](auto, auto) {
                                     if (broken) throw_environment("not now");
                                   })},
                              kOneUnit);
  options.progress = [&](const std::string&) {
    if (started) late = true;
  };
  options.problem = [&](const std::string& line) {
    if (line != "cpu is ready") return;
    static_cast<void>(asked.load()->statistics());
    ready.release();
  };
  Runtime runtime(std::move(options));
  asked = &runtime;
  started = true;
  for (int i = 0; i < runtime::kMostReturns; ++i) runtime.submit("fickle", {number(1)}).wait();
  EXPECT_FALSE(runtime.statistics().units[0].in_service);
  broken = false;
  runtime.bring_back("cpu");
  EXPECT_TRUE(ready.try_acquire_for(20s));
  EXPECT_FALSE(late.load());
}

TEST(Runtime, WhatHasNotStartedInTimeExpires) {
  std::binary_semaphore go(0);
  Runtime runtime(
      options_with({own("waits", 1, [&](auto, auto) { go.acquire(); }), adding()}, kOneUnit));
  const auto first = runtime.submit("waits", {number(1)});
  const auto late = runtime.submit("add", {number(1), number(1)}, {.expires = 10ms});
  EXPECT_EQ(late.wait(), TaskEnd::kExpired);
  go.release();
  EXPECT_EQ(first.wait(), TaskEnd::kCompleted);
}

TEST(Runtime, ItsEndCancelsWhatHasNotStarted) {
  std::vector<TaskFuture> futures;
  std::binary_semaphore go(0);
  {
    Runtime runtime(options_with({own("waits", 1,
                                      [&](auto, auto) {
                                        go.acquire();
                                        go.release();
                                      }),
                                  adding()}));
    for (int i = 0; i < 10; ++i) futures.push_back(runtime.submit("waits", {number(i)}));
    go.release();
  }
  for (const TaskFuture& future : futures) EXPECT_TRUE(future.end().has_value());
}

}  // namespace
}  // namespace pirt::test
