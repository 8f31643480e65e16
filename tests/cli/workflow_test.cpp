// The workflow files that users copy: they parse, ask for nothing that pirt does not have, and do
// what they say: their steps are run as they stand, on a runner that keeps its folder.
#include <yaml-cpp/yaml.h>

#include <map>
#include <regex>
#include <set>

#include "tests/cli/program.h"

namespace pirt::test {
namespace {

/// All scalars below @p node, one after the other.
std::string scalars(const YAML::Node& node) {
  if (node.IsScalar()) return node.Scalar() + "\n";
  std::string text;
  if (node.IsMap()) {
    for (const auto& each : node) text += scalars(each.second);
  } else {
    for (const auto& each : node) text += scalars(each);
  }
  return text;
}

class WorkflowFile : public testing::TestWithParam<const char*> {};

TEST_P(WorkflowFile, AsksForWhatPirtHas) {
  const YAML::Node file = YAML::LoadFile(std::string(kSourceFolder) + "/cli/ci/" + GetParam());
  const std::string text = std::regex_replace(scalars(file), std::regex("\\\\\n"), " ");
  const std::regex command(R"((?:build/pirt|"\$PIRT") ([a-z]+)([^\n|&]*))");
  int commands = 0;
  for (std::sregex_iterator at(text.begin(), text.end(), command), end; at != end; ++at) {
    ++commands;
    const std::string help = pirt({(*at)[1].str(), "--help"}).out;
    ASSERT_NE(help, "") << at->str();
    const std::string rest = (*at)[2].str();
    const std::regex option("--[a-z-]+");
    for (std::sregex_iterator o(rest.begin(), rest.end(), option); o != end; ++o) {
      EXPECT_THAT(help, testing::HasSubstr(o->str())) << at->str();
    }
  }
  EXPECT_GE(commands, 1);
}

// Tests take most of the time and none of the comparison.
TEST_P(WorkflowFile, BuildsNoTests) {
  const std::string text =
      scalars(YAML::LoadFile(std::string(kSourceFolder) + "/cli/ci/" + GetParam()));
  const std::regex configured("cmake -S [^\n]*");
  for (std::sregex_iterator at(text.begin(), text.end(), configured), end; at != end; ++at) {
    EXPECT_THAT(at->str(), testing::HasSubstr("-DPIRT_TESTS=OFF"));
  }
}

// A branch that wrote it would be compared with itself from its second run on.
TEST(Workflow, WritesItsBaseOnTheDefaultBranchOnly) {
  const YAML::Node file = YAML::LoadFile(std::string(kSourceFolder) + "/cli/ci/gitlab.yml");
  int writers = 0;
  for (const auto& job : file) {
    const YAML::Node cache = job.second["cache"];
    if (!cache) continue;
    if (cache["policy"] && cache["policy"].Scalar() == "pull") continue;
    ++writers;
    // What a job extends is merged into it: it would only pull, and keep nothing of a run that
    // fails.
    ASSERT_TRUE(cache["policy"] && cache["when"]) << job.first;
    EXPECT_EQ(cache["policy"].Scalar(), "pull-push");
    EXPECT_EQ(cache["when"].Scalar(), "always");
    EXPECT_EQ(cache["unprotect"].Scalar(), "true") << "branches that are not protected read it";
    const YAML::Node rules = job.second["rules"];
    ASSERT_EQ(rules.size(), 1U) << job.first;
    EXPECT_EQ(rules[0]["if"].Scalar(), "$CI_COMMIT_BRANCH == $CI_DEFAULT_BRANCH");
  }
  EXPECT_EQ(writers, 1);
}

TEST_P(WorkflowFile, PassesYamllint) {
  if (run("command -v yamllint").exit_code != 0) GTEST_SKIP() << "yamllint is not installed";
  const std::string source = kSourceFolder;
  const auto outcome = run("yamllint --strict -c " + quoted(source + "/.yamllint") + " " +
                           quoted(source + "/cli/ci/" + GetParam()));
  EXPECT_EQ(outcome.exit_code, 0) << outcome.out;
}

/// @source  GitHub's "Workflow syntax for GitHub Actions", of what is used here.
TEST(Workflow, OfGithubHasTheKeysThatGithubReads) {
  const auto known = [](const YAML::Node& map, const std::set<std::string>& keys) {
    for (const auto& each : map) {
      EXPECT_TRUE(keys.contains(each.first.Scalar())) << each.first.Scalar();
    }
  };
  const YAML::Node file = YAML::LoadFile(std::string(kSourceFolder) + "/cli/ci/github.yml");
  known(file, {"name", "on", "permissions", "env", "concurrency", "defaults", "jobs"});
  for (const auto& job : file["jobs"]) {
    known(job.second, {"name", "needs", "if", "runs-on", "permissions", "env", "timeout-minutes",
                       "strategy", "container", "services", "steps"});
    EXPECT_TRUE(job.second["runs-on"]);
    for (const auto& step : job.second["steps"]) {
      known(step, {"id", "name", "if", "uses", "run", "with", "env", "shell", "working-directory",
                   "continue-on-error", "timeout-minutes"});
      EXPECT_NE(step["uses"].IsDefined(), step["run"].IsDefined()) << "a step is one of the two";
      if (!step["run"]) continue;
      const Scratch scratch;
      const auto script = scratch.write("step.sh", step["run"].Scalar());
      EXPECT_EQ(run("bash -n " + script).err, "");
    }
  }
}

/// A runner whose folder stays from job to job. `cmake --build FOLDER` there makes FOLDER/pirt,
/// which compares and measures with the real one, on a simulated board; what `pirt sample` would
/// take says file `speed` of the source folder, in seconds, and of which commit a base is file
/// `base_commit`. Package managers and gh do nothing but write down what they were asked for.
class Runner {
 public:
  Runner() {
    tool("apt-get", "exit 0");
    tool("dpkg-query", "echo all installed");
    tool("gh",
         "[ -n \"$GH_REPO\" ] || exit 1; while [ $# -gt 1 ]; do [ $1 != --body-file ] || cp $2 '" +
             file("comment") + "'; shift; done");
    tool("cmake",
         "source=.\n"
         "for word in \"$@\"; do [ \"$last\" != -S ] || source=$word; [ \"$last\" != -B ] || "
         "into=$word; last=$word; done\n"
         "if [ $1 = -S ]; then mkdir -p $into; cp $source/speed $into/; exit; fi\n"
         "cp '" +
             file("pirt") + "' $2/pirt");
    const std::string real = quoted(kProgram);
    write("pirt",
          "#!/bin/sh\nspeed=$(cat \"$(dirname \"$0\")/speed\")\ncase $1 in\n"
          "  sample) case \"$*\" in *--help*) echo --workload; exit;; esac\n"
          "    echo '{\"pirt_sample\": 1, \"version\": \"1\", \"device\": \"CPU\", \"inputs\": "
          "\"a\", \"right\": true, \"detail\": \"\", \"seconds\": {\"call\": '$speed'}}';;\n"
          "  doctor) exit 1;;\n"
          "  export) echo '\"git_commit\": \"'$(cat base_commit 2>/dev/null)'\"' > base.json;;\n"
          "  characterize) shift\n"
          "    sed \"s/SPEED/$speed/\" '" +
              file("board.in") +
              "' > board.yaml\n"
              "    exec " +
              real +
              " characterize --quick --platform ./board.yaml --filter "
              "'^(sobel|fc8)$' $SEED \"$@\";;\n"
              "  regress) shift\n"
              "    case $1 in --*) exec " +
              real +
              " regress \"$@\" --platform fake --units cpu --filter "
              "sobel;; *) exec " +
              real +
              " regress \"$@\" --mix none;; esac;;\n"
              "esac\n");
    std::filesystem::permissions(file("pirt"), std::filesystem::perms::owner_all);
    // SPEED: milliseconds of sobel, so that 0.010 s of a sample and 0.010 ms differ in scale alone.
    write("board.in",
          "platform: board\nunits: {cpu: {backend: fake, slots: 1, active_w: 2}}\nworkloads:\n"
          "  sobel: {cpu: [{on: cpu, ms: SPEED, name: execute}]}\n"
          "  fc8: {cpu: [{on: cpu, ms: 5, name: execute}]}\n");
    std::filesystem::create_directory(file("work"));
  }

