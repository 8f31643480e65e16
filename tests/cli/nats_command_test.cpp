// The cloud as its user starts it: a server, a worker and a robot, each a process of its own.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <regex>
#include <set>
#include <utility>

#include "tests/cli/program.h"
#include "tests/support/data.h"
#include "workloads/base/time.h"

namespace pirt::test {
namespace {

using testing::HasSubstr;

std::string nats_server() {
  for (const char* each :
       {"/usr/sbin/nats-server", "/usr/bin/nats-server", "/usr/local/bin/nats-server"}) {
    if (::access(each, X_OK) == 0) return each;
  }
  return "";
}

/// Scripts in a folder that the tests of a suite share, with a server and a worker each.
class CloudTest : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    if (!nats_server().empty()) scratch = new Scratch;
  }
  static void TearDownTestSuite() { delete std::exchange(scratch, nullptr); }
  void SetUp() override {
    if (scratch == nullptr) GTEST_SKIP() << "skipped: nats-server is not installed";
  }

  /// The server is at $url; both are killed when the script ends.
  /// @param worker  Its further options.
  static Outcome run_with_cloud(const std::string& script, const std::string& worker = "") {
    return run("cd " + quoted(scratch->file("")) + "; rm -rf store *.ports; " +
               quoted(nats_server()) +
               " -a 127.0.0.1 -p -1 --ports_file_dir . -js -sd store >server.log 2>&1 & server=$!; "
               "trap 'kill -9 $server $worker 2>/dev/null' EXIT; "
               "until url=$(grep -ho 'nats://127.0.0.1:[0-9]*' *.ports 2>/dev/null); do "
               "kill -0 $server || exit 9; sleep 0.05; done; " +
               start_worker(worker) + script);
  }
  static std::string start_worker(const std::string& options = "") {
    // What an earlier one has said is none of this one's.
    return "rm -f worker.log; " + quoted(kProgram) + " cloud-worker --server $url --slots 2 " +
           options +
           " >worker.log 2>&1 & worker=$!; "
           "until grep -q 'with 2 slots' worker.log; do "
           "kill -0 $worker || { cat worker.log; exit 9; }; sleep 0.05; done; ";
  }
  static std::string kill_worker() { return "kill -9 $worker; wait $worker; "; }
  static std::string kill_server() { return "kill -9 $server; wait $server; "; }
  /// Until the robot has said so, or ended.
  static std::string until_robot_says(const std::string& what) {
    return "until grep -qs '" + what + "' heard || ! kill -0 $run; do sleep 0.05; done; ";
  }
  /// Until it has a task that no worker has yet.
  static std::string until_robot_offers() {
    return R"(timeout 30 bash -c 'exec 5<>/dev/tcp/127.0.0.1/'${url##*:}'; )"
           R"(printf "CONNECT {}\r\nSUB pirt.offer.robot 1\r\n" >&5; )"
           R"(grep -qm1 "^MSG pirt.offer" <&5'; )";
  }
  static std::string start_server() {
    return quoted(nats_server()) +
           " -a 127.0.0.1 -p ${url##*:} -js -sd store >>server.log 2>&1 & server=$!; ";
  }
  struct Script {
    std::string meanwhile = {};  ///< Once the robot's cloud is ready.
    std::string after = {};      ///< Once the robot has ended.
    std::string worker = {};     ///< Further options of the worker.
    std::string before = {};     ///< Before the robot starts.
  };
  /// A command on host-cloud. At the end the worker says what it has done.
  static Outcome run_on_cloud(const std::string& command, const Script& script) {
    return run_with_cloud(
        // What another robot has said is none of this one's.
        script.before + "rm -f heard; " + quoted(kProgram) + " " + command +
            " --mode advanced --platform host-cloud --set cloud.server=$url --json run.json "
            "2>heard & run=$!; " +
            until_robot_says("cloud is ready") + script.meanwhile + "wait $run; rc=$?; " +
            script.after + "kill $worker; wait $worker; cat heard >&2; cat worker.log; exit $rc",
        script.worker);
  }
  static nlohmann::json record() { return nlohmann::json::parse(slurp(scratch->file("run.json"))); }
  /// By the worker's word, e.g. "done".
  static int counted(const Outcome& outcome, const std::string& what) {
    const auto end = outcome.out.rfind(' ' + what);
    if (end == std::string::npos) return -1;
    const auto begin = outcome.out.find_last_of(" \n", end - 1);
    return std::stoi(outcome.out.substr(begin + 1));
  }

