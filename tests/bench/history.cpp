// How often a step in a series is found, and how often one is found where none is, beside a rule of
// windows' medians.
//
// Usage: history [SERIES]   of each kind; default 2000
#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <functional>
#include <numbers>
#include <span>
#include <vector>

#include "characterize/statistics/change_points.h"
#include "characterize/statistics/rank_tests.h"
#include "workloads/base/math/random.h"

namespace {

using namespace pirt;  // NOLINT: a program

using Finder = std::function<std::vector<std::size_t>(std::span<const double>)>;

std::vector<std::size_t> by_levels(std::span<const double> values) {
  std::vector<std::size_t> found;
  for (const auto& change : change_points(values, 0)) {
    if (change.sure) found.push_back(change.at);
  }
  return found;
}

/// What benchmark pages do: the medians of five values before and from each on, apart by more than
/// four standard deviations of the five before (by their median deviation); the farthest of each
/// run of such places.
std::vector<std::size_t> by_windows(std::span<const double> values) {
  constexpr std::size_t kWindow = 5;
  std::vector<std::size_t> found;
  std::size_t best = 0;  // 0: none
  double farthest = 0;
  for (std::size_t at = kWindow; at + kWindow <= values.size(); ++at) {
    const auto before = values.subspan(at - kWindow, kWindow);
    const double middle = median_of(before);
    std::vector<double> deviations;
    for (const double value : before) deviations.push_back(std::abs(value - middle));
    const double noise = std::max(1.4826 * median_of(deviations), 1e-9);
    const double distance = std::abs(median_of(values.subspan(at, kWindow)) - middle) / noise;
    if (distance > 4) {
      if (best == 0 || distance > farthest) {
        best = at;
        farthest = distance;
      }
    } else if (best != 0) {
      found.push_back(best);
      best = 0;
    }
  }
  if (best != 0) found.push_back(best);
  return found;
}

std::vector<double> noise(std::size_t count, double rho, Random& random) {
  const auto uniform = [&random] {
    return (static_cast<double>(random.next() >> 11U) + 0.5) * 0x1p-53;
  };
  std::vector<double> values;
  for (std::size_t i = 0; i < count; ++i) {
    const double fresh =
        std::sqrt(-2 * std::log(uniform())) * std::cos(2 * std::numbers::pi * uniform());
    values.push_back(i == 0 ? fresh : rho * values.back() + std::sqrt(1 - rho * rho) * fresh);
  }
  return values;
}

}  // namespace

int main(int argc, char** argv) {
  const int series = argc > 1 ? std::max(1, std::atoi(argv[1])) : 2000;
  fmt::print("{:>7} {:>6} {:>14} | {:>12} {:>12} | {:>12} {:>12}\n", "points", "AR(1)", "step at",
             "found %", "windows %", "false/1000", "windows");
  for (const std::size_t points : {20U, 50U, 100U, 200U}) {
    for (const double rho : {0.0, 0.3}) {
      for (const bool at_end : {true, false}) {
        Random random(1);
        std::vector<Finder> finders = {by_levels, by_windows};
        std::vector<int> found(2), wrong(2);
        for (int i = 0; i < series; ++i) {
          const auto without = noise(points, rho, random);
          auto values = noise(points, rho, random);
          const std::size_t at =
              at_end ? points - kFewestOfLevel
                     : kFewestOfLevel +
                           static_cast<std::size_t>(random.below(points - 2 * kFewestOfLevel + 1));
          for (std::size_t j = at; j < points; ++j) values[j] += 3;
          for (std::size_t f = 0; f < finders.size(); ++f) {
            wrong[f] += static_cast<int>(finders[f](without).size());
            const auto places = finders[f](values);
            found[f] +=
                std::ranges::any_of(
                    places, [at](std::size_t place) { return place + 2 >= at && place <= at + 2; })
                    ? 1
                    : 0;
          }
        }
        const auto percent = [series](int count) { return 100.0 * count / series; };
        const auto of_1000 = [&](int count) {
          return 1000.0 * count / (series * static_cast<double>(points));
        };
        fmt::print("{:>7} {:>6} {:>14} | {:>12.1f} {:>12.1f} | {:>12.2f} {:>12.2f}\n", points, rho,
                   at_end ? "5 from the end" : "anywhere", percent(found[0]), percent(found[1]),
                   of_1000(wrong[0]), of_1000(wrong[1]));
      }
    }
  }
  return 0;
}
