// Sizes that are not measured, in schedule and what-if: said, or modelled where that is asked for.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "characterize/profile/store/writer.h"
#include "tests/cli/program.h"

namespace pirt::test {
namespace {

using testing::AllOf;
using testing::HasSubstr;
using testing::Not;

/// sobel on `cpu` of host-cpu at four sizes: 1 ms and 10 ns an element.
class Estimate : public testing::Test {
 protected:
  Estimate() {
    ProfileWriter writer(profile_);
    RunHeader header{.started = "2026-01-02T03:04:05Z",
                     .platform = "host-cpu",
                     .seed = 1,
                     .environment = {{"cpu_model", "test cpu"}},
                     .units = {{"cpu", "cpu", "test", true, {}}}};
    const auto run = writer.begin_run(header);
    for (const auto& [name, elements] :
         std::vector<std::pair<std::string, double>>{{"sobel@640x480", 640 * 480},
                                                     {"sobel@800x600", 800 * 600},
                                                     {"sobel@1600x1200", 1600 * 1200},
                                                     {"sobel", 1920 * 1080}}) {
      CellRecord cell{.workload = name,
                      .unit = "cpu",
                      .ops = 1000,
                      .bytes = 1000,
                      .verification = "equal",
                      .phases = {},
                      .energy = {}};
      for (const Phase phase : {Phase::kExecute, Phase::kCall}) {
        PhaseRecord record{.phase = phase,
                           .state = State::kSteady,
                           .provenance = Provenance::kMeasured,
                           .reasons = {},
                           .notes = {},
                           .samples = std::vector<Nanos>(20, from_ms(1 + 1e-5 * elements))};
        for (std::int32_t i = 0; i < 20; ++i) record.processes.push_back(i / 5);
        cell.phases.push_back(std::move(record));
      }
      writer.write_cell(run, cell);
    }
    writer.finish_run(run, "2026-01-02T03:05:05Z");
  }

  [[nodiscard]] std::string mix_of_size(const std::string& workload) const {
    return scratch_.write("m.yaml", "mix: m\npipelines:\n  see: {rate_hz: 10, tasks: [{workload: " +
                                        workload + "}]}\n");
  }

  const Scratch scratch_;
  const std::string profile_ = scratch_.file("p.db");
};

TEST_F(Estimate, IsNotMadeUnlessItIsAskedFor) {
  const auto outcome = pirt(
      {"schedule", "--profile", profile_, "--mix", mix_of_size("sobel@1280x720"), "--mode", "ect"});
  expect_refused(outcome, {"none of another size is taken for it",
                           "pirt characterize --platform host-cpu --units cpu --filter "
                           "'^(sobel@1280x720)$' --db",
                           "or --estimate"});
}

TEST_F(Estimate, AllThatIsMissingIsToldAtOnce) {
  const auto mix = scratch_.write(
      "two.yaml",
      "mix: m\npipelines:\n  see: {rate_hz: 10, tasks: [{workload: sobel@1280x720}, {workload: "
      "sobel@1024x768}, {workload: sobel@800x600}]}\n");
  expect_refused(pirt({"schedule", "--profile", profile_, "--mix", mix, "--mode", "ect"}),
                 {"--filter '^(sobel@1280x720|sobel@1024x768)$' --db"});
}

TEST_F(Estimate, IsMarkedWithItsInterval) {
  const auto mix = mix_of_size("sobel@1280x720");
  const auto outcome = pirt({"schedule", "--profile", profile_, "--mix", mix, "--mode", "ect",
                             "--duration", "10s", "--estimate", "--json", "-"});
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  EXPECT_THAT(outcome.err, AllOf(HasSubstr("sobel@1280x720 on cpu is modelled: 10.2"),
                                 HasSubstr("95 %"), HasSubstr("4 other sizes")));
  const auto run = outcome.json();
  EXPECT_EQ(run["units"]["cpu"]["provenance"][0], "modelled");
  EXPECT_NEAR(run["mean_latency_ms"].get<double>(), 1 + 1e-5 * 1280 * 720, 0.05);
  const auto what_if =
      pirt({"what-if", "--profile", profile_, "--mix", mix, "--modes", "ect", "--estimate"});
  EXPECT_EQ(what_if.exit_code, 0) << what_if.err;
}

TEST_F(Estimate, IsNotMadeBeyondTheSizes) {
  expect_refused(pirt({"schedule", "--profile", profile_, "--mix", mix_of_size("sobel@320x240"),
                       "--mode", "ect", "--estimate"}),
                 {"sobel@320x240", "not between sizes that are measured"});
}

TEST_F(Estimate, AMeasuredSizeIsTakenAsItIs) {
  const auto outcome =
      pirt({"schedule", "--profile", profile_, "--mix", mix_of_size("sobel@800x600"), "--mode",
            "ect", "--estimate", "--json", "-"});
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  EXPECT_EQ(outcome.json()["units"]["cpu"]["provenance"][0], "measured");
  EXPECT_THAT(outcome.err, Not(HasSubstr("modelled: ")));
}

}  // namespace
}  // namespace pirt::test
