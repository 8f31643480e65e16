#include "characterize/energy/model.h"

#include <fmt/core.h>

#include <algorithm>

#include "characterize/platform/elsewhere.h"
#include "characterize/statistics/statistics.h"
#include "workloads/base/text/text.h"

namespace pirt {
namespace {

double stated_call_j(const Platform& platform, const UnitModel& unit, const std::string& workload) {
  const auto model = platform.workloads.find(workload);
  if (model == platform.workloads.end()) return 0;
  const auto joules = model->second.call_j.find(unit.name);
  return joules == model->second.call_j.end() ? 0 : joules->second;
}

double link_j(const Platform& platform, const UnitModel& unit, const Workload& workload) {
  const auto link = platform.links.find(unit.link);
  if (link == platform.links.end()) return 0;
  std::int64_t size_bytes = 0;
  for (const auto* tensors : {&workload.inputs, &workload.outputs}) {
    for (const TensorSpec& spec : *tensors) size_bytes += spec.size_bytes();
  }
  return link->second.active_w * static_cast<double>(size_bytes) * 8 / (link->second.mbit_s * 1e6);
}

/// What of a mean call draws the unit's active_w.
Nanos drawing(const UnitModel& unit, const PhaseRecord& call, std::span<const PhaseRecord> phases) {
  if (!is_elsewhere(unit)) return mean(call.samples, call.processes);
  Nanos sum{0};
  for (const PhaseRecord& each : phases) {
    if (!is_setup(each.phase) && draws_in(unit, each.phase) && !each.samples.empty()) {
      sum += mean(each.samples, each.processes);
    }
  }
  return sum;
}

/// That of the call's time.
void add_interval(const PhaseRecord& call, double fixed_j, double timed_j, EnergyRecord& energy) {
  const Statistics time = statistics_of(call);
  if (!time.interval || time.median <= Nanos::zero()) return;
  const double energy_j = energy.energy_j.value();  // which rounding must not leave out
  const double low_j = fixed_j + timed_j * to_s(time.interval->low) / to_s(time.median);
  const double high_j = fixed_j + timed_j * to_s(time.interval->high) / to_s(time.median);
  energy.ci_low_j = std::min(low_j, energy_j);
  energy.ci_high_j = std::max(high_j, energy_j);
}

/// The platform's own words, in one line.
std::string remark(const Platform& platform, const UnitModel& unit) {
  std::string text = unit.energy_source.empty() ? platform.assumptions : unit.energy_source;
  std::ranges::replace(text, '\n', ' ');
  while (text.ends_with(' ')) text.pop_back();
  return text.empty() ? "" : "; " + text;
}

}  // namespace

double stated_j(const Platform& platform, const UnitModel& unit, const Workload& workload) {
  return stated_call_j(platform, unit, workload.name) + link_j(platform, unit, workload);
}

EnergyRecord model_energy(const Platform& platform, const UnitModel& unit, const Workload& workload,
                          const PhaseRecord& call, const std::optional<CallWork>& work,
                          std::span<const PhaseRecord> phases) {
  const auto [ops, bytes] = work.value_or(CallWork{workload.ops, workload.bytes()});
  const double call_j = stated_call_j(platform, unit, workload.name) + unit.call_j;
  std::vector<std::string> terms;
  EnergyRecord result;
  result.provenance = weakest(unit.energy_provenance, call.provenance);
  result.reasons = call.reasons;
  result.doubts = call.doubts;
  double energy_j = stated_j(platform, unit, workload) + unit.call_j;
  double timed_j = 0;  // of it, what goes with the time of the call
  if (unit.active_w > 0) {
    terms.push_back(fmt::format("active_w {} W x mean {}", unit.active_w,
                                is_elsewhere(unit) ? "upload and download" : "call"));
    if (!call.samples.empty()) timed_j = unit.active_w * to_s(drawing(unit, call, phases));
    energy_j += timed_j;
  }
  if (unit.op_pj > 0) {
    terms.push_back(fmt::format("op_pj {} pJ x ops", unit.op_pj));
    energy_j += unit.op_pj * kPico * static_cast<double>(ops.value_or(0));
    if (!ops) result.reasons.emplace_back("ops_unknown");
  }
  if (unit.byte_pj > 0) {
    terms.push_back(fmt::format("byte_pj {} pJ x bytes", unit.byte_pj));
    energy_j += unit.byte_pj * kPico * static_cast<double>(bytes);
  }
  if (call_j > 0) terms.push_back(fmt::format("call_j {} J", call_j));
  if (link_j(platform, unit, workload) > 0) {
    terms.push_back(fmt::format("link {} active_w {} W x transfer", unit.link,
                                platform.links.at(unit.link).active_w));
  }

  if (terms.empty()) {
    result.source =
        fmt::format("model: none, unit '{}' states no power{}; give it with --set {}.active_w=W",
                    unit.name, unit.watts_of_host_cores ? kOfItsDevice : "", unit.name);
    result.reasons.emplace_back("no_power");
    return result;
  }
  result.source = "model: " + join(terms, " + ") + remark(platform, unit);
  const bool has_ops = unit.op_pj <= 0 || ops.has_value();
  if (!call.samples.empty() && has_ops) {
    result.energy_j = energy_j;
    add_interval(call, energy_j - timed_j, timed_j, result);
  }
  return result;
}

}  // namespace pirt