  static Scratch* scratch;
};
Scratch* CloudTest::scratch = nullptr;

/// On one profile, measured over loopback.
class CloudCommand : public CloudTest {
 protected:
  static void SetUpTestSuite() {
    CloudTest::SetUpTestSuite();
    if (scratch == nullptr) return;
    scratch->write("mix.yaml", R"(
mix: m
pipelines:
  camera: {rate_hz: 10, tasks: [{workload: pool5, eligible: [cpu]}]}
  scenes: {rate_hz: 10, real_time: false, tasks: [{workload: pool5}]}
  map: {rate_hz: 10, real_time: false, tasks: [{workload: pool5, eligible: [cloud]}]}
)");
    measured = run_with_cloud(quoted(kProgram) +
                              " characterize --quick --precision 50% --max-time 15s --platform "
                              "host-cloud --set cloud.server=$url --units cpu,cloud --filter "
                              "'^pool5$' --db p.db");
  }
  void SetUp() override {
    CloudTest::SetUp();
    if (scratch == nullptr) return;
    ASSERT_EQ(measured.exit_code, 0) << measured.err;
  }
  static Outcome live(const std::string& options, const std::string& meanwhile) {
    return run_on_cloud("schedule --live --profile p.db --mix mix.yaml " + options,
                        {.meanwhile = meanwhile});
  }
  /// By how much before their deadlines a trace's tasks are taken back from the cloud, in ms.
  static std::set<double> recall_leads(const std::string& trace) {
    const std::regex both(R"("deadline":(\d+),"recall":\[(\d+),)");
    const std::string text = slurp(scratch->file(trace));
    std::set<double> leads;
    for (std::sregex_iterator each(text.begin(), text.end(), both), end; each != end; ++each) {
      leads.insert(to_ms(Nanos(std::stoll((*each)[1])) - Nanos(std::stoll((*each)[2]))));
    }
    return leads;
  }
  static Outcome measured;
};
Outcome CloudCommand::measured;

TEST_F(CloudTest, AnOutboxIsRefusedWithTheReason) {
  for (const char* const set : {"cloud.outbox=o.db", "cloud.options.outbox_mb=64"}) {
    const auto refused =
        pirt({"schedule", "--mode", "advanced", "--platform", "host-cloud", "--set", set});
    EXPECT_EQ(refused.exit_code, 2);
    EXPECT_THAT(refused.err,
                HasSubstr("there is no outbox any more: every workload of the cloud is "
                          "a function of its inputs"));
  }
}

// A service's processes may all hear what is for the worker.
TEST_F(CloudTest, ASlotEndsWithItsLineAndWithNoSignal) {
  const std::string script = scratch->write("slot.py", R"(
import os, signal, socket, subprocess, sys
ours, theirs = socket.socketpair()
slot = subprocess.Popen([sys.argv[1], 'cloud-slot'], pass_fds=[3],
                        preexec_fn=lambda: os.dup2(theirs.fileno(), 3))
theirs.close()
assert len(ours.recv(8)) == 8  # It is ready.
for each in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
    slot.send_signal(each)
ours.close()
assert slot.wait(60) == 0, slot.returncode
)");
  const auto outcome = run("python3 " + quoted(script) + " " + quoted(kProgram));
  EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
}

TEST_F(CloudTest, WhatIsOutOfReachIsNamedWithItsRemedy) {
  scratch->write("board.yaml", R"(
platform: board
units:
  cpu: {backend: cpu, cores: all, slots: 1, active_w: 1}
  cloud: {role: cloud, backend: nats, active_w: 1, server: "nats://127.0.0.1:1"}
)");
  const std::string remedy = "start one (nats-server -js), or name another";
  const auto doctor =
      pirt({"doctor", "--platform", scratch->file("board.yaml"), "--seconds", "0.1"});
  EXPECT_THAT(doctor.out, HasSubstr("no connection to server nats://127.0.0.1:1"));
  EXPECT_THAT(doctor.out, HasSubstr(remedy));
  const auto measured = pirt({"characterize", "--quick", "--platform", scratch->file("board.yaml"),
                              "--units", "cloud", "--filter", "^pool5$", "--max-time", "3s", "-q",
                              "--db", scratch->file("none.db")});
  EXPECT_EQ(measured.exit_code, 4);
  EXPECT_THAT(measured.err, HasSubstr("no connection to server nats://127.0.0.1:1"));
  EXPECT_THAT(measured.err, HasSubstr(remedy));
}

