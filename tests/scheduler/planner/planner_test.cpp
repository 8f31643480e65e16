// The static planners: the published example, a small one worked by hand, and random graphs against
// a plain HEFT and the exhaustive optimum.
#include "scheduler/planner/planner.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>
#include <fstream>
#include <functional>
#include <numeric>

#include "tests/scheduler/support.h"
#include "tests/support/data.h"
#include "workloads/base/math/random.h"
#include "workloads/base/text/text.h"

namespace pirt::test {
namespace {

using std::chrono::milliseconds;
using testing::HasSubstr;

/// The rows of a CSV of integers behind its header.
std::vector<std::vector<int>> table(const std::filesystem::path& path) {
  std::ifstream in(path);
  std::string line;
  std::getline(in, line);
  std::vector<std::vector<int>> rows;
  while (std::getline(in, line)) {
    auto& row = rows.emplace_back();
    for (const auto& cell : split(line, ',')) row.push_back(std::stoi(cell));
  }
  return rows;
}

TaskGraph topcuoglu(const std::filesystem::path& folder) {
  TaskGraph graph;
  for (const auto& row : table(folder / "exec_cost.csv")) {
    graph.names.push_back(std::to_string(row[0]));
    graph.costs.push_back({milliseconds(row[1]), milliseconds(row[2]), milliseconds(row[3])});
  }
  for (const auto& row : table(folder / "comm_cost.csv")) {
    graph.edges.push_back({.from = static_cast<std::size_t>(row[0] - 1),
                           .to = static_cast<std::size_t>(row[1] - 1),
                           .delay = milliseconds(row[2])});
  }
  return graph;
}

/// Fails unless the plan keeps costs, transfers and one task at a time, and its order and makespan
/// are those of its times.
void expect_valid(const TaskGraph& graph, const Plan& plan) {
  ASSERT_EQ(plan.tasks.size(), graph.costs.size());
  Nanos last{0};
  for (std::size_t t = 0; t < plan.tasks.size(); ++t) {
    const auto& task = plan.tasks[t];
    ASSERT_NE(graph.costs[t][task.unit], kUnsupported);
    EXPECT_EQ(task.finish - task.start, graph.costs[t][task.unit]);
    EXPECT_GE(task.start, Nanos::zero());
    last = std::max(last, task.finish);
  }
  EXPECT_EQ(plan.makespan, last);
  for (const auto& edge : graph.edges) {
    const auto& from = plan.tasks[edge.from];
    const auto& to = plan.tasks[edge.to];
    EXPECT_GE(to.start, from.finish + edge.transfer(from.unit, to.unit));
  }
  std::size_t ordered = 0;
  for (UnitId unit = 0; unit < plan.order.size(); ++unit) {
    for (std::size_t i = 0; i < plan.order[unit].size(); ++i, ++ordered) {
      EXPECT_EQ(plan.tasks[plan.order[unit][i]].unit, unit);
      if (i == 0) continue;
      EXPECT_GE(plan.tasks[plan.order[unit][i]].start, plan.tasks[plan.order[unit][i - 1]].finish);
    }
  }
  EXPECT_EQ(ordered, plan.tasks.size());
}

TEST(Planner, GivesThePublishedMakespansOfTopcuoglusExample) {
  PIRT_DATA_OR_SKIP(folder, "taskgraph-topcuoglu10");
  const auto graph = topcuoglu(folder);
  const PlanningGraph planning(graph);
  EXPECT_EQ(planner::heft.plan(planning).makespan, milliseconds(80));
  EXPECT_EQ(planner::cpop.plan(planning).makespan, milliseconds(86));
  for (const PlannerInfo* planner : planners()) expect_valid(graph, planner->plan(planning));
}

TEST(Planner, FinishesTheTasksOfTopcuoglusExampleWhenItSays) {
  PIRT_DATA_OR_SKIP(folder, "taskgraph-topcuoglu10");
  const PlanningGraph graph(topcuoglu(folder));
  const auto ranks = graph.upward_ranks();
  const Plan plan = planner::heft.plan(graph);
  std::ifstream in(folder / "expected_heft.csv");
  std::string line;
  std::getline(in, line);
  while (std::getline(in, line)) {
    const auto cells = split(line, ',');
    const auto task = std::stoul(cells[0]) - 1;
    EXPECT_NEAR(to_ms(ranks[task]), std::stod(cells[1]), 0.001) << "task " << cells[0];
    EXPECT_EQ("P" + std::to_string(plan.tasks[task].unit + 1), cells[2]) << "task " << cells[0];
    EXPECT_EQ(to_ms(plan.tasks[task].finish), std::stod(cells[3])) << "task " << cells[0];
  }
}

/// a -> b, a -> c, b -> d, c -> d on two units; ms:
///        u0  u1          transfers: a-b 4, a-c 1, b-d 2, c-d 6
///   a     2   4
///   b     3   5
///   c     6   2
///   d     4   2
TaskGraph diamond() {
  return {.names = {"a", "b", "c", "d"},
          .costs = {{milliseconds(2), milliseconds(4)},
                    {milliseconds(3), milliseconds(5)},
                    {milliseconds(6), milliseconds(2)},
                    {milliseconds(4), milliseconds(2)}},
          .edges = {{.from = 0, .to = 1, .delay = milliseconds(4)},
                    {.from = 0, .to = 2, .delay = milliseconds(1)},
                    {.from = 1, .to = 3, .delay = milliseconds(2)},
                    {.from = 2, .to = 3, .delay = milliseconds(6)}}};
}

TEST(Heft, PlansASmallGraphAsWorkedByHand) {
  // Means: a 3, b 4, c 4, d 3. rank_u: d 3; b 4+2+3 = 9; c 4+6+3 = 13; a 3 + max(4+9, 1+13) = 17.
  // a: u0 0-2 (u1: 4). c: u0 2-8; u1 3-5 -> u1. b: u0 2-5; u1 6-11 -> u0.
  // d: u0 max(5, 5+6) = 11-15; u1 max(5+2, 5) = 7-9 -> u1.
  const PlanningGraph graph(diamond());
  EXPECT_THAT(graph.upward_ranks(), testing::ElementsAre(milliseconds(17), milliseconds(9),
                                                         milliseconds(13), milliseconds(3)));
  const Plan plan = planner::heft.plan(graph);
  EXPECT_EQ(plan.tasks[0], (PlannedTask{0, milliseconds(0), milliseconds(2)}));
  EXPECT_EQ(plan.tasks[1], (PlannedTask{0, milliseconds(2), milliseconds(5)}));
  EXPECT_EQ(plan.tasks[2], (PlannedTask{1, milliseconds(3), milliseconds(5)}));
  EXPECT_EQ(plan.tasks[3], (PlannedTask{1, milliseconds(7), milliseconds(9)}));
  EXPECT_EQ(plan.makespan, milliseconds(9));
}

TEST(Cpop, KeepsTheCriticalPathOnOneUnitAsWorkedByHand) {
  // rank_d: a 0, b 7, c 4, d max(7+4+2, 4+4+6) = 14. Sums: a 17, b 16, c 17, d 17: the path is a c
  // d. On u0 it costs 12, on u1 8 -> u1. a: u1 0-4. c: u1 4-6. b: u0 4+4 = 8-11; u1 6-11 -> u0
  // (first of two that finish at 11). d: u1 max(6, 11+2) = 13-15.
  const Plan plan = planner::cpop.plan(PlanningGraph(diamond()));
  EXPECT_EQ(plan.tasks[2], (PlannedTask{1, milliseconds(4), milliseconds(6)}));
  EXPECT_EQ(plan.tasks[1], (PlannedTask{0, milliseconds(8), milliseconds(11)}));
  EXPECT_EQ(plan.makespan, milliseconds(15));
}

TEST(Peft, LooksAheadByItsTableAsWorkedByHand) {
  // OCT: d 0 0. b: u0 min(4, 2+2) = 4, u1 min(4+2, 2) = 2. c: u0 min(4, 2+6) = 4, u1 2.
  // a, u0: b: min(4+3, 2+5+4) = 7; c: min(4+6, 2+2+1) = 5 -> 7.
  // a, u1: b: min(4+3+4, 2+5) = 7; c: min(4+6+1, 2+2) = 4 -> 7. Ranks: a 7, b 3, c 3, d 0.
  // a: 2+7 on u0, 4+7 on u1 -> u0 0-2. b (the first of two): u0 5+4 = 9, u1 11+2 -> u0 2-5.
  // c: u0 5-11, +4 = 15; u1 3-5, +2 = 7 -> u1. d: u0 11-15, u1 7-9 -> u1.
  const Plan plan = planner::peft.plan(PlanningGraph(diamond()));
  EXPECT_EQ(plan.tasks[1], (PlannedTask{0, milliseconds(2), milliseconds(5)}));
  EXPECT_EQ(plan.tasks[2], (PlannedTask{1, milliseconds(3), milliseconds(5)}));
  EXPECT_EQ(plan.makespan, milliseconds(9));
}

TEST(Etf, TakesThePairThatCanStartFirstAsWorkedByHand) {
  // Levels: d 3, b 7, c 7, a 10. a: both units at 0, u0 is faster: 0-2. Ready b, c: on u0 both at
  // 2; same level; b is faster there: 2-5. c: u0 at 5, u1 at 3 -> u1 3-5. d: u0 at 11, u1 at 7 ->
  // 7-9.
  const Plan plan = planner::etf.plan(PlanningGraph(diamond()));
  EXPECT_EQ(plan.tasks[1], (PlannedTask{0, milliseconds(2), milliseconds(5)}));
  EXPECT_EQ(plan.tasks[2], (PlannedTask{1, milliseconds(3), milliseconds(5)}));
  EXPECT_EQ(plan.makespan, milliseconds(9));
}

TEST(Heft, InsertsIntoTheGapBeforeATaskThatIsPlaced) {
  // rank_u: a 1+5+4 = 10, b 4, x 3. a: u0 0-1. b: u1 1+5 = 6-10. x fits u1 0-3, before b.
  const TaskGraph graph{.names = {"a", "b", "x"},
                        .costs = {{milliseconds(1), kUnsupported},
                                  {kUnsupported, milliseconds(4)},
                                  {kUnsupported, milliseconds(3)}},
                        .edges = {{.from = 0, .to = 1, .delay = milliseconds(5)}}};
  const Plan plan = planner::heft.plan(PlanningGraph(graph));
  EXPECT_EQ(plan.tasks[2], (PlannedTask{1, milliseconds(0), milliseconds(3)}));
  EXPECT_EQ(plan.order[1], (std::vector<std::size_t>{2, 1}));
}

TEST(Planner, CountsTheLinksOfBothUnits) {
  // 1 ms to leave u0, 2 ms to enter u1, and back 0 and 4.
  const GraphEdge edge{.from = 0,
                       .to = 1,
                       .leave = {milliseconds(1), milliseconds(0)},
                       .enter = {milliseconds(4), milliseconds(2)}};
  EXPECT_EQ(edge.transfer(0, 1), milliseconds(3));
  EXPECT_EQ(edge.transfer(1, 0), milliseconds(4));
  EXPECT_EQ(edge.transfer(1, 1), milliseconds(0));
  const PlanningGraph graph(
      {.names = {"a", "b"},
       .costs = {{milliseconds(1), milliseconds(1)}, {milliseconds(1), milliseconds(1)}},
       .edges = {edge}});
  EXPECT_EQ(graph.mean_transfer(0), Nanos(3'500'000));
}

TEST(PlanningGraph, PrintsACycleAndRefusesWhatCannotBePlanned) {
  TaskGraph graph = diamond();
  graph.edges.push_back({.from = 3, .to = 1});
  EXPECT_THAT(bad_input([&] { PlanningGraph{graph}; }), HasSubstr("b -> d -> b"));
  graph = diamond();
  graph.costs[2] = {kUnsupported, kUnsupported};
  EXPECT_THAT(bad_input([&] { PlanningGraph{graph}; }), HasSubstr("no unit can run c"));
  graph = diamond();
  graph.costs[1][1] = Nanos::zero();
  EXPECT_THAT(bad_input([&] { PlanningGraph{graph}; }), HasSubstr("b has a cost below 1 ns"));
  graph = diamond();
  graph.edges[0].delay = Nanos(-1);
  EXPECT_THAT(bad_input([&] { PlanningGraph{graph}; }), HasSubstr("from a to b"));
  graph = diamond();
  graph.edges[0].to = 9;
  EXPECT_THAT(bad_input([&] { PlanningGraph{graph}; }), HasSubstr("task 9 of 4"));
  EXPECT_THAT(bad_input([] { PlanningGraph{TaskGraph{}}; }), HasSubstr("no task"));
}

/// Every task but the first has one to three earlier predecessors; costs are 1 to 20 ms, each
/// unit's its own, and transfers have a mean of ccr times 10.5 ms.
TaskGraph random_graph(std::uint64_t seed, std::size_t tasks, UnitId units, double ccr) {
  Random random(seed);
  TaskGraph graph;
  for (std::size_t task = 0; task < tasks; ++task) {
    graph.names.push_back("t" + std::to_string(task));
    auto& row = graph.costs.emplace_back();
    for (UnitId unit = 0; unit < units; ++unit) row.push_back(from_ms(random.uniform(1, 20)));
    const std::size_t wanted = task == 0 ? 0 : 1 + random.below(std::min<std::size_t>(task, 3));
    std::vector<std::size_t> from;
    while (from.size() < wanted) {
      const std::size_t each = random.below(task);
      if (std::ranges::find(from, each) == from.end()) from.push_back(each);
    }
    for (const std::size_t each : from) {
      graph.edges.push_back(
          {.from = each, .to = task, .delay = from_ms(random.uniform(0, 21 * ccr))});
    }
  }
  return graph;
}

/// HEFT as in the paper, written apart from the planner: recursion for ranks, a list of busy times
/// a unit, floating-point milliseconds. @return the makespan in ms.
double plain_heft(const TaskGraph& graph) {
  const std::size_t n = graph.costs.size();
  const std::size_t units = graph.costs.front().size();
  std::vector<double> rank(n, -1);
  const std::function<double(std::size_t)> rank_of = [&](std::size_t task) {
    if (rank[task] >= 0) return rank[task];
    double mean = 0;
    for (const Nanos cost : graph.costs[task]) mean += to_ms(cost) / static_cast<double>(units);
    double longest = 0;
    for (const auto& edge : graph.edges) {
      if (edge.from == task) longest = std::max(longest, to_ms(edge.delay) + rank_of(edge.to));
    }
    return rank[task] = mean + longest;
  };
  std::vector<std::size_t> order(n);
  std::iota(order.begin(), order.end(), 0);
  std::ranges::stable_sort(order,
                           [&](std::size_t a, std::size_t b) { return rank_of(a) > rank_of(b); });
  std::vector<std::vector<std::pair<double, double>>> busy(units);
  std::vector<std::size_t> where(n);
  std::vector<double> finish(n);
  for (const std::size_t task : order) {
    double best_start = 0, best_finish = INFINITY;
    std::size_t best = 0;
    for (std::size_t unit = 0; unit < units; ++unit) {
      double ready = 0;
      for (const auto& edge : graph.edges) {
        if (edge.to != task) continue;
        const double moved = where[edge.from] == unit ? 0 : to_ms(edge.delay);
        ready = std::max(ready, finish[edge.from] + moved);
      }
      const double cost = to_ms(graph.costs[task][unit]);
      // Candidates: when the data is there, and every end of a busy time after that.
      std::vector<double> starts = {ready};
      for (const auto& [begin, end] : busy[unit]) starts.push_back(std::max(end, ready));
      for (const double start : starts) {
        const bool free = std::ranges::none_of(busy[unit], [&](const auto& each) {
          return start < each.second - 1e-9 && each.first < start + cost - 1e-9;
        });
        if (!free || start + cost >= best_finish - 1e-9) continue;
        best_start = start;
        best_finish = start + cost;
        best = unit;
      }
    }
    busy[best].emplace_back(best_start, best_finish);
    where[task] = best;
    finish[task] = best_finish;
  }
  return *std::ranges::max_element(finish);
}

TEST(Heft, AgreesWithAPlainHeftOnRandomGraphs) {
  for (std::uint64_t seed = 0; seed < 100; ++seed) {
    Random random(hash_u64(7, seed));
    const std::size_t tasks = 20 + random.below(81);
    const auto graph = random_graph(seed, tasks, 3, random.uniform(0.1, 5));
    const PlanningGraph planning(graph);
    const Plan plan = planner::heft.plan(planning);
    EXPECT_NEAR(to_ms(plan.makespan), plain_heft(graph), 1e-6) << "seed " << seed;
    for (const PlannerInfo* planner : planners()) expect_valid(graph, planner->plan(planning));
  }
}

/// The shortest makespan of all schedules. Tasks are appended in every order that the edges permit,
/// to every unit: any schedule comes about so, by its tasks' start times. A branch that cannot beat
/// the best, by the fastest way to the end of the graph, is cut.
class Exhaustive {
 public:
  Exhaustive(const TaskGraph& graph, Nanos known) : graph_(graph), best_(known) {
    const std::size_t n = graph.costs.size();
    tail_.resize(n);
    finish_.assign(n, Nanos::min());
    where_.resize(n);
    for (std::size_t task = n; task-- > 0;) {  // random_graph's edges point forward.
      for (const auto& edge : graph.edges) {
        if (edge.from == task)
          tail_[task] = std::max(tail_[task], fastest(edge.to) + tail_[edge.to]);
      }
    }
  }

