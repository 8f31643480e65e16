// Timelines of traces and of static plans.
#include "reports/run/timeline.h"

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/support/errors.h"

namespace pirt {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;

std::string slice(int process, int slot, double start_us, double us) {
  return fmt::format(
      R"({{"name":"robot.blur","cat":"gaussian_blur","ph":"X","pid":{},"tid":{},"ts":{},"dur":{},)"
      R"("args":{{"task":1,"firing":7,"waited_us":500}}}})",
      process, slot, start_us, us);
}

std::string trace(const std::string& events, int version = 6) {
  return fmt::format(
      R"({{"traceEvents":[{{"name":"process_name","ph":"M","pid":1,"args":{{"name":"cpu"}}}}{}],)"
      R"("pirt":{{"schema_version":{},"mode":"latency","units":["cpu","gpu"],"platform":"board",)"
      R"("mix":"m","seed":5,"log":[]}}}})",
      events.empty() ? "" : "," + events, version);
}

TEST(Timeline, HasTheSlicesOfATrace) {
  const auto timeline =
      parse_timeline(trace(slice(2, 0, 2000, 1000) + "," + slice(1, 0, 0, 500)), "t");
  ASSERT_EQ(timeline.slices.size(), 2U);
  EXPECT_EQ(timeline.slices[0].unit, 0U);
  EXPECT_EQ(timeline.slices[1].task, "blur");
  EXPECT_EQ(timeline.slices[1].pipeline, "robot");
  EXPECT_DOUBLE_EQ(timeline.slices[1].start_ms, 2);
  EXPECT_DOUBLE_EQ(timeline.slices[1].end_ms, 3);
  EXPECT_DOUBLE_EQ(timeline.slices[1].waited_ms, 0.5);
  EXPECT_EQ(timeline.seed, 5U);
}

TEST(Timeline, OfALiveRunThatWasKilledIsOfWhatItLeft) {
  const std::string lines =
      R"([{"name":"pirt","ph":"M","pid":0,"args":{"schema_version":6,"mode":"latency",)"
      R"("units":["cpu","gpu"],"platform":"board","mix":"m","seed":5,"time":"live"}},)"
      "\n" +
      slice(1, 0, 0, 500) + ",\n" + slice(2, 0, 2000, 1000).substr(0, 60);
  const auto timeline = parse_timeline(lines, "t");
  ASSERT_EQ(timeline.slices.size(), 1U);
  EXPECT_EQ(timeline.time, "live");
  EXPECT_THAT(timeline_chart(timeline).table.footnotes.front(), HasSubstr("in the middle"));
}

TEST(Timeline, DrawsALaneASlotInTheUnitsOrder) {
  const auto chart = timeline_chart(parse_timeline(
      trace(slice(2, 0, 0, 1000) + "," + slice(1, 1, 10, 900) + "," + slice(1, 0, 20, 900)), "t"));
  std::vector<std::string> lanes;
  for (const Mark& mark : chart.marks) lanes.push_back(mark.group);
  EXPECT_THAT(lanes, ElementsAre("cpu, slot 1", "cpu, slot 2", "gpu"));
  EXPECT_EQ(chart.table.rows.size(), chart.marks.size());
}

TEST(Timeline, ShowsTheFirstTasksOfALongRunAndSaysSo) {
  std::string events;
  for (int i = 0; i < 1000; ++i) events += (i == 0 ? "" : ",") + slice(1, 0, 1000.0 * i, 900);
  const auto chart = timeline_chart(parse_timeline(trace(events), "t"));
  EXPECT_EQ(chart.marks.size(), kMostSlices);
  EXPECT_THAT(chart.summary, HasSubstr("of 1000 tasks"));
  for (const Mark& mark : chart.marks) EXPECT_LE(*mark.high, 300.0);
}

TEST(Timeline, CutsAFewTasksThatWouldHideTheOthers) {
  std::string events = slice(2, 0, 0, 9'000'000);
  for (int i = 0; i < 40; ++i) events += "," + slice(1, 0, 1000.0 * i, 900);
  const auto chart = timeline_chart(parse_timeline(trace(events), "t"));
  EXPECT_EQ(chart.marks.size(), 41U);
  EXPECT_LT(*chart.marks.back().high, 60);
}

std::string refusal(const std::string& text) {
  return test::bad_input([&] { static_cast<void>(parse_timeline(text, "t.json")); });
}

TEST(Timeline, RefusesWhatIsNoTraceOfThisVersion) {
  EXPECT_THAT(refusal("{"), HasSubstr("t.json"));
  EXPECT_THAT(refusal("[]"), HasSubstr("not a trace"));
  EXPECT_THAT(refusal(trace("", 99)), HasSubstr("99"));
  EXPECT_THAT(refusal(trace(slice(9, 0, 0, 1))), HasSubstr("process 9"));
  EXPECT_THAT(refusal(trace(slice(1, 0, -1, 1))), HasSubstr("ts"));
}

TEST(Timeline, ShowsAStaticPlan) {
  RunRecord run;
  run.units.resize(2);
  run.units[0].unit = "cpu";
  run.units[1].unit = "gpu";
  EXPECT_FALSE(planned_timeline(run));
  run.plan = {{"p", "b", "gpu", 2, 5}, {"p", "a", "cpu", 0, 2}};
  const auto timeline = planned_timeline(run);
  ASSERT_TRUE(timeline);
  EXPECT_EQ(timeline->slices[0].task, "a");
  EXPECT_EQ(timeline->slices[1].unit, 1U);
  EXPECT_EQ(timeline_chart(*timeline).marks.size(), 2U);
}

}  // namespace
}  // namespace pirt
