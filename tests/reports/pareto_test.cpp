// Which modes nobody beats, worked by hand.
#include "reports/run/pareto.h"

#include <gtest/gtest.h>

#include "scheduler/record/interval.h"

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

TEST(Pareto, ModesThatCannotBeToldApartDoNotBeatEachOther) {
  const auto redrawn = [](RunRecord record, const std::vector<double>& joules) {
    for (const double each : joules) {
      RunRecord other = record;
      other.energy_j = each;
      record.redrawn.push_back(figures_of(other));
    }
    return record;
  };
  const std::vector<RunRecord> runs = {redrawn(run("a", 1, 2, 10), {1.9, 2.0, 2.1}),
                                       redrawn(run("b", 1, 2.1, 10), {2.0, 1.9, 2.2}),
                                       redrawn(run("c", 1, 2.5, 10), {2.4, 2.5, 2.6})};
  const auto points = mode_points(runs);
  ASSERT_EQ(points.size(), 3U);
  EXPECT_EQ(points[1].beaten_by, nullptr) << "less in one of three";
  ASSERT_NE(points[2].beaten_by, nullptr);
  EXPECT_EQ(points[2].beaten_by->mode, "a");
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

TEST(Pareto, AModeThatKeepsUpWithAnotherMixLeavesNobodyOut) {
  auto other = run("b", 1, 2, 10);
  other.mix = "another";
  const std::vector<RunRecord> runs = {run("a", 1, 2, 10, 899), other};
  const auto points = mode_points(runs);
  ASSERT_EQ(points.size(), 1U);
  EXPECT_EQ(points[0].run->mode, "a");
}

TEST(Pareto, SaysOfEachRunWhyItIsNoPoint) {
  auto dark = run("dark", 1, 2, 10), idle = run("idle", 1, 2, 10), other = run("other", 1, 2, 10);
  dark.energy_j.reset();
  idle.completed = idle.pipelines[0].fired = idle.pipelines[0].completed = 0;
  other.mix = "another";
  const ModeRuns modes = {{run("a", 1, 2, 10), run("late", 1, 2, 10, 899), dark, idle, other},
                          {{"heft", "it plans ahead"}}};
  const Json left_out = pareto_json(modes)["left_out"];
  std::vector<std::string> reasons;
  for (const auto& each : left_out) {
    reasons.push_back(each["goal"].get<std::string>() + ": " + each["reason"].get<std::string>());
  }
  EXPECT_EQ(reasons,
            (std::vector<std::string>{"heft: it plans ahead", "late: it does not keep up",
                                      "dark: its energy is not known", "idle: no firing completed",
                                      "other: it is not comparable with the first"}));
  const std::string text = render(pareto_document(modes), Format::kText);
  EXPECT_NE(text.find("Not shown: late: it does not keep up"), std::string::npos) << text;
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

TEST(Pareto, WhatMakesItsPointsHoldsInAnyFolder) {
  std::vector<RunRecord> runs = {run("a", 1, 2, 10), run("b", 1, 1.5, 9)};
  for (RunRecord& each : runs) {
    each.platform_file = "/robots/my board.yaml";
    each.mix_file = "/robots/mine.yaml";
    each.duration_s = 2.013712345;
    each.in_flight = 3;
  }
  const std::string command =
      "pirt schedule --compare a,b --platform '/robots/my board.yaml' --mix /robots/mine.yaml "
      "--duration 2.013712345s --seed 1";
  for (const Chart& chart : pareto_charts(mode_points(runs))) {
    EXPECT_EQ(chart.table.origin, command + " --in-flight 3");
  }
  runs[1].in_flight = 7;
  for (const Chart& chart : pareto_charts(mode_points(runs))) {
    EXPECT_EQ(chart.table.origin, command);
  }
}

TEST(Pareto, WhatMakesItsPointsHasWhatTheyWereAskedFor) {
  std::vector<RunRecord> runs = {run("a", 1, 2, 10), run("b", 1, 1.5, 9)};
  for (RunRecord& each : runs) {
    each.profile = "p.db";
    each.profile_file = "/robots/p.db";
    each.settings = {"cpu.active_w=15"};
    each.besides = {"--without gpu"};
  }
  runs[1].objective = "energy";
  runs[1].power_cap_w = 6.0;
  // The platform is the database's: no file and none that is shipped.
  for (const Chart& chart : pareto_charts(mode_points(runs))) {
    EXPECT_EQ(chart.table.origin,
              "pirt schedule --compare a,b --profile /robots/p.db --set cpu.active_w=15 --mix mix "
              "--without gpu --seed 1 --objective energy --power-cap 6W");
  }
}

TEST(Pareto, TasksWithoutAPredecessorAreNotDropped) {
  auto first = run("a", 1, 2, 10);
  first.dropped = 5;
  first.no_predecessor = 3;
  const std::vector<RunRecord> runs = {first};
  const auto charts = pareto_charts(mode_points(runs));
  ASSERT_EQ(charts.size(), 2U);
  EXPECT_EQ(charts[1].table.rows[0][5], "2");
}

}  // namespace
}  // namespace pirt