TEST_F(CloudCommand, AWorkerTakesItsLimitsFromAProfileOfItsUnit) {
  const auto outcome = run_with_cloud("kill $worker; wait $worker; cat worker.log",
                                      "--profile " + quoted(scratch->file("p.db")));
  EXPECT_THAT(outcome.out, HasSubstr("0 taken"));
}

// Half-way through, the server is killed, and comes back.
TEST_F(CloudCommand, ALiveRunLosesNothingWithItsServer) {
  const auto outcome =
      live("--duration 5s", "sleep 2; " + kill_server() + until_robot_says("out of reach") +
                                "sleep 1; " + start_server());
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  EXPECT_THAT(outcome.err, HasSubstr("cloud is out of reach"));
  EXPECT_THAT(outcome.err, HasSubstr("cloud is within reach again"));
  const auto made = record();
  EXPECT_EQ(made["submitted"], 150);
  EXPECT_EQ(made["failed"], 0);
  EXPECT_EQ(made["dropped"], 0);
  EXPECT_EQ(made["expired"], 0);
  EXPECT_EQ(made["stalled"], 0);
  EXPECT_EQ(made["completed"].get<int>() + made["queued"].get<int>(), 150);
  EXPECT_GT(made["units"]["cloud"]["link_mbit_s"], 0);
  EXPECT_THAT(outcome.out, HasSubstr("a cloud, to which a task goes or not, has no weights"));
  // Those of the map are computed there in any case, also the ones that were queued at the end.
  EXPECT_GE(counted(outcome, "done"), 50);
  EXPECT_EQ(counted(outcome, "failed"), 0);
}

// Neither is there when the robot starts.
TEST_F(CloudCommand, ALiveRunTakesInAServerAndAWorkerThatStartAfterIt) {
  const auto outcome = run_on_cloud("schedule --live --profile p.db --mix mix.yaml --duration 5s",
                                    {.meanwhile = start_server() + start_worker(),
                                     .before = kill_worker() + kill_server() + "rm -rf store; "});
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  EXPECT_THAT(outcome.err, HasSubstr("cloud: no connection to server nats://127.0.0.1:"));
  EXPECT_THAT(outcome.err, HasSubstr("cloud is within reach again"));
  const auto made = record();
  EXPECT_EQ(made["failed"], 0);
  EXPECT_EQ(made["stalled"], 0);
  EXPECT_EQ(made["completed"].get<int>() + made["queued"].get<int>(), 150);
  EXPECT_GE(counted(outcome, "done"), 50) << "what it alone may serve";
}

// The run is over, and what waits for the cloud is computed when it comes back.
TEST_F(CloudCommand, ALiveRunWaitsForACloudThatComesBack) {
  const auto outcome =
      live("--duration 2s", "sleep 1; " + kill_server() + "sleep 3; " + start_server());
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  const auto made = record();
  EXPECT_EQ(made["stalled"], 0);
  EXPECT_EQ(made["failed"], 0);
  EXPECT_GT(made["queued"], 0);
  EXPECT_GT(made["drain_s"], 1);
  EXPECT_GE(counted(outcome, "done"), 20);
}

TEST_F(CloudCommand, ALiveRunEndsWithoutACloudThatDoesNot) {
  const auto outcome =
      live("--set cloud.options.patience_s=1 --duration 2s", "sleep 1; " + kill_server());
  EXPECT_EQ(outcome.exit_code, 1) << outcome.err;
  EXPECT_THAT(outcome.err, HasSubstr("out of reach at the end, and longer than a call would wait"));
  const auto made = record();
  EXPECT_GT(made["stalled"], 0);
  EXPECT_EQ(made["completed"].get<int>() + made["queued"].get<int>(), 60);
}

