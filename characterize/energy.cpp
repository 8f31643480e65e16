#include "characterize/energy.h"

#include <fmt/format.h>

#include <algorithm>

#include "characterize/statistics.h"
#include "workloads/base/text.h"

namespace pirt {
namespace {

constexpr double kPico = 1e-12;

double stated_call_j(const Platform& platform, const UnitModel& unit, const std::string& workload) {
  const auto model = platform.workloads.find(workload);
  if (model == platform.workloads.end()) return 0;
  const auto joules = model->second.call_j.find(unit.name);
  return joules == model->second.call_j.end() ? 0 : joules->second;
}

}  // namespace

EnergyRecord model_energy(const Platform& platform, const UnitModel& unit, const Workload& workload,
                          const PhaseRecord& call) {
  const double call_j = stated_call_j(platform, unit, workload.name);
  std::vector<std::string> terms;
  EnergyRecord result;
  result.reasons = call.reasons;
  double energy_j = call_j;
  if (unit.active_w > 0) {
    terms.push_back(fmt::format("active_w {} W x call", unit.active_w));
    if (!call.samples.empty())
      energy_j += unit.active_w * to_s(median(call.samples, call.processes));
  }
  if (unit.op_pj > 0) {
    terms.push_back(fmt::format("op_pj {} pJ x ops", unit.op_pj));
    energy_j += unit.op_pj * kPico * static_cast<double>(workload.ops.value_or(0));
    if (!workload.ops) result.reasons.emplace_back("ops_unknown");
  }
  if (unit.byte_pj > 0) {
    terms.push_back(fmt::format("byte_pj {} pJ x bytes", unit.byte_pj));
    energy_j += unit.byte_pj * kPico * static_cast<double>(workload.bytes());
  }
  if (call_j > 0) terms.push_back(fmt::format("call_j {} J", call_j));

  if (terms.empty()) {
    result.source =
        fmt::format("model: none, unit '{}' states no power; give it with --set {}.active_w=W",
                    unit.name, unit.name);
    result.reasons.emplace_back("no_power");
    return result;
  }
  result.source = "model: " + join(terms, " + ");
  if (!platform.assumptions.empty()) {
    std::string assumptions = platform.assumptions;
    std::ranges::replace(assumptions, '\n', ' ');
    while (assumptions.ends_with(' ')) assumptions.pop_back();
    result.source += "; " + assumptions;
  }
  const bool has_ops = unit.op_pj <= 0 || workload.ops.has_value();
  if (!call.samples.empty() && has_ops) result.energy_j = energy_j;
  return result;
}

}  // namespace pirt
