#include "scheduler/policies/foresight.h"

#include <algorithm>
#include <cmath>

namespace pirt {
namespace {

constexpr std::int64_t kEnded = 2;                      ///< Firings in a row that did not come.
constexpr Nanos kGrace = std::chrono::milliseconds(1);  ///< That a clock may be late.
constexpr std::size_t kLooksAt = 8;  ///< Waiting tasks of one entry; more are late anyway.

/// As Firings::due has it.
Nanos nominal(const BudgetPlan::Arrivals& arrivals, std::int64_t number) {
  return arrivals.offset +
         Nanos(std::llround(static_cast<double>(number) * 1e9 / *arrivals.rate_hz));
}

}  // namespace

Foresight::Foresight(const BudgetPlan& plan)
    : plan_(plan),
      waiting_(plan.tasks.size()),
      is_urgent_(plan.tasks.size(), false),
      streams_(plan.pipelines.size()),
      missed_(plan.pipelines.size(), 0) {
  for (std::uint32_t entry = 0; entry < plan.tasks.size(); ++entry) {
    const std::uint32_t pipeline = plan.tasks[entry].pipeline;
    streams_[pipeline].entries.push_back(entry);
    is_urgent_[entry] = plan.pipelines[pipeline].deadline.has_value();
    if (is_urgent_[entry]) urgent_.push_back(entry);
  }
}

void Foresight::submitted(const Task& task) {
  const std::uint32_t entry = task.kind.entry;
  if (!task.deadline) return;
  came_back(entry, *task.deadline);
  if (!is_urgent_[entry]) urgent_.push_back(entry);
  is_urgent_[entry] = true;
  const BudgetPlan::Task& planned = plan_.tasks[entry];
  const BudgetPlan::Arrivals& arrivals = plan_.pipelines[planned.pipeline];
  if (!planned.first || !arrivals.rate_hz || !arrivals.deadline) return;
  const Nanos since = *task.deadline - *arrivals.deadline - arrivals.offset;
  // A firing is at its nominal time or after it, which was rounded to a nanosecond.
  const double number = std::floor((to_s(since) + 1e-9) * *arrivals.rate_hz + 1e-9);
  Stream& stream = streams_[planned.pipeline];
  stream.next = std::max(stream.next, static_cast<std::int64_t>(number) + 1);
  missed_[planned.pipeline] = 0;
}

void Foresight::came_back(std::uint32_t entry, Nanos deadline) {
  auto& waiting = waiting_[entry];
  if (deadline == Nanos::max()) return;
  waiting.insert(std::ranges::upper_bound(waiting, deadline), deadline);
}

void Foresight::left(std::uint32_t entry, Nanos deadline) {
  auto& waiting = waiting_[entry];
  const auto it = std::ranges::lower_bound(waiting, deadline);
  if (it != waiting.end() && *it == deadline) waiting.erase(it);
}

Nanos Foresight::latest_end(std::uint32_t entry) const {
  if (waiting_[entry].empty()) return Nanos::max();
  return waiting_[entry].front() - plan_.tasks[entry].behind;
}

UnitId Foresight::unit_of(std::uint32_t entry, UnitMask up) const {
  const auto& units = plan_.tasks[entry].units;
  const auto first = std::ranges::find_if(units, [up](UnitId unit) { return contains(up, unit); });
  return first == units.end() ? units.front() : *first;
}

/// Firings that should have come are not waited for.
void Foresight::skip_missing(std::size_t pipeline, Nanos now) {
  const BudgetPlan::Arrivals& arrivals = plan_.pipelines[pipeline];
  Stream& stream = streams_[pipeline];
  while (missed_[pipeline] < kEnded &&
         nominal(arrivals, stream.next) + arrivals.jitter + kGrace < now) {
    ++stream.next;
    ++missed_[pipeline];
  }
}

/// Adds what firings before @p until need of the unit. @return when the first of them is missing.
Nanos Foresight::foresee(std::size_t pipeline, UnitId unit, UnitMask up, Nanos now, Nanos until) {
  const BudgetPlan::Arrivals& arrivals = plan_.pipelines[pipeline];
  if (!arrivals.rate_hz || !arrivals.deadline) return Nanos::max();
  skip_missing(pipeline, now);
  if (missed_[pipeline] >= kEnded) return Nanos::max();
  Nanos missing = Nanos::max();
  for (std::int64_t number = streams_[pipeline].next;; ++number) {
    const Nanos at = std::max(now, nominal(arrivals, number));
    if (at >= until) break;
    for (const std::uint32_t entry : streams_[pipeline].entries) {
      if (unit_of(entry, up) != unit) continue;
      const BudgetPlan::Task& task = plan_.tasks[entry];
      demands_.push_back({.latest_end = at + *arrivals.deadline - task.behind,
                          .ready = at,
                          .takes = task.worst[unit] + task.prepare[unit]});
      missing = std::min(missing, nominal(arrivals, number) + arrivals.jitter + kGrace + Nanos(1));
    }
  }
  return missing;
}

/// Adds what was submitted and has not been placed. That it may have to wait for what it comes
/// after is left out: it would be needed no earlier.
void Foresight::add_waiting(std::uint32_t asking, UnitId unit, UnitMask up, Nanos now) {
  for (const std::uint32_t entry : urgent_) {
    if (unit_of(entry, up) != unit) continue;
    const BudgetPlan::Task& task = plan_.tasks[entry];
    const auto& waiting = waiting_[entry];
    const std::size_t most = std::min(waiting.size(), kLooksAt);
    for (std::size_t i = entry == asking ? 1 : 0; i < most; ++i) {
      demands_.push_back({.latest_end = waiting[i] - task.behind,
                          .ready = now,
                          .takes = task.worst[unit] + task.prepare[unit]});
    }
  }
}

std::optional<Foresight::Conflict> Foresight::conflict(std::uint32_t entry, UnitId unit,
                                                       UnitMask up, Nanos now) {
  if (urgent_.empty()) return std::nullopt;
  const BudgetPlan::Task& asking = plan_.tasks[entry];
  const Nanos takes = asking.worst[unit] + asking.prepare[unit];
  const Nanos own_end = latest_end(entry);
  demands_.clear();
  Nanos ask_again = Nanos::max();
  for (std::size_t p = 0; p < streams_.size(); ++p) {
    ask_again = std::min(ask_again, foresee(p, unit, up, now, now + takes));
  }
  add_waiting(entry, unit, up, now);
  std::erase_if(demands_, [own_end](const Demand& each) { return each.latest_end >= own_end; });
  std::ranges::stable_sort(demands_, {}, &Demand::latest_end);
  // What can be left goes on while nothing more urgent is there, and holds the unit for a slice.
  const bool sliced = asking.can_be_left(unit);
  const Nanos slice = asking.slice_on(unit);
  Nanos free = now;  // Without the task, and behind it, or what it holds the unit for.
  Nanos free_behind = now + (sliced ? slice + asking.prepare[unit] : takes);
  Nanos urgent{0};
  bool late = false;
  for (const Demand& each : demands_) {
    free = std::max(free, each.ready) + each.takes;
    if (sliced && each.ready > free_behind) free_behind = each.ready + slice;
    free_behind = std::max(free_behind, each.ready) + each.takes;
    urgent += each.takes;
    late = late || (free_behind > each.latest_end && free <= each.latest_end);
  }
  if (!late) return std::nullopt;
  if (own_end != Nanos::max()) {
    const Nanos latest_start = own_end - takes - urgent;
    if (latest_start <= now) return std::nullopt;
    ask_again = std::min(ask_again, latest_start);
  }
  return Conflict{ask_again};
}

}  // namespace pirt