TEST_F(CloudCommand, IsMeasuredAndComparedWithTheRobot) {
  const auto report = pirt({"report", "offload", scratch->file("p.db"), "--json", "-"});
  ASSERT_EQ(report.exit_code, 0) << report.err;
  const auto made = report.json();
  // On a busy machine its rows are not valid, and the report says which.
  if (made["offload"].empty()) {
    EXPECT_THAT(made["left_out"].dump(), HasSubstr("pool5: in the cloud its "));
    return;
  }
  const auto& row = made["offload"][0];
  EXPECT_EQ(row["workload"], "pool5");
  EXPECT_EQ(row["fastest"]["unit"], "cpu");
  EXPECT_EQ(row["cloud"]["unit"], "cloud");
  EXPECT_GT(row["cloud"]["ms"], 0);
}

// A task that the cloud would not have ready in time comes back when it can just be computed here.
TEST_F(CloudCommand, ATaskWithADeadlineComesBackAtItsLatestSafeStart) {
  scratch->write("urgent.yaml", R"(
mix: urgent
pipelines:
  map: {rate_hz: 4, offset_ms: 1000, real_time: false, deadline_ms: 1000, tasks: [{workload: pool5}]}
)");
  // The first is submitted once the worker has long been stopped.
  const auto outcome = run_on_cloud(
      "schedule --live --profile p.db --mix urgent.yaml "
      "--duration 4s --trace live.json",
      {.meanwhile = "kill -STOP $worker; ", .after = "kill -CONT $worker; sleep 2; "});
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  const auto made = record();
  EXPECT_EQ(made["submitted"], 12);
  EXPECT_EQ(made["failed"], 0);
  EXPECT_EQ(made["offloaded"], 0);
  EXPECT_EQ(made["completed"].get<int>() + made["queued"].get<int>(), 12);
  EXPECT_GE(made["units"]["cpu"]["completed"], 1);
  // They were in the cloud until it was time: the same one as in virtual time.
  const auto leads = recall_leads("live.json");
  ASSERT_EQ(leads.size(), 1U);
  EXPECT_GE(made["pipelines"]["map"]["p50_ms"], 0.998 * (1000 - *leads.begin()));
  const auto virtual_time = run("cd " + quoted(scratch->file("")) + "; " + quoted(kProgram) +
                                " schedule --profile p.db --mix urgent.yaml --mode advanced "
                                "--platform host-cloud --duration 4s --trace virtual.json");
  ASSERT_EQ(virtual_time.exit_code, 0) << virtual_time.err;
  EXPECT_EQ(recall_leads("virtual.json"), leads);
  EXPECT_EQ(counted(outcome, "failed"), 0);
}

/// A robot that runs through a room: long enough for a batch of keyframes, and one description.
class CloudRobot : public CloudTest {
 protected:
  static void SetUpTestSuite() {
    CloudTest::SetUpTestSuite();
    if (scratch == nullptr) return;
    made = pirt({"generate", scratch->file("room"), "--duration", "8s", "--rest", "1s", "--seed",
                 "3", "--width", "320", "--height", "240"});
  }
  void SetUp() override {
    CloudTest::SetUp();
    if (scratch == nullptr) return;
    ASSERT_EQ(made.exit_code, 0) << made.err;
  }
  /// Of its activities or units.
  static int completed(const char* list, const char* name) {
    const auto all = record();
    for (const auto& each : all[list]) {
      if (each["name"] == name) return each["completed"];
    }
    return -1;
  }
  static Outcome made;
};
Outcome CloudRobot::made;

TEST_F(CloudRobot, TakesItsRefinedMapBackFromTheCloud) {
  const auto outcome = run_on_cloud("run-robot room", {});
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  EXPECT_EQ(record()["problems"].size(), 0U) << record()["problems"];
  EXPECT_GE(completed("activities", "bundle_adjust"), 1);
  EXPECT_GE(completed("activities", "describe_scene"), 1);
  EXPECT_EQ(completed("units", "cloud"),
            completed("activities", "bundle_adjust") + completed("activities", "describe_scene"));
  EXPECT_GT(record()["keyframes_ate_rms_m"]["after"], 0);
}

TEST_F(CloudRobot, GoesOnWithoutACloudThatIsGone) {
  const auto outcome =
      run_on_cloud("run-robot room --set cloud.options.patience_s=5", {.meanwhile = kill_server()});
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  EXPECT_EQ(record()["frames"].get<int>() + record()["dropped"].get<int>(), 200);
  EXPECT_GE(completed("activities", "bundle_adjust"), 1);
  EXPECT_GE(completed("activities", "describe_scene"), 1);
  // The server may have been there for the first of them.
  EXPECT_LT(completed("units", "cloud"),
            completed("activities", "bundle_adjust") + completed("activities", "describe_scene"));
  EXPECT_GT(record()["keyframes_ate_rms_m"]["after"], 0);
}

