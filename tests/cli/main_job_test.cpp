// The main job as its user does it: characterize, schedule, report, on a platform that is there
// everywhere.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/cli/program.h"
#include "tests/support/data.h"
#include "tests/support/optional_backend.h"

namespace pirt::test {
namespace {

using testing::HasSubstr;
using testing::Not;

std::int64_t accounted(const nlohmann::json& run) {
  std::int64_t sum = 0;
  for (const auto* key : {"completed", "dropped", "expired", "failed", "queued"}) {
    sum += run.at(key).get<std::int64_t>();
  }
  return sum;
}

class MainJob : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    scratch_ = std::make_unique<Scratch>();
    const auto made =
        pirt({"characterize", "--quick", "--platform", "fake", "--filter",
              "undistort|gaussian_blur|feature_detect|optical_flow|track_features|alexnet|fc8",
              "--db", profile()});
    ASSERT_EQ(made.exit_code, 0) << made.err;
  }
  static void TearDownTestSuite() { scratch_.reset(); }
  static std::string profile() { return scratch_->file("profile.db"); }
  static Outcome report(std::vector<std::string> more) {
    more.insert(more.begin(), "report");
    more.insert(more.end(), {"--mix", "table1-robot"});
    return pirt(more);
  }
  static Outcome schedule(const std::string& mode) {
    return pirt({"schedule", "--mode", mode, "--mix", "table1-robot", "--profile", profile(),
                 "--json", "-"});
  }
  static inline std::unique_ptr<Scratch> scratch_;
};

TEST_F(MainJob, AllFourModesAccountForEveryTask) {
  for (const auto* mode : {"latency", "throughput", "energy", "advanced"}) {
    const auto outcome = schedule(mode);
    ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
    const auto run = outcome.json();
    EXPECT_EQ(run["submitted"], accounted(run)) << mode;
    EXPECT_EQ(run["mode"], mode);
    EXPECT_EQ(run["schema_version"], 2);
  }
}

TEST_F(MainJob, AdvancedOffloadsExactlyTheTasksThatAreNotRealTime) {
  // In 60 s scene_understanding (one task) fires at 0, 10, ..., 50 s and map_generation (two tasks)
  // at 0 and 50 s: 6 + 2 * 2 tasks.
  const auto advanced = schedule("advanced").json();
  EXPECT_EQ(advanced["offloaded"], 10);
  EXPECT_EQ(advanced["units"]["cloud"]["completed"], 10);
  for (const auto* mode : {"latency", "throughput", "energy"})
    EXPECT_EQ(schedule(mode).json()["offloaded"], 0);
}

TEST_F(MainJob, TheSameSeedGivesTheSameBytes) {
  EXPECT_EQ(schedule("advanced").out, schedule("advanced").out);
}

TEST_F(MainJob, ReportShowsProfilePreferenceAndTheFourModes) {
  const auto text = report({profile()});
  ASSERT_EQ(text.exit_code, 0) << text.err;
  for (const auto* part :
       {"Profile (medians, ms)", "Table III", "Modes side by side", "advanced", "modelled"}) {
    EXPECT_THAT(text.out, HasSubstr(part));
  }
  const auto json = report({profile(), "--json", "-"}).json();
  EXPECT_EQ(json["modes"].size(), 4U);
  EXPECT_FALSE(json["profile_summary"].empty());
  EXPECT_THAT(report({"page", profile()}).out, HasSubstr("</html>"));
  EXPECT_THAT(report({profile(), "--format", "md"}).out, HasSubstr("| workload |"));
}

