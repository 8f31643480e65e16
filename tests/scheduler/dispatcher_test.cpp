// The dispatcher's sequences, worked by hand. Letters as in support.h: "G3" = task 3 starts on the
// GPU.
#include "tests/scheduler/support.h"

namespace pirt::test {
namespace {

constexpr TaskClass kPlain{.eligible = kLocal};
constexpr TaskClass kImage{.eligible = kLocal, .image_input = true};

Script throughput(int gpu, int dsp, int cpu,
                  std::vector<std::optional<int>> slots = {1, 1, 1, {}}) {
  return {policy_of("throughput", setup_of(gpu, dsp, cpu)), std::move(slots)};
}
Script advanced(int gpu, int dsp, int cpu, std::vector<std::optional<int>> slots = {1, 1, 1, {}}) {
  return {policy_of("advanced", setup_of(gpu, dsp, cpu)), std::move(slots)};
}

TEST(Dispatcher, StartsUpToTheSlotsAndQueuesTheRest) {
  // Weights G 3, C 1; the GPU starts two at a time.
  Script script = throughput(3, 0, 1, {2, 1, 1, {}});
  EXPECT_EQ(script.submit(1), "G1");
  EXPECT_EQ(script.submit(2), "G2");
  EXPECT_EQ(script.submit(3), "");    // In the GPU's queue.
  EXPECT_EQ(script.submit(4), "C4");  // Qg = 3 is its weight.
  EXPECT_EQ(script.dispatcher().load(kGpu), 3);
  EXPECT_EQ(script.dispatcher().running(kGpu), 2);
  EXPECT_EQ(script.complete(kGpu, 2), "G3");
}

TEST(Dispatcher, HoldsInOrderUntilAQueueHasRoom) {
  Script script = throughput(1, 0, 1);
  EXPECT_EQ(script.submit(1), "G1");
  EXPECT_EQ(script.submit(2), "C2");
  EXPECT_EQ(script.submit(3), "");
  EXPECT_EQ(script.submit(4), "");
  EXPECT_EQ(script.dispatcher().state(3), TaskState::kHeld);
  EXPECT_EQ(script.complete(kCpu, 2), "C3");
  EXPECT_EQ(script.complete(kGpu, 1), "G4");
}

TEST(Dispatcher, AHeldClassDoesNotBlockAnother) {
  // The GPU-only tasks wait; a later one that the CPU may serve does not.
  Script script = throughput(1, 0, 1);
  const TaskClass gpu_only{.eligible = unit_bit(kGpu)};
  EXPECT_EQ(script.submit(1, gpu_only), "G1");
  EXPECT_EQ(script.submit(2, gpu_only), "");
  EXPECT_EQ(script.submit(3, kPlain), "C3");
  EXPECT_EQ(script.submit(4, kPlain), "");
  // The GPU is free: task 2 is the older of the two heads.
  EXPECT_EQ(script.complete(kGpu, 1), "G2");
  EXPECT_EQ(script.complete(kCpu, 3), "C4");
}

TEST(Dispatcher, Algorithm1IgnoresLoadSoThatASlowUnitCollects) {
  // Cycle G D C: tasks 2 and 5 are the DSP's, and 5 waits behind 2 although GPU and CPU are idle.
  Script script(policy_of("latency", setup_of(1, 1, 0)), {1, 1, 1, {}});
  EXPECT_EQ(script.submit(1), "G1");
  EXPECT_EQ(script.submit(2), "D2");
  EXPECT_EQ(script.submit(3), "C3");
  EXPECT_EQ(script.complete(kGpu, 1), "");
  EXPECT_EQ(script.complete(kCpu, 3), "");
  EXPECT_EQ(script.submit(4), "G4");
  EXPECT_EQ(script.submit(5), "");
  EXPECT_EQ(script.complete(kDsp, 2), "D5");
}

TEST(Dispatcher, ClearsHighPriorityBeforeOwnQueue) {
  // One unit: 1 runs, 2 waits in its queue, 3 comes with an image and goes first.
  Script script = advanced(3, 0, 0);
  EXPECT_EQ(script.submit(1, kPlain), "G1");
  EXPECT_EQ(script.submit(2, kPlain), "");
  EXPECT_EQ(script.submit(3, kImage), "");
  EXPECT_EQ(script.dispatcher().state(2), TaskState::kQueued);
  EXPECT_EQ(script.dispatcher().state(3), TaskState::kHighPriority);
  EXPECT_EQ(script.complete(kGpu, 1), "G3");
  EXPECT_EQ(script.complete(kGpu, 3), "G2");
}

TEST(Dispatcher, EachUnitTakesTheFirstHighPriorityTaskThatItCanServe) {
  Script script = advanced(2, 2, 2);
  const TaskClass for_cpu{.eligible = unit_bit(kCpu), .image_input = true};
  EXPECT_EQ(script.submit(1, kImage), "G1");
  EXPECT_EQ(script.submit(2, kImage), "C2");
  EXPECT_EQ(script.submit(3, kImage), "D3");
  EXPECT_EQ(script.submit(4, for_cpu), "");
  EXPECT_EQ(script.submit(5, kImage), "");
  EXPECT_EQ(script.submit(6, kImage), "");
  EXPECT_EQ(script.complete(kGpu, 1), "G5");  // 4 is first, but only the CPU can serve it.
  EXPECT_EQ(script.complete(kCpu, 2), "C4");
  EXPECT_EQ(script.complete(kDsp, 3), "D6");
}

TEST(Dispatcher, AUnitWithoutWeightTakesNothingFromHighPriority) {
  Script script = advanced(1, 0, 1);
  EXPECT_EQ(script.submit(1, kImage), "G1");
  EXPECT_EQ(script.submit(2, kImage), "C2");
  EXPECT_EQ(script.submit(3, kImage), "");  // The DSP is idle and could, but has weight 0.
  EXPECT_EQ(script.complete(kCpu, 2), "C3");
}

TEST(Dispatcher, AsksIdleUnitsInTheOrderOfTheBasicScheduler) {
  PolicySetup setup = setup_of(1, 1, 1);
  setup.basic = "energy";  // D, G, C
  Script script(policy_of("advanced", setup), {1, 1, 1, {}});
  EXPECT_EQ(script.submit(1, kImage), "D1");
  EXPECT_EQ(script.submit(2, kImage), "G2");
  EXPECT_EQ(script.submit(3, kImage), "C3");
}

TEST(Dispatcher, HighPriorityTasksCountInTheLoadThatTheBasicSchedulerSees) {
  Script script = advanced(1, 0, 1);
  EXPECT_EQ(script.submit(1, kImage), "G1");
  EXPECT_EQ(script.dispatcher().load(kGpu), 1);
  EXPECT_EQ(script.submit(2, kPlain), "C2");  // Qg is at its weight.
}

TEST(Dispatcher, SendsNonRealTimeTasksToTheCloudWithoutLimit) {
  Script script = advanced(1, 0, 0);
  const TaskClass slow{.eligible = kAll, .real_time = false};
  EXPECT_EQ(script.submit(1, slow), "L1");
  EXPECT_EQ(script.submit(2, slow), "L2");
  EXPECT_EQ(script.submit(3, kPlain), "G3");
}

TEST(Dispatcher, ReleasesATaskWhenItsLastPredecessorCompletes) {
  // A diamond: 1 -> {2, 3} -> 4.
  Script script = throughput(9, 0, 0, {9, 9, 9, {}});
  EXPECT_EQ(script.submit(1), "G1");
  EXPECT_EQ(script.submit(2, kPlain, {1}), "");
  EXPECT_EQ(script.submit(3, kPlain, {1}), "");
  EXPECT_EQ(script.submit(4, kPlain, {2, 3}), "");
  EXPECT_EQ(script.complete(kGpu, 1), "G2 G3");
  EXPECT_EQ(script.complete(kGpu, 3), "");
  EXPECT_EQ(script.complete(kGpu, 2), "G4");
}

TEST(Dispatcher, TakesAnUnknownPredecessorAsComplete) {
  Script script = throughput(9, 0, 0);
  EXPECT_EQ(script.submit(1), "G1");
  EXPECT_EQ(script.complete(kGpu, 1), "");
  EXPECT_EQ(script.submit(2, kPlain, {1}), "G2");
}

TEST(Dispatcher, WhatWaitsAlreadyGoesBeforeWhatIsReleased) {
  // Weight 1 on the GPU alone. 1 runs, 2 follows it, 3 is held: the room that 1 leaves is 3's.
  Script script = throughput(1, 0, 0);
  EXPECT_EQ(script.submit(1), "G1");
  EXPECT_EQ(script.submit(2, kPlain, {1}), "");
  EXPECT_EQ(script.submit(3), "");
  EXPECT_EQ(script.complete(kGpu, 1), "G3");
  EXPECT_EQ(script.complete(kGpu, 3), "G2");
}

TEST(Dispatcher, AFailedTaskDropsItsSuccessorsOnce) {
  Script script = throughput(9, 0, 0, {9, 9, 9, {}});
  EXPECT_EQ(script.submit(1), "G1");
  EXPECT_EQ(script.submit(2, kPlain, {1}), "");
  EXPECT_EQ(script.submit(3, kPlain, {1}), "");
  EXPECT_EQ(script.submit(4, kPlain, {2, 3}), "");
  EXPECT_EQ(script.submit(5), "G5");
  EXPECT_EQ(script.complete(kGpu, 1, Outcome::kFailed), "-2 -3 -4");
  const TaskCounts& counts = script.dispatcher().counts();
  EXPECT_EQ(counts.failed, 1);
  EXPECT_EQ(counts.dropped, 3);
  EXPECT_EQ(counts.queued(), 1);
}

TEST(Dispatcher, CancelsInEveryState) {
  Script script = advanced(2, 0, 0);
  EXPECT_EQ(script.submit(1, kPlain), "G1");
  EXPECT_EQ(script.submit(2, kPlain), "");
  EXPECT_EQ(script.submit(3, kPlain), "");
  EXPECT_EQ(script.submit(4, kImage), "");
  EXPECT_EQ(script.submit(5, kPlain, {1}), "");
  EXPECT_EQ(script.submit(6, kPlain, {5}), "");
  EXPECT_EQ(script.dispatcher().state(1), TaskState::kRunning);
  EXPECT_EQ(script.dispatcher().state(2), TaskState::kQueued);
  EXPECT_EQ(script.dispatcher().state(3), TaskState::kHeld);
  EXPECT_EQ(script.dispatcher().state(4), TaskState::kHighPriority);
  EXPECT_EQ(script.dispatcher().state(5), TaskState::kWaiting);

  EXPECT_EQ(script.cancel(4), "-4");
  EXPECT_EQ(script.cancel(5), "-5 -6");
  EXPECT_EQ(script.cancel(2), "-2");  // 3 moves up into the queue.
  EXPECT_EQ(script.dispatcher().state(3), TaskState::kQueued);
  EXPECT_EQ(script.cancel(3), "-3");
  EXPECT_EQ(script.dispatcher().load(kGpu), 1);
  EXPECT_EQ(script.cancel(1), "-1");
  EXPECT_EQ(script.cancel(1), "");   // Once is enough,
  EXPECT_EQ(script.cancel(99), "");  // and an unknown task may have ended meanwhile.
  EXPECT_EQ(script.dispatcher().counts().dropped, 6);
  EXPECT_EQ(script.dispatcher().counts().queued(), 0);
}

TEST(Dispatcher, ACancelledTaskKeepsItsSlotUntilItIsCompleted) {
  Script script = throughput(2, 0, 0);
  EXPECT_EQ(script.submit(1), "G1");
  EXPECT_EQ(script.submit(2), "");
  EXPECT_EQ(script.cancel(1), "-1");
  EXPECT_EQ(script.dispatcher().running(kGpu), 1);
  EXPECT_EQ(script.submit(3, kPlain, {1}), "-3");  // Its predecessor will never have completed.
  EXPECT_EQ(script.complete(kGpu, 1), "G2");
  EXPECT_EQ(script.dispatcher().counts().completed, 0);
  EXPECT_EQ(script.dispatcher().counts().dropped, 2);
}

TEST(Dispatcher, ExpiresWhatHasNotStartedInTime) {
  Script script = throughput(2, 0, 0);
  EXPECT_EQ(script.submit(1, kPlain, {}, Nanos(10)), "G1");
  EXPECT_EQ(script.submit(2, kPlain, {}, Nanos(10)), "");
  EXPECT_EQ(script.submit(3, kPlain, {}, Nanos(20)), "");
  EXPECT_EQ(script.submit(4, kPlain, {2}), "");
  EXPECT_EQ(script.dispatcher().next_wake(), Nanos(10));
  EXPECT_EQ(script.wake(Nanos(9)), "");
  EXPECT_EQ(script.wake(Nanos(10)), "!2 -4");  // 1 runs; 3, held till now, is queued behind it.
  EXPECT_EQ(script.dispatcher().state(3), TaskState::kQueued);
  EXPECT_EQ(script.dispatcher().next_wake(), Nanos(20));
  EXPECT_EQ(script.complete(kGpu, 1), "G3");
  EXPECT_EQ(script.dispatcher().next_wake(), std::nullopt);
  EXPECT_EQ(script.dispatcher().counts().expired, 1);
  EXPECT_EQ(script.dispatcher().counts().dropped, 1);
}

TEST(Dispatcher, AUnitThatGoesDownHandsOnWhatItHasNotStarted) {
  Script script = throughput(3, 0, 2);
  EXPECT_EQ(script.submit(1), "G1");
  EXPECT_EQ(script.submit(2), "");
  EXPECT_EQ(script.submit(3), "");
  EXPECT_EQ(script.set(kGpu, UnitState::kDown), "C2");  // 3 waits in the CPU's queue.
  EXPECT_EQ(script.dispatcher().load(kGpu), 1);
  EXPECT_EQ(script.dispatcher().load(kCpu), 2);
  EXPECT_EQ(script.submit(4), "");  // Held: the CPU is at its weight.
  EXPECT_EQ(script.complete(kGpu, 1, Outcome::kFailed), "");
  EXPECT_EQ(script.set(kGpu, UnitState::kUp), "G4");
  EXPECT_EQ(script.complete(kCpu, 2), "C3");
}

TEST(Dispatcher, ReturnedTasksKeepTheirPlaceInLine) {
  // 2 and 3 waited for the GPU before 4 was held; the CPU alone takes them in that order.
  Script script = throughput(3, 0, 1);
  EXPECT_EQ(script.submit(1), "G1");
  EXPECT_EQ(script.submit(2), "");
  EXPECT_EQ(script.submit(3), "");
  EXPECT_EQ(script.submit(4), "C4");
  EXPECT_EQ(script.submit(5), "");
  EXPECT_EQ(script.set(kGpu, UnitState::kDraining), "");
  EXPECT_EQ(script.complete(kGpu, 1), "");
  EXPECT_EQ(script.complete(kCpu, 4), "C2");
  EXPECT_EQ(script.complete(kCpu, 2), "C3");
  EXPECT_EQ(script.complete(kCpu, 3), "C5");
}

TEST(Dispatcher, WaitsWhileNoUnitIsUp) {
  Script script = advanced(1, 0, 0);
  EXPECT_EQ(script.set(kGpu, UnitState::kDown), "");
  EXPECT_EQ(script.submit(1, kPlain), "");
  EXPECT_EQ(script.submit(2, kImage), "");
  EXPECT_EQ(script.set(kGpu, UnitState::kUp), "G2");  // With an image first.
  EXPECT_EQ(script.complete(kGpu, 2), "G1");
}

TEST(Dispatcher, SaysWhenATaskWasDispatched) {
  // Dispatch is when it enters the unit's queue; from the high-priority queue, when the unit takes
  // it.
  Dispatcher dispatcher({1, 1, 1, {}}, policy_of("advanced", setup_of(2, 0, 0)));
  Starts out;
  dispatcher.submit({.id = 1, .kind = kPlain, .deadline = {}, .expires_at = {}}, Nanos(1), out);
  dispatcher.submit({.id = 2, .kind = kPlain, .deadline = {}, .expires_at = {}}, Nanos(2), out);
  dispatcher.submit({.id = 3, .kind = kImage, .deadline = {}, .expires_at = {}}, Nanos(3), out);
  out.clear();
  dispatcher.complete(kGpu, 1, Outcome::kCompleted, Nanos(10), out);
  dispatcher.complete(kGpu, 3, Outcome::kCompleted, Nanos(20), out);
  ASSERT_EQ(out.started.size(), 2U);
  EXPECT_EQ(out.started[0].task, 3U);
  EXPECT_EQ(out.started[0].dispatched_at, Nanos(10));
  EXPECT_EQ(out.started[1].task, 2U);
  EXPECT_EQ(out.started[1].dispatched_at, Nanos(2));
}

TEST(Dispatcher, DropsALongChainWithoutRecursion) {
  Script script = throughput(1, 0, 0);
  static_cast<void>(script.submit(0));
  for (TaskId id = 1; id <= 200'000; ++id) static_cast<void>(script.submit(id, kPlain, {id - 1}));
  static_cast<void>(script.complete(kGpu, 0, Outcome::kFailed));
  EXPECT_EQ(script.dispatcher().counts().dropped, 200'000);
  EXPECT_EQ(script.dispatcher().counts().queued(), 0);
}

}  // namespace
}  // namespace pirt::test
