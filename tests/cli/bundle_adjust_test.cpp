// pirt generate bal and pirt bundle-adjust as their user runs them.
#include <gtest/gtest.h>

#include "tests/cli/program.h"
#include "tests/support/data.h"

namespace pirt::test {
namespace {

TEST(BundleAdjustCommand, AdjustsWhatWasGenerated) {
  const Scratch scratch;
  ASSERT_EQ(pirt({"generate", "bal", "--images", "20", "--points", "400", "-o",
                  scratch.file("b.txt"), "--truth", scratch.file("t.txt")})
                .exit_code,
            0);
  const auto outcome =
      pirt({"bundle-adjust", scratch.file("b.txt"), "-o", scratch.file("o.txt"), "--json", "-"});
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  EXPECT_EQ(outcome.err, "");
  const auto json = outcome.json();
  EXPECT_TRUE(json.at("converged"));
  EXPECT_NEAR(json.at("noise_px"), 1, 0.1);
  // What was written begins where the first run ended, and the truth fits its own observations.
  const auto again = pirt({"bundle-adjust", scratch.file("o.txt"), "--json", "-"}).json();
  EXPECT_DOUBLE_EQ(again.at("initial_cost"), json.at("final_cost"));
  EXPECT_LT(pirt({"bundle-adjust", scratch.file("t.txt"), "--json", "-"}).json().at("initial_cost"),
            1e-9);
}

TEST(BundleAdjustCommand, ReadsStandardInputForADash) {
  const auto outcome = run(quoted(kProgram) + " generate bal --images 20 --points 400 | " +
                           quoted(kProgram) + " bundle-adjust - --json -");
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  EXPECT_TRUE(outcome.json().at("converged"));
  const Scratch scratch;
  const auto input = quoted(scratch.write("b.txt", "1 1 1\n"));
  expect_refused(run(quoted(kProgram) + " bundle-adjust - -o " + input + " <" + input),
                 {"would overwrite"});
}

TEST(BundleAdjustCommand, WritesNothingWhenItIsInterrupted) {
  const Scratch scratch;
  const auto problem = scratch.file("b.txt");
  ASSERT_EQ(
      pirt({"generate", "bal", "--images", "300", "--points", "20000", "-o", problem}).exit_code,
      0);
  // Asked to stop from when it listens on: at the next iteration. The shell listens before it.
  const auto outcome = run(
      "env --default-signal " + quoted(kProgram) + " bundle-adjust " + quoted(problem) + " -o " +
      quoted(scratch.file("o.txt")) + " & pid=$!; until [ /proc/$pid/exe -ef " + quoted(kProgram) +
      " ] && [ $((0x$(sed -n 's/^SigCgt:\\s*//p' /proc/$pid/status) & 2)) != 0 ]; do "
      "sleep 0.01; done; kill -INT $pid; wait $pid");
  EXPECT_EQ(outcome.exit_code, 4);
  EXPECT_THAT(outcome.err, testing::HasSubstr("interrupted after"));
  EXPECT_EQ(outcome.out, "");
  EXPECT_FALSE(std::filesystem::exists(scratch.file("o.txt")));
}

TEST(BundleAdjustCommand, RefusesDamagedProblemsAndWritesNothing) {
  const Scratch scratch;
  const auto bad = scratch.write("b.txt", "1 1 1\n0 1 2.0 3.0\n0 0 0 0 0 0 500 0 0 0 0 -5\n");
  expect_refused(pirt({"bundle-adjust", bad, "-o", scratch.file("o.txt")}),
                 {"b.txt:2:", "point of an observation"});
  EXPECT_FALSE(std::filesystem::exists(scratch.file("o.txt")));
  expect_refused(pirt({"bundle-adjust", bad, "-o", bad}), {"would overwrite"});
  expect_refused(pirt({"generate", "bal", "--images", "7"}), {"--images"});
}

}  // namespace
}  // namespace pirt::test