TEST_F(MainJob, ABriefReportIsAScreenOfUnitsAndModes) {
  const auto text = report({"compare", profile()});
  ASSERT_EQ(text.exit_code, 0) << text.err;
  for (const auto* part : {"Table III", "gaussian_blur", "latency", "throughput", "energy"}) {
    EXPECT_THAT(text.out, HasSubstr(part));
  }
  EXPECT_THAT(text.out, Not(HasSubstr("Profile (medians, ms)")));
  EXPECT_LE(std::ranges::count(text.out, '\n'), 45);  // 14 workloads, 4 modes, what they mean
  const auto json = report({"compare", profile(), "--json", "-"}).json();
  EXPECT_EQ(json["runs"].size(), 4U);
  EXPECT_EQ(json["preferable"], report({profile(), "--json", "-"}).json()["preferable"]);
  EXPECT_EQ(report({"compare", profile(), profile()}).exit_code, 2);
  EXPECT_EQ(report({profile(), "--brief", "--setup"}).exit_code, 2);
}

TEST_F(MainJob, WhatWereFlagsOfReportStillWorkAndSayTheWords) {
  const std::pair<std::vector<std::string>, std::string> old_ones[] = {
      {{"--brief"}, "compare"},
      {{"--setup"}, "setup"},
      {{"--offload"}, "offload"},
      {{"--paper"}, "paper"},
      {{"--format", "html"}, "page"}};
  for (const auto& [flags, word] : old_ones) {
    std::vector<std::string> before = {"report", profile()};
    before.insert(before.end(), flags.begin(), flags.end());
    const auto old = pirt(before);
    const auto now = pirt({"report", word, profile()});
    EXPECT_EQ(old.exit_code, now.exit_code) << word;
    EXPECT_EQ(old.out, now.out) << word;
    EXPECT_THAT(old.err, HasSubstr("'pirt report " + word + "' now")) << word;
    EXPECT_THAT(now.err, Not(HasSubstr("next release"))) << word;
  }
  const auto text = pirt({"report", profile()});
  EXPECT_EQ(text.out, pirt({"report", "text", profile()}).out);
  EXPECT_THAT(text.err, Not(HasSubstr("next release")));
}

TEST_F(MainJob, AReportOfTheProfileRunsNoMode) {
  const auto shown = pirt({"report", "profile", profile()});
  ASSERT_EQ(shown.exit_code, 0) << shown.err;
  EXPECT_THAT(shown.out, HasSubstr("Profile (medians, ms)"));
  EXPECT_THAT(shown.out, Not(HasSubstr("Modes")));
  EXPECT_EQ(pirt({"report", "profile", profile(), "--mix", "full-robot"}).exit_code, 2);
}

TEST_F(MainJob, ReportTakesStoredRuns) {
  const auto latency = scratch_->write("latency.json", schedule("latency").out);
  const auto json = report({profile(), latency, "--json", "-"}).json();
  ASSERT_EQ(json["modes"].size(), 1U);
  EXPECT_EQ(json["modes"][0]["mode"], "latency");
}

TEST_F(MainJob, ReportShowsSeveralDatabasesSideBySide) {
  const auto other = scratch_->write("other.db", slurp(profile()));
  const auto shown = report({profile(), other, "--format", "md"});
  ASSERT_EQ(shown.exit_code, 0) << shown.err;
  for (const auto* part : {"## Side by side", "nothing: they compare", "1.00x",
                           "## profile.db: Time and energy", "## other.db: Time and energy"}) {
    EXPECT_THAT(shown.out, HasSubstr(part));
  }
  EXPECT_EQ(report({profile(), other, "--json", "-"}).json()["others"].size(), 1U);
}

TEST_F(MainJob, ReportShowsATraceAsATimeline) {
  const auto trace = scratch_->file("trace.json");
  const auto made = pirt({"schedule", "--mode", "energy", "--mix", "table1-robot", "--duration",
                          "1s", "--profile", profile(), "--trace", trace});
  ASSERT_EQ(made.exit_code, 0) << made.err;
  const auto given = report({profile(), trace, "--format", "md"});
  ASSERT_EQ(given.exit_code, 0) << given.err;
  EXPECT_THAT(given.out, HasSubstr("What ran where and when: mode energy"));
  EXPECT_THAT(given.out, HasSubstr("trace.json"));
  // Without one, the first seconds are simulated, for a page.
  EXPECT_THAT(report({"page", profile()}).out, HasSubstr("What ran where and when: mode advanced"));
  EXPECT_THAT(report({profile()}).out, Not(HasSubstr("What ran where and when")));
}

