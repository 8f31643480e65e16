#include "characterize/profile/size_estimate.h"

#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <optional>

#include "workloads/base/text/text.h"
#include "workloads/catalog/specs.h"
#include "workloads/own/definition.h"

namespace pirt {
namespace {

constexpr double kLeastExponent = 0.1, kMostExponent = 3, kExponentStep = 0.01;
constexpr std::array kPhasesOfCall = {Phase::kUpload, Phase::kLaunch, Phase::kExecute,
                                      Phase::kDownload};

using own::plain_name;
using own::size_in;

/// Of the first output, or, where that is a list, which is as long at any size, or @p by_inputs, of
/// the first input; of a foreign workload, whose outputs nobody knows, of a picture of its size.
/// Absent where that is not known either.
std::optional<double> elements_of(const std::string& workload, bool by_inputs) {
  const auto spec = try_find_spec(workload);
  if (spec && !spec->outputs.empty()) {
    const TensorSpec& output = spec->outputs.front();
    const bool by_input = (by_inputs || output.varies) && !spec->inputs.empty();
    return static_cast<double>((by_input ? spec->inputs.front() : output).count());
  }
  const auto size = size_in(workload);
  if (!size) return std::nullopt;
  return static_cast<double>(size->width) * size->height;
}

const PhaseRow* usable_row(const Profile& profile, const std::string& workload,
                           const std::string& unit, Phase phase) {
  const PhaseRow* const row = profile.find(workload, unit, phase);
  const bool usable =
      row != nullptr && is_used(*row) && row->median && *row->median > Nanos::zero();
  return usable ? row : nullptr;
}

/// Relative errors squared of the best a and b at that c, and these.
double fit_at(std::span<const SizedTime> times, SizeFit& fit) {
  // With u = 1 / t and v = n^c / t, the a and b at least 0 of the least sum of (a u + b v - 1)^2.
  double uu = 0, uv = 0, vv = 0, u = 0, v = 0;
  for (const SizedTime& each : times) {
    const double x = 1 / each.time_s;
    const double y = std::pow(each.elements, fit.c) / each.time_s;
    uu += x * x;
    uv += x * y;
    vv += y * y;
    u += x;
    v += y;
  }
  const double determinant = uu * vv - uv * uv;
  fit.a = (u * vv - v * uv) / determinant;
  fit.b = (v * uu - u * uv) / determinant;
  if (!(fit.a >= 0)) fit = {.a = 0, .b = v / vv, .c = fit.c};
  if (!(fit.b >= 0)) fit = {.a = u / uu, .b = 0, .c = fit.c};
  double sum = 0;
  for (const SizedTime& each : times) {
    const double error = fit.at(each.elements) / each.time_s - 1;
    sum += error * error;
  }
  return sum;
}

std::vector<SizedTime> times_of(const Profile& profile, const SizeGap& gap, Phase phase) {
  std::vector<SizedTime> times;
  for (const std::string& other : gap.others) {
    const PhaseRow& row = *usable_row(profile, other, gap.unit, phase);
    times.push_back({*elements_of(other, gap.by_inputs), to_s(*row.median)});
  }
  return times;
}

/// Whether the rows of all sizes tell all the phases apart that any of them has.
std::vector<Phase> phases_of(const Profile& profile, const SizeGap& gap) {
  std::vector<Phase> phases = {Phase::kCall};
  for (const Phase phase : kPhasesOfCall) {
    const auto having = std::ranges::count_if(gap.others, [&](const std::string& other) {
      return usable_row(profile, other, gap.unit, phase) != nullptr;
    });
    if (having == std::ssize(gap.others)) phases.push_back(phase);
    if (having != 0 && having != std::ssize(gap.others)) return {Phase::kCall};
  }
  return phases;
}

PhaseRow estimated_row(const Profile& profile, const SizeGap& gap, Phase phase) {
  const auto times = times_of(profile, gap, phase);
  const Nanos middle = from_s(fit_sizes(times).at(*elements_of(gap.workload, gap.by_inputs)));
  double error = log_error_of_fit(times);
  double tail = 1;                  // p95 over median
  std::vector<std::string> doubts;  // What is doubted of them is of what follows from them.
  for (const std::string& other : gap.others) {
    const PhaseRow& row = *usable_row(profile, other, gap.unit, phase);
    const double median = to_s(*row.median);
    tail = std::max(tail, to_s(row.p95.value_or(*row.median)) / median);
    if (row.ci_high) error = std::max(error, std::log(to_s(*row.ci_high) / median));
    for (const std::string& doubt : row.doubts) {
      if (std::ranges::find(doubts, doubt) == doubts.end()) doubts.push_back(doubt);
    }
  }
  PhaseRow row = *usable_row(profile, gap.others.front(), gap.unit, phase);
  row.workload = gap.workload;
  row.provenance = Provenance::kModelled;
  row.notes = {fmt::format("estimated through {} sizes", gap.others.size())};
  row.doubts = std::move(doubts);
  row.median = row.mean = middle;
  row.mad = Nanos::zero();
  row.p95 = row.p99 = scaled(middle, tail);
  row.ci_low = scaled(middle, std::exp(-error));
  row.ci_high = scaled(middle, std::exp(error));
  row.cpu = row.bound = std::nullopt;
  row.taken = std::nullopt;
  row.host_memory_bytes = row.device_memory_bytes = std::nullopt;
  row.values = {middle};
  row.value_processes = {0};
  row.samples = row.processes = 1;
  const auto spec = try_find_spec(gap.workload);
  row.ops = spec ? spec->ops : std::nullopt;
  row.bytes = spec ? spec->bytes : 0;
  return row;
}

std::string why_no_estimate(const SizeGap& gap) {
  const auto elements = elements_of(gap.workload, gap.by_inputs);
  std::vector<double> sizes;
  for (const std::string& other : gap.others) {
    const double size = *elements_of(other, gap.by_inputs);
    if (sizes.empty() || sizes.back() != size) sizes.push_back(size);
  }
  if (sizes.size() < kLeastSizes) {
    return fmt::format("{} of its sizes {} measured there, and an estimate needs {}", sizes.size(),
                       sizes.size() == 1 ? "is" : "are", kLeastSizes);
  }
  if (*elements < sizes.front() || *elements > sizes.back()) {
    return "it is not between sizes that are measured there";
  }
  return "";
}

}  // namespace

double SizeFit::at(double elements) const { return a + b * std::pow(elements, c); }

SizeFit fit_sizes(std::span<const SizedTime> times) {
  double largest = 0;
  for (const SizedTime& each : times) largest = std::max(largest, each.elements);
  // Of the largest size, so that powers stay near 1.
  std::vector<SizedTime> parts(times.begin(), times.end());
  for (SizedTime& each : parts) each.elements /= largest;
  SizeFit best;
  double least = std::numeric_limits<double>::infinity();
  for (double c = kLeastExponent; c <= kMostExponent; c += kExponentStep) {
    SizeFit fit{.c = c};
    const double sum = fit_at(parts, fit);
    if (sum < least) {
      least = sum;
      best = fit;
    }
  }
  best.b /= std::pow(largest, best.c);
  return best;
}

double log_error_of_fit(std::span<const SizedTime> times) {
  double largest = 0;
  for (std::size_t i = 0; i < times.size(); ++i) {
    const double elements = times[i].elements;
    if (elements == times.front().elements || elements == times.back().elements) continue;
    std::vector<SizedTime> others;
    for (const SizedTime& each : times) {
      if (each.elements != elements) others.push_back(each);
    }
    const double shown = fit_sizes(others).at(elements);
    largest = std::max(largest, std::abs(std::log(shown / times[i].time_s)));
  }
  return 3 * largest;
}

std::vector<SizeGap> size_gaps(const Profile& profile, const std::vector<std::string>& workloads) {
  std::vector<SizeGap> gaps;
  const auto known = profile.workloads();
  for (const std::string& workload : workloads) {
    if (!size_in(workload)) continue;
    for (const std::string& unit : profile.units()) {
      if (profile.find(workload, unit, Phase::kCall) != nullptr ||
          profile.find(workload, unit, Phase::kExecute) != nullptr) {
        continue;
      }
      SizeGap gap{.workload = workload, .unit = unit, .others = {}, .why_not = {}};
      for (const std::string& other : known) {
        const bool sized = other == plain_name(other) || size_in(other);
        if (sized && plain_name(other) == plain_name(workload) && elements_of(other, false) &&
            usable_row(profile, other, unit, Phase::kCall) != nullptr) {
          gap.others.push_back(other);
        }
      }
      if (gap.others.empty()) continue;
      gap.by_inputs = std::ranges::all_of(gap.others, [&workload](const std::string& other) {
        return elements_of(other, false) == elements_of(workload, false);
      });
      std::ranges::stable_sort(gap.others, {}, [&gap](const std::string& other) {
        return *elements_of(other, gap.by_inputs);
      });
      gap.why_not = why_no_estimate(gap);
      gaps.push_back(std::move(gap));
    }
  }
  return gaps;
}

PhaseRow add_estimate(Profile& profile, const SizeGap& gap) {
  for (const Phase phase : phases_of(profile, gap)) {
    PhaseRow row = estimated_row(profile, gap, phase);
    profile.phases.push_back(std::move(row));
  }
  return *profile.find(gap.workload, gap.unit, Phase::kCall);
}

}  // namespace pirt
