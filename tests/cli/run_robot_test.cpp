// pirt run-robot as a process, on a small sequence.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <cmath>
#include <map>

#include "tests/cli/program.h"
#include "tests/workloads/inputs/sequence_support.h"
#include "workloads/inputs/recording/recording.h"

namespace pirt::test {
namespace {

using testing::HasSubstr;

class RunRobot : public testing::Test {
 protected:
  RunRobot() {
    options_.path.rest_s = 0.4;
    options_.width = 320;
    options_.height = 240;
    // Its pictures are rendered once for the suite.
    static const Scratch made;
    static const bool written = write_euroc(generate_sequence(options_), made.file("room"), 1);
    EXPECT_TRUE(written);
    std::filesystem::copy(made.file("room"), scratch_.file("room"),
                          std::filesystem::copy_options::recursive);
    scratch_.write("board.yaml", R"(
platform: board
units:
  cpu: {backend: cpu, cores: all, slots: 1, active_w: 1}
  gpu: {backend: cpu, cores: all, slots: 1, active_w: 1}
)");
  }
  [[nodiscard]] std::vector<std::string> arguments(std::vector<std::string> more) const {
    more.insert(more.begin(), {"run-robot", scratch_.file("room")});
    return more;
  }
  [[nodiscard]] std::vector<std::string> live(std::vector<std::string> more) const {
    more.insert(more.begin(), {"--platform", scratch_.file("board.yaml")});
    return arguments(std::move(more));
  }
  const Scratch scratch_;
  SceneOptions options_ = scene(3, 2.0);
};

TEST_F(RunRobot, LiveWritesTheTrajectoryOfTheSerialRun) {
  const auto fast = pirt(live({"--fast", "--trajectory", scratch_.file("live.txt"), "--trace",
                               scratch_.file("t.json"), "--plot", scratch_.file("p.svg"),
                               "--save-slam-map", scratch_.file("live.map"), "--json", "-"}));
  ASSERT_EQ(fast.exit_code, 0) << fast.err;
  const auto serial =
      pirt(arguments({"--serial", "--fast", "--trajectory", scratch_.file("serial.txt"),
                      "--save-slam-map", scratch_.file("serial.map"), "--json", "-"}));
  ASSERT_EQ(serial.exit_code, 0) << serial.err;
  EXPECT_EQ(slurp(scratch_.file("live.txt")), slurp(scratch_.file("serial.txt")));
  EXPECT_EQ(slurp(scratch_.file("live.map")), slurp(scratch_.file("serial.map")));
  EXPECT_THAT(slurp(scratch_.file("p.svg")), HasSubstr("truth grey, estimate blue, map brown"));
  EXPECT_EQ(pirt({"replay", scratch_.file("t.json")}).exit_code, 0);
  const auto a = fast.json();
  const auto b = serial.json();
  for (const char* key : {"rotation_error_mean_deg", "ate_rms_m", "path_m", "frames"}) {
    EXPECT_EQ(a[key], b[key]) << key;
  }
  for (const char* key : {"rate_hz", "latency_p50_ms", "latency_p95_ms", "latency_p99_ms"}) {
    EXPECT_GT(a[key], 0) << key;
  }
  EXPECT_EQ(a["dropped"], 0);
  int updates = 0;
  for (const auto& calls : a["served"]["update_pose"]) updates += calls.get<int>();
  EXPECT_EQ(updates, 50);
}

// What is compiled for vectors besides is chosen at run time.
TEST_F(RunRobot, LocalizesOnAProcessorWithoutVectorsOfFourNumbers) {
  const std::string emulator = "/usr/bin/qemu-x86_64";
#ifdef __x86_64__
  if (::access(emulator.c_str(), X_OK) != 0) GTEST_SKIP() << "skipped: no qemu-x86_64";
#else
  GTEST_SKIP() << "skipped: for x86-64 only";
#endif
  const auto command = arguments({"--serial", "--fast", "--localize-only", "--json", "-"});
  const auto old = pirt(command, emulator + " -cpu Westmere");
  ASSERT_EQ(old.exit_code, 0) << old.err;
  const auto usual = pirt(command);
  ASSERT_EQ(usual.exit_code, 0) << usual.err;
  EXPECT_EQ(old.json()["frames_tracking"], usual.json()["frames_tracking"]);
  EXPECT_GT(old.json()["frames_tracking"], 30);
  EXPECT_NEAR(old.json()["ate_rms_m"], usual.json()["ate_rms_m"], 2e-3);
}

TEST_F(RunRobot, SaysWhetherTheMapThatWasLoadedWasFoundAndSavesItsOwnIfNot) {
  const auto own = scratch_.file("own.map");
  ASSERT_EQ(pirt(arguments({"--serial", "--fast", "--save-slam-map", own})).exit_code, 0);
  const auto known = pirt(live({"--fast", "--load-slam-map", own, "--json", "-"}));
  ASSERT_EQ(known.exit_code, 0) << known.err;
  EXPECT_EQ(known.json()["map"], "found");
  EXPECT_GT(known.json()["known_map_points"], 20);
  EXPECT_LT(known.json()["map_found_after_s"], 2.0);
  const auto text =
      pirt(arguments({"--serial", "--fast", "--localize-only", "--load-slam-map", own}));
  EXPECT_THAT(text.out, HasSubstr("loaded map     found"));

  auto elsewhere = options_;
  elsewhere.room_seed = 4;
  write_euroc(generate_sequence(elsewhere), scratch_.file("elsewhere"), 1);
  const auto there = [&](std::vector<std::string> more) {
    more.insert(more.begin(),
                {"run-robot", scratch_.file("elsewhere"), "--serial", "--fast", "--localize-only"});
    return pirt(more);
  };
  const auto lost = there({"--load-slam-map", own, "--save-slam-map", scratch_.file("a.map"),
                           "--trajectory", scratch_.file("a.txt"), "--json", "-"});
  ASSERT_EQ(lost.exit_code, 0) << lost.err;
  EXPECT_EQ(lost.json()["map"], "not found");
  EXPECT_EQ(lost.json()["frames_lost"], 0);
  ASSERT_EQ(
      there({"--save-slam-map", scratch_.file("b.map"), "--trajectory", scratch_.file("b.txt")})
          .exit_code,
      0);
  EXPECT_EQ(slurp(scratch_.file("a.map")), slurp(scratch_.file("b.map")));
  EXPECT_EQ(slurp(scratch_.file("a.txt")), slurp(scratch_.file("b.txt")));
  const auto both = there({"--load-slam-map", own, "--no-map"});
  expect_refused(both, {"--no-map"});
}

// 0.2 s are too few for the start from rest, which takes a quarter of a second.
TEST_F(RunRobot, ComparesTheSerialRunWithEachMode) {
  const auto outcome =
      pirt(live({"--fast", "--duration", "1200ms", "--compare", "ect,heft,energy", "--json", "-"}));
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  const auto runs = outcome.json()["runs"];
  ASSERT_EQ(runs.size(), 3U);
  EXPECT_THAT(runs[0]["driver"], HasSubstr("serial"));
  EXPECT_EQ(runs[1]["mode"], "ect");
  EXPECT_EQ(runs[2]["mode"], "energy");
  for (const auto& run : runs) {
    EXPECT_EQ(run["frames"], 30);
    EXPECT_EQ(run["ate_rms_m"], runs[0]["ate_rms_m"]);
  }
  const auto text = pirt(live({"--fast", "--duration", "1s", "--compare", "ect,heft"}));
  EXPECT_THAT(text.out, HasSubstr("Not run: heft"));
}

TEST_F(RunRobot, AComparisonKeepsWhatRanAndSaysWhatFailed) {
  const auto board = scratch_.write("broken.yaml", R"(
platform: broken
units:
  cpu: {backend: cpu, cores: all, slots: 1, active_w: 1}
  gpu: {backend: fake, slots: 1, active_w: 1, script: {fail_open: not plugged in}}
)");
  const auto outcome = pirt(arguments(
      {"--platform", board, "--fast", "--duration", "1200ms", "--compare", "ect", "--json", "-"}));
  ASSERT_EQ(outcome.exit_code, 4) << outcome.err;
  const auto json = outcome.json();
  ASSERT_EQ(json["runs"].size(), 1U);
  EXPECT_THAT(json["not_run"][0], HasSubstr("not plugged in"));
}

TEST_F(RunRobot, AComparisonInWhichNothingIsLocalizedFails) {
  const auto outcome =
      pirt(live({"--fast", "--localize-only", "--duration", "100ms", "--compare", "ect"}));
  EXPECT_EQ(outcome.exit_code, 4) << outcome.err;
  EXPECT_THAT(outcome.err, HasSubstr("nothing was localized"));
}

TEST_F(RunRobot, SaysNoPartOfAPathThatIsNone) {
  const auto text =
      pirt(arguments({"--serial", "--fast", "--localize-only", "--duration", "400ms"}));
  EXPECT_THAT(text.out, HasSubstr("standing still (SE(3)-aligned)"));
}

TEST_F(RunRobot, TakesOutByHowMuchPicturesAreLate) {
  const auto path = [&](const char* late) {
    const auto file = scratch_.file("late.txt");
    const auto outcome = pirt(arguments({"--serial", "--fast", "--localize-only", "--camera-late",
                                         late, "--trajectory", file, "--json", "-"}));
    EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
    return line_of(slurp(file), 1);
  };
  const double stamp = std::stod(path("0"));
  // It may begin a picture sooner or later.
  constexpr double kFrame_s = 0.04;
  EXPECT_NEAR(std::remainder(std::stod(path("10")) - stamp + 0.01, kFrame_s), 0, 1e-3);
  EXPECT_NEAR(std::remainder(std::stod(path("-10")) - stamp - 0.01, kFrame_s), 0, 1e-3);
}

TEST_F(RunRobot, WithoutAnImuNoPictureIsLate) {
  const auto outcome = pirt(arguments({"--serial", "--fast", "--localize-only", "--no-imu",
                                       "--duration", "100ms", "--camera-late", "10"}));
  EXPECT_THAT(outcome.err, HasSubstr("there is no IMU: pictures keep theirs"));
}

TEST_F(RunRobot, KeepsWhatRanWhenItIsInterrupted) {
  const std::string heard = quoted(scratch_.file("heard"));
  std::string command = "env --default-signal " + quoted(kProgram);
  // Frames that are a second apart: it would go on for a minute. The IMU's clock is another one.
  for (const char* camera : {"cam0", "cam1"}) {
    const auto csv = scratch_.file("room/mav0/" + std::string(camera) + "/data.csv");
    std::istringstream old(slurp(csv));
    std::string slow, line;
    for (int i = 0; std::getline(old, line); ++i) {
      if (i > 0) line = std::to_string(i) + "000000000" + line.substr(line.find(','));
      slow += line + "\n";
    }
    put(csv, slow);
  }
  for (const auto& argument :
       live({"--no-imu", "--json", scratch_.file("run.json"), "--trace", scratch_.file("t.json"),
             "--trajectory", scratch_.file("t.txt")})) {
    command += " " + quoted(argument);
  }
  const auto outcome =
      run(command + " 2>" + heard + " & pid=$!; until grep -q 'gpu is ready' " + heard +
          " || ! kill -0 $pid; do sleep 0.1; done; sleep 0.3; kill -INT $pid; wait $pid; "
          "rc=$?; cat " +
          heard + " >&2; exit $rc");
  ASSERT_EQ(outcome.exit_code, 4) << outcome.err;
  EXPECT_THAT(outcome.out, HasSubstr("stopped before its time"));
  const auto made = nlohmann::json::parse(slurp(scratch_.file("run.json")));
  EXPECT_TRUE(made["stopped"]);
  EXPECT_LT(made["arrived"], 50);
  EXPECT_EQ(pirt({"replay", scratch_.file("t.json")}).exit_code, 0);
}

TEST_F(RunRobot, OfOneCameraTheOtherIsNotRead) {
  std::filesystem::remove_all(scratch_.file("room/mav0/cam1/sensor.yaml"));
  const auto outcome =
      pirt(arguments({"--serial", "--fast", "--localize-only", "--mono", "--json", "-"}));
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  EXPECT_EQ(outcome.json()["cameras"], 1);
}

TEST_F(RunRobot, TakesTruthOfAFile) {
  const std::string way = scratch_.file("way.txt");
  ASSERT_EQ(
      pirt(arguments({"--serial", "--fast", "--localize-only", "--trajectory", way})).exit_code, 0);
  const auto same =
      pirt(arguments({"--serial", "--fast", "--localize-only", "--truth", way, "--json", "-"}));
  ASSERT_EQ(same.exit_code, 0) << same.err;
  EXPECT_LT(same.json()["ate_rms_m"].get<double>(), 1e-4) << "what it was written by";
  expect_refused(pirt(arguments({"--truth", scratch_.write("t.txt", "1 2 3\n")})),
                 {"t.txt:1", "3 columns"});
}

TEST_F(RunRobot, WithoutATrackedFrameAnEarlierMapAndTrajectoryStay) {
  const std::string map = scratch_.write("good.map", "a good one");
  const std::string path = scratch_.write("good.txt", "as good");
  const auto outcome = pirt(arguments(
      {"--serial", "--fast", "--duration", "100ms", "--save-slam-map", map, "--trajectory", path}));
  ASSERT_EQ(outcome.exit_code, 4) << outcome.err;
  EXPECT_THAT(outcome.err, HasSubstr("leaves '" + map + "' as it is"));
  EXPECT_THAT(outcome.err, HasSubstr("nothing was localized"));
  EXPECT_EQ(slurp(map), "a good one");
  EXPECT_EQ(slurp(path), "as good");
}

TEST_F(RunRobot, ADamagedPictureIsLeftOutAndManyEndTheRun) {
  std::vector<std::filesystem::path> pictures;
  for (const auto& entry :
       std::filesystem::directory_iterator(scratch_.file("room/mav0/cam0/data"))) {
    pictures.push_back(entry.path());
  }
  std::ranges::sort(pictures);
  std::filesystem::resize_file(pictures[30], 100);
  for (const bool serial : {true, false}) {
    const auto once =
        pirt(serial ? arguments({"--serial", "--fast", "--localize-only", "--json", "-"})
                    : live({"--fast", "--localize-only", "--json", "-"}));
    ASSERT_EQ(once.exit_code, 0) << once.err;
    EXPECT_THAT(once.err, HasSubstr(pictures[30].filename().string()));
    const auto json = nlohmann::json::parse(once.out);
    EXPECT_EQ(json["left_out"], 1);
    EXPECT_EQ(json["frames"], 49);
  }
  for (std::size_t i = 31; i < 36; ++i) std::filesystem::resize_file(pictures[i], 100);
  const auto many = pirt(arguments({"--serial", "--fast", "--localize-only", "--json", "-"}));
  ASSERT_EQ(many.exit_code, 4) << many.err;
  EXPECT_THAT(many.err, HasSubstr("more than 5 % of the pictures cannot be read"));
  EXPECT_TRUE(nlohmann::json::parse(many.out)["stopped"]);
}

TEST_F(RunRobot, WhatCannotBeWrittenCostsNoOtherResult) {
  std::string command = "ulimit -f 64; " + quoted(kProgram);
  for (const auto& argument :
       live({"--fast", "--trace", scratch_.file("trace.json"), "--trajectory",
             scratch_.file("t.txt"), "--json", scratch_.file("r.json")})) {
    command += " " + quoted(argument);
  }
  const auto outcome = run(command);
  EXPECT_EQ(outcome.exit_code, 2);
  EXPECT_THAT(outcome.err, HasSubstr("trace.json"));
  EXPECT_THAT(slurp(scratch_.file("t.txt")), HasSubstr(" "));
  EXPECT_EQ(nlohmann::json::parse(slurp(scratch_.file("r.json")))["frames"], 50);
}

TEST_F(RunRobot, ATrajectoryOnStdoutIsAlone) {
  const auto outcome =
      pirt(arguments({"--serial", "--fast", "--localize-only", "--trajectory", "-"}));
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  std::istringstream lines(outcome.out);
  std::string line;
  ASSERT_TRUE(std::getline(lines, line));
  EXPECT_THAT(line, testing::StartsWith("#"));
  int count = 0;
  for (; std::getline(lines, line); ++count) {
    EXPECT_EQ(std::ranges::count(line, ' '), 7) << line;
  }
  EXPECT_GT(count, 30);  // Of 50 frames, but for those before it moved.
}

/// The same with a map of the room.
class RunWholeRobot : public RunRobot {
 protected:
  RunWholeRobot() {
    const FloorMap map = floor_map(options_);
    scratch_.write("room/map.yaml", map.yaml);
    scratch_.write("room/map.pgm", map.pgm);
    scratch_.write("room/goal.yaml", map.goal_yaml);
  }
};

TEST_F(RunWholeRobot, PlansAvoidsRecognizesAndAdjustsBesides) {
  const auto outcome = pirt(live({"--fast", "--compare", "ect", "--json", "-"}));
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  const auto runs = outcome.json()["runs"];
  ASSERT_EQ(runs.size(), 3U);
  EXPECT_THAT(runs[1]["driver"], HasSubstr("its map as it was"));
  for (const auto& run : runs) {
    EXPECT_EQ(run["problems"].size(), 0U) << run["problems"];
    EXPECT_EQ(run["ate_rms_m"], runs[0]["ate_rms_m"]);
    std::vector<std::string> names;
    for (const auto& each : run["activities"]) {
      names.push_back(each["name"]);
      if (names.back() == "bundle_adjust") continue;  // In 2 s there is little to adjust.
      EXPECT_GT(each["completed"], 0) << names.back();
      EXPECT_GT(each["p99_ms"], 0) << names.back();
    }
    EXPECT_THAT(names, testing::ElementsAre("alexnet", "describe_scene", "plan_path",
                                            "avoid_obstacles", "bundle_adjust"));
    EXPECT_GT(run["paths_found"], 0);
  }
  const auto text = pirt(live({"--fast", "--duration", "1200ms"}));
  EXPECT_THAT(text.out, HasSubstr("paths          found by"));
}

TEST_F(RunWholeRobot, RecordsPosesPathsAndLatenciesForFoxglove) {
  const std::string file = scratch_.file("out.mcap");
  const auto outcome = pirt(arguments({"--serial", "--fast", "--record", file, "--json", "-"}));
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  const auto recording = open_recording(file);
  std::map<std::string, std::size_t> messages;
  for (const Topic& topic : recording->topics()) {
    EXPECT_EQ(topic.encoding, "json");
    messages[topic.name] = topic.messages;
  }
  EXPECT_EQ(messages["/latency"], outcome.json()["frames"].get<std::size_t>());
  EXPECT_EQ(messages["/trajectory"], 1U);
  EXPECT_GE(messages["/path"], 2U) << "one a second";
  EXPECT_EQ(messages["/tf"], messages["/pose"] + 1) << "and of the world in the map";
  const auto pose = recording->topic("/pose", {"foxglove.PoseInFrame"});
  const auto first = nlohmann::json::parse(recording->message(pose, 0));
  EXPECT_EQ(first.at("frame_id"), "world");
  EXPECT_EQ(first.at("timestamp").at("sec").get<std::int64_t>(),
            recording->time(pose, 0).count() / 1'000'000'000);
}

TEST_F(RunWholeRobot, AtItsOwnRateSaysWhatItDraws) {
  const auto outcome = pirt(live({"--json", "-"}));
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  const auto run = outcome.json();
  // Two units of 1 W at work, and none at rest.
  EXPECT_GT(run["power_w"], 0);
  EXPECT_LE(run["power_w"], 2.0);
  EXPECT_EQ(run["energy_provenance"], "modelled");
}

TEST_F(RunWholeRobot, LocalizesOnlyIfNothingElseIsWanted) {
  const auto outcome = pirt(live({"--fast", "--duration", "1s", "--localize-only", "--json", "-"}));
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  EXPECT_FALSE(outcome.json().contains("activities"));
}

TEST_F(RunWholeRobot, RefusesPlacesAndMapsThatAreNoUse) {
  expect_refused(pirt(live({"--goal", "50,50"})), {"goal"});
  expect_refused(pirt(live({"--goal", "1"})), {"--goal", "x,y"});
  expect_refused(pirt(live({"--start", "1,2"})), {"--start", "degrees"});
  expect_refused(pirt(live({"--start=-1000,0,0"})), {"start", "not on the map"});
  expect_refused(pirt(live({"--localize-only", "--goal", "1,2"})), {"--localize-only"});
  expect_refused(pirt(live({"--mono", "--no-imu"})), {"no scale"});
  expect_refused(pirt(live({"--map", scratch_.file("none.yaml")})), {"none.yaml"});
  expect_refused(pirt(live({"--model", scratch_.file("board.yaml")})), {"board.yaml"});
  expect_refused(pirt(live({"--classifier", scratch_.file("board.yaml")})), {"--model"});
  expect_refused(pirt(live({"--config", scratch_.file("board.yaml")})), {"--model"});
  expect_refused(pirt(live({"--scenes", scratch_.file("s.jsonl")})), {"--scenes", "--model"});
  scratch_.write("room/goal.yaml", "goal: [1, two]\n");
  expect_refused(pirt(live({})), {"goal.yaml:1", "two"});
  scratch_.write("room/goal.yaml", "goal: [1, 2]\n");
  expect_refused(pirt(live({})), {"--start"});
}

TEST_F(RunRobot, RefusesWhatMakesNoSense) {
  expect_refused(pirt({"run-robot", scratch_.file("nothing")}), {"nothing"});
  expect_refused(pirt({"run-robot"}), {"folder"});
  expect_refused(pirt(arguments({"--serial", "--camera-late", "soon"})), {"--camera-late", "soon"});
  expect_refused(pirt(arguments({"--serial", "--mode", "ect"})), {"--serial"});
  expect_refused(pirt(arguments({"--serial", "--slices", "off"})), {"--serial", "--slices"});
  expect_refused(pirt(live({"--strict"})), {"--strict", "--profile"});
  expect_refused(pirt(arguments({"--serial", "--compare"})), {"--serial"});
  expect_refused(pirt(live({"--compare", "--mode", "ect"})), {"--compare"});
  expect_refused(pirt(live({"--compare", "--trace", scratch_.file("t.json")})), {"--compare"});
  expect_refused(pirt(live({"--compare", "etc"})), {"etc"});
  expect_refused(pirt(live({"--mode", "heft"})), {"heft"});
  expect_refused(pirt(live({"--in-flight", "0"})), {"--in-flight"});
  expect_refused(pirt(live({"--goal", "1,2"})), {"--map"});
  expect_refused(pirt(live({"--duration", "0s"})), {"--duration"});
  expect_refused(pirt(live({"--plot", scratch_.file("p.gif")})), {".png or .svg"});
  expect_refused(pirt(live({"--record", scratch_.file("p.bag")})), {"must end in .mcap"});
  expect_refused(pirt(live({"--stereo-tolerance", "soon"})), {"--stereo-tolerance", "soon"});
  expect_refused(pirt(live({"--topics", "left=/a"})), {"--topics", "recordings"});
  expect_refused(pirt(arguments({"--platform", "snapdragon820"})), {"snapdragon820"});
  expect_refused(pirt(arguments({"--platform", "hst"})), {"host"});
  EXPECT_FALSE(std::filesystem::exists(scratch_.file("t.json")));
}

}  // namespace
}  // namespace pirt::test
