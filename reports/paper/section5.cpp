#include "reports/paper/section5.h"

#include <fmt/core.h>

#include <algorithm>
#include <cassert>

#include "scheduler/policies/policy.h"
#include "scheduler/schedule.h"

namespace pirt {
namespace {

const PipelineResult& pipeline_of(const RunRecord& run, const char* name) {
  const PipelineResult* const found = run.find_pipeline(name);
  assert(found != nullptr);
  return *found;
}

Section5Row row_of(const RunRecord& run) {
  const auto& planning = pipeline_of(run, "planning");
  return {run.mode,
          run.mix,
          pipeline_of(run, "localization").rate_hz.value_or(0),
          pipeline_of(run, "recognition").rate_hz.value_or(0),
          planning.p50_ms.value_or(0),
          planning.p99_ms.value_or(0),
          run.average_power_w.value_or(0)};
}

std::vector<Section5Row> run_mix(const Platform& platform, const std::string& mix,
                                 const std::vector<std::string>& modes,
                                 std::vector<std::string>& not_run) {
  const auto runs = run_modes(platform, nullptr, load_mix(mix), modes, {});
  for (const auto& [mode, reason] : runs.skipped) {
    not_run.push_back(fmt::format("{}, mode {}: {}", mix, mode, reason));
  }
  std::vector<Section5Row> rows;
  for (const auto& run : runs.runs) rows.push_back(row_of(run));
  return rows;
}

}  // namespace

Section5 run_section5() {
  const auto platform = load_platform("snapdragon820-section5");
  Section5 section;
  section.paper_without = {"paper", "section5-cpu-only", 15, 1 / 1.5, 0, 0, 10};
  section.paper_with = {"paper", "section5", 25, 3, 6, 6, 11};
  section.fitted = run_mix(platform, "section5-cpu-only", {"cpu-only"}, section.not_run).at(0);
  section.predictions = run_mix(platform, "section5", policy_names(), section.not_run);
  section.placed = run_mix(platform, "section5-placed", policy_names(), section.not_run);
  return section;
}

}  // namespace pirt
