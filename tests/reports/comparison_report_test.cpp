// Modes in one table: gaps, what each costs, modes that could not run, and what strict priority
// does.
#include "reports/run/comparison_report.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "scheduler/schedule.h"
#include "workloads/base/text/json.h"

namespace pirt {
namespace {

using testing::Contains;
using testing::HasSubstr;
using testing::Not;

RunRecord run_of(const std::string& mode, double energy_j, double p99_ms) {
  RunRecord run;
  run.mode = mode;
  run.platform = "p";
  run.mix = "m";
  run.energy_j = energy_j;
  run.p99_latency_ms = p99_ms;
  run.completed = 1000;
  PipelineResult pipeline;
  pipeline.pipeline = "camera";
  pipeline.fired = pipeline.completed = 1000;
  pipeline.p99_ms = 2 * p99_ms;
  run.pipelines = {pipeline};
  run.throughput_per_ms = 0.5;
  run.bounds = RunBounds{
      .throughput_per_ms = 1.0, .energy_j = 2.0, .makespan_s = {}, .critical_path_ms = {}};
  UnitResult unit;
  unit.unit = "cpu";
  unit.completed = 1;
  unit.provenance = {"fitted"};
  unit.energy_provenance = {"modelled"};
  run.units = {unit};
  run.in_flight = 6;
  run.weights_from = "derived";
  return run;
}

TEST(Comparison, ShowsGapsAndCostsAgainstTheBestOfTheTable) {
  const ModeRuns comparison = {{run_of("a", 4, 10), run_of("b", 2, 25)}, {}};
  const auto document = comparison_document(comparison, {});
  const auto& modes = std::get<Table>(document.parts[2]);
  EXPECT_EQ(modes.columns.size(), 3U);
  EXPECT_EQ(modes.rows[1], (std::vector<std::string>{"energy, J", "~4.00", "~2.00"}));
  EXPECT_EQ(modes.rows[3], (std::vector<std::string>{"camera, p99 ms", "^20.0", "^50.0"}))
      << "from firing to completion";
  // 4 J for 1000 tasks against 2 J.
  const auto& table = std::get<Table>(document.parts[3]);
  EXPECT_EQ(table.rows[0], (std::vector<std::string>{"a", "-50.0", "+100.0", "-", "^10.0", "0", "0",
                                                     "-", "0", "0", "6", "derived"}));
  EXPECT_EQ(table.rows[1][2], "+0.0");
}

TEST(Comparison, EndsWithWhatItComesTo) {
  // a: 0.5 tasks/ms, 4 J, p99 10 ms; b and c: 2 J, p99 25 ms.
  ModeRuns comparison = {{run_of("a", 4, 10), run_of("b", 2, 25), run_of("c", 2, 25)}, {}};
  comparison.runs[0].throughput_per_ms = 0.75;
  const auto document = comparison_document(comparison, {});
  EXPECT_EQ(std::get<Table>(document.parts[3]).footnotes.back(),
            "In short: most tasks/ms: a; least energy: b = c; least p99 from firing to completion: "
            "a.");
  comparison.runs.resize(1);
  EXPECT_THAT(render(comparison_document(comparison, {}), Format::kText),
              Not(HasSubstr("In short")));
}

TEST(Comparison, OfAModeWhoseEnergyNobodyKnowsSaysWhy) {
  ModeRuns comparison = {{run_of("a", 4, 10), run_of("b", 2, 25)}, {}};
  comparison.runs[1].energy_j.reset();
  comparison.runs[1].units[0].busy_s = 1;
  const auto document = comparison_document(comparison, {});
  EXPECT_EQ(std::get<Table>(document.parts[2]).rows[1][2], "-");
  const auto& table = std::get<Table>(document.parts[3]);
  EXPECT_EQ(table.rows[1][2], "-");
  EXPECT_THAT(std::get<Paragraph>(document.parts[4]).lines, Contains(HasSubstr("cpu.active_w")));
}

TEST(Comparison, SaysWhichModesCouldNotRunAndWhy) {
  const ModeRuns comparison = {{run_of("a", 4, 10)}, {{"cpu-only", "there is no cpu"}}};
  EXPECT_THAT(render(comparison_document(comparison, {}), Format::kText),
              HasSubstr("Not run: cpu-only: there is no cpu"));
  EXPECT_EQ(comparison_json(comparison)["skipped"][0]["mode"], "cpu-only");
}

TEST(Comparison, ShowsWhatStrictPriorityDoesToPipelinesWithoutImages) {
  // A camera that keeps the only unit busy for 9 of 10 ms, and a planner of 3 ms that is due every
  // 20 ms: with strict priority it waits for images.
  const auto platform =
      parse_platform("test.yaml",
                     "platform: one\nunits: {cpu: {slots: 1, active_w: 1}}\nworkloads:\n"
                     "  sobel: {cpu: [{on: cpu, ms: 4.5}]}\n  fc8: {cpu: [{on: cpu, ms: 1}]}\n",
                     {}, 1);
  const auto mix = parse_mix(
      "test.yaml",
      "mix: m\npipelines:\n"
      "  camera: {rate_hz: 100, tasks: [{name: a, workload: sobel, image_input: true}, {name: b, "
      "workload: sobel, image_input: true}]}\n"
      "  planner: {rate_hz: 50, deadline_ms: 5, tasks: [{name: p, workload: fc8}]}\n");
  ModeRuns comparison;
  for (const auto* mode : {"throughput", "advanced"}) {
    ScheduleOptions options;
    options.mode = mode;
    options.duration = from_s(2);
    comparison.runs.push_back(run_virtual(platform, nullptr, mix, options));
  }
  const auto text = render(comparison_document(comparison, mix), Format::kText);
  EXPECT_THAT(
      text, HasSubstr("planner without images, under strict priority of images (advanced): p99 ~"));
  EXPECT_THAT(text, HasSubstr("without (throughput): p99 ~"));
  EXPECT_THAT(text, Not(HasSubstr("camera without images")));
}

}  // namespace
}  // namespace pirt
