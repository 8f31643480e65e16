// pirt history through the program: files and folders, the same run twice, a page.
#include "tests/cli/program.h"

namespace pirt::test {
namespace {

using testing::AllOf;
using testing::HasSubstr;
using testing::SizeIs;

class HistoryCommand : public testing::Test {
 protected:
  void measure(const std::string& database, const std::string& ms,
               const std::string& seed = "7") const {
    const auto board = scratch_.write(
        "board.yaml",
        "platform: board\nunits: {cpu: {backend: fake, slots: 1, active_w: 2}}\nworkloads:\n"
        "  sobel: {cpu: [{on: cpu, ms: " +
            ms + ", name: execute}]}\n");
    const auto made = pirt({"characterize", "--quick", "--platform", board, "--filter", "^sobel$",
                            "--seed", seed, "--db", scratch_.file(database)});
    ASSERT_EQ(made.exit_code, 0) << made.err;
  }
  Scratch scratch_;
};

TEST_F(HistoryCommand, PutsRunsInARowAndSaysWhatChanged) {
  std::filesystem::create_directory(scratch_.file("runs"));
  measure("runs/a.db", "2");
  measure("runs/a.db", "2.09");
  measure("runs/b.db", "2.18");
  measure("runs/b.db", "2.28");
  std::filesystem::copy_file(scratch_.file("runs/a.db"), scratch_.file("runs/copy.db"));
  const auto page = scratch_.file("page.html");
  const auto outcome = pirt({"history", scratch_.file("runs"), "--json", "-", "-o", page});
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  const auto json = outcome.json();
  EXPECT_THAT(json["runs"], SizeIs(4)) << "a run that stands in two files is one";
  for (const auto& series : json["series"]) {
    EXPECT_EQ(series["workload"], "sobel");
    EXPECT_THAT(series["points"], SizeIs(4));
    if (series["phase"] != "execute" && series["phase"] != "call") continue;
    ASSERT_THAT(series["changes"], SizeIs(1)) << series;
    EXPECT_EQ(series["changes"][0]["what"], "creep");
    EXPECT_EQ(series["changes"][0]["between"], nlohmann::json({0, 3}));
    EXPECT_EQ(series["changes"][0]["why"], "its platform was changed");
  }
  EXPECT_THAT(slurp(page), AllOf(HasSubstr("<html"), HasSubstr("sobel on cpu")));
  const auto text = pirt({"history", scratch_.file("runs/a.db"), scratch_.file("runs/b.db")});
  EXPECT_THAT(text.out, AllOf(HasSubstr("4 runs of board"), HasSubstr("creep"), HasSubstr("+14")));
}

TEST_F(HistoryCommand, AnotherMachineIsABreak) {
  measure("a.db", "2");
  measure("b.db", "3", "8");  // other inputs
  const auto text = pirt({"history", scratch_.file("a.db"), scratch_.file("b.db")});
  EXPECT_EQ(text.exit_code, 0) << text.err;
  EXPECT_THAT(text.out, AllOf(HasSubstr("no change"), HasSubstr("Break of cpu"),
                              HasSubstr("seed: 7 against 8")));
}

TEST_F(HistoryCommand, RefusesBadInput) {
  std::filesystem::create_directory(scratch_.file("empty"));
  expect_refused(pirt({"history"}), {"folder"});
  expect_refused(pirt({"history", scratch_.file("empty")}), {"empty", "*.db"});
  expect_refused(pirt({"history", scratch_.file("none.db")}), {"none.db"});
  measure("a.db", "2");
  expect_refused(pirt({"history", scratch_.file("a.db"), "--filter", "xyz"}), {"--filter", "xyz"});
  expect_refused(pirt({"history", scratch_.file("a.db"), "--platform", "other"}), {"other"});
}

}  // namespace
}  // namespace pirt::test