TEST_F(MainJob, ReportSaysThatARunIsOfAnotherPlatform) {
  const auto run = scratch_->write(
      "elsewhere.json", pirt({"schedule", "--mode", "latency", "--platform", "snapdragon820",
                              "--mix", "convolution-1000", "--json", "-"})
                            .out);
  const auto shown = report({profile(), run});
  EXPECT_EQ(shown.exit_code, 0);
  EXPECT_THAT(shown.err, HasSubstr("NOT COMPARABLE"));
  EXPECT_THAT(shown.out, HasSubstr("of platform snapdragon820, the database of fake"));
}

TEST_F(MainJob, PaperClaimsAreHeldAgainstAProfile) {
  const auto report = pirt({"report", "paper", profile(), "--json", "-"});
  ASSERT_EQ(report.exit_code, 0) << report.err;
  int units = 0;
  const auto json = report.json();
  for (const auto& claim : json["scorecard"]) units += claim["where"] == "Table III" ? 1 : 0;
  EXPECT_EQ(units, 2 * 4);  // four of its six workloads were measured, by time and by energy
}

TEST_F(MainJob, SettingsTakeOneValueEach) {
  const auto shown =
      report({"--set", "cpu.active_w=1", "--set", "gpu.active_w=1", profile(), "--json", "-"});
  EXPECT_EQ(shown.exit_code, 0) << shown.err;
  const auto plain = report({profile(), "--json", "-"});
  EXPECT_LT(shown.json()["modes"][0]["energy_j"], plain.json()["modes"][0]["energy_j"]);
}

TEST_F(MainJob, ReportOfAPartialProfileSaysWhyThereAreNoModes) {
  const auto partial = scratch_->file("partial.db");
  const auto made = pirt({"characterize", "--quick", "--platform", "host-cpu", "--filter",
                          "^pool5$", "--max-time", "5s", "--db", partial});
  ASSERT_EQ(made.exit_code, 0) << made.err;
  const auto report = pirt({"report", partial});
  EXPECT_EQ(report.exit_code, 0);
  EXPECT_THAT(report.out, HasSubstr("Modes that are not shown: latency, throughput, energy"));
  EXPECT_THAT(report.out, HasSubstr("pirt characterize --platform host-cpu --filter"));
}

TEST_F(MainJob, JsonOnStdoutStandsAlone) {
  const auto outcome = pirt({"list", "workloads", "--json", "-"});
  EXPECT_GE(outcome.json()["workloads"].size(), 18U);
}

TEST(Schedule, AlgorithmOneCyclesAsPrinted) {
  // Weights gpu 5, dsp 1, cpu 2: the cycle is G G G G G D C C C, nine tasks. 1000 = 111 * 9 + 1
  // tasks: 5 * 111 + 1 for the GPU, 111 for the DSP, 3 * 111 for the CPU.
  const auto run = pirt({"schedule", "--platform", "fake", "--mix", "convolution-1000", "--mode",
                         "latency", "--weights", "gpu=5,dsp=1,cpu=2", "--json", "-"})
                       .json();
  EXPECT_EQ(run["units"]["gpu"]["completed"], 556);
  EXPECT_EQ(run["units"]["dsp"]["completed"], 111);
  EXPECT_EQ(run["units"]["cpu"]["completed"], 333);
}

TEST(Schedule, ModesPlaceDifferentlyOnThreeUnits) {
  const auto placed = [](const std::string& mode) {
    const auto run = pirt({"schedule", "--platform", "fake", "--mix", "convolution-1000", "--mode",
                           mode, "--json", "-"})
                         .json();
    std::vector<int> counts;
    for (const auto* unit : {"cpu", "gpu", "dsp"})
      counts.push_back(run["units"][unit]["completed"]);
    return counts;
  };
  EXPECT_NE(placed("latency"), placed("throughput"));
  EXPECT_NE(placed("throughput"), placed("energy"));
  EXPECT_NE(placed("latency"), placed("energy"));
}

