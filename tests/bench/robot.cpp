// The robot's own work beside its goals: plan_path on the map of a depot, bundle_adjust on 100
// images.
//
// Usage: robot plan MAP.yaml [QUERIES [SEED]]     e.g. ../shared/data/maps-nav2/depot.yaml 1000
//        robot bundle [THREADS]                   default 1
#include <fmt/format.h>
#include <sys/resource.h>

#include <algorithm>
#include <chrono>
#include <cstdlib>
#include <string_view>
#include <vector>

#include "workloads/base/math/random.h"
#include "workloads/mapping/bundle_adjust.h"
#include "workloads/mapping/generate_bal.h"
#include "workloads/planning/changing_map.h"
#include "workloads/planning/map_files.h"
#include "workloads/planning/plain_search.h"

namespace {

namespace mapping = pirt::mapping;
namespace planning = pirt::planning;

template <typename Work>
double ms_of(const Work& work) {
  const auto begin = std::chrono::steady_clock::now();
  work();
  return std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - begin)
      .count();
}

struct Times {
  std::vector<double> ms = {};

  [[nodiscard]] double quantile(double q) {
    std::ranges::sort(ms);
    return ms[static_cast<std::size_t>(q * static_cast<double>(ms.size() - 1))];
  }
  [[nodiscard]] double sum() const {
    double total = 0;
    for (const double value : ms) total += value;
    return total;
  }
  void print(std::string_view name) {
    fmt::print("{:<34} median {:8.4f}  p95 {:8.4f}  p99 {:8.4f}  max {:8.4f} ms\n", name,
               quantile(0.5), quantile(0.95), quantile(0.99), quantile(1));
  }
};

/// Both searches answer each query in turns, between cells drawn from those that are passable and
/// connected. @return whether the goals are met.
bool plan_paths(const std::string& file, int queries, std::uint64_t seed) {
  const planning::Grid grid = planning::read_map(file);
  fmt::print("plan_path: {} x {} cells, {} queries a radius, one core, path included\n", grid.width,
             grid.height, queries);
  bool met = true;
  for (const double radius : {0.0, 0.22}) {
    std::vector<std::uint8_t> passable;
    std::optional<planning::PreparedMap> map;
    const double prepare_ms = ms_of([&] { map.emplace(grid, radius); });
    passable = planning::passable_cells(grid, radius);
    planning::PathPlanner planner(*map);
    pirt::Random random(seed);
    Times ours, plain;
    double worst = 0;
    while (ours.ms.size() < static_cast<std::size_t>(queries)) {
      const planning::Cell start = map->cell(random.below(map->size()));
      const planning::Cell goal = map->cell(random.below(map->size()));
      if (!map->passable(start) || !map->passable(goal) || !map->connected(start, goal)) continue;
      planning::Path path, expected;
      ours.ms.push_back(ms_of([&] { path = planner.plan(start, goal); }));
      plain.ms.push_back(ms_of([&] {
        expected = planning::plan_plainly(planning::PlainSearch::kAStar, grid.width, grid.height,
                                          passable, start, goal);
      }));
      worst = std::max(worst, std::abs(path.length - expected.length));
    }
    fmt::print("radius {} {}: map prepared in {:.1f} ms; lengths differ by at most {:.1g} cells\n",
               radius, to_string(grid.unit), prepare_ms, worst);
    plain.print("  A*, binary heap");
    ours.print("  plan_path");
    const double ratio = ours.sum() / plain.sum();
    fmt::print("  time of plan_path over A*'s: {:.4f} (goal 0.5); p99 {:.3f} ms (goal 6)\n", ratio,
               ours.quantile(0.99));
    met = met && ratio <= 0.5 && ours.quantile(0.99) < 6 && worst < 1e-6;
  }
  return met;
}

