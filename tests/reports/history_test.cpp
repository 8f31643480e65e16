// Series over runs: what is put in a row, what is not, and what is said of it.
#include "reports/history/history.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

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

TEST(History, NothingChangedIsSaid) {
  History history = history_of(step(20, 0, 1));
  find_changes(history);
  EXPECT_THAT(render(history_document(history, false), Format::kText), HasSubstr("no change"));
}

}  // namespace
}  // namespace pirt
