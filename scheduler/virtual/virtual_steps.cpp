// What a step takes where that is not always the same: what is drawn, what other calls do to it,
// and data that is on its way.
#include <algorithm>
#include <optional>
#include <utility>

#include "scheduler/services/transfers.h"
#include "scheduler/virtual/virtual_time.h"
#include "workloads/base/math/random.h"

namespace pirt {

/// Data sets out to the unit when its predecessor completes; other transfers do not hold it up. A
/// state moves when who holds it next is known, which is now.
Nanos VirtualTime::data_arrival(JobIndex index) {
  const Job& job = jobs_[index];
  const TaskPlan& plan = plans_[job.plan];
  Nanos arrival = now_;
  const auto moves = [&](const GraphEdge& edge, UnitId from, Nanos at, Nanos wait) {
    const bool leaves = !edge.leave.empty() && edge.leave[from] > Nanos::zero();
    if (leaves) send(from, edge.size_bytes, at, wait);
    if (!edge.enter.empty() && edge.enter[job.unit] > Nanos::zero()) {
      send(job.unit, edge.size_bytes, leaves ? at + edge.leave[from] : at, wait);
    }
  };
  for (const GraphEdge& edge : plan.edges) {
    const Firings::Made& made =
        edge.earlier ? firings_.made_earlier(index, edge.from) : firings_.made(index, edge.from);
    arrival = std::max(arrival, made.at + edge.transfer(made.unit, job.unit));
    if (made.unit != job.unit) moves(edge, made.unit, made.at, arrival - now_);
  }
  if (!plan.state) return arrival;
  const std::optional<UnitId> from = std::exchange(state_units_[*plan.state], job.unit);
  if (!from || *from == job.unit) return arrival;
  const Nanos wait = plan.state_edge.transfer(*from, job.unit);
  moves(plan.state_edge, *from, now_, wait);
  return std::max(arrival, now_ + wait);
}

/// The unit's link is busy with it; what of that is after the end does not count.
/// @param wait  From now until all of it is there. A run learns only now where the data goes, which
/// may have been on its way before: who follows hears of its joules from now on, spread over what
/// is left of that time, before the call that needs it.
void VirtualTime::send(UnitId unit, std::int64_t size_bytes, Nanos from, Nanos wait) {
  const Link& link = *link_of(scenario_.platform, unit);
  const Nanos takes = sending_time(link, size_bytes);
  tally_.units[unit].transferring += std::clamp(firings_.end() - from, Nanos::zero(), takes);
  if (observers_.empty() || link.active_w == 0 || takes == Nanos::zero()) return;
  constexpr Nanos kShortest = std::chrono::microseconds(100);
  const Nanos spread = std::clamp(wait, std::min(takes, kShortest), takes);
  draw_for(servers_of_link(scenario_.platform, unit), link.active_w * (to_s(takes) / to_s(spread)),
           spread);
}

/// Who follows hears that so much is drawn beside what servers do, for a time.
void VirtualTime::draw_for(std::size_t servers, double watts, Nanos time) {
  tell(&RunObserver::drawing, servers, watts);
  const Slot slot = draws_.take();
  draws_[slot] = {servers, watts};
  add_timer(now_ + time, TimerKind::kDrawn, slot);
}

/// Sets what the step takes, where that is not always the same.
void VirtualTime::measure(JobIndex index, const CallStep& step) {
  Job& job = jobs_[index];
  const bool constant = step.time.kind == Distribution::Kind::kConstant;
  Nanos unscaled = constant ? step.time.low : step.time.draw(random(index));
  job.takes = constant ? step.scaled : scaled(unscaled, step.scale);
  job.powered = step.powered(unscaled);
  // A call that can be suspended has its unit to itself: its server begins with it at once.
  if (step.slices != nullptr) add_effects(index, step);
  if (step.servers == job.unit && step.conditions == nullptr) {
    job.takes += std::exchange(job.handover, Nanos::zero());
  }
  job.own_w = step.own_w(job.takes);
  if (step.own_j == 0 || job.takes > Nanos::zero()) return;
  // Joules of what takes no time are drawn at once.
  tally_.units[job.unit].own_j += step.own_j;
  if (!observers_.empty()) draw_for(job.unit, step.own_j / to_s(Nanos(1)), Nanos(1));
}

Nanos VirtualTime::begins(JobId index, Nanos work) {
  const CallStep& step = step_of(jobs_[index]);
  if (step.conditions == nullptr || step.slices != nullptr) return work;
  add_effects(index, step);
  Job& job = jobs_[index];
  if (!observers_.empty()) {  // It may have waited, and have been told of as it was then.
    job.told_w = power_w(job, step);
    tell(&RunObserver::draws, step.servers, index, job.told_w);
  }
  return job.takes;
}

/// While a server works on the step. A scaled stage draws less for longer, and so does one with a
/// hand-over: its energy stays.
double VirtualTime::power_w(const Job& job, const CallStep& step) const {
  if (!call_effects_.any()) return step.watts * step.energy_scale / step.scale + job.own_w;
  if (job.takes <= Nanos::zero()) return 0;
  return step.watts * (to_s(job.powered) / to_s(job.takes)) + job.own_w;
}

/// A server begins with the step, which takes what else happened, too; others that it slows end
/// later from now on.
void VirtualTime::add_effects(JobIndex index, const CallStep& step) {
  Job& job = jobs_[index];
  if (step.conditions == nullptr) return;
  const CallEffects::Execution execution{index,     job.unit,        workload_of(job),
                                         job.takes, step.conditions, step.scale};
  const Nanos longer = call_effects_.executes(execution, now_, hash_u64(random(index), 2));
  job.powered += scaled(longer - job.takes, step.energy_scale / step.scale);
  job.takes = longer + std::exchange(job.handover, Nanos::zero());
  if (execution.steady > Nanos::zero()) job.own_w = step.own_w(job.takes);
  lengthen_slowed();
}

/// What call_effects_ said of others. What follows the slice that is served becomes longer by its
/// part. A call's own joules stay what they are, so that the rest of them is drawn more slowly.
void VirtualTime::lengthen_slowed() {
  for (const auto& [other, unit, by] : call_effects_.slowed()) {
    Job& job = jobs_[other];
    const CallStep& step = step_of(job);
    const Nanos behind = step.slices != nullptr ? job.rest : Nanos::zero();
    Nanos here = by;
    if (behind > Nanos::zero()) {  // Such a unit has one server, which is the call's.
      const double left_s = to_s(servers_[unit]->next().time - now_);
      here = scaled(by, left_s / (left_s + to_s(behind)));
    }
    const std::optional<Nanos> left = servers_[unit]->lengthen(other, here, now_);
    if (!left) continue;
    const double longer = 1 + to_s(by) / to_s(*left + behind);
    const double less_w = job.own_w * (1 - 1 / longer);
    tally_.units[job.unit].own_j += less_w * to_s(job.takes - *left);
    job.own_w -= less_w;
    if (!observers_.empty() && *left + here > Nanos::zero()) {
      const double more_j = step.watts * (step.energy_scale / step.scale) * to_s(here);
      job.told_w = (job.told_w * to_s(*left) + more_j) / to_s(*left + here);
      tell(&RunObserver::draws, unit, other, job.told_w);
    }
    job.takes += here;
    job.powered += scaled(here, step.energy_scale / step.scale);
    if (behind > Nanos::zero()) {
      job.rest += by - here;
      job.whole = scaled(job.whole, longer);
      job.whole_powered = scaled(job.whole_powered, longer);
    }
    note_next(unit);
  }
}

/// A pure function of seed, pipeline, firing, task and step, so that two policies meet the same
/// luck.
std::uint64_t VirtualTime::random(JobIndex job) const {
  const Firings::TaskPlace& place = firings_.place(job);
  const std::uint64_t stream = hash_u64(hash_u64(seeds_[place.pipeline], place.firing), place.task);
  const Job& its = jobs_[job];
  const std::size_t first = first_steps_[its.plan * scenario_.platform.units.size() + its.unit];
  return hash_u64(stream, its.step - first);
}

}  // namespace pirt
