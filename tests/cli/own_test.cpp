// Workloads of one's own through the program: measured, stored, scheduled without their code.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/cli/program.h"

namespace pirt::test {
namespace {

using testing::AllOf;
using testing::HasSubstr;
using testing::Not;

class Own : public testing::Test {
 protected:
  [[nodiscard]] Outcome characterize(const std::string& file, const std::string& filter,
                                     const std::string& units = "cpu") const {
    return pirt({"characterize", "--workloads", file, "--filter", filter, "--units", units,
                 "--quick", "--max-time", "3s", "--db", database_});
  }
  const Scratch scratch_;
  const std::string database_ = scratch_.file("p.db");
};

TEST_F(Own, AModuleThatDoesWhatNoKernelShouldCostsOneCellEach) {
  const auto outcome =
      pirt({"characterize", "--workloads", kHostileModule, "--filter",
            "^bad\\.(good|crash|beyond|far_beyond|throws|prints|ends|thread|wrong)$", "--units",
            "cpu", "--quick", "--max-time", "12s", "--db", database_});
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  EXPECT_THAT(outcome.out, Not(HasSubstr("hello")));
  const auto why = [&](const std::string& name, const std::string& text) {
    EXPECT_THAT(outcome.err, HasSubstr("warning: bad." + name + " on cpu: not valid")) << name;
    EXPECT_THAT(outcome.err, HasSubstr(text));
  };
  why("crash", "crashed (SIGABRT)");
  why("beyond", "wrote byte 101 of an output of 101 bytes");
  why("far_beyond", "crashed (SIGSEGV)");
  why("throws", "no such luck");
  why("ends", "ended with code 0");
  why("wrong", "wrong_output");
  for (const char* name : {"good", "prints", "thread"}) {
    EXPECT_THAT(outcome.err, Not(HasSubstr(std::string("warning: bad.") + name + " on cpu: not")));
  }
}

TEST_F(Own, IsScheduledWithoutItsCode) {
  const std::string module = scratch_.write("libmine.so", slurp(kExampleModule));
  const auto measured = characterize(module, "^mine.sobel@160x120$");
  ASSERT_EQ(measured.exit_code, 0) << measured.err;
  EXPECT_THAT(measured.out, HasSubstr("unverified"));
  const auto mix = [this](const std::string& workload) {
    return scratch_.write("m.yaml",
                          "mix: m\npipelines:\n  a: {rate_hz: 10, tasks: [{name: t, workload: \"" +
                              workload + "\"}]}\n");
  };
  const auto schedule = [&](const std::string& workload, std::vector<std::string> more) {
    std::vector<std::string> words = {"schedule", "--profile", database_,    "--mix", mix(workload),
                                      "--mode",   "edf",       "--duration", "1s"};
    words.insert(words.end(), more.begin(), more.end());
    return pirt(words);
  };
  const std::string sized = "mine.sobel@160x120";
  std::filesystem::remove(module);
  EXPECT_EQ(schedule(sized, {}).exit_code, 0) << "nothing of it is loaded";
  expect_refused(schedule("mine.sobel", {}),
                 {"not in profile", "characterize", "--workloads", module});
  expect_refused(schedule("mine.sobl", {}),
                 {"nothing says what 'mine.sobl' is", "mine.sobel@160x120"});
  // Another one of the same name.
  scratch_.write("libmine.so", slurp(kExampleModule) + " ");
  const auto changed = schedule(sized, {"--workloads", module});
  EXPECT_EQ(changed.exit_code, 0);
  EXPECT_THAT(changed.err, AllOf(HasSubstr("is not what was measured"), HasSubstr(sized)));
  EXPECT_EQ(schedule(sized, {"--workloads", module, "--strict"}).exit_code, 2);
  // Live it is loaded, and has to be there.
  expect_refused(schedule(sized, {"--live"}), {sized, "--workloads", module});
  const auto live = schedule(sized, {"--workloads", module, "--live", "--json", "-"});
  ASSERT_EQ(live.exit_code, 0) << live.err;
  EXPECT_EQ(live.json().at("completed"), 10);
}

TEST_F(Own, ARunIsNotGoneOnWithAnotherBuild) {
  const std::string module = scratch_.write("libmine.so", slurp(kExampleModule));
  // Its time is over before it has the processes that it needs.
  const auto begun = pirt({"characterize", "--workloads", module, "--units", "cpu", "--max-time",
                           "1s", "--db", database_});
  EXPECT_THAT(begun.out + begun.err, HasSubstr("--resume"));
  scratch_.write("libmine.so", slurp(kExampleModule) + " ");
  const auto resumed = pirt({"characterize", "--resume", "--max-time", "20s", "--db", database_});
  EXPECT_EQ(resumed.exit_code, 2);
  EXPECT_THAT(resumed.err, HasSubstr("mine.sobel was built anew"));
}

TEST_F(Own, AWorkloadFileHasKernelsAndPrograms) {
  const std::string folder = std::string(kSourceFolder) + "/tests/examples/workloads/";
  const auto measured = characterize(folder + "own.yaml", "my.mean");
  ASSERT_EQ(measured.exit_code, 0) << measured.err;
  EXPECT_THAT(measured.out, AllOf(HasSubstr("null call"), HasSubstr("unverified")));
  const auto listed = pirt({"list", "workloads", "--workloads", folder + "own.yaml"});
  EXPECT_THAT(listed.out, AllOf(HasSubstr("my.threshold"), HasSubstr("cloud f32[1000,3]")));
}

TEST_F(Own, IsHeldAgainstAnother) {
  const auto regress = [this](const std::string& pair, std::vector<std::string> more) {
    std::vector<std::string> words = {"regress",     "--as",         pair,
                                      "--workloads", kHostileModule, "--work",
                                      "2ms",         "--ledger",     scratch_.file("ledger"),
                                      "--max-time",  "1ms"};
    words.insert(words.end(), more.begin(), more.end());
    return pirt(words);
  };
  // No time decides nothing; what is compared is said.
  const auto outcome = regress("bad.good=bad.prints", {"--units", "cpu"});
  EXPECT_EQ(outcome.exit_code, 3) << outcome.err;
  EXPECT_THAT(outcome.out,
              AllOf(HasSubstr("--workload bad.good"), HasSubstr("--workload bad.prints")));
  expect_refused(regress("bad.good", {"--units", "cpu"}), {"CANDIDATE=BASELINE"});
  expect_refused(regress("bad.good=bad.prints", {}), {"--units"});
}

TEST_F(Own, FilesThatAreNoneAreNamed) {
  const std::string text = scratch_.write("none.yaml", "workloads:\n  - {name: nodot}\n");
  expect_refused(characterize(text, ""), {"none.yaml:2"});
  expect_refused(pirt({"list", "workloads", "--workloads", scratch_.file("absent.so")}),
                 {"absent.so"});
  expect_refused(pirt({"list", "modes", "--workloads", text}), {"--workloads"});
}

TEST_F(Own, BesideAMixIsTakenByItself) {
  const std::string folder = std::string(kSourceFolder) + "/tests/examples/workloads/";
  scratch_.write("pirt.workloads", slurp(folder + "own.yaml"));
  scratch_.write("threshold.cl", slurp(folder + "threshold.cl"));
  scratch_.write("mean.py", slurp(folder + "mean.py"));
  const std::string mix = scratch_.write("mix.yaml", slurp(folder + "mix.yaml"));
  const auto plan = pirt({"characterize", "--mix", mix, "--units", "cpu", "--dry-run"});
  EXPECT_EQ(plan.exit_code, 0) << plan.err;
  EXPECT_THAT(plan.out, HasSubstr("my.mean"));
}

}  // namespace
}  // namespace pirt::test
