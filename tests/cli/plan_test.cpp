// pirt plan as its user runs it.
#include <gtest/gtest.h>

#include "tests/cli/program.h"
#include "tests/support/data.h"

namespace pirt::test {
namespace {

using testing::HasSubstr;

constexpr const char* kMap = "type octile\nheight 3\nwidth 4\nmap\n..@.\n..@.\n..@.\n";

TEST(Plan, GivesThePublishedLengths) {
  PIRT_DATA_OR_SKIP(folder, "maps-movingai");
  const auto outcome = pirt({"plan", "--map", (folder / "room-64-64-8.map").string(), "--scenario",
                             (folder / "room-64-64-8.map.scen").string(), "--json", "-"});
  EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
  const auto json = outcome.json();
  EXPECT_EQ(json.at("queries").size(), 50U);
  EXPECT_NEAR(json.at("queries").at(0).at("length"), 31.3137085, 1e-6);
}

TEST(Plan, ALengthThatIsNotThePublishedOneIsACheckThatFailed) {
  const Scratch scratch;
  const auto map = scratch.write("a.map", kMap);
  const auto scenario = scratch.write("a.scen", "version 1\n0\ta.map\t4\t3\t0\t0\t1\t2\t2.5\n");
  const auto outcome = pirt({"plan", "--map", map, "--scenario", scenario});
  EXPECT_EQ(outcome.exit_code, 1);
  EXPECT_THAT(outcome.out, HasSubstr("2.4142136"));
  EXPECT_THAT(outcome.out, HasSubstr("differs"));
}

TEST(Plan, APublishedLengthOfSixDigitsIsRounded) {
  const Scratch scratch;
  const auto map = scratch.write("a.map", kMap);
  const auto exit_code = [&](const std::string& length) {
    const auto scenario =
        scratch.write("a.scen", "version 1\n0\ta.map\t4\t3\t0\t0\t1\t2\t" + length + "\n");
    return pirt({"plan", "--map", map, "--scenario", scenario}).exit_code;
  };
  EXPECT_EQ(exit_code("2.41421"), 0);
  EXPECT_EQ(exit_code("2.4143"), 1);
  EXPECT_EQ(exit_code("2.41421000"), 1);
}

TEST(Plan, TheFreePlaceThatItProposesIsTaken) {
  const Scratch scratch;
  scratch.write("m.pgm", "P2 4 1 255 0 0 254 254");
  const auto map = scratch.write("m.yaml",
                                 "image: m.pgm\nresolution: 0.05\norigin: [448000, 5411000, 0]\n"
                                 "occupied_thresh: 0.65\nfree_thresh: 0.196\n");
  const auto from = [&](const std::string& start) {
    return pirt({"plan", "--map", map, "--start", start, "--goal", "448000.175,5411000.025"});
  };
  const std::string proposed = "448000.125,5411000.025";
  expect_refused(from("448000.02,5411000.02"), {"the nearest free place is " + proposed});
  const auto outcome = from(proposed);
  EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
}

TEST(Plan, WithoutAPathItSaysSo) {
  const Scratch scratch;
  const auto map = scratch.write("a.map", kMap);
  const auto outcome = pirt({"plan", "--map", map, "--start", "0,0", "--goal", "3,0"});
  EXPECT_EQ(outcome.exit_code, 1);
  EXPECT_THAT(outcome.out, HasSubstr("unreachable"));
}

TEST(Plan, RefusesEndsWhereTheRobotCannotBe) {
  const Scratch scratch;
  const auto map = scratch.write("a.map", kMap);
  const auto plan = [&](const std::string& start, const std::string& goal,
                        const std::string& radius = "0") {
    return pirt({"plan", "--map", map, "--start", start, "--goal", goal, "--radius", radius});
  };
  expect_refused(plan("0,0", "9,9"), {"--goal 9,9 is outside the map", "nearest", "3,2"});
  expect_refused(plan("2,1", "0,0"), {"--start 2,1", "occupied", "nearest"});
  expect_refused(plan("1,1", "0,0", "1.5"), {"closer to an obstacle", "0,1"});
  expect_refused(plan("1,1", "0,0", "9"), {"no cell of the map is free"});
  expect_refused(plan("1", "0,0"), {"--start", "x,y"});
  expect_refused(plan("1,nan", "0,0"), {"--start y"});
  expect_refused(pirt({"plan", "--map", map, "--start", "0,0"}), {"--scenario", "--goal"});
  expect_refused(
      pirt({"plan", "--map", scratch.write("a.txt", "x"), "--start", "0,0", "--goal", "0,0"}),
      {"a.txt", ".yaml", ".map"});
}

TEST(Plan, AMapWithoutAFreeCellIsSaid) {
  const Scratch scratch;
  const auto map = scratch.write("a.map", "type octile\nheight 1\nwidth 2\nmap\n@@\n");
  expect_refused(pirt({"plan", "--map", map, "--start", "0,0", "--goal", "1,0"}),
                 {"no cell of the map is free"});
}

}  // namespace
}  // namespace pirt::test
