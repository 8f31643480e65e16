// Which modes nobody beats, worked by hand.
#include "reports/run/pareto.h"

#include <gtest/gtest.h>

namespace pirt {
namespace {

RunRecord run(const std::string& mode, double rate, double energy_j, double p99_ms,
              std::int64_t completed = 1000) {
  RunRecord record;
  record.mode = mode;
  record.platform = "board";
  record.mix = "mix";
  record.submitted = 1000;
  record.completed = completed;
  record.throughput_per_ms = rate;
  record.p99_latency_ms = p99_ms;
  record.energy_j = energy_j;
  PipelineResult pipeline;
  pipeline.pipeline = "camera";
  pipeline.fired = 1000;
  pipeline.completed = completed;
  pipeline.dropped = 1000 - completed;
  pipeline.p99_ms = p99_ms;
  record.pipelines = {pipeline};
  record.bounds.emplace().throughput_per_ms = 2;
  record.bounds->energy_j = 0.5;
  return record;
}

TEST(Pareto, ModesThatAreWorseInAllThreeAreBeaten) {
  // b is as fast as a at less energy and latency; c has the least energy, d the highest rate.
  const std::vector<RunRecord> runs = {run("a", 1, 2, 10), run("b", 1, 1.5, 9),
                                       run("c", 0.5, 1, 20), run("d", 1.5, 3, 9)};
  const auto points = mode_points(runs);
  ASSERT_EQ(points.size(), 4U);
  ASSERT_NE(points[0].beaten_by, nullptr);
  EXPECT_EQ(points[0].beaten_by->mode, "b");
  for (const auto i : {1U, 2U, 3U}) EXPECT_EQ(points[i].beaten_by, nullptr) << runs[i].mode;
  EXPECT_DOUBLE_EQ(points[1].energy_mj, 1.5);
}

TEST(Pareto, EqualModesDoNotBeatEachOther) {
  const std::vector<RunRecord> runs = {run("a", 1, 2, 10), run("b", 1, 2, 10)};
  for (const auto& point : mode_points(runs)) EXPECT_EQ(point.beaten_by, nullptr);
}

TEST(Pareto, DroppingIsNoWayToSaveEnergy) {
  const std::vector<RunRecord> runs = {run("a", 1, 2, 10), run("lazy", 1, 0.1, 1, 899)};
  const auto points = mode_points(runs);
  ASSERT_EQ(points.size(), 1U);
  EXPECT_EQ(points[0].run->mode, "a");
}

TEST(Pareto, LeavesOutRunsOfAnotherPlatform) {
  auto other = run("b", 9, 0.1, 1);
  other.platform = "another";
  EXPECT_EQ(mode_points(std::vector{run("a", 1, 2, 10), other}).size(), 1U);
}

TEST(Pareto, DrawsBothBoundsAndTheFront) {
  const std::vector<RunRecord> runs = {run("a", 1, 2, 10), run("b", 1, 1.5, 9),
                                       run("c", 0.5, 1, 20), run("d", 1.5, 3, 9)};
  const auto charts = pareto_charts(mode_points(runs));
  ASSERT_EQ(charts.size(), 2U);
  for (const Chart& chart : charts) EXPECT_EQ(chart.marks.size(), chart.table.rows.size());
  // The front of rate over energy: c, b, d. Bounds: 2 tasks/ms; 0.5 J for 1000 tasks are 0.5 mJ.
  const std::vector<std::pair<double, double>> front = {{1, 0.5}, {1.5, 1}, {3, 1.5}};
  EXPECT_EQ(charts[0].lines[0].points, front);
  EXPECT_EQ(charts[0].lines[1].y, 2);
  EXPECT_EQ(charts[0].lines[2].x, 0.5);
}

}  // namespace
}  // namespace pirt
