// The workflow files that users copy: they parse, and ask for nothing that pirt does not have.
#include <yaml-cpp/yaml.h>

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
  const std::regex command(R"(build/pirt ([a-z]+)([^\n|&]*))");
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

// A branch that wrote it would be compared with itself from its second run on.
TEST(Workflow, WritesItsBaseOnTheDefaultBranchOnly) {
  const YAML::Node file = YAML::LoadFile(std::string(kSourceFolder) + "/cli/ci/gitlab.yml");
  int writers = 0;
  for (const auto& job : file) {
    const YAML::Node cache = job.second["cache"];
    if (!cache) continue;
    if (cache["policy"] && cache["policy"].Scalar() == "pull") continue;
    ++writers;
    const YAML::Node rules = job.second["rules"];
    ASSERT_EQ(rules.size(), 1U) << job.first;
    EXPECT_EQ(rules[0]["if"].Scalar(), "$CI_COMMIT_BRANCH == $CI_DEFAULT_BRANCH");
  }
  EXPECT_EQ(writers, 1);
}

TEST_P(WorkflowFile, PassesYamllint) {
  if (run("command -v yamllint").exit_code != 0) GTEST_SKIP() << "yamllint is not installed";
  const std::string source = kSourceFolder;
  const auto outcome =
      run("yamllint --strict -c " + source + "/.yamllint " + source + "/cli/ci/" + GetParam());
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

INSTANTIATE_TEST_SUITE_P(Files, WorkflowFile, testing::Values("github.yml", "gitlab.yml"),
                         [](const auto& test) {
                           const std::string name = test.param;
                           return name.substr(0, name.find('.'));
                         });

}  // namespace
}  // namespace pirt::test
