// What a run of a robot is said to have drawn, and how far off it was.
#include "reports/run/robot_report.h"

#include <gtest/gtest.h>

#include "tests/workloads/inputs/sequence_support.h"

namespace pirt {
namespace {

/// Of a minute in which the only unit was always busy.
double joules_of(const std::string& figures) {
  LocalizationOptions options;
  options.runtime.platform = parse_platform(
      "test.yaml",
      "platform: one\nunits: {cpu: {backend: cpu, cores: all, slots: 1, " + figures + "}}\n", {},
      1);
  LocalizationResult result;
  result.duration = from_s(60);
  RuntimeStatistics::Unit& unit = result.statistics.units.emplace_back();
  unit.name = "cpu";
  unit.busy = unit.powered = from_s(60);
  return robot_run("live", "ect", {}, options, std::move(result), nullptr).energy_j;
}

TEST(RobotRun, DrawsIdlePowerAlsoWhileItIsBusy) {
  EXPECT_DOUBLE_EQ(joules_of("active_w: 10, idle_w: 1"), 660);
}

TEST(RobotRun, JoulesOfCallsThatNobodyCountsMakeItsEnergyUnknown) {
  EXPECT_EQ(joules_of("active_w: 10, idle_w: 1, energy: {op_pj: 4}"), 0);
}

TEST(RobotRun, TruthOfItsBeginningAloneCostsNoResult) {
  SceneOptions scene = test::scene(4, 2.4);
  scene.path.rest_s = 0.4;
  scene.width = 320;
  scene.height = 240;
  Sequence sequence = generate_sequence(scene);
  const Nanos end = sequence.frames[0].time + from_ms(500);
  std::erase_if(sequence.truth, [&](const TruthRow& row) { return row.time > end; });
  ActivityOptions besides{.width = scene.width, .height = scene.height};
  besides.recognition_hz = besides.scenes_hz = 0;
  besides.keyframes = 5;
  besides.setup = slam::setup_of(sequence);
  Activities activities(besides);
  LocalizationOptions options;
  options.setup = besides.setup;
  options.companion = &activities;
  options.own_rate = false;
  auto result = localize_serially(sequence, options);
  ASSERT_GE(activities.adjusted().before.size(), 5U);
  const RobotRun run = robot_run("serial", "", sequence, options, std::move(result), &activities);
  EXPECT_TRUE(run.summary.error.has_value());
  EXPECT_FALSE(run.keyframes_after.has_value());
}

}  // namespace
}  // namespace pirt
