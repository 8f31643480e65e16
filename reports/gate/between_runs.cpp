#include "reports/gate/between_runs.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <vector>

#include "characterize/statistics/rank_tests.h"
#include "characterize/statistics/statistics.h"

namespace pirt {
namespace {

std::vector<double> medians_of(const PhaseRow& row) {
  std::vector<double> medians;
  for (const Nanos each : process_medians(row.values, row.value_processes)) {
    medians.push_back(static_cast<double>(each.count()));
  }
  return medians;
}

std::optional<double> wider_spread(std::span<const double> a, std::span<const double> b) {
  const auto spread_a = process_spread(a);
  const auto spread_b = process_spread(b);
  if (!spread_a && !spread_b) return std::nullopt;
  return std::max(spread_a.value_or(0), spread_b.value_or(0));
}

/// With interpolation. @param values  At least one.
double lower_quartile(std::vector<double> values) {
  std::ranges::sort(values);
  const double at = 0.25 * static_cast<double>(values.size() - 1);
  const auto below = static_cast<std::size_t>(at);
  const std::size_t above = std::min(below + 1, values.size() - 1);
  return std::lerp(values[below], values[above], at - static_cast<double>(below));
}

}  // namespace

std::optional<double> process_spread(std::span<const double> medians) {
  if (medians.size() < 2) return std::nullopt;
  const double middle = median_of(medians);
  if (middle <= 0) return std::nullopt;
  std::vector<double> deviations;
  for (const double each : medians) deviations.push_back(std::abs(each - middle));
  // For n from 2 to 9; n / (n - 0.8) from there on.
  constexpr std::array kFactors = {1.196, 1.495, 1.363, 1.206, 1.200, 1.140, 1.129, 1.107};
  constexpr double kOfNormal = 1.4826;
  const std::size_t n = medians.size();
  const auto count = static_cast<double>(n);
  const double few = n - 2 < kFactors.size() ? kFactors[n - 2] : count / (count - 0.8);
  return few * kOfNormal * median_of(deviations) / middle;
}

std::optional<double> spread_between(const PhaseRow& base, const PhaseRow& candidate) {
  return wider_spread(medians_of(base), medians_of(candidate));
}

std::optional<double> noise_between(const PhaseRow& base, const PhaseRow& candidate, Drift drift) {
  const auto a = medians_of(base);
  const auto b = medians_of(candidate);
  const auto spread = wider_spread(a, b);
  if (!spread) return std::nullopt;
  // Of a median of n normal values: sqrt(pi / 2) / sqrt(n) of theirs.
  const double of_medians =
      std::sqrt(std::numbers::pi / 2 *
                (1.0 / static_cast<double>(a.size()) + 1.0 / static_cast<double>(b.size())));
  double of_drift = *spread * kDrift * std::numbers::sqrt2;
  if (drift == Drift::kOfOneRow && of_drift > kWideDrift) {
    of_drift = std::sqrt(of_drift * kWideDrift);
  }
  return std::hypot(*spread * of_medians, of_drift);
}

std::optional<double> half_width_between(const PhaseRow& base, const PhaseRow& candidate) {
  double both = 0;
  for (const PhaseRow* row : {&base, &candidate}) {
    const auto medians = process_medians(row->values, row->value_processes);
    const auto half = relative_half_width(interval_over_processes(medians), *row->median);
    if (!half) return std::nullopt;
    both = std::hypot(both, *half);
  }
  return both;
}

std::optional<double> wander_of(const PhaseRow& row) {
  constexpr std::size_t kFewest = 8;
  const std::span<const Nanos> values(row.values);
  std::vector<double> wanders;
  std::size_t begin = 0;
  while (begin < values.size()) {
    std::size_t end = begin;
    while (end < values.size() && row.value_processes[end] == row.value_processes[begin]) ++end;
    const std::size_t half = (end - begin) / 2;
    if (end - begin >= kFewest) {
      const Nanos first = median(values.subspan(begin, half));
      const Nanos second = median(values.subspan(begin + half, end - begin - half));
      if (first.count() > 0 && second.count() > 0) {
        wanders.push_back(std::abs(std::log(to_s(second) / to_s(first))));
      }
    }
    begin = end;
  }
  if (wanders.empty()) return std::nullopt;
  return median_of(wanders);
}

std::optional<double> change_between(const PhaseRow& base, const PhaseRow& candidate,
                                     double shift) {
  if (!base.median || !candidate.median || base.values.empty() || candidate.values.empty()) {
    return std::nullopt;
  }
  const auto of_medians =
      static_cast<double>(candidate.median->count()) / static_cast<double>(base.median->count());
  const double of_quartiles =
      lower_quartile(medians_of(candidate)) / lower_quartile(medians_of(base));
  if (!(of_medians > 0 && of_quartiles > 0) || std::isinf(of_medians) || std::isinf(of_quartiles)) {
    return std::nullopt;
  }
  const double a = std::log(of_medians) - shift;
  const double b = std::log(of_quartiles) - shift;
  if ((a > 0) != (b > 0)) return 0.0;
  return std::abs(a) < std::abs(b) ? a : b;
}

}  // namespace pirt