  /// @param script  Run by bash as both services do, in the runner's folder.
  Outcome job(const std::string& script, const std::string& environment = "") {
    write("job.sh", script);
    return run("cd " + quoted(file("work")) + "; " + environment + " PATH=" +
               quoted(file("tools")) + ":$PATH bash -eo pipefail " + quoted(file("job.sh")));
  }
  /// A source folder in the runner's, of a pirt that takes so long.
  void source(const std::string& folder, const std::string& speed) const {
    std::filesystem::create_directories(file("work/" + folder + "/cli"));
    std::filesystem::copy_file(std::string(kSourceFolder) + "/cli/packages.sh",
                               file("work/" + folder + "/cli/packages.sh"),
                               std::filesystem::copy_options::overwrite_existing);
    write("work/" + folder + "/speed", speed);
  }
  void write(const std::string& name, const std::string& text) const {
    static_cast<void>(scratch_.write(name, text));
  }
  [[nodiscard]] std::string file(const std::string& name) const { return scratch_.file(name); }

 private:
  void tool(const std::string& name, const std::string& body) const {
    std::filesystem::create_directories(file("tools"));
    write("tools/" + name, "#!/bin/sh\n" + body + "\n");
    std::filesystem::permissions(file("tools/" + name), std::filesystem::perms::owner_all);
  }
  Scratch scratch_;
};

YAML::Node workflow(const std::string& name) {
  return YAML::LoadFile(std::string(kSourceFolder) + "/cli/ci/" + name);
}

TEST(WorkflowSteps, OfGithubTellOneFromThreeOnARunnerThatKeepsItsFolder) {
  std::string script;
  for (const auto& step : workflow("github.yml")["jobs"]["regress"]["steps"]) {
    if (step["run"]) script += "(" + step["run"].Scalar() + ")\n";
  }
  Runner runner;
  const std::string summary = "GITHUB_STEP_SUMMARY=" + quoted(runner.file("summary"));
  runner.source("baseline", "0.010");
  runner.source("candidate", "0.012");
  const auto slower = runner.job(script, summary);
  EXPECT_EQ(slower.exit_code, 1) << slower.out << slower.err;
  EXPECT_THAT(slurp(runner.file("summary")), testing::HasSubstr("REGRESSION"));
  runner.source("candidate", "0.010");
  const auto same = runner.job(script, summary);
  EXPECT_EQ(same.exit_code, 0) << same.out << same.err;
  runner.source("baseline", "broken");  // the baseline fails: not comparable
  const auto untold = runner.job(script, summary);
  EXPECT_EQ(untold.exit_code, 0) << untold.err;
  EXPECT_THAT(untold.out, testing::HasSubstr("::warning::pirt could not tell"));
}

/// A job of gitlab.yml with what it extends.
std::string gitlab_script(const std::string& name) {
  const YAML::Node file = workflow("gitlab.yml");
  const auto lines = [&file](std::string job, const char* key) {
    for (;; job = file[job]["extends"].Scalar()) {
      if (!file[job][key]) continue;
      std::string text;
      for (const auto& line : file[job][key]) text += line.Scalar() + "\n";
      return text;
    }
  };
  return lines(name, "before_script") + lines(name, "script");
}

// Of whoever commits, for commands of git.
constexpr const char* kIdentity =
    "GIT_CONFIG_GLOBAL=/dev/null GIT_AUTHOR_NAME=a GIT_AUTHOR_EMAIL=a@a GIT_COMMITTER_NAME=a "
    "GIT_COMMITTER_EMAIL=a@a ";
const std::string kIntoMain = std::string(kIdentity) + "CI_MERGE_REQUEST_TARGET_BRANCH_NAME=main";

TEST(WorkflowSteps, OfGitlabCompareTwoProgramsOnARunnerThatKeepsItsFolder) {
  Runner runner;
  runner.source(".", "0.010");
  const auto repository = runner.job(
      "git init -q -b main .; echo build > .gitignore; git add -A; git commit -qm 1\n"
      "git clone -q --bare . ../origin; git remote add origin ../origin\n"
      "git checkout -qb branch",
      kIdentity);
  ASSERT_EQ(repository.exit_code, 0) << repository.err;
  const auto same = runner.job(gitlab_script("pirt-programs"), kIntoMain);
  EXPECT_EQ(same.exit_code, 0) << same.out << same.err;
  runner.source(".", "0.012");
  const auto slower = runner.job(gitlab_script("pirt-programs"), kIntoMain);
  EXPECT_EQ(slower.exit_code, 1) << slower.out << slower.err;
  EXPECT_THAT(slurp(runner.file("work/pirt.md")), testing::HasSubstr("REGRESSION"));
  // A runner that cleans what git does not know keeps what it knows of worktrees.
  ASSERT_EQ(runner.job("git clean -qffdx", kIdentity).exit_code, 0);
  EXPECT_EQ(runner.job(gitlab_script("pirt-programs"), kIntoMain).exit_code, 1);
}

// A speed-up that others merged since is none of the branch's slowdowns.
TEST(WorkflowSteps, OfGitlabCompareABranchWithWhatItLeft) {
  Runner runner;
  runner.source(".", "0.010");
  const auto repository = runner.job(
      "git init -q -b main .; printf 'build\\n*.db\\nbase_commit\\n' > .gitignore; git add -A\n"
      "git commit -qm 1; git clone -q --bare . ../origin; git remote add origin ../origin\n"
      "git checkout -qb branch; git clone -q ../origin ../other; cd ../other\n"
      "echo 0.008 > speed; git commit -qam 2; git push -q\n"
      "git rev-parse HEAD > \"$OLDPWD/base_commit\"",
      kIdentity);
  ASSERT_EQ(repository.exit_code, 0) << repository.err;
  const auto programs = runner.job(gitlab_script("pirt-programs"), kIntoMain);
  EXPECT_EQ(programs.exit_code, 0) << programs.out << programs.err;
  // The base of profiles is the default branch's newest, which has that commit.
  runner.write("work/base.db", "");
  runner.source(".", "2.0");
  const auto profiles = runner.job(gitlab_script("pirt-profiles"), kIntoMain);
  EXPECT_EQ(profiles.exit_code, 3) << profiles.err;
  EXPECT_THAT(profiles.out, testing::HasSubstr("the base has what this branch has not"));
}

TEST(WorkflowSteps, OfGitlabReplaceTheBaseByWhatPassedAndSayWhy) {
  Runner runner;
  const auto base_job = [&](const std::string& speed, const std::string& more = "") {
    runner.source(".", speed);
    return runner.job(gitlab_script("pirt-base"), more);
  };
  const auto bytes = [&](const char* name) {
    return slurp(runner.file(std::string("work/") + name));
  };
  runner.source(".", "2.0");
  const auto alone = runner.job(gitlab_script("pirt-profiles"));
  EXPECT_EQ(alone.exit_code, 3) << "nothing was compared: " << alone.err;
  const auto first = base_job("2.0");
  EXPECT_EQ(first.exit_code, 0) << first.out << first.err;
  EXPECT_THAT(first.out, testing::AllOf(testing::HasSubstr("base replaced: there was none"),
                                        testing::HasSubstr("anchor set")));
  const std::string anchor = bytes("anchor.db");
  const auto passed = base_job("2.08");
  EXPECT_EQ(passed.exit_code, 0) << passed.out << passed.err;
  EXPECT_THAT(passed.out, testing::HasSubstr("base replaced: this run passed"));
  EXPECT_EQ(bytes("base.db"), bytes("new.db"));
  EXPECT_EQ(bytes("anchor.db"), anchor) << "it holds still";
  // 7.7 % more than the base, and 12 % more than the anchor.
  const std::string before = bytes("base.db");
  const auto slower = base_job("2.24");
  EXPECT_EQ(slower.exit_code, 1) << slower.out << slower.err;
  EXPECT_THAT(slower.out, testing::HasSubstr("base kept: exit code 1"));
  EXPECT_EQ(bytes("base.db"), before);
  const auto branch = runner.job(gitlab_script("pirt-profiles"));
  EXPECT_EQ(branch.exit_code, 1) << branch.err;
  EXPECT_EQ(bytes("base.db"), before);
  const auto accepted = runner.job(gitlab_script("pirt-accept"), "SET_ANCHOR=1");
  EXPECT_EQ(accepted.exit_code, 0) << accepted.err;
  EXPECT_THAT(accepted.out, testing::HasSubstr("accepted by hand"));
  EXPECT_EQ(bytes("anchor.db"), bytes("newest.db"));
  EXPECT_EQ(bytes("base.db"), bytes("newest.db"));
  EXPECT_EQ(base_job("2.24").exit_code, 0);
  // Other inputs: nothing can be compared any more.
  const auto other = base_job("2.24", "SEED='--seed 8'");
  EXPECT_EQ(other.exit_code, 3) << other.out << other.err;
  EXPECT_THAT(other.out, testing::AllOf(testing::HasSubstr("the machine is another one"),
                                        testing::HasSubstr("anchor set")));
  EXPECT_EQ(base_job("2.24", "SEED='--seed 8'").exit_code, 0);
  // An anchor of the former inputs would be compared with nothing ever after.
  runner.write("work/anchor.db", anchor);
  const auto anew = base_job("2.24", "SEED='--seed 8'");
  EXPECT_EQ(anew.exit_code, 3) << anew.out << anew.err;
  EXPECT_THAT(anew.out, testing::AllOf(testing::HasSubstr("base kept: exit code 3"),
                                       testing::HasSubstr("anchor set")));
  EXPECT_EQ(bytes("anchor.db"), bytes("new.db"));
}

// What failed in the base may fail in all that come after.
TEST(WorkflowSteps, OfGitlabTakeNoFirstBaseWhoseCellsFailed) {
  Runner runner;
  runner.write("board.in",
               "platform: board\nunits: {cpu: {backend: fake, slots: 1, active_w: 2, script: "
               "{stages: {sobel: [{name: execute, ms: SPEED}]}, wrong_output: [sobel]}}}\n");
  runner.source(".", "2.0");
  const auto first = runner.job(gitlab_script("pirt-base"));
  EXPECT_EQ(first.exit_code, 1) << first.out << first.err;
  EXPECT_THAT(first.out, testing::HasSubstr("no base: cells failed"));
  EXPECT_FALSE(std::filesystem::exists(runner.file("work/base.db")));
  EXPECT_FALSE(std::filesystem::exists(runner.file("work/anchor.db")));
  EXPECT_EQ(runner.job(gitlab_script("pirt-accept")).exit_code, 0) << "by hand";
}

TEST(WorkflowSteps, OfTheActionCommentWithTheReportAndTellOneFromThree) {
  const YAML::Node file = workflow("action.yml");
  Runner runner;
  const auto act = [&](const std::string& baseline, const std::string& candidate) {
    const std::map<std::string, std::string> values = {
        {"inputs.pirt", kProgram},
        {"inputs.baseline-command", baseline},
        {"inputs.reads", "lines"},
        {"inputs.candidate-command", candidate},
        {"inputs.max-time", "1min"},
        {"inputs.comment", "7"},
        {"inputs.token", "none"},
        {"github.repository", "a/robot"},
        {"steps.compare.outputs.exit-code", "$(sed s/.*=// output)"}};
    std::string script = "export GITHUB_OUTPUT=output GITHUB_STEP_SUMMARY=summary\n: > output\n";
    for (const auto& step : file["runs"]["steps"]) {
      script += "(";
      for (const auto& variable : step["env"]) {
        std::string name = variable.second.Scalar();
        name = name.substr(4, name.size() - 7);  // ${{ NAME }}
        EXPECT_TRUE(values.contains(name)) << name;
        const std::string value = values.at(name);
        script += "export " + variable.first.Scalar() + "=" +
                  (value.starts_with("$(") ? value : quoted(value)) + "\n";
      }
      script += step["run"].Scalar() + ")\n";
    }
    return runner.job(script);
  };
  const auto slower = act("echo time 1 s", "echo time 1.2 s");
  EXPECT_EQ(slower.exit_code, 1) << slower.out << slower.err;
  EXPECT_THAT(slurp(runner.file("comment")),
              testing::AllOf(testing::HasSubstr("REGRESSION"), testing::HasSubstr("| command")));
  const auto same = act("echo time 1 s", "echo time 1 s");
  EXPECT_EQ(same.exit_code, 0) << same.out << same.err;
  const auto untold = act("false", "echo time 1 s");
  EXPECT_EQ(untold.exit_code, 0) << untold.err;
  EXPECT_THAT(untold.out, testing::HasSubstr("::warning::"));
}

INSTANTIATE_TEST_SUITE_P(Files, WorkflowFile,
                         testing::Values("github.yml", "gitlab.yml", "action.yml"),
                         [](const auto& test) {
                           const std::string name = test.param;
                           return name.substr(0, name.find('.'));
                         });

}  // namespace
}  // namespace pirt::test
