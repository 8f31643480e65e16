#include "scheduler/planner/shortened.h"

#include <algorithm>
#include <utility>

#include "scheduler/planner/planner.h"
#include "workloads/base/math/random.h"

namespace pirt {
namespace {

/// What a search changes: tasks are placed by falling priority as they become ready, each on the
/// unit that it is given, or where it finishes first.
struct Genes {
  std::vector<double> priority;
  std::vector<std::optional<UnitId>> unit;
};

Plan decode(const PlanningGraph& graph, const Genes& genes) {
  return plan_by_priority(graph, genes.priority, [&](const PlanBuilder& builder, std::size_t task) {
    return genes.unit[task] ? *genes.unit[task] : builder.best_unit(task);
  });
}

/// Those of HEFT.
Genes by_rank(const PlanningGraph& graph) {
  Genes genes{.priority = {}, .unit = std::vector<std::optional<UnitId>>(graph.tasks())};
  for (const Nanos rank : graph.upward_ranks()) genes.priority.push_back(to_ms(rank));
  return genes;
}

/// Those that give the plan again.
Genes of_plan(const Plan& plan) {
  Genes genes;
  for (const PlannedTask& task : plan.tasks) {
    genes.priority.push_back(-to_ms(task.start));
    genes.unit.emplace_back(task.unit);
  }
  return genes;
}

class Search {
 public:
  explicit Search(const PlanningGraph& graph)
      : graph_(graph), random_(derive_seed(graph.tasks(), "shortened plan")) {}

  /// Climbs from @p genes for so many tries.
  void climb(Genes genes, int tries, Plan& best) {
    Plan plan = decode(graph_, genes);
    const auto [low, high] = std::ranges::minmax(genes.priority);
    for (int i = 0; i < tries; ++i) {
      if (plan.makespan < best.makespan) best = plan;
      Genes changed = genes;
      mutate(changed, low, high);
      Plan next = decode(graph_, changed);
      if (next.makespan > plan.makespan) continue;
      genes = std::move(changed);
      plan = std::move(next);
    }
    if (plan.makespan < best.makespan) best = std::move(plan);
  }

 private:
  void mutate(Genes& genes, double low, double high) {
    const std::uint64_t changes = 1 + random_.below(3);
    for (std::uint64_t i = 0; i < changes; ++i) {
      const std::size_t task = random_.below(graph_.tasks());
      switch (random_.below(4)) {
        case 0:
          genes.priority[task] = random_.uniform(low, high);
          break;
        case 1:
          std::swap(genes.priority[task], genes.priority[random_.below(graph_.tasks())]);
          break;
        case 2: {
          const auto& units = graph_.units_of(task);
          genes.unit[task] = units[random_.below(units.size())];
          break;
        }
        default:
          genes.unit[task].reset();
      }
    }
  }

  const PlanningGraph& graph_;
  Random random_;
};

}  // namespace

Plan shortened_plan(const PlanningGraph& graph) {
  constexpr std::size_t kWork = 80'000;  // Placed tasks, in all tries.
  constexpr std::size_t kMostClimbs = 4'000;
  Plan best = planner::shortest.plan(graph);
  const int tries = static_cast<int>(std::min(kWork / graph.tasks(), kMostClimbs)) / 2;
  if (tries == 0) return best;
  Search search(graph);
  search.climb(by_rank(graph), tries, best);
  search.climb(of_plan(best), tries, best);
  return best;
}

}  // namespace pirt
