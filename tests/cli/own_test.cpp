// Workloads of one's own through the program: measured, stored, scheduled without their code.
#include "workloads/own/own.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "characterize/profile/own_rows.h"
#include "characterize/profile/store/writer.h"
#include "tests/cli/program.h"
#include "tests/support/optional_backend.h"

namespace pirt::test {
namespace {

using testing::AllOf;
using testing::HasSubstr;
using testing::Not;

/// A workload file, and an entry that may follow.
const std::string kMean =
    "workloads:\n  - {name: my.mean, inputs: {cloud: \"f32[1000,3]\"}, outputs: {mean: "
    "\"f32[3]\"}, command: [cat]}\n";
constexpr const char* kMore = "  - {name: my.more, outputs: {a: \"u8[4]\"}, command: [cat]}\n";

class Own : public testing::Test {
 protected:
  [[nodiscard]] Outcome characterize(const std::string& file, const std::string& filter,
                                     const std::string& units = "cpu",
                                     const std::string& max_time = "5s") const {
    return pirt({"characterize", "--workloads", file, "--filter", filter, "--units", units,
                 "--quick", "--precision", "50%", "--max-time", max_time, "--db", database_});
  }
  /// The example module, measured once for the suite; @p database gets a copy of the profile.
  /// @return Where it lies, which a test may change.
  [[nodiscard]] static std::string measured_module(const std::string& database) {
    static const Scratch folder;
    const std::string module = folder.write("libmine.so", slurp(kExampleModule));
    const std::string profile = folder.file("p.db");
    static const Outcome measured =
        pirt({"characterize", "--workloads", module, "--filter", "^mine.sobel@160x120$", "--units",
              "cpu", "--quick", "--precision", "50%", "--max-time", "10s", "--db", profile});
    EXPECT_EQ(measured.exit_code, 0) << measured.err;
    EXPECT_THAT(measured.out, HasSubstr("unverified"));
    std::filesystem::copy_file(profile, database);
    return module;
  }
  [[nodiscard]] Outcome scheduled(const std::vector<std::string>& workloads,
                                  const std::vector<std::string>& more) const {
    std::string mix = "mix: m\npipelines:\n  a:\n    rate_hz: 1\n    tasks:\n";
    for (const std::string& each : workloads) mix += "      - {workload: \"" + each + "\"}\n";
    std::vector<std::string> words = {
        "schedule", "--mode", "edf", "--duration", "1s", "--mix", scratch_.write("m.yaml", mix)};
    words.insert(words.end(), more.begin(), more.end());
    return pirt(words);
  }
  /// A profile as if my.mean of the file had been measured, and nothing else.
  void write_profile(const std::string& file, const std::string& platform) const {
    RunHeader header{.started = "2026-01-02T03:04:05Z",
                     .platform = platform,
                     .seed = 1,
                     .environment = {{"cpu_model", "test cpu"}},
                     .units = {{"cpu", "cpu", "test", true, {}}}};
    for (const own::Definition& each : own::load(file)) {
      if (each.name == "my.mean") header.environment.merge(own_facts(own::to_workload(each)));
    }
    ProfileWriter writer(database_);
    const auto run = writer.begin_run(header);
    CellRecord cell{.workload = "my.mean",
                    .unit = "cpu",
                    .ops = 1000,
                    .bytes = 1000,
                    .verification = "equal",
                    .phases = {},
                    .energy = {}};
    for (const Phase phase : {Phase::kExecute, Phase::kCall}) {
      cell.phases.push_back({.phase = phase,
                             .state = State::kSteady,
                             .provenance = Provenance::kMeasured,
                             .reasons = {},
                             .notes = {},
                             .samples = std::vector<Nanos>(20, from_ms(1))});
    }
    writer.write_cell(run, cell);
    writer.finish_run(run, "2026-01-02T03:05:05Z");
  }
  const Scratch scratch_;
  const std::string database_ = scratch_.file("p.db");
};

TEST_F(Own, AModuleThatDoesWhatNoKernelShouldCostsOneCellEach) {
  const auto outcome =
      pirt({"characterize", "--workloads", kHostileModule, "--filter",
            "^bad\\.(good|crash|beyond|far_beyond|throws|prints|ends|thread|wrong)$", "--units",
            "cpu", "--quick", "--precision", "50%", "--max-time", "40s", "--db", database_});
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

TEST_F(Own, WhatAKernelLeavesUnwrittenIsFound) {
  EXPECT_THAT(characterize(kHostileModule, "^bad\\.half$").err,
              AllOf(HasSubstr("bad.half on cpu: not valid"), HasSubstr("wrong_output")));
  scratch_.write(
      "p.py",
      "import json, sys\n"
      "sys.stdin.readline()\n"
      "print(json.dumps({'ready': True}), flush=True)\n"
      "for line in sys.stdin:\n"
      "    asked = json.loads(line)\n"
      "    print(json.dumps({'done': asked.get('call', asked.get('null'))}), flush=True)\n");
  const std::string head = "workloads:\n  - name: my.k\n    outputs: {a: \"u8[4]\"}\n    ";
  const std::string program = scratch_.write("p.yaml", head + "command: [python3, p.py]\n");
  EXPECT_THAT(characterize(program, "^my.k$").err, HasSubstr("wrong_output"));
}

TEST_F(Own, WhatAnOpenclKernelLeavesUnwrittenIsFound) {
  PIRT_BACKEND_OR_SKIP("opencl");
  scratch_.write("k.cl", "__kernel void k(__global uchar* a) { a[get_global_id(0)] = 1; }\n");
  const std::string file =
      scratch_.write("w.yaml",
                     "workloads:\n  - name: my.k\n    outputs: {a: \"u8[4]\"}\n"
                     "    opencl: {source: k.cl, kernel: k, global: [2], args: [a]}\n");
  EXPECT_THAT(characterize(file, "^my.k$", "opencl", "15s").err,
              AllOf(HasSubstr("my.k on opencl: not valid"), HasSubstr("wrong_output")));
}

TEST_F(Own, WhatAModuleSaysIsHeldAgainstWhatItDoes) {
  const auto outcome = characterize(kHostileModule, "^bad\\.(slices|outside)$", "cpu", "10s");
  EXPECT_THAT(outcome.out, HasSubstr("slices: says 4"));
  EXPECT_THAT(outcome.err, AllOf(HasSubstr("bad.outside on cpu: not"),
                                 HasSubstr("from u8[101]: 9.000000 at 0 is not from 0.0")));
}

TEST_F(Own, IsScheduledWithoutItsCode) {
  const std::string module = measured_module(database_);
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
  expect_refused(schedule("mine.sobel@320x240", {}),
                 {"has no row", "--workloads " + module, "'^(mine.sobel@320x240)$'"});
  expect_refused(schedule("mine.sobl", {}),
                 {"nothing says what 'mine.sobl' is", "mine.sobel@160x120"});
  // Another one of the same name.
  std::ofstream(module, std::ios::binary) << slurp(kExampleModule) + " ";
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

TEST_F(Own, AReportSaysWhatIsNotAsItWasMeasured) {
  const std::string module = measured_module(database_);
  const std::string mix =
      scratch_.write("m.yaml",
                     "mix: m\npipelines:\n  a: {rate_hz: 10, tasks: [{name: t, workload: "
                     "\"mine.sobel@160x120\"}]}\n");
  const auto report = [&](const std::string& kind, const std::string& file) {
    std::vector<std::string> words = {"report", kind, database_, "--workloads", file};
    if (kind == "compare") words.insert(words.end(), {"--mix", mix});
    return pirt(words);
  };
  for (const char* kind : {"compare", "profile", "setup", "offload"}) {
    SCOPED_TRACE(kind);
    const auto same = report(kind, module);
    EXPECT_EQ(same.exit_code, 0) << same.err;
    EXPECT_THAT(same.err, Not(HasSubstr("measure")));
  }
  // The same elsewhere is the same; another one of its name is not, wherever it lies.
  EXPECT_THAT(report("compare", kExampleModule).err, Not(HasSubstr("not what was measured")));
  const std::string other = scratch_.write("other.so", slurp(kExampleModule) + " ");
  EXPECT_THAT(report("compare", other).err,
              AllOf(HasSubstr("other.so is not what was measured"), HasSubstr("mine.sobel")));
  EXPECT_THAT(report("profile", kHostileModule).err,
              AllOf(HasSubstr("has no rows of bad."), HasSubstr("--platform host --workloads"),
                    HasSubstr("--db")));
  expect_refused(report("compare", scratch_.file("absent.so")), {"absent.so"});
  // Beside a mix it is taken by itself.
  scratch_.write("pirt.workloads", "workloads:\n  - {module: other.so}\n");
  EXPECT_THAT(pirt({"report", "compare", database_, "--mix", mix}).err,
              HasSubstr("pirt.workloads is not what was measured"));
}

TEST_F(Own, IsScheduledOnABoardThatIsModelled) {
  const std::string board =
      scratch_.write("board.yaml",
                     "platform: board\nunits: {npu: {role: dsp, active_w: 1}}\n"
                     "workloads: {mine.sobel: {npu: 5}, sobel@160x120: {npu: 3}}\n");
  const auto mix = [this](const std::string& workload) {
    return scratch_.write("m.yaml",
                          "mix: m\npipelines:\n  a:\n    rate_hz: 10\n    tasks:\n      - {name: "
                          "s, workload: \"sobel@160x120\"}\n      - {name: t, workload: " +
                              workload + ", after: [s]}\n");
  };
  for (const auto& words : std::vector<std::vector<std::string>>{{"schedule", "--mode", "edf"},
                                                                 {"schedule", "--compare", "edf"},
                                                                 {"what-if", "--modes", "edf"},
                                                                 {"report", "compare"}}) {
    SCOPED_TRACE(words.front());
    const auto with = [&](const std::string& workload, std::vector<std::string> more) {
      std::vector<std::string> all = words;
      all.insert(all.end(), {"--platform", board, "--mix", mix(workload)});
      all.insert(all.end(), more.begin(), more.end());
      return pirt(all);
    };
    const auto good = with("mine.sobel", {"--workloads", kExampleModule});
    EXPECT_EQ(good.exit_code, 0) << good.err;
    for (const auto& more :
         std::vector<std::vector<std::string>>{{}, {"--workloads", kExampleModule}}) {
      const auto wrong = with("mine.sobl", more);
      // A report is of what can be said, and has that in it.
      EXPECT_EQ(wrong.exit_code, words.front() == "report" ? 0 : 2);
      EXPECT_THAT(wrong.out + wrong.err,
                  AllOf(HasSubstr("'mine.sobl'"), HasSubstr("did you mean mine.sobel")));
    }
    expect_refused(with("mine.sobel", {"--workloads", scratch_.file("absent.so")}), {"absent.so"});
  }
  const std::string wrong = scratch_.write(
      "wrong.yaml",
      "platform: board\nunits: {gpu: {role: gpu, active_w: 1, contexts: {programs: {a: "
      "[sobl]}}}}\n");
  expect_refused(pirt({"list", "units", "--platform", wrong}), {"sobl", "did you mean sobel"});
}

TEST_F(Own, ThatHangsCostsTheTimeThatItsFileSays) {
  const std::string file = scratch_.write(
      "w.yaml", std::string("workloads:\n  - {module: ") + kHostileModule + ", limit_s: 5}\n");
  const auto outcome = characterize(file, "^bad\\.(hang|good)$", "cpu", "45s");
  EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
  EXPECT_THAT(outcome.err,
              AllOf(HasSubstr("bad.hang on cpu: not"), HasSubstr("timed out after 5 s"),
                    HasSubstr("limit_s"), Not(HasSubstr("bad.good on cpu: not"))));
}

TEST_F(Own, ItsLastWordsAreShown) {
  scratch_.write("p.py", "import no_such_package\n");
  const std::string file =
      scratch_.write("w.yaml",
                     "workloads:\n  - {name: my.p, outputs: {a: \"u8[4]\"}, command: [python3, "
                     "p.py]}\n");
  const auto outcome = characterize(file, "my.p");
  EXPECT_EQ(outcome.exit_code, 4);
  EXPECT_THAT(outcome.out + outcome.err,
              AllOf(HasSubstr("ended with code 1"), HasSubstr("No module named")));
}

TEST_F(Own, KernelsThatAreNoneSayWhy) {
  PIRT_BACKEND_OR_SKIP("opencl");
  const std::string head =
      "workloads:\n  - name: my.k\n    outputs: {a: \"u8[4]\"}\n    opencl: {source: k.cl, kernel: "
      "k, global: [4], args: ";
  const auto outcome = [&](const std::string& source, const std::string& args) {
    scratch_.write("k.cl", source);
    return pirt({"sample", "--workload", "my.k", "--unit", "opencl", "--workloads",
                 scratch_.write("w.yaml", head + args + "}\n")});
  };
  const auto broken = outcome("__kernel void k(__global uchar* a) { a[0] = nothing; }\n", "[a]");
  EXPECT_NE(broken.exit_code, 0);
  EXPECT_THAT(broken.err, AllOf(HasSubstr("k.cl"), HasSubstr("nothing")));
  const auto few = outcome("__kernel void k(__global uchar* a, int b) { a[0] = b; }\n", "[a]");
  EXPECT_THAT(few.err, HasSubstr("takes 2 arguments, and 1 are given"));
  const auto other =
      outcome("__kernel void k(__global uchar* a, int b) { a[0] = b; }\n", "[a, {u8: 1}]");
  EXPECT_THAT(other.err, HasSubstr("takes no {u8: 1} as argument 1"));
}

TEST_F(Own, ANeedThatNothingKnowsIsSaid) {
  const std::string mix = scratch_.write(
      "m.yaml", "mix: m\npipelines:\n  a: {rate_hz: 1, tasks: [{name: t, workload: mine.sobl}]}\n");
  const auto plan = pirt(
      {"characterize", "--mix", mix, "--workloads", kExampleModule, "--units", "cpu", "--dry-run"});
  EXPECT_EQ(plan.exit_code, 0) << plan.err;
  EXPECT_THAT(plan.out, AllOf(HasSubstr("needs 'mine.sobl'"), HasSubstr("did you mean")));
}

TEST_F(Own, PirtsOwnThatAMixOfTheirsNeedsAreMeasuredBesideThem) {
  const auto planned = [](const std::vector<std::string>& more) {
    std::vector<std::string> words = {"characterize", "--workloads", kExampleModule, "--units",
                                      "cpu",          "--dry-run",   "--json",       "-"};
    words.insert(words.end(), more.begin(), more.end());
    std::vector<std::string> workloads;
    const auto plan = pirt(words).json();
    for (const auto& cell : plan["cells"]) workloads.push_back(cell["workload"].get<std::string>());
    return workloads;
  };
  const std::string mix =
      scratch_.write("m.yaml",
                     "mix: m\npipelines:\n  a: {rate_hz: 1, tasks: [{workload: mine.sobel}, "
                     "{workload: sobel}, {workload: gaussian_blur@320x240}]}\n");
  EXPECT_THAT(planned({"--mix", mix}),
              testing::ElementsAre("mine.sobel", "sobel", "gaussian_blur@320x240"));
  EXPECT_THAT(planned({}), testing::ElementsAre("mine.sobel"));
  EXPECT_THAT(planned({"--mix", mix, "--filter", "^mine"}), testing::ElementsAre("mine.sobel"));
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
  const auto regress = [this](const std::string& pair, std::vector<std::string> more,
                              const std::string& max_time = "1ms") {
    std::vector<std::string> words = {"regress",           "--as",       pair,    "--workloads",
                                      kHostileModule,      "--work",     "2ms",   "--ledger",
                                      scratch_.file(pair), "--max-time", max_time};
    words.insert(words.end(), more.begin(), more.end());
    return pirt(words);
  };
  // No time decides nothing; what is compared is said.
  const auto outcome = regress("bad.good=bad.prints", {"--units", "cpu"});
  EXPECT_EQ(outcome.exit_code, 3) << outcome.err;
  EXPECT_THAT(outcome.out,
              AllOf(HasSubstr("--workload bad.good"), HasSubstr("--workload bad.prints"),
                    testing::ContainsRegex("bad.good=bad.prints +cpu +all")));
  EXPECT_THAT(outcome.err, AllOf(Not(HasSubstr("do not have the same to do")),
                                 Not(HasSubstr("has no reference"))));
  EXPECT_THAT(regress("bad.renamed=bad.good", {"--units", "cpu"}).err,
              AllOf(HasSubstr("same to do: origin u8[101] and from u8[101]"),
                    HasSubstr("bad.renamed has no reference: whether both compute the same is")));
  EXPECT_THAT(regress("bad.good=sobel", {"--units", "cpu"}).err,
              HasSubstr("bad.good and sobel do not have the same to do: "));
  const auto wrong = regress("bad.wrong=bad.good", {"--units", "cpu"}, "1min");
  EXPECT_EQ(wrong.exit_code, 1) << wrong.err;
  EXPECT_THAT(wrong.out, HasSubstr("the candidate failed: wrong output"));
  expect_refused(regress("bad.good", {"--units", "cpu"}), {"CANDIDATE=BASELINE"});
  expect_refused(regress("bad.god=bad.prints", {"--units", "cpu"}), {"did you mean bad.good"});
  expect_refused(regress("bad.good=sobl", {"--units", "cpu"}), {"did you mean sobel"});
  expect_refused(regress("bad.good=bad.prints", {}), {"--units"});
}

TEST_F(Own, ALedgerIsAlsoOfTheFilesThatAWorkloadFileNames) {
  const std::string folder = std::string(kSourceFolder) + "/tests/examples/workloads/";
  const std::string own = scratch_.write("own.yaml", slurp(folder + "own.yaml"));
  for (const char* named : {"threshold.cl", "mean.py"}) {
    scratch_.write(named, slurp(folder + named));
  }
  const auto regress = [&] {
    return pirt({"regress", "--as", "my.mean=my.mean", "--workloads", own, "--units", "cpu",
                 "--max-time", "1ms", "--ledger", scratch_.file("ledger")});
  };
  EXPECT_EQ(regress().exit_code, 3) << "no time decides nothing";
  EXPECT_EQ(regress().exit_code, 3);
  scratch_.write("mean.py", slurp(folder + "mean.py") + "\n");
  expect_refused(regress(), {"another comparison", "own"});
}

// Of a file that was measured in part; what it has besides is known of no run.
TEST_F(Own, WhatAProfileDoesNotHaveIsAskedOfTheFile) {
  const std::string file = std::string(kSourceFolder) + "/tests/examples/workloads/own.yaml";
  write_profile(file, "host-cpu");
  expect_refused(
      scheduled({"my.mean", "my.threshold"}, {"--profile", database_, "--workloads", file}),
      {"--workloads " + file, "--filter '^(my.threshold)$'"});
}

TEST_F(Own, WhatABoardModelsIsAskedOfNoFile) {
  const std::string file = scratch_.write("own.yaml", kMean);
  write_profile(file, "board");
  const std::string board =
      scratch_.write("board.yaml",
                     "platform: board\nunits:\n  cpu: {backend: cpu, cores: all, slots: 1, "
                     "active_w: 1}\nworkloads: {lidar.seg: {cpu: 5}}\n");
  scratch_.write("own.yaml", kMean + "  - {name: nodot, command: [cat]}\n");
  std::vector<std::string> words = {"--platform", board,         "--profile",
                                    database_,    "--workloads", file};
  const auto modelled = scheduled({"my.mean", "lidar.seg"}, words);
  EXPECT_EQ(modelled.exit_code, 0) << modelled.err;
  EXPECT_THAT(modelled.err,
              AllOf(HasSubstr("is not what was measured"), Not(HasSubstr("own.yaml:3"))));
  // A file that cannot be loaded here leaves others to be asked.
  const std::string more = scratch_.write("more.yaml", std::string("workloads:\n") + kMore);
  words.insert(words.end(), {"--workloads", more});
  const auto asked = scheduled({"my.mean", "my.more"}, words);
  EXPECT_EQ(asked.exit_code, 2);
  EXPECT_THAT(asked.err,
              AllOf(HasSubstr("own.yaml:3"), HasSubstr("--workloads " + more + " --filter")));
}

TEST_F(Own, FilesWithOneNameAreRefusedBesideAProfile) {
  const std::string first = scratch_.write("a.yaml", kMean);
  const std::string second = scratch_.write("b.yaml", kMean + kMore);
  write_profile(first, "host-cpu");
  const auto with = [&](const std::string& one, const std::string& other) {
    return scheduled({"my.mean"},
                     {"--profile", database_, "--workloads", one, "--workloads", other});
  };
  expect_refused(with(first, second), {"my.mean is in " + first + " and in " + second});
  EXPECT_THAT(with(second, first).err,
              HasSubstr("my.mean is in " + second + " and in " + first + "; rename one"));
  // What was measured of the first is in the other one by now.
  scratch_.write("a.yaml", std::string("workloads:\n") + kMore);
  scratch_.write("b.yaml", kMean);
  const auto moved = with(first, second);
  EXPECT_EQ(moved.exit_code, 0) << moved.err;
}

// The file that has it says nothing of sizes.
TEST_F(Own, TimesOfASizeMayBeImportedOrModelled) {
  const std::string file = scratch_.write("own.yaml", kMean);
  const std::string table =
      scratch_.write("t.csv", "workload,unit,ms,size\nmy.mean,gpu,9.5,1280x720\n");
  const auto imported = pirt({"import", table, "--db", database_});
  ASSERT_EQ(imported.exit_code, 0) << imported.err;
  const std::string board =
      scratch_.write("board.yaml",
                     "platform: board\nunits: {npu: {role: dsp, active_w: 1}}\n"
                     "workloads: {my.mean@1280x720: {npu: 5}}\n");
  for (const auto& words :
       std::vector<std::vector<std::string>>{{"--profile", database_, "--workloads", file},
                                             {"--platform", board, "--workloads", file}}) {
    SCOPED_TRACE(words.front());
    const auto sized = scheduled({"my.mean@1280x720"}, words);
    EXPECT_EQ(sized.exit_code, 0) << sized.err;
    expect_refused(scheduled({"my.mean@640x480"}, words),
                   {"mix m: ", "'my.mean' has no other sizes"});
  }
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
  const std::string own = scratch_.write("pirt.workloads", slurp(folder + "own.yaml"));
  scratch_.write("threshold.cl", slurp(folder + "threshold.cl"));
  scratch_.write("mean.py", slurp(folder + "mean.py"));
  const std::string mix = scratch_.write("mix.yaml", slurp(folder + "mix.yaml"));
  std::vector<std::string> words = {"characterize", "--mix", mix, "--units", "cpu", "--dry-run"};
  const auto plan = pirt(words);
  EXPECT_EQ(plan.exit_code, 0) << plan.err;
  EXPECT_THAT(plan.out, HasSubstr("my.mean"));
  // Not a stranger's, unless it is named.
  constexpr uid_t kStranger = 12345;
  if (::chown(own.c_str(), kStranger, kStranger) != 0) GTEST_SKIP() << "skipped: only root can";
  expect_refused(pirt(words), {own, "belongs to somebody else", "--workloads"});
  words.insert(words.end(), {"--workloads", own});
  EXPECT_EQ(pirt(words).exit_code, 0);
}

}  // namespace
}  // namespace pirt::test