TEST(Schedule, ComparesModesAndListsThoseThatCannotRun) {
  const auto all = pirt({"schedule", "--platform", "snapdragon820", "--mix", "convolution-1000",
                         "--compare", "--json", "-"});
  ASSERT_EQ(all.exit_code, 0) << all.err;
  const auto json = all.json();
  EXPECT_GE(json["runs"].size(), 10U);
  for (const auto& run : json["runs"]) {
    EXPECT_LE(run["gaps"]["throughput"], 1e-6) << run["mode"];
    EXPECT_GE(run["gaps"]["energy"], -1e-6) << run["mode"];
  }
  const auto twice = pirt({"schedule", "--platform", "snapdragon820", "--mix", "convolution-1000",
                           "--compare", "met,ect,met", "--json", "-"});
  ASSERT_EQ(twice.exit_code, 0) << twice.err;
  EXPECT_EQ(twice.json()["runs"].size(), 2U);
  const auto two = pirt({"schedule", "--platform", "host-opencl", "--mix", "convolution-1000",
                         "--compare", "cpu-only"});
  EXPECT_EQ(two.exit_code, 2);  // none can run
  EXPECT_EQ(pirt({"schedule", "--platform", "fake", "--compare", "latency,thruput"}).exit_code, 2);
  EXPECT_EQ(pirt({"schedule", "--platform", "fake", "--compare", "--mode", "latency"}).exit_code,
            2);
}

TEST(Report, ShowsThePapersTable) {
  const auto json = pirt({"report", "paper", "--json", "-"}).json();
  EXPECT_EQ(json["table5"].size(), 13U);
  EXPECT_EQ(pirt({"report"}).exit_code, 2);
  expect_refused(pirt({"report", "paper", "--format", "json"}), {"--json -"});
  EXPECT_EQ(pirt({"report", "paper", "none.db"}).exit_code, 2);
  EXPECT_EQ(pirt({"report", "paper", "a.db", "b.db"}).exit_code, 2);
}

TEST(Schedule, RefusesBadWeightsAndDurations) {
  const auto with = [](const std::string& option, const std::string& value) {
    return pirt({"schedule", "--platform", "fake", "--mode", "latency", option, value});
  };
  for (const auto* weights : {"gpu", "gpu=", "gpu=-1", "gpu=1.5", "=3", "gpu=1,gpu=2", ""}) {
    const auto outcome = with("--weights", weights);
    EXPECT_EQ(outcome.exit_code, 2) << weights;
    EXPECT_THAT(outcome.err, HasSubstr("--weights")) << weights;
  }
  EXPECT_THAT(with("--weights", "gpuu=3").err, HasSubstr("gpuu"));
  for (const auto* duration : {"0", "-1s", "soon", "1parsec", "nan", ""}) {
    EXPECT_EQ(with("--duration", duration).exit_code, 2) << duration;
  }
}

TEST(Characterize, DryRunShowsTheCellsAndWritesNothing) {
  const Scratch scratch;
  const auto outcome = pirt({"characterize", "--platform", "fake", "--filter", "^fc", "--dry-run",
                             "--db", scratch.file("p.db"), "--json", "-"});
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  EXPECT_EQ(outcome.json()["cells"].size(), 9U);  // fc6, fc7, fc8 on three units
  EXPECT_FALSE(std::filesystem::exists(scratch.file("p.db")));
}

/// Interrupted as soon as there is a database: well before its processes are done.
Outcome characterize_interrupted(const std::string& options, const std::string& database) {
  // A shell's background ignores SIGINT.
  return run("env --default-signal " + quoted(kProgram) + " characterize --quick --platform fake " +
             options + " --db " + quoted(database) + " & pid=$!; while [ ! -e " + quoted(database) +
             " ]; do sleep 0.02; done; kill -INT $pid; wait $pid");
}

