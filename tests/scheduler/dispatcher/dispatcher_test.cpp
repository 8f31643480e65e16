// The dispatcher's sequences, worked by hand. Letters as in support.h: "G3" = task 3 starts on the
// GPU.
#include "tests/scheduler/support.h"

namespace pirt::test {
namespace {

constexpr TaskClass kPlain{.eligible = kLocal};
constexpr TaskClass kImage{.eligible = kLocal, .image_input = true};
constexpr TaskClass kSlow{.eligible = kAll, .real_time = false};

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

TEST(Dispatcher, FailsAtOnceWhatItsPolicyWouldGiveToNobody) {
  Script script = throughput(1, 0, 1);
  const TaskClass dsp_only{.eligible = unit_bit(kDsp)};  // Which has no weight.
  EXPECT_EQ(script.submit(1, dsp_only), "x1");
  EXPECT_EQ(script.submit(2, kPlain), "G2");
  EXPECT_EQ(script.submit(3, dsp_only, {2}), "");
  EXPECT_EQ(script.submit(4, kPlain, {3}), "");
  EXPECT_EQ(script.complete(kGpu, 2), "x3 -4");
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
  setup.basic = &find_basic_policy("energy");  // D, G, C
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
  EXPECT_EQ(script.submit(1, kSlow), "L1");
  EXPECT_EQ(script.submit(2, kSlow), "L2");
  EXPECT_EQ(script.submit(3, kPlain), "G3");
}

TEST(Dispatcher, TakesBackWhatHasNotCompletedInTheCloudInTime) {
  // One slot in the cloud: 1 runs there, 2 is queued there; 3 has time.
  Script script(policy_of("advanced", setup_of(1, 1, 1)), {1, 1, 1, 1});
  EXPECT_EQ(script.submit_recalled(1, kSlow, Nanos(10)), "L1");
  EXPECT_EQ(script.submit_recalled(2, kSlow, Nanos(10)), "");
  EXPECT_EQ(script.submit_recalled(3, kSlow, Nanos(20)), "");
  EXPECT_EQ(script.dispatcher().next_wake(), Nanos(10));
  EXPECT_EQ(script.wake(Nanos(10)), "G2 <1") << "at once, and as soon as it has been let go";
  EXPECT_EQ(script.complete(kCloud, 1, Outcome::kReturned), "C1 L3");
  EXPECT_EQ(script.complete(kCpu, 1), "");
  EXPECT_EQ(script.complete(kCloud, 3), "");
  EXPECT_EQ(script.dispatcher().next_wake(), Nanos::max()) << "it completed in time";
  EXPECT_EQ(script.complete(kGpu, 2), "");
  EXPECT_EQ(script.dispatcher().counts().completed, 3);
  EXPECT_EQ(script.dispatcher().counts().returned, 1);
}

TEST(Dispatcher, TakesNothingBackThatNobodyElseWouldTake) {
  Script script(policy_of("advanced", setup_of(1, 1, 1)), {1, 1, 1, 1});
  const TaskClass only{.eligible = unit_bit(kCloud), .real_time = false};
  EXPECT_EQ(script.submit_recalled(1, only, Nanos(10)), "L1");
  EXPECT_EQ(script.submit_recalled(2, only, Nanos(10)), "");
  EXPECT_EQ(script.wake(Nanos(10)), "");
  EXPECT_EQ(script.complete(kCloud, 1), "L2");
}

TEST(Dispatcher, KnowsNoRecallOfWhatNobodyElseWouldTake) {
  Script script(policy_of("advanced", setup_of(1, 1, 1)), {1, 1, 1, 1});
  const TaskClass only{.eligible = unit_bit(kCloud), .real_time = false};
  EXPECT_EQ(script.submit_recalled(1, kSlow, Nanos(10)), "L1");
  EXPECT_EQ(script.submit_recalled(2, only, Nanos(20)), "");
  const Recall known = script.dispatcher().recall(1).value_or(Recall{});
  EXPECT_EQ(known.at, Nanos(10));
  EXPECT_EQ(known.from, unit_bit(kCloud));
  EXPECT_FALSE(script.dispatcher().recall(2).has_value());
  for (const UnitId unit : {kGpu, kDsp, kCpu}) EXPECT_EQ(script.set(unit, UnitState::kGone), "");
  EXPECT_FALSE(script.dispatcher().recall(1).has_value()) << "the others are gone";
}

TEST(Dispatcher, WhatCompletesWhileItIsWantedBackHasCompleted) {
  Script script(policy_of("advanced", setup_of(1, 1, 1)), {1, 1, 1, 1});
  EXPECT_EQ(script.submit_recalled(1, kSlow, Nanos(10)), "L1");
  EXPECT_EQ(script.wake(Nanos(10)), "<1");
  EXPECT_EQ(script.complete(kCloud, 1), "");
  EXPECT_EQ(script.dispatcher().counts().completed, 1);
  // And one that was cancelled meanwhile is not asked for.
  EXPECT_EQ(script.submit_recalled(2, kSlow, Nanos(20)), "L2");
  EXPECT_EQ(script.cancel(2), "-2");
  EXPECT_EQ(script.wake(Nanos(20)), "");
  EXPECT_EQ(script.complete(kCloud, 2, Outcome::kReturned), "");
}

TEST(Dispatcher, HandsWhatWaitsForTheCloudToOthersWhileItIsAway) {
  Script script(policy_of("advanced", setup_of(1, 1, 1)), {1, 1, 1, 1});
  EXPECT_EQ(script.submit(1, kSlow), "L1");
  EXPECT_EQ(script.submit(2, kSlow), "");
  EXPECT_EQ(script.set(kCloud, UnitState::kDraining), "G2");
  EXPECT_EQ(script.submit(3, kSlow), "C3");
  EXPECT_EQ(script.complete(kCloud, 1), "") << "its reply came all the same";
  EXPECT_EQ(script.set(kCloud, UnitState::kUp), "");
  EXPECT_EQ(script.submit(4, kSlow), "L4");
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
  EXPECT_EQ(script.dispatcher().next_wake(), Nanos::max());
  EXPECT_EQ(script.dispatcher().counts().expired, 1);
  EXPECT_EQ(script.dispatcher().counts().dropped, 1);
}

TEST(Dispatcher, AUnitThatGoesDownHandsOnWhatItHasNotStarted) {
  Script script = throughput(3, 0, 2);
  EXPECT_EQ(script.submit(1), "G1");
  EXPECT_EQ(script.submit(2), "");
  EXPECT_EQ(script.submit(3), "");
  EXPECT_EQ(script.set(kGpu, UnitState::kDraining), "C2");  // 3 waits in the CPU's queue.
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
  EXPECT_EQ(script.set(kGpu, UnitState::kDraining), "");
  EXPECT_EQ(script.submit(1, kPlain), "");
  EXPECT_EQ(script.submit(2, kImage), "");
  EXPECT_EQ(script.set(kGpu, UnitState::kUp), "G2");  // With an image first.
  EXPECT_EQ(script.complete(kGpu, 2), "G1");
}

TEST(Dispatcher, SaysWhenATaskWasDispatched) {
  // Dispatch is when it enters the unit's queue; from the high-priority queue, when the unit takes
  // it.
  NamedDispatcher dispatcher({1, 1, 1, {}}, policy_of("advanced", setup_of(2, 0, 0)));
  Effects out;
  dispatcher.submit(1, std::vector{task_of(1, kPlain)}, Nanos(1), out);
  dispatcher.submit(2, std::vector{task_of(2, kPlain)}, Nanos(2), out);
  dispatcher.submit(3, std::vector{task_of(3, kImage)}, Nanos(3), out);
  out.clear();
  dispatcher.complete(kGpu, 1, Outcome::kCompleted, Nanos(10), out);
  dispatcher.complete(kGpu, 3, Outcome::kCompleted, Nanos(20), out);
  ASSERT_EQ(out.started.size(), 2U);
  EXPECT_EQ(out.started[0].task, 3U);
  EXPECT_EQ(out.started[0].dispatched_at, Nanos(10));
  EXPECT_EQ(out.started[1].task, 2U);
  EXPECT_EQ(out.started[1].dispatched_at, Nanos(2));
}

TEST(Dispatcher, ExpiresWhatShouldHaveStartedBeforeWhateverInputComes) {
  // 2 and 3 wait behind 1, to be started by 10. At 10 they still may; at 11 none of these does.
  const auto waiting = [] {
    Script script = throughput(1, 0, 0);
    EXPECT_EQ(script.submit(1), "G1");
    EXPECT_EQ(script.submit(2, kPlain, {}, Nanos(10)), "");
    EXPECT_EQ(script.submit(3, kPlain, {}, Nanos(10)), "");
    return script;
  };
  Script script = waiting();
  script.at(Nanos(10));
  EXPECT_EQ(script.complete(kGpu, 1), "G2");
  EXPECT_EQ(script.complete(kGpu, 2), "G3");
  script = waiting();
  script.at(Nanos(11));
  EXPECT_EQ(script.complete(kGpu, 1), "!2 !3");
  script = waiting();
  script.at(Nanos(11));
  EXPECT_EQ(script.submit(4), "!2 !3");
  script = waiting();
  script.at(Nanos(11));
  EXPECT_EQ(script.cancel(3), "!2 !3");
  script = waiting();
  script.at(Nanos(11));
  EXPECT_EQ(script.set(kDsp, UnitState::kDraining), "!2 !3");
  // One that comes too late, with its successor.
  EXPECT_EQ(script.complete(kGpu, 1), "");
  EXPECT_EQ(script.submit(5, kPlain, {}, Nanos(11)), "G5");
  EXPECT_EQ(script.submit(6, kPlain, {}, Nanos(10)), "!6");
}

TEST(Dispatcher, RegistersAFiringBeforeItPlacesAnyOfIt) {
  // Weights G 1, C 1. 2 is placed on the GPU and 3 on the CPU before the GPU takes 1, the image,
  // from the high-priority queue.
  Script script = advanced(1, 0, 1);
  EXPECT_EQ(script.submit_all(1, {task_of(1, kImage), task_of(2, kPlain), task_of(3, kPlain)}),
            "G1 C3");
  EXPECT_EQ(script.dispatcher().state(2), TaskState::kQueued);
  EXPECT_EQ(script.dispatcher().load(kGpu), 2);
}

TEST(Dispatcher, RefusesACompletionOfWhatDoesNotRunThere) {
  Script script = throughput(2, 0, 1);
  EXPECT_EQ(script.submit(1), "G1");
  EXPECT_EQ(script.submit(2), "");
  EXPECT_EQ(script.complete(kCpu, 1), "refused");   // It runs on the GPU.
  EXPECT_EQ(script.complete(kGpu, 2), "refused");   // Queued.
  EXPECT_EQ(script.complete(kGpu, 99), "refused");  // Unknown.
  EXPECT_EQ(script.complete(77, 1), "refused");     // No such unit.
  EXPECT_EQ(script.complete(kGpu, 1), "G2");
  EXPECT_EQ(script.complete(kGpu, 1), "refused");  // Again.
  EXPECT_EQ(script.complete(kGpu, 2, Outcome::kFailed), "");
  EXPECT_EQ(script.complete(kGpu, 2), "refused");
  EXPECT_EQ(script.set(77, UnitState::kDraining), "refused");
  EXPECT_EQ(script.dispatcher().counts().completed, 1);
  EXPECT_EQ(script.dispatcher().counts().failed, 1);
  EXPECT_EQ(script.dispatcher().load(kGpu), 0);
  EXPECT_EQ(script.dispatcher().running(kGpu), 0);
}

TEST(Dispatcher, RefusesAFiringThatMakesNoSenseAsAWhole) {
  Script script = throughput(9, 0, 0, {9, 9, 9, {}});
  const std::vector<TaskId> two = {2};
  const std::vector<TaskId> three = {3};
  EXPECT_EQ(script.submit(1), "G1");
  EXPECT_EQ(script.submit_all(2, {task_of(2, kPlain, two)}), "refused");
  EXPECT_EQ(script.submit_all(2, {task_of(2, kPlain, three), task_of(3, kPlain)}), "refused");
  EXPECT_EQ(script.submit_all(2, {task_of(2, kPlain), task_of(3, {.eligible = 0})}), "refused");
  EXPECT_EQ(script.submit_all(2, {task_of(2, {.eligible = UnitMask{1} << 40})}), "refused");
  EXPECT_EQ(script.dispatcher().counts().submitted, 1);
  EXPECT_EQ(script.dispatcher().known_tasks(), 1U);
  EXPECT_EQ(script.dispatcher().known_firings(), 1U);
  // Nothing of it is left behind.
  EXPECT_EQ(script.submit_all(2, {task_of(2, kPlain), task_of(3, kPlain, two)}), "G2");
  EXPECT_EQ(script.complete(kGpu, 2), "G3");
}

TEST(Dispatcher, TakesATimeBeforeTheLastAsTheLast) {
  NamedDispatcher dispatcher({1, 1, 1, {}}, policy_of("throughput", setup_of(1, 0, 0)));
  Effects out;
  ASSERT_TRUE(dispatcher.submit(1, std::vector{task_of(1, kPlain)}, Nanos(10), out));
  ASSERT_TRUE(dispatcher.submit(2, std::vector{task_of(2, kPlain)}, Nanos(20), out));
  ASSERT_TRUE(dispatcher.complete(kGpu, 1, Outcome::kCompleted, Nanos(15), out));
  ASSERT_EQ(out.started.size(), 2U);
  EXPECT_EQ(out.started[1].dispatched_at, Nanos(20));
}

TEST(Dispatcher, ATaskAfterOneThatDidNotCompleteIsDroppedUntilTheFiringIsReleased) {
  // Of firing 7, task 1 fails, 2 is dropped with it, 3 expires and 4 is cancelled while it runs.
  const std::vector<TaskId> one = {1};
  Script script = throughput(2, 0, 0, {2, 1, 1, {}});
  NamedTask late = task_of(3, kPlain);
  late.expires_at = Nanos(5);
  EXPECT_EQ(
      script.submit_all(7, {task_of(1, kPlain), task_of(2, kPlain, one), task_of(4, kPlain), late}),
      "G1 G4");
  EXPECT_EQ(script.complete(kGpu, 1, Outcome::kFailed), "G3 -2");
  EXPECT_EQ(script.cancel(4), "-4");
  EXPECT_EQ(script.complete(kGpu, 3, Outcome::kFailed), "");
  for (const TaskId before : {TaskId{1}, TaskId{2}, TaskId{3}, TaskId{4}}) {
    EXPECT_EQ(script.submit(100 + before, kPlain, {before}), "-" + std::to_string(100 + before));
  }
  EXPECT_TRUE(script.release(7));
  EXPECT_FALSE(script.release(7));
  EXPECT_FALSE(script.release(8));
  // 4 has yet to complete; then nothing is known of its firing.
  EXPECT_EQ(script.complete(kGpu, 4), "");
  for (const TaskId before : {TaskId{1}, TaskId{2}, TaskId{3}, TaskId{4}})
    EXPECT_TRUE(script.release(100 + before));
  EXPECT_EQ(script.dispatcher().known_tasks(), 0U);
  EXPECT_EQ(script.dispatcher().known_firings(), 0U);
  EXPECT_EQ(script.submit_all(7, {task_of(1, kPlain, std::vector<TaskId>{4})}), "G1");
}

TEST(Dispatcher, TakesNoTaskForAnotherThatHadItsSlot) {
  Dispatcher dispatcher({9, 1, 1, {}}, policy_of("throughput", setup_of(9, 0, 0)));
  Effects out;
  const auto submit = [&](std::span<const TaskId> after) {
    const Task task{.kind = kPlain, .after = after};
    EXPECT_TRUE(dispatcher.submit(std::span(&task, 1), Nanos(0), out));
    return out.submitted.back();
  };
  const TaskId first = submit({});
  EXPECT_TRUE(dispatcher.complete(kGpu, first, Outcome::kCompleted, Nanos(0), out));
  const TaskId second = submit({});
  EXPECT_EQ(slot_of(second), slot_of(first));
  EXPECT_NE(second, first);
  EXPECT_FALSE(dispatcher.complete(kGpu, first, Outcome::kCompleted, Nanos(0), out));
  EXPECT_FALSE(dispatcher.state(first));
  const std::vector<TaskId> after = {first};
  submit(after);  // Not after the second.
  EXPECT_EQ(out.started.size(), 3U);
  // Whoever guesses the next id waits for nobody: not even itself.
  EXPECT_TRUE(dispatcher.complete(kGpu, second, Outcome::kCompleted, Nanos(0), out));
  const std::vector<TaskId> guessed = {second + (second - first)};
  EXPECT_EQ(submit(guessed), guessed[0]);
  EXPECT_EQ(out.started.size(), 4U);
  const std::vector<TaskId> never = {kNoTask};
  const TaskId dropped = submit(never);
  ASSERT_EQ(out.ended.size(), 1U);
  EXPECT_EQ(out.ended[0], (Ended{dropped, TaskEnd::kDropped}));
}

TEST(Dispatcher, MemoryIsFlatOverAMillionFiringsOfWhichATenthFails) {
  Dispatcher dispatcher({1, 1, 1, {}}, policy_of("throughput", setup_of(4, 0, 0)));
  Effects out;
  std::size_t most = 0;
  static constexpr std::uint32_t kBoth[] = {0, 1};
  std::vector<Task> tasks(3, Task{.kind = kPlain});
  tasks[2].after_own = kBoth;
  for (int i = 0; i < 1'000'000; ++i) {
    const auto firing = dispatcher.submit(tasks, Nanos(i), out);
    const TaskId second = out.submitted[1];
    while (!out.started.empty()) {
      const TaskId task = out.started.front().task;
      out.clear();
      const bool fails = i % 10 == 3 && task == second;
      dispatcher.complete(kGpu, task, fails ? Outcome::kFailed : Outcome::kCompleted, Nanos(i),
                          out);
    }
    most = std::max(most, dispatcher.known_tasks() + dispatcher.known_firings());
    ASSERT_TRUE(dispatcher.release(firing.value(), Nanos(i)));
  }
  EXPECT_EQ(dispatcher.counts().failed, 100'000);
  EXPECT_EQ(dispatcher.counts().dropped, 100'000);
  EXPECT_LE(most, 4U);
  EXPECT_EQ(dispatcher.known_tasks() + dispatcher.known_firings(), 0U);
}

TEST(Dispatcher, AnObserverThatThrowsReachesTheCallerAndLeavesTheDispatcherInOrder) {
  struct Throws final : DispatcherObserver {
    void on_input(const DispatcherInput&, const Answer&) override {
      throw std::runtime_error("no room");
    }
  } throws;
  Dispatcher dispatcher({1, 1, 1, {}}, policy_of("throughput", setup_of(2, 0, 0)));
  Effects out;
  dispatcher.observe(&throws);
  const std::vector<Task> tasks(2, Task{.kind = kPlain});
  EXPECT_THROW(dispatcher.submit(tasks, Nanos(1), out), std::runtime_error);
  ASSERT_EQ(out.submitted.size(), 2U);
  EXPECT_THROW(dispatcher.complete(kGpu, out.submitted[0], Outcome::kCompleted, Nanos(2), out),
               std::runtime_error);
  dispatcher.observe(nullptr);
  EXPECT_TRUE(dispatcher.complete(kGpu, out.submitted[1], Outcome::kCompleted, Nanos(3), out));
  EXPECT_EQ(dispatcher.counts().completed, 2);
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
