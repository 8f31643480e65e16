#include "scheduler/mix/dag_generator.h"

#include <fmt/core.h>

#include <algorithm>
#include <cctype>
#include <cmath>
#include <set>

#include "workloads/base/error.h"
#include "workloads/base/math/random.h"
#include "workloads/base/text/text.h"

namespace pirt {
namespace {

void check_range(const char* name, double value, double low, double high, bool low_allowed) {
  // Written so that NaN is refused.
  const bool good = (low_allowed ? value >= low : value > low) && value <= high;
  if (good) return;
  throw_bad_input(fmt::format("{} is {}; it is {} {} and at most {}", name, value,
                              low_allowed ? "at least" : "above", low, high));
}

void check(const DagParameters& parameters) {
  check_range("--tasks", parameters.tasks, 1, kMostDagTasks, true);
  check_range("--shape", parameters.shape, 0, kHighestDagShape, false);
  check_range("--out-degree", parameters.out_degree, 1, kMostDagTasks, true);
  check_range("--ccr", parameters.ccr, 0, kHighestDagCcr, true);
  check_range("--heterogeneity", parameters.heterogeneity, 0, kHighestDagHeterogeneity, true);
  check_range("--mean-ms", parameters.mean_ms, 0, kLongestDagMeanMs, false);
  if (parameters.units.empty()) throw_bad_input("--units names no unit");
  std::set<std::string> seen;
  for (const auto& unit : parameters.units) {
    const bool plain = !unit.empty() && std::ranges::all_of(unit, [](unsigned char c) {
      return std::isalnum(c) != 0 || c == '_' || c == '-';
    });
    if (!plain) throw_bad_input("--units: '" + unit + "' is no name of a unit; write e.g. cpu,gpu");
    if (!seen.insert(unit).second) throw_bad_input("--units: '" + unit + "' is named twice");
  }
}

/// Where each level begins among the tasks, and the last one ends; no level is empty.
std::vector<std::size_t> draw_levels(const DagParameters& parameters, Random& random) {
  const double root = std::sqrt(parameters.tasks);
  const auto height =
      std::clamp(static_cast<int>(std::llround(root / parameters.shape)), 1, parameters.tasks);
  // Each level has one task and a drawn share of the others, so that widths vary around their mean.
  std::vector<double> bounds;
  double sum = 0;
  for (int level = 0; level < height; ++level) bounds.push_back(sum += random.uniform(0.5, 1.5));
  std::vector<std::size_t> widths(static_cast<std::size_t>(height), 1);
  for (int more = parameters.tasks - height; more > 0; --more) {
    const double at = random.uniform(0, sum);
    const auto level = std::ranges::upper_bound(bounds, at) - bounds.begin();
    ++widths[static_cast<std::size_t>(std::min<std::ptrdiff_t>(level, height - 1))];
  }
  std::vector<std::size_t> levels = {0};
  for (const std::size_t width : widths) levels.push_back(levels.back() + width);
  return levels;
}

/// Predecessors by task, each list rising.
using Predecessors = std::vector<std::set<std::size_t>>;

Predecessors draw_edges(const DagParameters& parameters, const std::vector<std::size_t>& levels,
                        Random& random) {
  Predecessors after(levels.back());
  std::vector<std::size_t> degree(after.size(), 0);
  const auto add = [&](std::size_t from, std::size_t to) {
    if (after[to].insert(from).second) ++degree[from];
  };
  // First a predecessor for each task, of those of the level before with the fewest edges.
  for (std::size_t l = 1; l + 1 < levels.size(); ++l) {
    const std::size_t above = levels[l - 1];
    const std::size_t width = levels[l] - above;
    for (std::size_t task = levels[l]; task < levels[l + 1]; ++task) {
      const std::size_t first = random.below(width);
      std::size_t from = above + first;
      for (std::size_t i = 1; i < width; ++i) {
        const std::size_t other = above + (first + i) % width;
        if (degree[other] < degree[from]) from = other;
      }
      add(from, task);
    }
  }
  // Then up to out_degree: three of four edges to the next level, the others anywhere below.
  for (std::size_t l = 0; l + 2 < levels.size(); ++l) {
    const std::size_t below = levels[l + 1];
    for (std::size_t task = levels[l]; task < below; ++task) {
      const std::size_t wanted =
          1 + random.below(static_cast<std::uint64_t>(parameters.out_degree));
      // A draw may hit an edge that there is; then the task has one fewer.
      for (std::size_t edges = degree[task]; edges < wanted; ++edges) {
        const bool next = random.below(4) != 0;
        add(task, below + random.below((next ? levels[l + 2] : after.size()) - below));
      }
    }
  }
  return after;
}

/// Milliseconds with nanoseconds, at least one: what the mix will read.
std::string ms(double value) { return fmt::format("{:.6f}", std::max(value, 1e-6)); }

}  // namespace

std::string generate_dag(const DagParameters& parameters) {
  check(parameters);
  Random shape(derive_seed(parameters.seed, "shape"));
  const auto levels = draw_levels(parameters, shape);
  const auto after = draw_edges(parameters, levels, shape);
  Random costs(derive_seed(parameters.seed, "costs"));
  std::string yaml = fmt::format(
      "mix: dag-{0}-{6}\n"
      "description: Random task graph of {0} tasks (shape {1}, out-degree {2}, CCR {3}, "
      "heterogeneity {4}, mean {5} ms, seed {6})\n"
      "pipelines:\n  graph:\n    closed_loop: {{frames: 1}}\n    tasks:\n",
      parameters.tasks, parameters.shape, parameters.out_degree, parameters.ccr,
      parameters.heterogeneity, parameters.mean_ms, parameters.seed);
  for (std::size_t task = 0; task < after.size(); ++task) {
    const double mean = costs.uniform(0, 2 * parameters.mean_ms);
    std::vector<std::string> services;
    for (const auto& unit : parameters.units) {
      const double half = parameters.heterogeneity / 2;
      services.push_back(unit + ": " + ms(mean * costs.uniform(1 - half, 1 + half)));
    }
    yaml += fmt::format("      - {{name: t{}, service_ms: {{{}}}", task + 1, join(services, ", "));
    std::vector<std::string> edges;
    for (const std::size_t from : after[task]) {
      const double transfer = costs.uniform(0, 2 * parameters.ccr * parameters.mean_ms);
      edges.push_back(fmt::format("{{task: t{}, transfer_ms: {:.6f}}}", from + 1, transfer));
    }
    yaml += edges.empty() ? "}\n" : ", after: [" + join(edges, ", ") + "]}\n";
  }
  return yaml;
}

}  // namespace pirt
