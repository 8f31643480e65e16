// The baseline policies as exact sequences worked by hand. Units gpu, dsp, cpu (and a cloud),
// written G, D, C, L.
#include "tests/scheduler/support.h"

namespace pirt::test {
namespace {

using std::chrono::milliseconds;
using testing::HasSubstr;

/// Every unit serves the one workload, in ms as given; the CPU has two servers. A cloud that takes
/// no time must never be asked.
PolicySetup timed(int gpu, int dsp, int cpu) {
  PolicySetup setup = setup_of(0, 0, 0);
  setup.servers = {1, 1, 2, 64};
  setup.costs.emplace_back();
  for (const int ms : {gpu, dsp, cpu, 0}) {
    setup.costs[0].push_back(CallCost{.total = milliseconds(ms), .occupied = milliseconds(ms)});
  }
  return setup;
}

/// Submits @p count tasks at time 0 of which none completes; what starts, in order.
std::string dealt(const std::string& mode, const PolicySetup& setup, int count,
                  UnitMask eligible = kAll) {
  Script script(policy_of(mode, setup), {std::nullopt, std::nullopt, std::nullopt, std::nullopt});
  std::string text;
  for (int i = 0; i < count; ++i) {
    const std::string started = script.submit(static_cast<TaskId>(i), {.eligible = eligible});
    text += started.empty() ? '.' : started.front();
  }
  return text;
}

TEST(CpuOnly, SendsEverythingToTheCpu) { EXPECT_EQ(dealt("cpu-only", timed(1, 1, 9), 5), "CCCCC"); }

TEST(CpuOnly, SharesBetweenCpusByTheirServers) {
  PolicySetup setup = timed(1, 1, 1);
  setup.roles = {Role::kCpu, Role::kDsp, Role::kCpu, Role::kCloud};
  // Loads over servers, unit 0 with one and unit 2 with two: 0/1 0/2 -> 0; 1/1 0/2 -> 2;
  // 1/1 1/2 -> 2; 1/1 2/2 -> 0.
  EXPECT_EQ(dealt("cpu-only", setup, 4), "GCCG");
}

TEST(Met, TakesTheFastestUnitWhateverItsLoad) {
  EXPECT_EQ(dealt("met", timed(5, 3, 4), 4), "DDDD");
  EXPECT_EQ(dealt("met", timed(5, 3, 4), 2, unit_bit(kGpu) | unit_bit(kCpu)), "CC");
  EXPECT_EQ(dealt("met", timed(3, 3, 4), 2), "GG");
}

TEST(Olb, TakesTheNextIdleUnitInOrderAndHoldsWithoutOne) {
  Script script(policy_of("olb", timed(9, 1, 5)), {4, 4, 4, 4});
  EXPECT_EQ(script.submit(1, {.eligible = kAll}), "G1");
  EXPECT_EQ(script.submit(2, {.eligible = kAll}), "D2");
  EXPECT_EQ(script.submit(3, {.eligible = kAll}), "C3");
  EXPECT_EQ(script.submit(4, {.eligible = kAll}), "C4");
  EXPECT_EQ(script.submit(5, {.eligible = kAll}), "");
  EXPECT_EQ(script.complete(kDsp, 2), "D5");
}

TEST(Ect, CountsWhatWaitsOnAUnit) {
  // gpu 2, dsp 5, cpu 4 on two servers. Ends if given: G 2; G 4 = C 4, the first is G; then
  // G 6, D 5, C 4 -> C; C 4 on its other server; then G 6, D 5, C 8 -> D; then G 6.
  EXPECT_EQ(dealt("ect", timed(2, 5, 4), 6), "GGCCDG");
}

TEST(Ect, TrustsAnIdleUnitMoreThanItsAccount) {
  Script script(policy_of("ect", timed(10, 12, 30)), {1, 1, 2, 1});
  EXPECT_EQ(script.submit(1, {.eligible = kAll}), "G1");
  // It took 1 ms in place of 10: idle at 1, so that the next ends at 11 there, at 13 on the DSP.
  script.at(milliseconds(1));
  EXPECT_EQ(script.complete(kGpu, 1), "");
  EXPECT_EQ(script.submit(2, {.eligible = kAll}), "G2");
  // Now 21 on the GPU and 13 on the DSP.
  EXPECT_EQ(script.submit(3, {.eligible = kAll}), "D3");
}

TEST(Ect, KnowsThatALateUnitHasItsWorkStillToDo) {
  // G 10, D 25: ends on the GPU would be 10, 20 and 30, so that the third goes to the DSP.
  Script script(policy_of("ect", timed(10, 25, 1000)), {1, 1, 1, 1});
  EXPECT_EQ(script.submit(1, {.eligible = 0b11}), "G1");
  EXPECT_EQ(script.submit(2, {.eligible = 0b11}), "");
  EXPECT_EQ(script.submit(3, {.eligible = 0b11}), "D3");
  EXPECT_EQ(script.dispatcher().load(kGpu), 2);
  script.at(milliseconds(40));
  EXPECT_EQ(script.complete(kDsp, 3), "");
  // The GPU should be idle and has two tasks, of which one waits: 40 + 10 + 10 < 40 + 25.
  EXPECT_EQ(script.submit(4, {.eligible = 0b11}), "");
  EXPECT_EQ(script.dispatcher().load(kGpu), 3);
  // Now two of them wait: 40 + 20 + 10 > 40 + 25.
  EXPECT_EQ(script.submit(5, {.eligible = 0b11}), "D5");
}

TEST(Ect, CountsWhatAUnitTookFromTheHighPriorityQueue) {
  PolicySetup setup = timed(10, 15, 1000);
  setup.basic = &find_basic_policy("ect");
  Script script(policy_of("advanced", setup), {1, 1, 1, 1});
  const TaskClass image{.eligible = unit_bit(kGpu), .image_input = true};
  EXPECT_EQ(script.submit(1, image), "G1");
  EXPECT_EQ(script.submit(2, {.eligible = 0b11}), "D2");  // At 20 on the GPU, at 15 on the DSP.
}

TEST(Ect, LetsAPipelinedUnitTakeTheNextBeforeTheLastIsOut) {
  // A call takes 6 ms on the GPU, of which it occupies it for 1: ends at 6, 7, 8, 9 (the CPU: 8).
  PolicySetup setup = timed(6, 20, 8);
  setup.costs[0][kGpu]->occupied = milliseconds(1);
  EXPECT_EQ(dealt("ect", setup, 4), "GGGC");
}

TEST(Edf, ServesTheEarliestDeadlineFirst) {
  Script script(policy_of("edf", timed(1, 100, 100)), {1, 1, 1, 1});
  const auto submit = [&](TaskId id, std::optional<Nanos> deadline) {
    NamedTask task = task_of(id, {.eligible = unit_bit(kGpu)});
    task.deadline = deadline;
    return script.submit_all(id, {task});
  };
  EXPECT_EQ(submit(1, std::nullopt), "G1");
  EXPECT_EQ(submit(2, std::nullopt), "");
  EXPECT_EQ(submit(3, milliseconds(30)), "");
  EXPECT_EQ(submit(4, milliseconds(10)), "");
  EXPECT_EQ(submit(5, milliseconds(20)), "");
  EXPECT_EQ(submit(6, milliseconds(10)), "");
  // By deadline, 4 before 6 by age, and 2, which has none, last.
  EXPECT_EQ(script.complete(kGpu, 1), "G4");
  EXPECT_EQ(script.complete(kGpu, 4), "G6");
  EXPECT_EQ(script.complete(kGpu, 6), "G5");
  EXPECT_EQ(script.complete(kGpu, 5), "G3");
  EXPECT_EQ(script.complete(kGpu, 3), "G2");
  EXPECT_EQ(script.complete(kGpu, 2), "");
}

TEST(Edf, AReleasedTaskGoesBeforeAHeldOneWithALaterDeadline) {
  // The GPU has one slot: 1, then 2, deadline 40; 3, deadline 500, is held meanwhile.
  PolicySetup setup = timed(10, 1000, 1000);
  setup.servers = {1, 1, 1, 1};
  Script script(policy_of("edf", setup), {1, 1, 1, 1});
  const std::vector<TaskId> one = {1};
  std::vector tasks = {task_of(1, {.eligible = unit_bit(kGpu)}),
                       task_of(2, {.eligible = unit_bit(kGpu)}, one),
                       task_of(3, {.eligible = unit_bit(kGpu), .entry = 1})};
  tasks[0].deadline = tasks[1].deadline = milliseconds(40);
  tasks[2].deadline = milliseconds(500);
  EXPECT_EQ(script.submit_all(1, {tasks[0], tasks[1]}), "G1");
  EXPECT_EQ(script.submit_all(2, {tasks[2]}), "");
  script.at(milliseconds(10));
  EXPECT_EQ(script.complete(kGpu, 1), "G2");
  script.at(milliseconds(20));
  EXPECT_EQ(script.complete(kGpu, 2), "G3");
}

TEST(Edf, PlacesTasksThatTakeNoTime) {
  Script script(policy_of("edf", timed(0, 0, 0)), {1, 1, 1, 1});
  EXPECT_EQ(script.submit(1, {.eligible = unit_bit(kGpu)}), "G1");
  EXPECT_EQ(script.submit(2, {.eligible = unit_bit(kGpu)}), "");
  EXPECT_EQ(script.complete(kGpu, 1), "G2");
}

TEST(Edf, HoldsATaskWhileItsBestUnitIsBusy) {
  // The GPU ends a second task at 4, before the CPU's 5: it is worth waiting for.
  Script script(policy_of("edf", timed(2, 50, 5)), {4, 4, 4, 4});
  EXPECT_EQ(script.submit(1, {.eligible = kAll}), "G1");
  EXPECT_EQ(script.submit(2, {.eligible = kAll}), "");
  EXPECT_EQ(script.complete(kGpu, 1), "G2");
}

TEST(Qilin, SplitsFramesInProportionToTheRates) {
  // Rates: gpu 1/2, dsp 1/6, cpu 2/6 a ms: of 6 frames 3, 1 and 2, all ending at 6 ms. Ends with
  // one frame more, G D C: 2 6 3 -> G; 4 6 3 -> C; 4 6 6 -> G; 6 6 6 -> G (the first); 8 6 6 -> D;
  // 8 12 6 -> C.
  EXPECT_EQ(dealt("qilin", timed(2, 6, 6), 6), "GCGGDC");
  EXPECT_EQ(dealt("qilin", timed(2, 6, 6), 12), "GCGGDCGCGGDC");
}

TEST(Baselines, NeverUseTheCloud) {
  for (const char* mode : {"cpu-only", "met", "olb", "ect", "edf", "qilin"}) {
    const auto policy = policy_of(mode, timed(1, 1, 1));
    EXPECT_FALSE(contains(policy->takers({.eligible = kAll}, kAll), kCloud)) << mode;
    EXPECT_EQ(dealt(mode, timed(1, 1, 1), 3, unit_bit(kCloud)), "xxx") << mode;  // fail at once
  }
}

TEST(PolicyTable, DescribesEveryPolicyOnce) {
  std::vector<std::string> seen;
  for (const auto& info : policies()) {
    EXPECT_FALSE(info.description.empty()) << info.name;
    EXPECT_EQ(info.description.find('\n'), std::string_view::npos) << info.name;
    EXPECT_EQ(std::ranges::find(seen, info.name), seen.end()) << info.name;
    seen.emplace_back(info.name);
  }
  for (const char* name : {"latency", "throughput", "energy", "advanced", "cpu-only", "met", "olb",
                           "ect", "edf", "qilin", "etf", "heft", "cpop", "peft", "shortest"}) {
    EXPECT_THAT(seen, testing::Contains(name));
  }
}

TEST(PolicyTable, AdvancedFallsBackToABaselineButNotToAPlan) {
  EXPECT_EQ(find_basic_policy("ect").name, "ect");
  const auto message = bad_input([] { static_cast<void>(find_basic_policy("heft")); });
  EXPECT_THAT(message, HasSubstr("heft is not a basic scheduler"));
  EXPECT_THAT(message, HasSubstr("ect"));
}

}  // namespace
}  // namespace pirt::test