// Two busy loops a core. Whether all of a row's processes wait alike or not, each is doubted, and
// used all the same.
TEST(Characterize, DoubtsEachCallBesideOtherPrograms) {
  const Scratch scratch;
  const std::string database = scratch.file("p.db");
  const auto made =
      run("pids=; for i in $(seq $((2 * $(nproc)))); do (while :; do :; done) & pids=\"$pids $!\"; "
          "done; trap 'kill $pids' EXIT; " +
          quoted(kProgram) + " characterize --quick --platform host-cpu --filter '^fc8$' " +
          "--max-time 20s --db " + quoted(database) + " --json -");
  ASSERT_EQ(made.exit_code, 0) << made.err;
  EXPECT_THAT(made.err, HasSubstr("other programs take"));
  EXPECT_THAT(made.err, Not(HasSubstr("not valid")));
  int calls = 0;
  const auto shown = made.json();
  for (const auto& row : shown.at("profile_summary")) {
    if (row["phase"] != "call" && row["phase"] != "execute") continue;
    ++calls;
    EXPECT_EQ(row["valid"], false);
    EXPECT_EQ(row["reasons"].size(), 0U);
    EXPECT_THAT(row["doubts"].dump(), HasSubstr("contended"));
    EXPECT_GT(row["taken"], 0.1);
    EXPECT_LT(row["ci_low_ns"], row["median_ns"]);
  }
  EXPECT_EQ(calls, 2);
  EXPECT_EQ(pirt({"report", database}).exit_code, 0);
  const auto mix =
      scratch.write("mix.yaml", "mix: m\npipelines: {p: {rate_hz: 1, tasks: [{workload: fc8}]}}\n");
  const auto used =
      pirt({"schedule", "--mode", "edf", "--profile", database, "--mix", mix, "--json", "-"});
  ASSERT_EQ(used.exit_code, 0) << used.err;
  EXPECT_THAT(used.json()["doubted"][0]["doubts"].dump(), HasSubstr("contended"));
  const auto strict =
      pirt({"schedule", "--mode", "edf", "--profile", database, "--mix", mix, "--strict"});
  EXPECT_EQ(strict.exit_code, 2);
  EXPECT_THAT(strict.err, HasSubstr("--strict refuses"));
}

TEST(Characterize, MeasuresBatchesBesideThePlainRows) {
  const Scratch scratch;
  const std::string database = scratch.file("p.db");
  const std::vector<std::string> options = {
      "characterize", "--quick",       "--platform", "fake", "--units", "cpu,gpu",
      "--filter",     "^(fc8|sobel)$", "--batch",    "4",    "--db",    database};
  auto dry = options;
  dry.insert(dry.end(), {"--dry-run", "--json", "-"});
  std::vector<std::string> cells;
  const auto planned = pirt(dry).json();
  for (const auto& cell : planned["cells"]) {
    cells.push_back(cell["workload"].get<std::string>() + " " + cell["unit"].get<std::string>());
  }
  EXPECT_THAT(cells, testing::UnorderedElementsAre("sobel cpu", "fc8 cpu", "fc8@batch4 cpu",
                                                   "sobel gpu", "fc8 gpu", "fc8@batch4 gpu"));

  const auto made = pirt(options);
  ASSERT_EQ(made.exit_code, 0) << made.err;
  const auto report = pirt({"report", database, "--json", "-"});
  ASSERT_EQ(report.exit_code, 0) << report.err;
  int batches = 0;
  const auto shown = report.json();
  for (const auto& row : shown.at("profile_summary")) {
    const bool batch = row["workload"] == "fc8@batch4";
    batches += batch ? 1 : 0;
    EXPECT_EQ(row.value("batch", 1), batch ? 4 : 1);
  }
  EXPECT_GT(batches, 0);
  EXPECT_THAT(pirt({"report", database}).out, HasSubstr("call/image"));
  for (const auto* bad : {"1", "257", "many"}) {
    const auto refused = pirt(
        {"characterize", "--platform", "fake", "--batch", bad, "--db", scratch.file("none.db")});
    EXPECT_EQ(refused.exit_code, 2) << bad;
  }
}

