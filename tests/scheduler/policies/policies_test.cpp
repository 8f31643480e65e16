// Algorithms 1 to 4 as exact sequences. Units gpu, dsp, cpu (and a cloud), written G, D, C, L.
#include "tests/scheduler/support.h"

namespace pirt::test {
namespace {

/// Where the policy puts @p count tasks one after the other; loads rise with each and never fall.
/// '.' = held, 'H' = high priority.
std::string placements(Policy& policy, int count, TaskClass kind = {.eligible = kLocal},
                       UnitMask up = kAll) {
  std::vector<int> load(kRoles.size(), 0);
  std::string text;
  for (int i = 0; i < count; ++i) {
    const Placement placement = policy.place(kind, {.load = load, .up = up});
    if (placement.kind == Placement::Kind::kUnit) {
      text += letter(placement.unit);
      ++load[placement.unit];
    } else {
      text += placement.holds() ? '.' : 'H';
    }
  }
  return text;
}

TEST(Algorithm1, DealsOutACycleOfNineForWeights5And1And2) {
  // N:     0 1 2 3 4 | 5 | 6 7 | else, N = 0
  // N < 5: G G G G G;  N < 6: D;  N < 8: C C;  else: C.
  const auto policy = policy_of("latency", setup_of(5, 1, 2));
  EXPECT_EQ(placements(*policy, 18), "GGGGGDCCCGGGGGDCCC");
}

TEST(Algorithm1, GivesTheCpuItsElseEvenWithWeightZero) {
  // N < 2: G G; N < 3: D; N < 3: never; else: C, N = 0.
  const auto policy = policy_of("latency", setup_of(2, 1, 0));
  EXPECT_EQ(placements(*policy, 8), "GGDCGGDC");
}

TEST(Algorithm1, CountsEachWorkloadForItself) {
  PolicySetup setup = setup_of(1, 1, 0);
  setup.weights.push_back(setup.weights.front());
  const auto policy = policy_of("latency", setup);
  const TaskClass first{.workload = 0, .eligible = kLocal};
  const TaskClass second{.workload = 1, .eligible = kLocal};
  // Cycle G D C for either; the second workload's N starts at 0 whatever the first has had.
  EXPECT_EQ(placements(*policy, 2, first), "GD");
  EXPECT_EQ(placements(*policy, 1, second), "G");
  EXPECT_EQ(placements(*policy, 2, first), "CG");
  EXPECT_EQ(placements(*policy, 2, second), "DC");
}

TEST(Algorithm1, PassesOverUnitsThatMayNotServe) {
  // Without the GPU: N < 1: D; N < 3: C C; else C.
  const auto policy = policy_of("latency", setup_of(5, 1, 2));
  EXPECT_EQ(placements(*policy, 8, {.eligible = unit_bit(kDsp) | unit_bit(kCpu)}), "DCCCDCCC");
}

TEST(Algorithm1, TakesTheLastUnitOfItsOrderWhereThereIsNoCpu) {
  // gpu and dsp only; order G D, so that the else is D: N < 2: G G; N < 3: D; else D.
  const auto policy = policy_of("latency", setup_of(2, 1, 0));
  EXPECT_EQ(placements(*policy, 8, {.eligible = unit_bit(kGpu) | unit_bit(kDsp)}), "GGDDGGDD");
}

TEST(Algorithm1, HoldsOnlyWhenNoUnitIsUp) {
  const auto policy = policy_of("latency", setup_of(1, 1, 1));
  EXPECT_EQ(placements(*policy, 2, {.eligible = kLocal}, 0), "..");
}

TEST(Algorithm2, FillsGpuThenCpuThenDspAndHolds) {
  // Qg < 2: G G; Qc < 3: C C C; Qd < 1: D; then every queue is at its weight.
  const auto policy = policy_of("throughput", setup_of(2, 1, 3));
  EXPECT_EQ(placements(*policy, 8), "GGCCCD..");
}

TEST(Algorithm2, SendsTheOverflowToTheCpuWhenTakenLiterally) {
  PolicySetup setup = setup_of(2, 1, 3);
  setup.literal_overflow = true;
  const auto policy = policy_of("throughput", setup);
  EXPECT_EQ(placements(*policy, 9), "GGCCCDCCC");
}

TEST(Algorithm3, FillsDspThenGpuThenCpuAndHolds) {
  const auto policy = policy_of("energy", setup_of(2, 1, 3));
  EXPECT_EQ(placements(*policy, 8), "DGGCCC..");
}

TEST(Algorithm3, SendsTheOverflowToTheDspWhenTakenLiterally) {
  PolicySetup setup = setup_of(2, 1, 3);
  setup.literal_overflow = true;
  const auto policy = policy_of("energy", setup);
  EXPECT_EQ(placements(*policy, 9), "DGGCCCDDD");
}

TEST(Algorithm3, OverflowsToTheLastOfItsOrderWhereThereIsNoDsp) {
  // gpu and cpu only: order G C.
  PolicySetup setup = setup_of(1, 0, 1);
  setup.literal_overflow = true;
  const auto policy = policy_of("energy", setup);
  EXPECT_EQ(placements(*policy, 4, {.eligible = unit_bit(kGpu) | unit_bit(kCpu)}), "GCCC");
}

TEST(LiteralOverflow, SendsABacklogOf1000AsThePaperPrintsIt) {
  // Weights of Table V. Algorithm 2, (4, 0, 3): 4 to the GPU, 3 to the CPU, and 993 more by the
  // else: 996. Algorithm 3, (2, 1, 0): 1 to the DSP, 2 to the GPU, and 997 more to the DSP: 998.
  PolicySetup setup = setup_of(4, 0, 3);
  setup.literal_overflow = true;
  const auto throughput = placements(*policy_of("throughput", setup), 1000);
  EXPECT_EQ(std::ranges::count(throughput, 'C'), 996);
  setup.weights = {{2, 1, 0, 0}};
  const auto energy = placements(*policy_of("energy", setup), 1000);
  EXPECT_EQ(std::ranges::count(energy, 'D'), 998);
}

TEST(Orders, PutSeveralUnitsOfARoleInFileOrderAndFpgaAfterDsp) {
  PolicySetup setup;
  setup.roles = {Role::kCpu, Role::kFpga,  Role::kGpu,  Role::kDsp,
                 Role::kGpu, Role::kCloud, Role::kOther};
  setup.weights = {std::vector<int>(7, 1)};
  EXPECT_THAT(policy_of("latency", setup)->order(), testing::ElementsAre(2, 4, 3, 1, 6, 0));
  EXPECT_THAT(policy_of("throughput", setup)->order(), testing::ElementsAre(2, 4, 0, 3, 1, 6));
  EXPECT_THAT(policy_of("energy", setup)->order(), testing::ElementsAre(3, 1, 6, 2, 4, 0));
}

TEST(Algorithm4, TellsCloudHighPriorityAndBasicApart) {
  const auto policy = policy_of("advanced", setup_of(2, 1, 3));
  EXPECT_EQ(placements(*policy, 2, {.eligible = kAll, .real_time = false}), "LL");
  // The first question of Algorithm 4 is whether the task is real-time.
  EXPECT_EQ(placements(*policy, 1, {.eligible = kAll, .real_time = false, .image_input = true}),
            "L");
  EXPECT_EQ(placements(*policy, 2, {.eligible = kAll, .image_input = true}), "HH");
  EXPECT_EQ(placements(*policy, 8, {.eligible = kAll}), "GGCCCD..");
}

TEST(Algorithm4, UsesTheBasicSchedulerThatIsNamed) {
  PolicySetup setup = setup_of(2, 1, 3);
  setup.basic = &find_basic_policy("energy");
  EXPECT_EQ(placements(*policy_of("advanced", setup), 7, {.eligible = kAll}), "DGGCCC.");
}

TEST(Algorithm4, FallsBackToBasicWhereNoCloudMayServe) {
  const auto policy = policy_of("advanced", setup_of(1, 1, 1));
  EXPECT_EQ(placements(*policy, 3, {.eligible = kLocal, .real_time = false}), "GCD");
}

TEST(Algorithm4, ComputesHereWhileTheCloudIsAway) {
  const auto policy = policy_of("advanced", setup_of(1, 1, 1));
  const TaskClass slow{.eligible = kAll, .real_time = false};
  EXPECT_EQ(placements(*policy, 3, slow, kLocal), "GCD");
  EXPECT_EQ(policy->takers(slow, kLocal), kLocal);
  EXPECT_EQ(placements(*policy, 1, slow), "L") << "it is back";
}

TEST(Algorithm4, WaitsForACloudThatIsAwayWhereNobodyElseWouldTakeTheTask) {
  const auto policy = policy_of("advanced", setup_of(1, 1, 1));
  const TaskClass only{.eligible = unit_bit(kCloud), .real_time = false};
  EXPECT_EQ(placements(*policy, 2, only, kLocal), "..");
  EXPECT_EQ(placements(*policy, 2, only), "LL");
}

TEST(Takers, AreTheUnitsThatThePolicyEverUses) {
  const TaskClass kind{.eligible = kAll};
  EXPECT_EQ(policy_of("throughput", setup_of(2, 0, 3))->takers(kind, kAll),
            unit_bit(kGpu) | unit_bit(kCpu));
  EXPECT_EQ(policy_of("throughput", setup_of(2, 0, 3))->takers(kind, unit_bit(kCpu)),
            unit_bit(kCpu));
  // Algorithm 1's else makes a taker of the CPU whatever its weight.
  EXPECT_EQ(policy_of("latency", setup_of(2, 0, 0))->takers(kind, kAll),
            unit_bit(kGpu) | unit_bit(kCpu));
  EXPECT_EQ(policy_of("advanced", setup_of(2, 0, 0))
                ->takers({.eligible = kAll, .real_time = false}, kAll),
            unit_bit(kCloud));
}

TEST(PolicyTable, NamesTheNearestForAnUnknownMode) {
  EXPECT_THAT(bad_input([] { static_cast<void>(find_policy("througput")); }),
              testing::HasSubstr("throughput"));
  EXPECT_THAT(bad_input([] { static_cast<void>(find_basic_policy("advanced")); }),
              testing::HasSubstr("latency, throughput, energy"));
}

}  // namespace
}  // namespace pirt::test
