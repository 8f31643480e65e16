// pirt doctor as its user runs it, on recorded machines and on platforms that cannot be measured.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/cli/program.h"
#include "tests/support/recorded_machines.h"

namespace pirt::test {
namespace {

using testing::HasSubstr;

/// The findings of a check, as JSON.
nlohmann::json finding(const nlohmann::json& report, const std::string& check) {
  for (const auto& entry : report["findings"]) {
    if (entry["check"] == check) return entry;
  }
  return {};
}

/// Whether the binary under test is itself a finding (debug build, sanitizers).
bool build_is_good(const nlohmann::json& report) {
  return finding(report, "build")["level"] == "good";
}

TEST(Doctor, ExitsWith0WhereNothingSpoils) {
  const Scratch scratch;
  healthy_board(scratch.file("m"));
  const auto outcome = pirt({"doctor", "--root", scratch.file("m"), "--json", "-"});
  const auto report = outcome.json();
  EXPECT_EQ(outcome.exit_code, build_is_good(report) ? 0 : 1) << outcome.out;
  EXPECT_EQ(report["schema_version"], 1);
  EXPECT_EQ(finding(report, "governor")["found"], "performance on all cores");
  EXPECT_EQ(outcome.err, "");
}

TEST(Doctor, ExitsWith1AndSaysWhatToDo) {
  const Scratch scratch;
  laptop(scratch.file("m"));
  const auto outcome = pirt({"doctor", "--root", scratch.file("m")});
  EXPECT_EQ(outcome.exit_code, 1);
  EXPECT_THAT(outcome.out, HasSubstr("powersave on cores 0,1"));
  EXPECT_THAT(outcome.out,
              HasSubstr("echo 1 | sudo tee /sys/devices/system/cpu/intel_pstate/no_turbo"));
  const auto json = pirt({"doctor", "--root", scratch.file("m"), "--json", scratch.file("d.json")});
  EXPECT_EQ(json.exit_code, 1);
  EXPECT_EQ(nlohmann::json::parse(slurp(scratch.file("d.json")))["verdict"], "spoils");
}

TEST(Doctor, LooksAtThisMachine) {
  const auto outcome = pirt({"doctor", "--seconds", "0.1", "--json", "-"});
  const auto report = outcome.json();
  EXPECT_EQ(outcome.exit_code, report["verdict"] == "spoils" ? 1 : 0) << outcome.err;
  EXPECT_NE(finding(report, "jitter")["found"], "a recorded machine: nothing is computed");
  EXPECT_NE(finding(report, "load")["level"], "unknown");
  EXPECT_THAT(report.dump(), HasSubstr("\"gpu")) << "cards, or that there are none";
}

TEST(Doctor, ExitsWith4WhereNoUnitCanBeMeasured) {
  const Scratch scratch;
  const auto platform = scratch.write(
      "p.yaml", "platform: gone\nunits:\n  gpu: {backend: opencl, device: no such device}\n");
  const auto outcome = pirt({"doctor", "--platform", platform, "--seconds", "0.01", "--json", "-"});
  EXPECT_EQ(outcome.exit_code, 4) << outcome.out << outcome.err;
  const auto unit = finding(outcome.json(), "unit gpu");
  EXPECT_EQ(unit["level"], "blocks");
  EXPECT_NE(unit["remedy"], "");
}

TEST(Doctor, RefusesWhatItCannotJudge) {
  const Scratch scratch;
  const auto root = pirt({"doctor", "--root", scratch.file("nothing")});
  EXPECT_EQ(root.exit_code, 2);
  EXPECT_THAT(root.err, HasSubstr("has no folder proc"));
  const auto modelled = pirt({"doctor", "--platform", "snapdragon820"});
  EXPECT_EQ(modelled.exit_code, 2);
  EXPECT_THAT(modelled.err, HasSubstr("no unit to measure"));
  EXPECT_EQ(pirt({"doctor", "--seconds", "0"}).exit_code, 2);
  EXPECT_EQ(pirt({"doctor", "--seconds", "nan"}).exit_code, 2);
  // Of a recorded machine no unit is tried, and nothing is watched.
  const std::vector<std::vector<std::string>> ignored = {{"--platform", "host"},
                                                         {"--seconds", "5"}};
  for (const auto& words : ignored) {
    const auto outcome = pirt({"doctor", "--root", scratch.file("nothing"), words[0], words[1]});
    EXPECT_EQ(outcome.exit_code, 2);
    EXPECT_THAT(outcome.err, HasSubstr(words[0]));
  }
}

}  // namespace
}  // namespace pirt::test