TEST(Characterize, GoesOnWithABatchThatWasInterrupted) {
  const Scratch scratch;
  const std::string database = scratch.file("p.db");
  const auto interrupted =
      characterize_interrupted("--units cpu --filter '^fc8$' --batch 2", database);
  EXPECT_EQ(interrupted.exit_code, 4);
  const auto rest = pirt({"characterize", "--resume", "--db", database, "--json", "-"});
  ASSERT_EQ(rest.exit_code, 0) << rest.err;
  EXPECT_EQ(rest.json()["summary"]["cells"], 2) << "fc8 and fc8@batch2";
}

TEST(Characterize, KeepsWhatWasMeasuredOnCtrlCAndGoesOnWithIt) {
  const Scratch scratch;
  const std::string database = scratch.file("p.db");
  const auto interrupted = characterize_interrupted("--filter '^pool5$' --seed 5", database);
  EXPECT_EQ(interrupted.exit_code, 4);
  EXPECT_THAT(interrupted.err, HasSubstr("pirt characterize --resume --db " + database));

  const auto refused = pirt({"characterize", "--resume", "--db", database, "--precision", "1%"});
  EXPECT_EQ(refused.exit_code, 2);
  EXPECT_THAT(refused.err, HasSubstr("--precision"));

  const auto rest = pirt({"characterize", "--resume", "--db", database, "--json", "-"});
  ASSERT_EQ(rest.exit_code, 0) << rest.err;
  EXPECT_EQ(rest.json()["summary"]["run_id"], 1);
  EXPECT_EQ(rest.json()["summary"]["cells"], 3);
  EXPECT_FALSE(rest.json()["summary"]["interrupted"].get<bool>());
  EXPECT_EQ(pirt({"characterize", "--resume", "--db", database}).exit_code, 2);  // nothing is left

  // Of platform fake: device 1 ms, preparing 10 ms cold, 2 ms warm and a call; calls of pool5 take
  // 0.1 ms on cpu and 0.1 + 0.1 + 0.05 + 0.05 = 0.3 ms on gpu: never faster.
  const auto report = pirt({"report", "setup", database, "--json", "-"});
  ASSERT_EQ(report.exit_code, 0) << report.err;
  const auto shown = report.json();
  for (const auto& crossover : shown.at("crossovers")) {
    if (crossover["first"] == "cpu" && crossover["second"] == "gpu") {
      EXPECT_EQ(crossover["cold"]["wins"], "never");
    }
  }
  EXPECT_EQ(shown.at("crossovers").size(), 3U);
  for (const auto& cost : shown.at("offloading")) {
    EXPECT_DOUBLE_EQ(cost["device_init_ms"].get<double>(), 1);
    EXPECT_DOUBLE_EQ(cost["prepare_ms"].get<double>(), cost["state"] == "cold" ? 10 : 2);
  }
}

TEST(Characterize, RefusesAMaxTimeThatIsNone) {
  for (const auto* time : {"0", "-1s", "soon"}) {
    const auto outcome =
        pirt({"characterize", "--platform", "fake", "--dry-run", "--max-time", time});
    EXPECT_EQ(outcome.exit_code, 2) << time;
  }
}

/// The loader finds no driver: as on a machine without any.
constexpr auto* kNoOpenCl = "OCL_ICD_VENDORS=/nonexistent";