  Nanos makespan() {
    std::vector<Nanos> idle(graph_.costs.front().size(), Nanos::zero());
    search(idle, 0, Nanos::zero());
    return best_;
  }

 private:
  Nanos fastest(std::size_t task) const { return *std::ranges::min_element(graph_.costs[task]); }
  bool done(std::size_t task) const { return finish_[task] != Nanos::min(); }

  void search(std::vector<Nanos>& idle, std::size_t placed, Nanos last) {
    if (placed == graph_.costs.size()) {
      best_ = std::min(best_, last);
      return;
    }
    for (std::size_t task = 0; task < graph_.costs.size(); ++task) {
      if (done(task) || std::ranges::any_of(graph_.edges, [&](const GraphEdge& edge) {
            return edge.to == task && !done(edge.from);
          })) {
        continue;
      }
      for (UnitId unit = 0; unit < idle.size(); ++unit) {
        Nanos start = idle[unit];
        for (const auto& edge : graph_.edges) {
          if (edge.to != task) continue;
          start = std::max(start, finish_[edge.from] + edge.transfer(where_[edge.from], unit));
        }
        const Nanos finish = start + graph_.costs[task][unit];
        if (finish + tail_[task] >= best_) continue;
        const Nanos before = std::exchange(idle[unit], finish);
        finish_[task] = finish;
        where_[task] = unit;
        search(idle, placed + 1, std::max(last, finish));
        finish_[task] = Nanos::min();
        idle[unit] = before;
      }
    }
  }

