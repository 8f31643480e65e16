#include "scheduler/record/interval.h"

#include <algorithm>
#include <cmath>

#include "scheduler/record/keeping_up.h"

namespace pirt {
namespace {

/// The smallest and the largest but for what of 40 is 2.5 % at either end: none.
FigureInterval middle_95(std::vector<double> values) {
  std::ranges::sort(values);
  const auto cut =
      static_cast<std::size_t>(std::floor(0.025 * static_cast<double>(values.size() - 1)));
  return {values[cut], values[values.size() - 1 - cut]};
}

}  // namespace

RunFigures figures_of(const RunRecord& run) {
  RunFigures figures;
  const auto add = [&figures](const std::string& name, const std::optional<double>& value) {
    if (value) figures[name] = *value;
  };
  add("throughput_per_ms", run.throughput_per_ms);
  add("energy_j", run.energy_j);
  add("average_power_w", run.average_power_w);
  add("mean_latency_ms", run.mean_latency_ms);
  add("p99_latency_ms", run.p99_latency_ms);
  add("p99_of_deadline", p99_of_deadline(run));
  add("real_time_losses", static_cast<double>(real_time_losses(run)));
  add("real_time_queued", static_cast<double>(real_time_queued(run)));
  for (const PipelineResult& pipeline : run.pipelines) {
    add("pipelines." + pipeline.pipeline + ".p99_ms", pipeline.p99_ms);
  }
  return figures;
}

std::map<std::string, FigureInterval> intervals_of(std::span<const RunFigures> redrawn) {
  std::map<std::string, std::vector<double>> values;
  for (const RunFigures& each : redrawn) {
    for (const auto& [name, value] : each) values[name].push_back(value);
  }
  std::map<std::string, FigureInterval> intervals;
  for (auto& [name, all] : values) intervals[name] = middle_95(std::move(all));
  return intervals;
}

bool cannot_tell(const RunRecord& a, const RunRecord& b, const std::string& figure) {
  std::vector<double> differences;
  for (std::size_t i = 0; i < std::min(a.redrawn.size(), b.redrawn.size()); ++i) {
    const auto of_a = a.redrawn[i].find(figure);
    const auto of_b = b.redrawn[i].find(figure);
    if (of_a == a.redrawn[i].end() || of_b == b.redrawn[i].end()) continue;
    differences.push_back(of_a->second - of_b->second);
  }
  if (!differences.empty()) {
    const FigureInterval apart = middle_95(std::move(differences));
    return apart.low <= 0 && apart.high >= 0;
  }
  const auto around = [&figure](const RunRecord& run) -> std::optional<FigureInterval> {
    const RunFigures figures = figures_of(run);
    const auto value = figures.find(figure);
    if (value == figures.end()) return std::nullopt;
    const auto interval = run.intervals.find(figure);
    return interval == run.intervals.end() ? FigureInterval{value->second, value->second}
                                           : interval->second;
  };
  const auto its_a = around(a), its_b = around(b);
  return its_a && its_b && its_a->low <= its_b->high && its_b->low <= its_a->high;
}

}  // namespace pirt