/// Between queries a square of 0.4 m appears at random and the one before goes. @return whether the
/// goals are met.
bool plan_on_a_changing_map(const std::string& file, int queries, std::uint64_t seed) {
  constexpr double kRadius = 0.22;
  constexpr double kSquare = 0.4;
  const planning::Grid grid = planning::read_map(file);
  planning::ChangingMap map(grid, kRadius);
  planning::PathPlanner planner(map.prepared());
  const int side = std::max(1, static_cast<int>(kSquare / grid.resolution));
  pirt::Random random(seed);
  const auto any_cell = [&] { return map.prepared().cell(random.below(map.prepared().size())); };
  Times times;
  double worst = 0;
  while (times.ms.size() < static_cast<std::size_t>(queries)) {
    planning::Grid now = grid;
    const planning::Cell first = any_cell();
    for (int y = first.y; y < std::min(first.y + side, grid.height); ++y) {
      for (int x = first.x; x < std::min(first.x + side, grid.width); ++x) {
        now.cells[grid.index({x, y})] = planning::CellState::kOccupied;
      }
    }
    std::vector<std::uint8_t> cells;
    for (const auto cell : now.cells) cells.push_back(static_cast<std::uint8_t>(cell));
    const planning::Cell start = any_cell();
    const planning::Cell goal = any_cell();
    planning::Path path;
    const double took = ms_of([&] {
      map.become(cells);
      path = planner.plan(start, goal);
    });
    const auto expected =
        planning::plan_plainly(planning::PlainSearch::kAStar, grid.width, grid.height,
                               planning::passable_cells(now, kRadius), start, goal);
    if (path.status != expected.status) return fmt::print("another answer than A*'s\n"), false;
    if (path.status != planning::PathStatus::kFound) continue;
    times.ms.push_back(took);
    worst = std::max(worst, std::abs(path.length - expected.length));
  }
  times.print("  plan_path, the map changed");
  fmt::print("  p99 {:.3f} ms (goal 2); lengths differ by at most {:.1g} cells\n",
             times.quantile(0.99), worst);
  return times.quantile(0.99) < 2 && worst < 1e-6;
}

double peak_mib() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  return static_cast<double>(usage.ru_maxrss) / 1024;
}

bool adjust_bundles(int threads) {
  bool met = true;
  for (const double outliers : {0.0, 0.02}) {
    const auto made = mapping::generate_bal({.outliers = outliers});
    auto problem = made.problem;
    mapping::BundleOptions options;
    options.loss = outliers > 0 ? mapping::Loss::kCauchy : mapping::Loss::kNone;
    options.threads = threads;
    mapping::BundleSummary summary;
    const double s = ms_of([&] { summary = mapping::bundle_adjust(problem, options); }) / 1e3;
    fmt::print(
        "bundle_adjust: 100 images, 5000 points, {} observations, {:.0f} % outliers, loss {}, {} "
        "thread(s)\n  {:.2f} s (goal 20; the paper's cloud: under 300), peak {:.0f} MiB, {} "
        "iterations, noise found {:.3f} px (1 put in)\n",
        problem.observations.size(), 100 * outliers, to_string(options.loss), threads, s,
        peak_mib(), summary.iterations, summary.noise_px);
    met = met && s < 20;
  }
  return met;
}

}  // namespace

int main(int argc, char** argv) {
  const std::vector<std::string> arguments(argv + 1, argv + argc);
  if (arguments.size() >= 2 && arguments[0] == "plan") {
    const int queries = arguments.size() > 2 ? std::atoi(arguments[2].c_str()) : 1000;
    const auto seed = arguments.size() > 3 ? std::strtoull(arguments[3].c_str(), nullptr, 10) : 1;
    const bool met = plan_paths(arguments[1], queries, seed);
    return plan_on_a_changing_map(arguments[1], queries, seed) && met ? 0 : 1;
  }
  if (!arguments.empty() && arguments[0] == "bundle") {
    return adjust_bundles(arguments.size() > 1 ? std::atoi(arguments[1].c_str()) : 1) ? 0 : 1;
  }
  fmt::print(stderr, "usage: robot plan MAP.yaml [QUERIES [SEED]] | robot bundle [THREADS]\n");
  return 2;
}