  const TaskGraph& graph_;
  Nanos best_;
  std::vector<Nanos> tail_;  ///< The fastest way from the task's end to the graph's.
  std::vector<Nanos> finish_;
  std::vector<UnitId> where_;
};

TEST(Planner, ComesCloseToTheExhaustiveOptimum) {
  std::vector<double> logs(planners().size(), 0);
  constexpr int kGraphs = 100;
  for (std::uint64_t seed = 0; seed < kGraphs; ++seed) {
    Random random(hash_u64(9, seed));
    const std::size_t tasks = 4 + random.below(6);
    const auto graph = random_graph(hash_u64(11, seed), tasks, 3, random.uniform(0.1, 5));
    const PlanningGraph planning(graph);
    const Nanos known = planner::shortest.plan(planning).makespan;
    const Nanos best = Exhaustive(graph, known).makespan();
    for (std::size_t i = 0; i < logs.size(); ++i) {
      const Nanos makespan = planners()[i]->plan(planning).makespan;
      EXPECT_GE(makespan, best);
      logs[i] += std::log(to_ms(makespan) / to_ms(best)) / kGraphs;
    }
  }
  for (std::size_t i = 0; i < logs.size(); ++i) {
    const double percent = 100 * std::expm1(logs[i]);
    const std::string name(planners()[i]->name);
    std::printf("%s: %.2f %% above the optimum (geometric mean)\n", name.c_str(), percent);
    RecordProperty(name + "_percent_above_optimum", std::to_string(percent));
    if (planners()[i] == &planner::shortest) {
      EXPECT_LE(percent, 5);
    }
  }
}

}  // namespace
}  // namespace pirt::test
