#include "characterize/energy/model.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/characterize/support.h"
#include "workloads/catalog/catalog.h"

namespace pirt {
namespace {

using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

/// 20 samples of 2 ms.
PhaseRecord call_row() {
  return {Phase::kCall,
          State::kSteady,
          Provenance::kMeasured,
          {},
          {},
          std::vector<Nanos>(20, from_ms(2))};
}

Platform board() {
  Platform platform = test::fake_platform({{"gpu", ""}});
  platform.assumptions = "watts are guesses\nof mine\n";
  return platform;
}

TEST(EnergyModel, MultipliesPowerAndMeanTime) {
  const Platform platform = board();  // active_w 2
  const auto energy = model_energy(platform, platform.units[0], find_workload("sobel"), call_row());
  EXPECT_DOUBLE_EQ(energy.energy_j.value(), 2 * 0.002);
  EXPECT_EQ(energy.provenance, Provenance::kModelled);
  EXPECT_THAT(energy.reasons, IsEmpty());
  EXPECT_EQ(energy.source, "model: active_w 2 W x mean call; watts are guesses of mine");
}

// A robot that makes these calls again and again uses their mean each time.
TEST(EnergyModel, IsOfTheMeanWhereTimesAreSkewed) {
  const Platform platform = board();  // active_w 2
  PhaseRecord call = call_row();
  // Process 0: 1 ms nine times and 11 ms once, mean 2 ms. Process 1, with two samples: 4 ms.
  call.samples.assign(9, from_ms(1));
  call.samples.insert(call.samples.end(), {from_ms(11), from_ms(4), from_ms(4)});
  call.processes.assign(10, 0);
  call.processes.insert(call.processes.end(), {1, 1});
  const auto energy = model_energy(platform, platform.units[0], find_workload("sobel"), call);
  EXPECT_DOUBLE_EQ(energy.energy_j.value(), 2 * 0.003) << "a process counts once";
}

TEST(EnergyModel, IsAsWeakAsItsWeakestInput) {
  Platform platform = board();
  PhaseRecord call = call_row();
  const auto provenance = [&](Provenance watts, Provenance time) {
    platform.units[0].energy_provenance = watts;
    call.provenance = time;
    return model_energy(platform, platform.units[0], find_workload("sobel"), call).provenance;
  };
  EXPECT_EQ(provenance(Provenance::kModelled, Provenance::kMeasured), Provenance::kModelled);
  EXPECT_EQ(provenance(Provenance::kFitted, Provenance::kModelled), Provenance::kFitted);
  EXPECT_EQ(provenance(Provenance::kFitted, Provenance::kPublished), Provenance::kPublished);
}

TEST(EnergyModel, AddsEveryStatedTerm) {
  Platform platform = board();
  platform.units[0].op_pj = 10;
  platform.units[0].byte_pj = 100;
  platform.workloads["sobel"].call_j["gpu"] = 0.5;
  platform.workloads["sobel"].call_j["other"] = 7;
  // Sobel of 1920x1080: 74 649 600 ops; u8 in and two i16 out are 5 bytes a pixel, 10 368 000
  // bytes.
  const auto energy = model_energy(platform, platform.units[0], find_workload("sobel"), call_row());
  EXPECT_DOUBLE_EQ(energy.energy_j.value(),
                   0.5 + 0.004 + 74'649'600 * 10e-12 + 10'368'000 * 100e-12);
  EXPECT_THAT(energy.source, AllOf(HasSubstr("active_w 2 W"), HasSubstr("op_pj 10 pJ"),
                                   HasSubstr("byte_pj 100 pJ"), HasSubstr("call_j 0.5 J")));
}

TEST(EnergyModel, IsInvalidWhereTheTimeIs) {
  const Platform platform = board();
  PhaseRecord call = call_row();
  call.reasons = {"unstable"};
  const auto energy = model_energy(platform, platform.units[0], find_workload("sobel"), call);
  EXPECT_TRUE(energy.energy_j.has_value());
  EXPECT_THAT(energy.reasons, ElementsAre("unstable"));
  call.samples.clear();
  EXPECT_EQ(model_energy(platform, platform.units[0], find_workload("sobel"), call).energy_j,
            std::nullopt);
}

TEST(EnergyModel, IsNoFigureWithoutAnyStatedPower) {
  Platform platform = board();
  platform.units[0].active_w = 0;
  const auto energy = model_energy(platform, platform.units[0], find_workload("sobel"), call_row());
  EXPECT_EQ(energy.energy_j, std::nullopt);
  EXPECT_THAT(energy.reasons, ElementsAre("no_power"));
  EXPECT_THAT(energy.source, HasSubstr("--set gpu.active_w=W"));
}

TEST(EnergyModel, IsNoFigureWhereOperationsAreNotKnown) {
  Platform platform = board();
  platform.units[0].op_pj = 10;
  const auto energy =
      model_energy(platform, platform.units[0], find_workload("feature_detect"), call_row());
  EXPECT_EQ(energy.energy_j, std::nullopt);
  EXPECT_THAT(energy.reasons, ElementsAre("ops_unknown"));
}

}  // namespace
}  // namespace pirt
