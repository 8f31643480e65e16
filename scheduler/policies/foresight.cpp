#include "scheduler/policies/foresight.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <utility>

namespace pirt {
namespace {

constexpr Nanos kGrace = std::chrono::milliseconds(1);  ///< That a clock may be late.
constexpr std::size_t kLooksAt = 8;  ///< Waiting tasks of one entry; more are late anyway.
/// Demands that are gone through for one answer: what is not late by then is taken not to be.
constexpr int kMostDemands = 1000;
/// Of a heap whose top is the most urgent demand.
constexpr auto kLater = [](const auto& a, const auto& b) { return a.latest_end > b.latest_end; };

}  // namespace

Foresight::Foresight(const BudgetPlan& plan, std::vector<int> servers)
    : plan_(plan),
      servers_(std::move(servers)),
      waiting_(plan.tasks.size()),
      is_urgent_(plan.tasks.size(), false),
      eligible_(plan.tasks.size(), ~UnitMask{0}),
      streams_(plan.pipelines.size()) {
  for (std::uint32_t entry = 0; entry < plan.tasks.size(); ++entry) {
    is_urgent_[entry] = plan.pipelines[plan.tasks[entry].pipeline].deadline.has_value();
  }
  find_units(up_);
}

void Foresight::find_units(UnitMask up) {
  up_ = up;
  on_.assign(plan_.tasks.empty() ? 0 : plan_.tasks.front().capacity.size(), {});
  for (std::uint32_t entry = 0; entry < plan_.tasks.size(); ++entry) {
    if (is_urgent_[entry]) on_[unit_of(entry)].push_back(entry);
  }
}

/// The first of its units that is up and may serve its tasks.
UnitId Foresight::unit_of(std::uint32_t entry) const {
  const auto& units = plan_.tasks[entry].units;
  const UnitMask mask = up_ & eligible_[entry];
  const auto first =
      std::ranges::find_if(units, [mask](UnitId unit) { return contains(mask, unit); });
  return first == units.end() ? units.front() : *first;
}

void Foresight::submitted(const Task& task) {
  const std::uint32_t entry = task.kind.entry;
  if (!task.deadline) return;
  came_back(entry, *task.deadline);
  const UnitId before = unit_of(entry);
  eligible_[entry] = task.kind.eligible;
  if (!is_urgent_[entry] || unit_of(entry) != before) {
    is_urgent_[entry] = true;
    find_units(up_);
  }
  const BudgetPlan::Task& planned = plan_.tasks[entry];
  const BudgetPlan::Arrivals& arrivals = plan_.pipelines[planned.pipeline];
  if (!planned.first || !arrivals.is_periodic()) return;
  const Nanos since = *task.deadline - *arrivals.deadline - arrivals.offset;
  // A firing is at its nominal time or after it, which was rounded to a nanosecond.
  const double number = std::floor((to_s(since) + 1e-9) * *arrivals.rate_hz + 1e-9);
  Stream& stream = streams_[planned.pipeline];
  stream.next = std::max(stream.next, static_cast<std::int64_t>(number) + 1);
  stream.missed = 0;
}

void Foresight::came_back(std::uint32_t entry, Nanos deadline) {
  if (deadline == Nanos::max()) return;
  auto& waiting = waiting_[entry];
  if (waiting.empty() || waiting.back() <= deadline) return waiting.push_back(deadline);
  waiting.insert(std::ranges::upper_bound(waiting, deadline), deadline);
}

void Foresight::departed(std::uint32_t entry, Nanos deadline) {
  auto& waiting = waiting_[entry];
  if (!waiting.empty() && waiting.front() == deadline) return waiting.pop_front();
  const auto found = std::ranges::lower_bound(waiting, deadline);
  if (found != waiting.end() && *found == deadline) waiting.erase(found);
}

Nanos Foresight::latest_end(std::uint32_t entry) const {
  if (waiting_[entry].empty()) return Nanos::max();
  return waiting_[entry].front() - plan_.tasks[entry].behind;
}

Nanos Foresight::nominal(std::size_t pipeline, std::int64_t number) const {
  const BudgetPlan::Arrivals& arrivals = plan_.pipelines[pipeline];
  return arrivals.offset + Nanos(std::llround(nominal_ns(*arrivals.rate_hz, number)));
}

/// When the next firing should have come.
Nanos Foresight::missing(std::size_t pipeline) const {
  return nominal(pipeline, streams_[pipeline].next) + plan_.pipelines[pipeline].jitter + kGrace +
         Nanos(1);
}

/// Firings that should have come are not waited for.
void Foresight::skip_missing(std::size_t pipeline, Nanos now) {
  Stream& stream = streams_[pipeline];
  while (comes(pipeline) && missing(pipeline) <= now) {
    ++stream.next;
    ++stream.missed;
  }
}

/// When the @p place-th of the firings that come fires, at the earliest. Absent: no such comes.
std::optional<Nanos> Foresight::coming(std::size_t pipeline, std::size_t place, Nanos now) const {
  if (!comes(pipeline)) return std::nullopt;
  const std::int64_t number = streams_[pipeline].next + static_cast<std::int64_t>(place);
  return std::max(now, nominal(pipeline, number));
}

/// How many of the task's calls a server of the unit surely serves in the time of one, as where
/// they are elsewhere for most of it: capacities are rounded up.
int Foresight::calls_at_once(const BudgetPlan::Task& task, UnitId unit) const {
  const int most = task.at_once.empty() ? task.capacity[unit]
                                        : std::min(task.capacity[unit], task.at_once[unit]);
  const int calls = std::max(most, 1) - 1;
  const int servers = servers_.empty() ? 1 : servers_[unit];
  return calls / 2 < servers ? 1 : calls / servers;
}

/// Of a call, the time in which the unit is there for others; a program is loaded on the unit.
Nanos Foresight::elsewhere(const BudgetPlan::Task& task, UnitId unit) const {
  const int calls = calls_at_once(task, unit);
  return calls == 1 ? Nanos::zero() : task.worst[unit] - task.worst[unit] / calls;
}

/// Of those that wait, and then of firings that come.
std::optional<Foresight::Demand> Foresight::demand(std::uint32_t entry, UnitId unit,
                                                   std::size_t place, Nanos now) const {
  const BudgetPlan::Task& task = plan_.tasks[entry];
  const Nanos behind = task.behind + elsewhere(task, unit);
  const std::size_t waiting = std::min(waiting_[entry].size(), kLooksAt);
  // That it may have to wait for what it comes after is left out: it would be needed no earlier.
  if (place < waiting) return Demand{waiting_[entry][place] - behind, now, entry, place};
  const auto at = coming(task.pipeline, place - waiting, now);
  if (!at) return std::nullopt;
  return Demand{*at + *plan_.pipelines[task.pipeline].deadline - behind, *at, entry, place};
}

/// What is ready then and needs the unit for so long. @return  From its begin to its end.
Foresight::Span Foresight::Timeline::serve(Nanos ready, Nanos needs) {
  std::optional<Nanos> begun;
  for (auto at = std::ranges::upper_bound(idle, ready, {}, &Span::second); at != idle.end(); ++at) {
    const auto [from, to] = *at;
    if (from == to) continue;
    const Nanos begin = std::max(from, ready);
    const Nanos end = std::min(to, begin + needs);
    if (!begun) begun = begin;
    needs -= end - begin;
    at->first = end;
    if (from < begin) at = std::next(idle.insert(at, {from, begin}));
    if (needs == Nanos::zero()) return {*begun, end};
  }
  const Nanos begin = std::max(free, ready);
  if (free < begin) idle.emplace_back(free, begin);
  free = begin + needs;
  return {begun.value_or(begin), free};
}

/// What may need the unit beside the task, which would have it until @p ends: the first of each
/// entry. @return  When a firing that should have come by then is missing.
Nanos Foresight::first_demands(std::uint32_t entry, UnitId unit, Nanos now, Nanos ends) {
  const auto& state = plan_.tasks[entry].state;
  demands_.clear();
  Nanos ask_again = Nanos::max();
  for (const std::uint32_t each : on_[unit]) {
    // What shares a state with the task comes behind it, and cannot be late for want of the unit.
    if (each != entry && state && plan_.tasks[each].state == state) continue;
    const std::size_t pipeline = plan_.tasks[each].pipeline;
    if (comes(pipeline) && nominal(pipeline, streams_[pipeline].next) < ends) {
      ask_again = std::min(ask_again, missing(pipeline));
    }
    // Of its own the most urgent is the one that asks.
    const std::size_t own = each == entry && !waiting_[each].empty() ? 1 : 0;
    if (const auto first = demand(each, unit, own, now)) demands_.push_back(*first);
  }
  std::ranges::make_heap(demands_, kLater);
  return ask_again;
}

std::optional<Nanos> Foresight::conflict(std::uint32_t entry, UnitId unit, Nanos now) {
  if (on_[unit].empty()) return std::nullopt;
  const BudgetPlan::Task& asking = plan_.tasks[entry];
  for (std::size_t p = 0; p < streams_.size(); ++p) skip_missing(p, now);
  if (!plan_.pipelines[asking.pipeline].is_periodic()) {
    if (const auto again = breaks_guarantee(asking, unit, now)) return again;
  }
  const int at_once = calls_at_once(asking, unit);
  const Nanos takes = asking.takes(unit) - elsewhere(asking, unit);
  Nanos own_end = latest_end(entry);
  if (own_end != Nanos::max()) own_end -= elsewhere(asking, unit);
  // What can be left goes on while nothing more urgent is there, and holds the unit for a slice.
  const bool sliced = asking.can_be_suspended(unit);
  const Nanos slice = asking.slice_on(unit) / at_once;
  Nanos ask_again{0};
  Nanos urgent{0};
  Nanos left_out{0};  // When the first of the demands that were left out is ready.
  Nanos busy = now;   // Until then the unit is at least, with the task and what it puts off.
  bool late = false;
  int may_look = kMostDemands;
  do {
    ask_again = first_demands(entry, unit, now, now + takes);
    without_.free = now;
    behind_.free = now + (sliced ? slice + asking.prepare[unit] : takes);
    without_.idle.clear();
    behind_.idle.clear();
    Nanos ends = now + takes;  // The task, which what is let in puts off.
    urgent = Nanos::zero();
    left_out = Nanos::max();
    for (; may_look > 0 && !demands_.empty(); --may_look) {
      std::ranges::pop_heap(demands_, kLater);
      const Demand each = demands_.back();
      demands_.pop_back();
      if (each.latest_end >= own_end) break;
      if (each.ready >= std::max({ends, behind_.free, busy})) {
        left_out = std::min(left_out, each.ready);  // Later ones do not meet the task, either.
        continue;
      }
      if (const auto next = demand(each.entry, unit, each.place + 1, now)) {
        demands_.push_back(*next);
        std::ranges::push_heap(demands_, kLater);
      }
      const BudgetPlan::Task& other = plan_.tasks[each.entry];
      const Nanos needs = other.takes(unit) - elsewhere(other, unit);
      const Nanos end = without_.serve(each.ready, needs).second;
      // One that comes while the task has the unit waits for the end of a slice; one of the same
      // program, which no call lets in, for that of the task.
      const bool let_in = sliced && other.context[unit] != asking.context[unit];
      const bool meets = let_in && each.ready > now && each.ready < ends;
      const Nanos left = meets ? std::min(each.ready + slice, ends) : each.ready;
      const auto [begin, end_behind] = behind_.serve(let_in ? left : std::max(left, ends), needs);
      if (begin < ends) ends += needs;
      urgent += needs;
      if (end_behind > each.latest_end && end <= each.latest_end) {
        late = true;
        if (own_end == Nanos::max()) break;
      }
    }
    busy = std::max(ends, behind_.free);
    // What was left out comes before less urgent ones that are put off so far: again, with it.
  } while (!late && left_out < busy && may_look > 0);
  if (!late) return std::nullopt;
  if (own_end != Nanos::max()) {
    const Nanos latest_start = own_end - takes - urgent;
    if (latest_start <= now) return std::nullopt;
    ask_again = std::min(ask_again, latest_start);
  }
  return ask_again;
}

/// What other tasks with a deadline than those of @p entry need of the unit that may fire before
/// @p until.
Nanos Foresight::needed_beside(std::uint32_t entry, UnitId unit, Nanos now, Nanos until) const {
  Nanos sum{0};
  for (const std::uint32_t each : on_[unit]) {
    if (each == entry) continue;
    const BudgetPlan::Task& task = plan_.tasks[each];
    auto calls = static_cast<std::int64_t>(waiting_[each].size());
    if (const auto first = coming(task.pipeline, 0, now); first && *first < until) {
      const double period_s = 1 / *plan_.pipelines[task.pipeline].rate_hz;
      calls += 1 + static_cast<std::int64_t>(to_s(until - *first) / period_s);
    }
    sum += calls * task.takes(unit);
  }
  return sum;
}

/// Whether a call of what has no rate or no deadline would hold the unit longer than guarantees
/// count on. @return  If so, when it is worth asking again.
///
/// A guaranteed task bears to wait for one of its slices, or the call has to have ended by when
/// that task has to have the unit. What comes before it, as late as it may, may be let in and puts
/// that end off; the task itself, and what comes behind it, does not.
std::optional<Nanos> Foresight::breaks_guarantee(const BudgetPlan::Task& asking, UnitId unit,
                                                 Nanos now) const {
  constexpr std::size_t kMostFirings = 50;
  const bool sliced = asking.can_be_suspended(unit);
  const Nanos alone = now + asking.takes(unit);
  bool breaks = false;
  Nanos again = Nanos::max();
  for (const std::uint32_t each : on_[unit]) {
    const BudgetPlan::Task& task = plan_.tasks[each];
    if (!task.tolerates || (sliced && asking.holds(unit) <= *task.tolerates)) continue;
    const BudgetPlan::Arrivals& arrivals = plan_.pipelines[task.pipeline];
    const auto& waiting = waiting_[each];
    if (waiting.empty() && comes(task.pipeline)) again = std::min(again, missing(task.pipeline));
    for (std::size_t place = 0; !breaks && place < kMostFirings; ++place) {
      const auto fires = place < waiting.size()
                             ? std::optional(waiting[place] - *arrivals.deadline)
                             : coming(task.pipeline, place - waiting.size(), now);
      if (!fires) break;
      Nanos ends = alone;
      if (sliced) {
        const Nanos late = arrivals.jitter + task.ready + Nanos(1);
        ends += needed_beside(each, unit, now, *fires + late) +
                static_cast<std::int64_t>(place) * task.takes(unit);
      }
      if (*fires >= ends) break;
      breaks = ends > *fires + task.ready + *task.tolerates;
    }
  }
  return breaks ? std::optional(again) : std::nullopt;
}

}  // namespace pirt
