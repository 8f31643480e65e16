#include "scheduler/policies/weights.h"

#include <fmt/core.h>

#include <algorithm>
#include <cassert>
#include <cmath>
#include <limits>
#include <numeric>

#include "scheduler/policies/unit_order.h"
#include "scheduler/services/call_plan.h"
#include "workloads/base/error.h"
#include "workloads/base/text/text.h"

namespace pirt {
namespace {

constexpr int kMaxCycle = 9;
constexpr double kNegligibleShare = 1.0 / 20;
constexpr double kSlowRate = 1.0 / 10;  // Of the fastest.

/// Local units that serve the workload.
std::vector<UnitId> candidates(WorkloadId workload, const Platform& platform,
                               const ServiceTable& services) {
  const UnitMask mask = services.units_of(workload) & local_units(roles_of(platform));
  std::vector<UnitId> units;
  for (UnitId unit = 0; unit < platform.units.size(); ++unit) {
    if (contains(mask, unit)) units.push_back(unit);
  }
  return units;
}

double squared_error(const std::vector<int>& counts, const std::vector<double>& shares, int total) {
  double sum = 0;
  for (std::size_t i = 0; i < counts.size(); ++i) {
    const double difference = static_cast<double>(counts[i]) / total - shares[i];
    sum += difference * difference;
  }
  return sum;
}

/// The whole numbers of sum @p total closest to the shares: the error is separable and convex, so
/// that adding one at a time where it helps most is optimal (greedy resource allocation).
std::vector<int> apportion(const std::vector<double>& shares, std::vector<int> counts, int total) {
  for (int sum = std::accumulate(counts.begin(), counts.end(), 0); sum < total; ++sum) {
    std::size_t best = 0;
    double best_gain = -std::numeric_limits<double>::infinity();
    for (std::size_t i = 0; i < counts.size(); ++i) {
      const double gain =
          shares[i] * total - counts[i];  // Half the fall of (n - share*total)^2 + 1/2.
      if (gain > best_gain) {
        best = i;
        best_gain = gain;
      }
    }
    ++counts[best];
  }
  return counts;
}

/// The tasks of one cycle for each unit, the `else` included.
std::vector<int> cycle_of(const std::vector<double>& shares, std::size_t otherwise) {
  std::vector<int> least(shares.size());
  for (std::size_t i = 0; i < shares.size(); ++i)
    least[i] = shares[i] < kNegligibleShare && i != otherwise ? 0 : 1;
  const int smallest = std::accumulate(least.begin(), least.end(), 0);
  std::vector<int> best;
  double best_error = std::numeric_limits<double>::infinity();
  // More than nine units that all need one make a longer cycle.
  for (int total = smallest; total <= std::max(kMaxCycle, smallest); ++total) {
    const auto counts = apportion(shares, least, total);
    const double error = squared_error(counts, shares, total);
    if (error < best_error - 1e-12) {
      best = counts;
      best_error = error;
    }
  }
  return best;
}

void share_weights(WorkloadId workload, const Platform& platform, const ServiceTable& services,
                   std::vector<int>& weights) {
  const auto units = candidates(workload, platform, services);
  if (units.empty()) return;
  const auto roles = roles_of(platform);
  const auto order = units_by_role(roles, kLatencyOrder);
  UnitMask mask = 0;
  double sum = 0;
  std::vector<double> shares;
  for (const UnitId unit : units) {
    mask |= unit_bit(unit);
    const Nanos total = services.find(workload, unit)->total();
    shares.push_back(1 / to_s(std::max(total, Nanos(1))));
    sum += shares.back();
  }
  for (double& share : shares) share /= sum;
  const UnitId named = *else_target(order, roles, Role::kCpu, mask);
  const auto otherwise = static_cast<std::size_t>(std::ranges::find(units, named) - units.begin());
  const auto counts = cycle_of(shares, otherwise);
  for (std::size_t i = 0; i < units.size(); ++i)
    weights[units[i]] = counts[i] - (i == otherwise ? 1 : 0);
}

/// What a unit does of a workload's calls by themselves: what these move over links is no work of
/// it.
struct Queue {
  double per_s = 0;  ///< Calls.
  int weight = 0;    ///< kQueue's.
};

Queue queue_of(WorkloadId workload, UnitId unit, const Platform& platform,
               const ServiceTable& services) {
  const auto& model = platform.units[unit];
  const CallPlan call = plan_call(platform, services, workload, unit, {});
  const Nanos longest = std::max(call.bottleneck(unit), Nanos(1));
  const std::int64_t busy = calls_in_service(model.servers, call.takes(Taken::kMean), longest);
  return {.per_s = model.servers / to_s(longest),
          .weight = static_cast<int>(std::clamp<std::int64_t>(busy, 1, 1'000'000)) +
                    (model.slots == 1 ? 1 : 0)};
}

void queue_weights(WorkloadId workload, const Platform& platform, const ServiceTable& services,
                   bool fast_only, std::vector<int>& weights) {
  const auto units = candidates(workload, platform, services);
  double fastest = 0;
  for (const UnitId unit : units) {
    fastest = std::max(fastest, queue_of(workload, unit, platform, services).per_s);
  }
  for (const UnitId unit : units) {
    const Queue queue = queue_of(workload, unit, platform, services);
    weights[unit] = fast_only && queue.per_s < kSlowRate * fastest ? 0 : queue.weight;
  }
}

WeightTable zeros(const Platform& platform, const ServiceTable& services) {
  return {services.workloads.size(), std::vector<int>(platform.units.size(), 0)};
}

}  // namespace

WeightTable derive_weights(WeightRule rule, const Platform& platform,
                           const ServiceTable& services) {
  assert(rule != WeightRule::kOfBasic);
  WeightTable table = zeros(platform, services);
  for (WorkloadId workload = 0; workload < table.size(); ++workload) {
    if (rule == WeightRule::kShare) {
      share_weights(workload, platform, services, table[workload]);
    } else {
      queue_weights(workload, platform, services, rule == WeightRule::kFastQueue, table[workload]);
    }
  }
  return table;
}

WeightTable given_weights(const std::map<std::string, int>& weights, const Platform& platform,
                          const ServiceTable& services, const std::string& source) {
  WeightTable table = zeros(platform, services);
  bool any = false;
  for (const auto& [name, weight] : weights) {
    const auto found = std::ranges::find(platform.units, name, &UnitModel::name);
    if (found == platform.units.end()) {
      throw_bad_input(fmt::format("{}: platform {} has no unit '{}'{}", source, platform.name, name,
                                  suggestion(name, platform.unit_names())));
    }
    const auto unit = static_cast<UnitId>(found - platform.units.begin());
    if (weight < 0) {
      throw_bad_input(
          fmt::format("{}: the weight of {} is {}; weights are 0 or more", source, name, weight));
    }
    if (platform.units[unit].role == Role::kCloud) {
      throw_bad_input(
          fmt::format("{}: {} is a cloud, which no basic algorithm uses and which has no weight",
                      source, name));
    }
    any |= weight > 0;
    for (WorkloadId workload = 0; workload < table.size(); ++workload) {
      if (services.find(workload, unit) != nullptr) table[workload][unit] = weight;
    }
  }
  if (!any) throw_bad_input(source + ": all weights are 0; give one unit at least 1");
  return table;
}

int in_flight_for(const TaskClass& kind, const Platform& platform, const ServiceTable& services) {
  int sum = 0;
  for (const UnitId unit : candidates(kind.workload, platform, services)) {
    if (!contains(kind.eligible, unit)) continue;
    sum += queue_of(kind.workload, unit, platform, services).weight;
  }
  return std::max(1, sum);
}

}  // namespace pirt
