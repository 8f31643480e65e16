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

class Workflow : public testing::TestWithParam<const char*> {};

TEST_P(Workflow, AsksForWhatPirtHas) {
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

INSTANTIATE_TEST_SUITE_P(Files, Workflow, testing::Values("github.yml", "gitlab.yml"),
                         [](const auto& test) {
                           const std::string name = test.param;
                           return name.substr(0, name.find('.'));
                         });

}  // namespace
}  // namespace pirt::test