// The link is lost while keyframes are on their way: the robot goes on, and takes its refined map
// back when there is a link again.
TEST_F(CloudRobot, TakesBackAMapThatWasUnderWayWhenTheLinkWasLost) {
  const auto outcome = run_on_cloud(
      "run-robot room",
      {.meanwhile = "kill -STOP $worker; " + until_robot_offers() + kill_server() +
                    until_robot_says("out of reach") + start_server() + "kill -CONT $worker; "});
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  EXPECT_THAT(outcome.err, HasSubstr("cloud is within reach again"));
  EXPECT_EQ(record()["frames"].get<int>() + record()["dropped"].get<int>(), 200);
  EXPECT_GE(completed("activities", "bundle_adjust"), 1);
  EXPECT_GE(completed("units", "cloud"), 1);
  EXPECT_EQ(record()["problems"].size(), 0U) << record()["problems"];
  EXPECT_GT(record()["keyframes_ate_rms_m"]["after"], 0);
}

/// The same with a user's models, of which the worker has some.
class CloudScenes : public CloudRobot {
 protected:
  void SetUp() override {
    CloudRobot::SetUp();
    PIRT_DATA_OR_SKIP(yolo, "yolo-fastest-1.1");
    PIRT_DATA_OR_SKIP(squeezenet, "squeezenet-v1.0-deepcompressed");
    detector_ = " --model " + quoted(yolo / "yolo-fastest-1.1.weights") + " --config " +
                quoted(yolo / "yolo-fastest-1.1.cfg");
    classifier_ = " --classifier " + quoted(squeezenet / "squeezenet_v1.0_dc.caffemodel") +
                  " --classifier-config " + quoted(squeezenet / "SqueezeNet_deploy.prototxt");
  }
  [[nodiscard]] Outcome run_robot(const std::string& worker) const {
    return run_on_cloud(
        "run-robot room --duration 4s --scenes scenes.jsonl" + detector_ + classifier_,
        {.worker = worker});
  }
  static nlohmann::json scene() {
    return nlohmann::json::parse(slurp(scratch->file("scenes.jsonl")));
  }
  std::string detector_, classifier_;
};

TEST_F(CloudScenes, AreDescribedByAWorkerWithTheSameModels) {
  const auto outcome = run_robot(detector_ + classifier_);
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  EXPECT_EQ(record()["problems"].size(), 0U) << record()["problems"];
  EXPECT_EQ(completed("activities", "describe"), 1);
  EXPECT_GE(completed("units", "cloud"), 1);
  EXPECT_EQ(scene()["labels"].size(), 5U);
}

TEST_F(CloudScenes, StayWithTheRobotWhereTheWorkerHasOtherModels) {
  const auto outcome = run_robot(detector_);
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  EXPECT_THAT(outcome.err, HasSubstr("has another describe: other models"));
  EXPECT_EQ(completed("activities", "describe"), 1);
  EXPECT_EQ(completed("units", "cloud"), completed("activities", "bundle_adjust"));
  EXPECT_EQ(scene()["labels"].size(), 5U);
}

TEST_F(CloudScenes, StayWithTheRobotWhereTheWorkerHasNone) {
  const auto outcome = run_robot("");
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  EXPECT_THAT(outcome.err, HasSubstr("does not know describe: it was given no models"));
  EXPECT_EQ(completed("activities", "describe"), 1);
  EXPECT_EQ(completed("units", "cloud"), completed("activities", "bundle_adjust"));
}

TEST_F(CloudScenes, AWorkerRefusesWhatIsNoDetector) {
  const auto refused =
      pirt({"cloud-worker", "--model", scratch->write("m.onnx", "none"), "--size", "8x8"});
  EXPECT_EQ(refused.exit_code, 2);
  EXPECT_THAT(refused.err, HasSubstr("m.onnx"));
}

TEST(CloudWorker, ComputesItself) {
  const auto refused = pirt({"cloud-worker", "--units", "nats"});
  EXPECT_EQ(refused.exit_code, 2);
  EXPECT_THAT(refused.err, HasSubstr("name cpu, or another unit"));
}

}  // namespace
}  // namespace pirt::test
