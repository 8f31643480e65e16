// memory_mb of a unit: what is prepared there together.
#include "scheduler/services/scenario.h"
#include "tests/scheduler/profile_rows.h"
#include "tests/scheduler/support.h"

namespace pirt::test {
namespace {

using testing::AllOf;
using testing::Contains;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

/// Measured on cpu and gpu; of `fc8` the device's buffers are known, of `pool5` nothing.
Profile rows() {
  Profile profile = profile_of({});
  for (const char* unit : {"cpu", "gpu"}) {
    for (const char* workload : {"fc6", "fc7", "fc8", "pool5"}) {
      PhaseRow row = row_of(workload, unit, Phase::kCall, from_ms(1));
      const std::string name = workload;
      if (name != "pool5") row.host_memory_bytes = name == "fc6" ? 300'000'000 : 100'000'000;
      if (name == "fc8") row.device_memory_bytes = 20'000'000;
      profile.phases.push_back(row);
    }
  }
  return profile;
}

Platform board(const std::string& gpu) {
  return platform_of("platform: board\nunits:\n  cpu: {backend: fake}\n  gpu: {backend: fake, " +
                     gpu + "}\n");
}

const std::string kTasks = "mix: m\npipelines:\n  p:\n    rate_hz: 1\n    tasks:\n";
const std::string kAll = kTasks +
                         "      - {workload: fc7}\n      - {workload: fc6}\n"
                         "      - {workload: fc8}\n      - {workload: pool5}\n";

/// These tasks on a board.
struct OnBoard {
  Platform platform;
  Mix mix;
  Profile profile = rows();
  Scenario scenario = make_scenario(platform, &profile, mix, {}, CloudUse::kNone);
};

/// By workload: the units that serve it.
std::vector<std::string> served(const Scenario& scenario) {
  std::vector<std::string> units;
  for (WorkloadId workload = 0; workload < scenario.services.workloads.size(); ++workload) {
    units.push_back(scenario.services.workloads[workload] + ": " +
                    unit_list(scenario.platform, scenario.services.units_of(workload)));
  }
  return units;
}

TEST(Memory, AUnitHoldsWhatFitsBesideWhatComesBeforeIt) {
  const OnBoard on{board("memory_mb: 350"), mix_of(kAll)};
  // 100, then not 300 more, then the 20 of its buffers; what is not known is not counted.
  EXPECT_THAT(served(on.scenario),
              ElementsAre("fc7: cpu, gpu", "fc6: cpu", "fc8: cpu, gpu", "pool5: cpu, gpu"));
  EXPECT_EQ(on.scenario.services.entries[1][1].reason,
            "it needs 300 MB of the 350 of its memory_mb, of which fc7 has 100");
  EXPECT_THAT(on.scenario.services.warnings,
              AllOf(Contains(HasSubstr("fc6 is not prepared on gpu: it needs 300 MB")),
                    Contains(AllOf(HasSubstr("pool5"), HasSubstr("not counted")))));
  EXPECT_FALSE(contains(on.scenario.classes[0][1].eligible, 1)) << "nor is it placed there";
}

TEST(Memory, WhatMayNotGoThereTakesNothing) {
  const OnBoard on{
      board("memory_mb: 350"),
      mix_of(kTasks + "      - {workload: fc7, eligible: [cpu]}\n      - {workload: fc6}\n")};
  EXPECT_THAT(served(on.scenario), ElementsAre("fc7: cpu, gpu", "fc6: cpu, gpu"));
}

TEST(Memory, ContextsHoldOneAtATime) {
  const OnBoard on{board("memory_mb: 350, contexts: {prepare_ms: 1}"), mix_of(kAll)};
  EXPECT_THAT(served(on.scenario), Contains("fc6: cpu, gpu"));
}

TEST(Memory, WithoutALimitNothingIsSaid) {
  const OnBoard on{board("slots: 1"), mix_of(kAll)};
  EXPECT_THAT(served(on.scenario), Contains("fc6: cpu, gpu"));
  for (const std::string& warning : on.scenario.services.warnings) {
    EXPECT_THAT(warning, testing::Not(HasSubstr("memory")));
  }
}

TEST(Memory, WhatFitsNowhereIsAnErrorThatSaysWhy) {
  const Platform platform = platform_of(
      "platform: board\nunits: {cpu: {backend: fake, memory_mb: 200}, gpu: {backend: fake, "
      "memory_mb: 100}}\n");
  const Mix mix = mix_of(kTasks + "      - {workload: fc6}\n");
  const Profile profile = rows();
  const std::string problem = bad_input(
      [&] { static_cast<void>(make_scenario(platform, &profile, mix, {}, CloudUse::kNone)); });
  EXPECT_THAT(problem, AllOf(HasSubstr("can serve fc6"),
                             HasSubstr("cpu: it needs 300 MB of the 200 of its memory_mb")));
}

}  // namespace
}  // namespace pirt::test
