#include "scheduler/policies/completion_estimate.h"

#include <algorithm>
#include <bit>
#include <utility>

namespace pirt {

CompletionEstimate::CompletionEstimate(const PolicySetup& setup)
    : Baseline(setup), earliest_(setup.servers.size()) {
  for (const int servers : servers_) {
    accounts_.emplace_back().idle_at.resize(static_cast<std::size_t>(servers), Nanos::zero());
  }
  for (const auto& row : costs_) {
    auto& counts = in_service_.emplace_back();
    for (std::size_t unit = 0; unit < row.size(); ++unit) {
      counts.push_back(
          row[unit] ? calls_in_service(servers_[unit], row[unit]->total, row[unit]->occupied) : 0);
      totals_.push_back(row[unit] ? row[unit]->total : Nanos::zero());
    }
  }
}

std::optional<UnitId> CompletionEstimate::best_unit(const TaskClass& task, const UnitsView& units) {
  std::optional<UnitId> best;
  Nanos first_end = Nanos::max();
  const Nanos* const totals = &totals_[task.workload * accounts_.size()];
  for (UnitMask mask = Baseline::takers(task, units.up); mask != 0; mask &= mask - 1) {
    const auto unit = static_cast<UnitId>(std::countr_zero(mask));
    if (earliest_begin(unit, units) + totals[unit] >= first_end) continue;
    const Nanos end = completion(task, unit, units);
    if (end >= first_end) continue;
    best = unit;
    first_end = end;
  }
  return best;
}

bool CompletionEstimate::has_idle_server(UnitId unit, const UnitsView& units) const {
  return static_cast<std::size_t>(units.load[unit]) < accounts_[unit].idle_at.size();
}

void CompletionEstimate::Account::give(Nanos work, int load) {
  if (known + 1 == sums.size()) {
    std::vector<Nanos> more(2 * sums.size());
    for (std::uint64_t i = given - known; i <= given; ++i)
      more[i & (more.size() - 1)] = sum_after(i);
    sums = std::move(more);
  }
  const Nanos before = sum_after(given);
  sums[++given & (sums.size() - 1)] = before + work;
  known = std::min(known + 1, static_cast<std::uint64_t>(load) + 1);
}

/// When all servers are taken to be idle alike, where the account cannot be right; absent where it
/// can.
std::optional<Nanos> CompletionEstimate::corrected_idle(const TaskClass& task, UnitId unit,
                                                        const UnitsView& units) const {
  const Account& account = accounts_[unit];
  Nanos remaining{0};
  for (const Nanos idle_at : account.idle_at)
    remaining += std::max(Nanos::zero(), idle_at - units.now);
  const auto load = std::int64_t{units.load[unit]};
  const auto servers = static_cast<std::int64_t>(account.idle_at.size());
  const Nanos least =
      account.work_of_last(load - std::max(servers, in_service_[task.workload][unit]));
  const Nanos most = account.work_of_last(load);
  const Nanos right = std::clamp(remaining, least, most);
  if (right == remaining) return std::nullopt;
  return units.now + right / servers;
}

Nanos CompletionEstimate::completion(const TaskClass& task, UnitId unit, const UnitsView& units) {
  const Nanos total = time(task, unit).total;
  if (has_idle_server(unit, units)) return units.now + total;
  const Nanos idle = std::max(std::ranges::min(accounts_[unit].idle_at), units.now);
  const auto corrected = corrected_idle(task, unit, units);
  const Nanos begin = corrected.value_or(idle);
  // While the account is right it begins when the first server is idle, and that is never later
  // than all of them are on average; where more remains to be done than that, so far from now.
  earliest_[unit] = {.begin = std::min(begin, idle), .load = units.load[unit]};
  return begin + total;
}

void CompletionEstimate::add(const TaskClass& task, UnitId unit, const UnitsView& units) {
  Account& account = accounts_[unit];
  earliest_[unit] = {};
  if (const auto corrected = corrected_idle(task, unit, units)) {
    std::ranges::fill(account.idle_at, *corrected);
  }
  const Nanos work = time(task, unit).occupied;
  const auto first = std::ranges::min_element(account.idle_at);
  *first = (has_idle_server(unit, units) ? units.now : std::max(*first, units.now)) + work;
  account.give(work, units.load[unit]);
}

}  // namespace pirt
