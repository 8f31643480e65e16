#include "reports/profile/offloading.h"

#include <algorithm>
#include <array>

#include "reports/profile/shown_row.h"
#include "workloads/base/text/text.h"

namespace pirt {
namespace {

constexpr std::array kStates = {State::kCold, State::kWarm};

std::optional<Nanos> median_of(const PhaseRow* row) {
  return row != nullptr && is_used(*row) ? row->median : std::nullopt;
}

/// Why @p row gives no figure; empty if it does.
std::string reason_of(const PhaseRow* row, Phase phase) {
  const std::string name(to_string(phase));
  if (row == nullptr) return name + " was not measured";
  if (const std::string why = row->unknown(); !why.empty()) return name + " is unknown: " + why;
  if (!is_used(*row)) return name + " is not valid: " + join(row->reasons, ", ");
  return row->median ? "" : name + " has no samples";
}

void add_cost(const Profile& profile, const std::string& workload, const std::string& unit,
              State state, OffloadingCosts& result) {
  const PhaseRow* init = profile.find(workload, unit, Phase::kDeviceInit, state);
  const PhaseRow* prepare = profile.find(workload, unit, Phase::kPrepare, state);
  const PhaseRow* call = profile.find(workload, unit, Phase::kCall);
  if (init == nullptr && prepare == nullptr && call == nullptr) return;  // not planned there
  for (const auto& [row, phase] :
       {std::pair(init, Phase::kDeviceInit), std::pair(prepare, Phase::kPrepare),
        std::pair(call, Phase::kCall)}) {
    const std::string reason = reason_of(row, phase);
    if (reason.empty()) continue;
    result.missing.push_back({workload, unit, state, reason});
    return;
  }
  OffloadingCost cost;
  cost.workload = workload;
  cost.unit = unit;
  cost.state = state;
  cost.device_init = *init->median;
  cost.prepare = *prepare->median;
  cost.call = *call->median;
  cost.upload = median_of(profile.find(workload, unit, Phase::kUpload));
  cost.launch = median_of(profile.find(workload, unit, Phase::kLaunch));
  cost.execute = median_of(profile.find(workload, unit, Phase::kExecute));
  cost.download = median_of(profile.find(workload, unit, Phase::kDownload));
  const std::array rows = {init, prepare, call};
  for (const PhaseRow* row : rows) {
    cost.provenance =
        row == rows.front() ? row->provenance : sum_of(cost.provenance, row->provenance);
    cost.doubt = std::max(cost.doubt, doubt_mark(*row));
  }
  const auto has_interval = [](const PhaseRow* row) { return row->ci_low && row->ci_high; };
  if (std::ranges::all_of(rows, has_interval)) {
    cost.least = {*init->ci_low + *prepare->ci_low, *call->ci_low};
    cost.most = {*init->ci_high + *prepare->ci_high, *call->ci_high};
  }
  result.costs.push_back(std::move(cost));
}

}  // namespace

Nanos OffloadingCost::set_up() const { return device_init + std::max(Nanos(0), prepare - call); }

Nanos CallCosts::total(std::int64_t calls) const { return first + (calls - 1) * further; }

const OffloadingCost* OffloadingCosts::find(std::string_view workload, std::string_view unit,
                                            State state) const {
  const auto found = std::ranges::find_if(costs, [&](const OffloadingCost& cost) {
    return cost.workload == workload && cost.unit == unit && cost.state == state;
  });
  return found == costs.end() ? nullptr : &*found;
}

OffloadingCosts offloading_costs(const Profile& profile) {
  OffloadingCosts result;
  for (const auto& workload : profile.workloads()) {
    for (const auto& unit : profile.units()) {
      for (const State state : kStates) add_cost(profile, workload, unit, state, result);
    }
  }
  return result;
}

Crossover crossover(const CallCosts& a, const CallCosts& b) {
  // b is faster with n calls if later < (n - 1) * gain.
  const std::int64_t later = (b.first - a.first).count();
  const std::int64_t gain = (a.further - b.further).count();
  if (later < 0) {
    if (gain >= 0) return {Crossover::Kind::kFromFirst, 0};
    return {Crossover::Kind::kUpTo, (-later - 1) / -gain + 1};  // the largest n - 1 < later / gain
  }
  if (gain <= 0) return {Crossover::Kind::kNever, 0};
  return {Crossover::Kind::kFrom, later / gain + 2};  // the smallest n - 1 > later / gain
}

std::optional<CrossoverRange> crossover_range(const OffloadingCost& a, const OffloadingCost& b) {
  if (!a.least || !a.most || !b.least || !b.most) return std::nullopt;
  return CrossoverRange{crossover(*a.most, *b.least), crossover(*a.least, *b.most)};
}

std::optional<bool> is_faster_call(const OffloadingCost& a, const OffloadingCost& b) {
  if (a.least && a.most && b.least && b.most) {
    const bool apart = b.most->further < a.least->further || a.most->further < b.least->further;
    if (!apart) return std::nullopt;
  }
  if (a.call == b.call) return std::nullopt;
  return b.call < a.call;
}

}  // namespace pirt
