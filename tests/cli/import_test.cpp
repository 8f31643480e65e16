// pirt import, and a mix of what was imported.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/cli/program.h"

namespace pirt::test {
namespace {

using testing::AllOf;
using testing::HasSubstr;

class Import : public testing::Test {
 protected:
  const Scratch scratch_;
  const std::string table_ = scratch_.write(
      "t.csv",
      "soc,unit,threads,network,avg_ms\n"
      "Acme 1,CPU A57,4,alexnet,20\nAcme 1,GPU Quad,1,alexnet,10\nAcme 2,CPU A72,4,alexnet,5\n");
  const std::string database_ = scratch_.file("p.db");
  const std::string board_ = scratch_.file("board.yaml");
  const std::string mix_ = scratch_.write(
      "m.yaml",
      "mix: m\npipelines:\n  see: {closed_loop: {frames: 100}, tasks: [{workload: "
      "ncnn.alexnet}, {name: act, workload: ncnn.alexnet, after: [ncnn.alexnet]}]}\n");
};

TEST_F(Import, GivesABoardToScheduleOn) {
  const auto imported = pirt({"import", table_, "--db", database_, "--board", "acme-1",
                              "--platform-file", board_, "--source", "a README", "--json", "-"});
  ASSERT_EQ(imported.exit_code, 0) << imported.err;
  const auto json = imported.json();
  EXPECT_EQ(json["format"], "ncnn");
  ASSERT_EQ(json["runs"].size(), 1U);
  EXPECT_EQ(json["runs"][0]["rows"][0]["call_ns"][0], 20'000'000);
  const auto outcome = pirt({"schedule", "--profile", database_, "--platform", board_, "--mix",
                             mix_, "--mode", "ect", "--json", "-"});
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  // 200 calls on two units of 20 and 10 ms: no scheduler is faster than 200 / 0.15 ms.
  const auto run = outcome.json();
  EXPECT_EQ(run["completed"], 200);
  EXPECT_GE(run["makespan_s"].get<double>(), 200 / 150.0);
  EXPECT_FALSE(run.contains("energy_j")) << "nobody has said what the board draws";
  const auto report = pirt({"export", database_, "--format", "csv"});
  EXPECT_THAT(report.out, AllOf(HasSubstr("ncnn.alexnet"), HasSubstr("published")));
}

TEST_F(Import, ChoosesAndNamesABoard) {
  expect_refused(pirt({"import", table_, "--db", database_, "--platform-file", board_}),
                 {"2 boards", "--board", "acme-1, acme-2"});
  expect_refused(pirt({"import", table_, "--db", database_, "--board", "acme-3"}), {"acme-3"});
  expect_refused(pirt({"import", table_, "--db", database_, "--name", "A B"}), {"A B"});
  const auto imported = pirt({"import", table_, "--db", database_, "--board", "acme-2", "--name",
                              "mine", "--platform-file", board_});
  ASSERT_EQ(imported.exit_code, 0) << imported.err;
  EXPECT_THAT(imported.out, AllOf(HasSubstr("mine"), HasSubstr("ncnn.alexnet")));
  EXPECT_THAT(slurp(board_), HasSubstr("platform: mine\n"));
}

TEST_F(Import, SaysWhereAForeignWorkloadIsMissing) {
  ASSERT_EQ(
      pirt({"import", table_, "--db", database_, "--board", "acme-1", "--platform-file", board_})
          .exit_code,
      0);
  const auto mix = scratch_.write(
      "n.yaml", "mix: n\npipelines: {see: {rate_hz: 1, tasks: [{workload: ncnn.vgg}]}}\n");
  expect_refused(pirt({"schedule", "--profile", database_, "--platform", board_, "--mix", mix,
                       "--mode", "ect"}),
                 {"ncnn.vgg"});
}

TEST_F(Import, TakesTimesOfOnesOwnAndSchedulesWithThem) {
  const auto times = scratch_.write("bench.csv",
                                    "\xEF\xBB\xBFunit, workload, ms, p95_ms, energy_mj\r\n"
                                    "cpu,mine.icp,40,60,80\r\ngpu,\"mine.icp\",10,,\r\n");
  const auto imported =
      pirt({"import", times, "--db", database_, "--source", "our lab", "--json", "-"});
  ASSERT_EQ(imported.exit_code, 0) << imported.err;
  EXPECT_EQ(imported.json()["runs"][0]["provenance"], "measured");
  const auto mix = scratch_.write(
      "i.yaml",
      "mix: i\npipelines:\n  see: {closed_loop: {frames: 100}, tasks: [{workload: mine.icp}]}\n");
  // No platform is given: it has the units of the rows.
  const auto outcome =
      pirt({"schedule", "--profile", database_, "--mix", mix, "--mode", "ect", "--json", "-"});
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  const auto run = outcome.json();
  EXPECT_EQ(run["platform"], "bench");
  EXPECT_EQ(run["completed"], 100);
  EXPECT_GE(run["makespan_s"].get<double>(), 100 / 125.0);
  EXPECT_EQ(run["units"]["gpu"]["provenance"][0], "measured");
  const auto rows = pirt({"export", database_, "--format", "csv"});
  EXPECT_THAT(rows.out, AllOf(HasSubstr("measured elsewhere"), HasSubstr("60000000")));
}

TEST_F(Import, TakesAPlatformThatIsShippedByNameAlone) {
  const auto times =
      scratch_.write("jetson-tx1.csv", "workload,unit,ms\nalexnet,cpu,350\nalexnet,npu,8\n");
  expect_refused(pirt({"import", times, "--db", database_}), {"jetson-tx1", "--name"});
  expect_refused(pirt({"import", times, "--db", database_, "--name", "jetson-tx1"}), {"npu"});
  EXPECT_FALSE(std::filesystem::exists(database_));
  const auto imported = pirt({"import", times, "--db", database_, "--name", "mine"});
  ASSERT_EQ(imported.exit_code, 0) << imported.err;
  const auto mix = scratch_.write(
      "a.yaml",
      "mix: a\npipelines:\n  see: {closed_loop: {frames: 10}, tasks: [{workload: alexnet}]}\n");
  const auto outcome =
      pirt({"schedule", "--profile", database_, "--mix", mix, "--mode", "ect", "--json", "-"});
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  EXPECT_EQ(outcome.json()["platform"], "mine");
  EXPECT_TRUE(outcome.json()["units"].contains("npu"));
}

TEST_F(Import, TheFrontierSaysWhoseEnergyIsNotKnown) {
  const auto times =
      scratch_.write("bench.csv", "unit,workload,ms\ncpu,mine.icp,40\ngpu,mine.icp,10\n");
  ASSERT_EQ(pirt({"import", times, "--db", database_, "--source", "our lab"}).exit_code, 0);
  const auto mix = scratch_.write(
      "i.yaml",
      "mix: i\npipelines:\n  see: {closed_loop: {frames: 100}, tasks: [{workload: mine.icp}]}\n");
  const auto outcome = pirt({"schedule", "--pareto", "--profile", database_, "--mix", mix});
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  EXPECT_THAT(outcome.out, AllOf(HasSubstr("Mix i on platform bench"),
                                 HasSubstr("nobody knows what gpu draws; give it with --set"),
                                 HasSubstr("Not shown: ")));
  const auto json =
      pirt({"schedule", "--pareto", "--profile", database_, "--mix", mix, "--json", "-"}).json();
  EXPECT_TRUE(json["points"].empty());
  EXPECT_EQ(json["left_out"].back()["reason"], "its energy is not known");
}

TEST_F(Import, StoresNothingOfAFileWithoutATimeOfACall) {
  const auto file = scratch_.write(
      "benchmark.yaml",
      "id: a2\nname: a2_rectify\nresults:\n"
      "- result: {hardware: Board X, metric: throughput, metric_unit: fps, value: 30}\n");
  expect_refused(pirt({"import", file, "--db", database_}), {"no time of a call"});
  EXPECT_FALSE(std::filesystem::exists(database_));
}

TEST_F(Import, StoresNothingOfATableWithAWrongRow) {
  const auto times =
      scratch_.write("t2.csv", "workload,unit,ms\nsobell,cpu,1\nmine.a,cpu,x\nmine.b,cpu,2\n");
  expect_refused(pirt({"import", times, "--db", database_}),
                 {"t2.csv:2", "sobel", "t2.csv:3", "ms"});
  EXPECT_FALSE(std::filesystem::exists(database_));
}

TEST_F(Import, StoresNothingOfATableWithABoardWithoutAName) {
  const auto table = scratch_.write(
      "u.csv", "soc,unit,threads,network,avg_ms\nAcme 1,CPU,4,alexnet,20\n--,CPU,4,alexnet,5\n");
  expect_refused(pirt({"import", table, "--db", database_}), {"u.csv:3", "soc"});
  EXPECT_FALSE(std::filesystem::exists(database_));
}

TEST_F(Import, RefusesWhatIsNoPublication) {
  expect_refused(pirt({"import", mix_, "--db", database_}), {"none of what can be imported"});
  EXPECT_FALSE(std::filesystem::exists(database_)) << "nothing is made then";
}

}  // namespace
}  // namespace pirt::test