TEST(Characterize, GoesOnWithoutAnOpenClDevice) {
  PIRT_BACKEND_OR_SKIP("opencl")
  const Scratch scratch;
  const auto outcome = pirt({"characterize", "--quick", "--filter", "^pool5$", "--max-time", "5s",
                             "--db", scratch.file("p.db"), "--json", "-"},
                            kNoOpenCl);
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  EXPECT_THAT(outcome.err, HasSubstr("opencl"));
  EXPECT_THAT(outcome.err, HasSubstr("pocl-opencl-icd"));  // the remedy
  const auto json = outcome.json();
  for (const auto& row : json["profile_summary"]) EXPECT_EQ(row["unit"], "cpu");
}

TEST(Characterize, AUnitThatIsAskedForByNameMustBeThere) {
  PIRT_BACKEND_OR_SKIP("opencl")
  const Scratch scratch;
  const auto outcome = pirt(
      {"characterize", "--quick", "--units", "opencl", "--db", scratch.file("p.db")}, kNoOpenCl);
  EXPECT_EQ(outcome.exit_code, 4);
  EXPECT_THAT(outcome.err, HasSubstr("pocl-opencl-icd"));
  EXPECT_FALSE(std::filesystem::exists(scratch.file("p.db")));
}

TEST(List, ShowsTheMissingDeviceWithItsRemedy) {
  PIRT_BACKEND_OR_SKIP("opencl")
  const auto backends = pirt({"list", "backends"}, kNoOpenCl);
  EXPECT_EQ(backends.exit_code, 0);
  EXPECT_THAT(backends.out, HasSubstr("pocl-opencl-icd"));
}

TEST(Characterize, TakesRealPictures) {
  PIRT_DATA_OR_SKIP(images, "tum-fr3-office-640x480");
  const Scratch scratch;
  const auto outcome = pirt({"characterize", "--quick", "--platform", "fake", "--units", "cpu",
                             "--filter", "^(undistort|sobel)$", "--images", images.string(), "--db",
                             scratch.file("p.db"), "--json", "-"});
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  bool resized = false;
  const auto json = outcome.json();
  for (const auto& row : json["profile_summary"]) {
    if (row["phase"] != "call") continue;
    const bool noted = row["notes"].dump().find("input_resized") != std::string::npos;
    EXPECT_EQ(noted, row["workload"] ==
                         "sobel");  // 1920x1080 from 640x480; undistort takes them as they are
    resized = resized || noted;
  }
  EXPECT_TRUE(resized);
}

TEST(Help, EveryCommandHasOneWithAnExample) {
  for (const auto* command : {"list", "characterize", "schedule", "report", "export", "diff"}) {
    const auto help = pirt({command, "--help"});
    EXPECT_EQ(help.exit_code, 0);
    EXPECT_THAT(help.out, HasSubstr("Example: pirt")) << command;
    EXPECT_THAT(help.out, Not(HasSubstr("worker")));
  }
}

TEST(Characterize, SaysInALineWhatAUnitDoesNotSupport) {
  const Scratch scratch;
  const auto board =
      scratch.write("board.yaml",
                    "platform: board\nunits: {gpu: {backend: fake, slots: 1, active_w: 1, script: "
                    "{unsupported: [fc7, fc8], stages: {pool5: [{name: execute, ms: 1}]}}}}\n");
  const auto measured = [&](const std::string& filter) {
    return pirt({"characterize", "--quick", "--platform", board, "--db", scratch.file("p.db"),
                 "--filter", filter});
  };
  const auto several = measured("^(pool5|fc7|fc8)$");
  EXPECT_EQ(several.exit_code, 0) << several.err;
  EXPECT_THAT(several.err, HasSubstr("warning: 2 workloads on unit gpu are not measured "
                                     "(--dry-run says why): fc7, fc8\n"));
  const auto one = measured("^(pool5|fc8)$");
  EXPECT_EQ(one.exit_code, 0) << one.err;
  EXPECT_THAT(one.err, HasSubstr("fc8 on unit gpu is not measured: "));
}

}  // namespace
}  // namespace pirt::test
