// Units that nobody knows the power of: their joules are absent, in costs, sums and bounds, and
// never a cheap 0.
#include <filesystem>

#include "scheduler/bounds/bounds.h"
#include "scheduler/trace/replay.h"
#include "tests/scheduler/support.h"
#include "workloads/base/text/json.h"

namespace pirt::test {
namespace {

using testing::AllOf;
using testing::Contains;
using testing::HasSubstr;
using testing::Not;

/// The first unit states no power, the second 2 W.
constexpr const char* kBoard = R"(
platform: board
units: {gpu: {backend: fake}, cpu: {backend: fake, active_w: 2}}
workloads: {fc8: {gpu: [{on: gpu, ms: 1}], cpu: [{on: cpu, ms: 10}]}}
)";
constexpr const char* kMix =
    "mix: m\npipelines: {p: {closed_loop: {frames: 4}, tasks: [{workload: fc8}]}}\n";

RunRecord run(const std::string& mode, const char* board = kBoard) {
  ScheduleOptions options;
  options.mode = mode;
  options.trace = (std::filesystem::path(testing::TempDir()) / "pirt_unknown_energy.json").string();
  const RunRecord record = run_virtual(platform_of(board), nullptr, mix_of(kMix), options);
  EXPECT_FALSE(replay_file(*options.trace).result.difference) << mode;
  EXPECT_EQ(run_record_from_json(to_json(record), "r"), record) << mode;
  std::filesystem::remove(*options.trace);
  return record;
}

TEST(UnknownEnergy, OfAUnitThatServesIsThatOfTheWholeRun) {
  const RunRecord record = run("met");
  EXPECT_EQ(record.units[0].completed, 4);
  EXPECT_EQ(record.units[0].energy_j, std::nullopt);
  EXPECT_EQ(record.units[1].energy_j, 0);
  EXPECT_EQ(record.energy_j, std::nullopt);
  EXPECT_EQ(record.average_power_w, std::nullopt);
  EXPECT_FALSE(to_json(record).contains("energy_j"));
  EXPECT_THAT(record.warnings,
              Contains(AllOf(HasSubstr("energy of gpu is not known"), HasSubstr("gpu.active_w"))));
}

// 4 calls of 10 ms at 2 W.
TEST(UnknownEnergy, OfAUnitThatServesNothingIsNotMissed) {
  const RunRecord record = run("cpu-only");
  EXPECT_EQ(record.units[0].energy_j, std::nullopt);
  EXPECT_NEAR(record.energy_j.value(), 0.08, 1e-12);
}

TEST(UnknownEnergy, IsNotTheLeast) {
  const RunRecord record = run("mee");
  EXPECT_EQ(record.units[0].completed, 0);
  EXPECT_EQ(record.units[1].completed, 4);
}

TEST(UnknownEnergy, OfAllUnitsLeavesTheFirst) {
  const RunRecord record = run("mee", R"(
platform: board
units: {gpu: {backend: fake}, cpu: {backend: fake}}
workloads: {fc8: {gpu: [{on: gpu, ms: 10}], cpu: [{on: cpu, ms: 1}]}}
)");
  EXPECT_EQ(record.units[0].completed, 4);
}

TEST(UnknownEnergy, HasNoBound) {
  EXPECT_EQ(run("cpu-only").bounds.value().energy_j, std::nullopt);
  EXPECT_TRUE(run("cpu-only").bounds.value().throughput_per_ms.has_value());
}

TEST(UnknownEnergy, ThatIsGivenIsKnown) {
  const RunRecord record = run("met", R"(
platform: board
units: {gpu: {backend: fake, active_w: 3}, cpu: {backend: fake, active_w: 2}}
workloads: {fc8: {gpu: [{on: gpu, ms: 1}], cpu: [{on: cpu, ms: 10}]}}
)");
  EXPECT_NEAR(record.energy_j.value(), 0.012, 1e-12);
  EXPECT_TRUE(record.bounds.value().energy_j.has_value());
  EXPECT_THAT(record.warnings, Not(Contains(HasSubstr("is not known"))));
}

// Who models a unit says all of it: one without a backend that states no watts draws none.
TEST(UnknownEnergy, IsNotThatOfAModel) {
  const RunRecord record = run("met", R"(
platform: board
units: {gpu: {}, cpu: {active_w: 2}}
workloads: {fc8: {gpu: [{on: gpu, ms: 1}], cpu: [{on: cpu, ms: 10}]}}
)");
  EXPECT_EQ(record.energy_j, 0);
}

}  // namespace
}  // namespace pirt::test
