// Series over runs: what is put in a row, what is not, and what is said of it.
#include "reports/history/history.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>

#include "characterize/profile/store/writer.h"
#include "tests/characterize/support.h"
#include "tests/support/errors.h"
#include "workloads/base/text/json.h"

namespace pirt {
namespace {

using testing::AllOf;
using testing::HasSubstr;
using testing::SizeIs;

/// A row of these ms, a run each.
History history_of(const std::vector<double>& ms) {
  History history{.platform = "board", .runs = {}, .series = {}};
  HistorySeries series{"sobel", "cpu", "execute", {}};
  for (std::size_t i = 0; i < ms.size(); ++i) {
    HistoryRun run{"runs.db", {}};
    run.info.run_id = static_cast<std::int64_t>(i + 1);
    run.info.started = "2026-01-0" + std::to_string(i % 9 + 1);
    run.info.platform = "board";
    run.info.environment = {{"cpu_model", "one"}, {"platform_hash", "1"}, {"git_commit", "a"}};
    run.info.identity = {"cpu_model"};
    history.runs.push_back(run);
    series.points.push_back({.run = i, .value = 1e6 * ms[i]});
  }
  history.series = {series};
  return history;
}

std::vector<double> step(int before, int after, double factor) {
  std::vector<double> ms;
  for (int i = 0; i < before + after; ++i) {
    ms.push_back((i % 2 == 0 ? 1.99 : 2.01) * (i < before ? 1 : factor));
  }
  return ms;
}

TEST(History, SaysBetweenWhichRunsARowChanged) {
  History history = history_of(step(10, 10, 1.1));
  find_changes(history);
  const auto& changes = history.series[0].changes;
  ASSERT_THAT(changes, SizeIs(1));
  EXPECT_EQ(changes[0].kind, HistoryChange::Kind::kStep);
  EXPECT_EQ(changes[0].before, 9U);
  EXPECT_EQ(changes[0].after, 10U);
  EXPECT_NEAR(changes[0].ratio, 1.1, 1e-9);
  const auto text = render(history_document(history, false), Format::kText);
  EXPECT_THAT(text, AllOf(HasSubstr("1 step"), HasSubstr("+10.0"), HasSubstr("runs.db, run 11")));
  EXPECT_THAT(render(history_document(history, true), Format::kHtml), HasSubstr("sobel on cpu"));
  const Json json = history_json(history);
  EXPECT_EQ(json["series"][0]["changes"][0]["between"], (std::vector{9, 10}));
  EXPECT_EQ(json["series"][0]["points"].size(), 20U);
}

TEST(History, TheNewestRunsAreSuspected) {
  History history = history_of(step(20, 2, 1.2));
  find_changes(history);
  ASSERT_THAT(history.series[0].changes, SizeIs(1));
  EXPECT_EQ(history.series[0].changes[0].kind, HistoryChange::Kind::kSuspected);
  EXPECT_THAT(render(history_document(history, false), Format::kText),
              HasSubstr("suspected since"));
}

TEST(History, ThreeMergesOfFourAndAHalfPercentAreACreep) {
  History history = history_of({1.6, 1.672, 1.74724, 1.825866});
  find_changes(history);
  ASSERT_THAT(history.series[0].changes, SizeIs(1));
  EXPECT_EQ(history.series[0].changes[0].kind, HistoryChange::Kind::kCreep);
  EXPECT_NEAR(history.series[0].changes[0].ratio, 1.141, 1e-3);
}

TEST(History, AnotherMachineIsABreakAndAnEditedPlatformIsSaid) {
  History history = history_of(step(10, 10, 1.1));
  for (std::size_t i = 10; i < 20; ++i) history.runs[i].info.environment["git_commit"] = "b";
  find_changes(history);
  EXPECT_EQ(history.series[0].changes.at(0).kind, HistoryChange::Kind::kStep);
  for (std::size_t i = 10; i < 20; ++i) history.runs[i].info.environment["cpu_model"] = "two";
  find_changes(history);
  ASSERT_THAT(history.series[0].changes, SizeIs(1));
  EXPECT_EQ(history.series[0].changes[0].kind, HistoryChange::Kind::kBreak);
  EXPECT_THAT(history.series[0].changes[0].why, HasSubstr("cpu_model: one against two"));
  EXPECT_THAT(render(history_document(history, false), Format::kText),
              AllOf(HasSubstr("Break of cpu at"), HasSubstr("no change")));
  for (auto& run : history.runs) run.info.environment["cpu_model"] = "one";
  for (std::size_t i = 10; i < 20; ++i) history.runs[i].info.environment["platform_hash"] = "2";
  find_changes(history);
  EXPECT_EQ(history.series[0].changes.at(0).kind, HistoryChange::Kind::kStep);
  EXPECT_EQ(history.series[0].changes.at(0).why, "its platform was changed");
}

TEST(History, RunsOfTwoMachinesInTurnsAreTwoRows) {
  History history = history_of(step(12, 12, 1.5));
  for (std::size_t i = 1; i < 24; i += 2) history.runs[i].info.environment["cpu_model"] = "two";
  find_changes(history);
  const auto& changes = history.series[0].changes;
  ASSERT_THAT(changes, SizeIs(3));
  EXPECT_EQ(changes[0].kind, HistoryChange::Kind::kBreak);
  EXPECT_EQ(changes[0].after, 1U) << "the second machine's first, and no other";
  for (const std::size_t i : {1U, 2U}) {
    EXPECT_EQ(changes[i].kind, HistoryChange::Kind::kStep);
    EXPECT_EQ(changes[i].after - changes[i].before, 2U) << "on the same machine";
    EXPECT_NEAR(changes[i].ratio, 1.5, 1e-9);
  }
}

/// Appends a run of sobel on cpu, which ends if it is to.
void add_run(const std::filesystem::path& file, std::int64_t bytes, bool ends = true) {
  ProfileWriter writer(file);
  RunHeader header = test::small_run();
  header.plan = "{}";
  const auto run = writer.begin_run(header);
  CellRecord cell = test::small_cell("sobel", "cpu");
  cell.bytes = bytes;
  writer.write_cell(run, cell);
  if (ends) writer.finish_run(run, "2024-01-02T03:05:00Z");
}

TEST(History, AnotherSizeIsABreak) {
  const test::TemporaryFolder folder;
  const auto file = folder / "a.db";
  add_run(file, 1000);
  add_run(file, 500);
  const History history = read_history({file}, "", "");
  ASSERT_FALSE(history.series.empty());
  for (const HistorySeries& series : history.series) {
    ASSERT_THAT(series.changes, SizeIs(1)) << series.phase;
    EXPECT_EQ(series.changes[0].kind, HistoryChange::Kind::kBreak);
    EXPECT_EQ(series.changes[0].why, "sobel: the workload is of another size");
  }
}

TEST(History, AnotherMeterIsABreak) {
  const test::TemporaryFolder folder;
  const auto file = folder / "a.db";
  for (const bool idle_subtracted : {true, false}) {
    ProfileWriter writer(file);
    const auto run = writer.begin_run(test::small_run());
    CellRecord cell = test::small_cell("sobel", "cpu");
    cell.energy = EnergyRecord{.energy_j = idle_subtracted ? 0.5 : 1.5,
                               .provenance = Provenance::kMeasured,
                               .source = "rapl: package-0",
                               .reasons = {},
                               .domain = "package",
                               .idle_subtracted = idle_subtracted};
    writer.write_cell(run, cell);
    writer.finish_run(run, "2024-01-02T03:05:00Z");
  }
  const History history = read_history({file}, "", "");
  const auto energy =
      std::ranges::find(history.series, std::string("energy"), &HistorySeries::phase);
  ASSERT_NE(energy, history.series.end());
  ASSERT_THAT(energy->changes, SizeIs(1));
  EXPECT_EQ(energy->changes[0].kind, HistoryChange::Kind::kBreak);
  EXPECT_EQ(energy->changes[0].why, "the meters cover package and package with idle");
}

TEST(History, ARunThatDidNotEndIsLeftOutAndNamed) {
  const test::TemporaryFolder folder;
  const auto file = folder / "a.db";
  add_run(file, 1000, false);
  EXPECT_THAT(test::bad_input([&] { static_cast<void>(read_history({file}, "", "")); }),
              AllOf(HasSubstr("run 1 of "), HasSubstr("characterize --resume")));
  add_run(file, 1000);
  const History history = read_history({file}, "board", "");
  EXPECT_THAT(history.runs, SizeIs(1));
  EXPECT_THAT(render(history_document(history, false), Format::kText),
              AllOf(HasSubstr("run 1 of "), HasSubstr("characterize --resume")));
  EXPECT_EQ(history_json(history)["left_out"][0]["run_id"], 1);
  add_run(file, 1000, false);
  add_run(file, 1000);
  const Json left_out = history_json(read_history({file}, "board", ""))["left_out"];
  ASSERT_EQ(left_out.size(), 2U);
  EXPECT_EQ(left_out[0]["run_id"], 3);
  EXPECT_EQ(left_out[1]["run_id"], 1);
}

// As characterize leaves it that was killed in its first round.
TEST(History, AFirstFileWithoutACellIsNoReasonToRefuseTheOthers) {
  const test::TemporaryFolder folder;
  RunHeader header = test::small_run();
  header.plan = "{}";
  ProfileWriter(folder / "a.db").begin_run(header);
  add_run(folder / "b.db", 1000);
  const History history = read_history({folder / "a.db", folder / "b.db"}, "", "");
  EXPECT_THAT(history.runs, SizeIs(1));
  EXPECT_THAT(history.left_out, SizeIs(1));
}

TEST(History, NothingChangedIsSaid) {
  History history = history_of(step(20, 0, 1));
  find_changes(history);
  EXPECT_THAT(render(history_document(history, false), Format::kText), HasSubstr("no change"));
}

}  // namespace
}  // namespace pirt
