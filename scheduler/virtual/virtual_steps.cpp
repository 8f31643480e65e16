// What a step takes where that is not always the same: what is drawn, what other calls do to it,
// and data that is on its way.
#include <algorithm>
#include <utility>

#include "scheduler/services/transfers.h"
#include "scheduler/virtual/job.h"
#include "scheduler/virtual/virtual_time.h"
#include "workloads/base/math/random.h"

namespace pirt {

/// Data sets out to the unit when its predecessor completes; other transfers do not hold it up. A
/// state moves when who holds it next is known, which is now.
Nanos VirtualTime::data_arrival(JobIndex index) {
  const Job& job = jobs_[index];
  const TaskPlan& plan = plans_[job.plan];
  Nanos arrival = now_;
  for (const auto& [edge, size_bytes, earlier] : plan.edges) {
    const Firings::Made& made =
        earlier ? firings_.made_earlier(index, edge.from) : firings_.made(index, edge.from);
    arrival = std::max(arrival, made.at + edge.transfer(made.unit, job.unit));
    if (made.unit == job.unit) continue;
    const bool leaves = !edge.leave.empty() && edge.leave[made.unit] > Nanos::zero();
    if (leaves) send(made.unit, size_bytes, made.at);
    if (!edge.enter.empty() && edge.enter[job.unit] > Nanos::zero()) {
      send(job.unit, size_bytes, leaves ? made.at + edge.leave[made.unit] : made.at);
    }
  }
  if (!plan.state) return arrival;
  const std::optional<UnitId> from = std::exchange(state_units_[*plan.state], job.unit);
  if (!from || *from == job.unit) return arrival;
  Nanos moved = now_;
  for (const UnitId end : {*from, job.unit}) {
    const Link* link = link_of(scenario_.platform, end);
    if (link == nullptr) continue;
    const std::int64_t size_bytes = scenario_.mix.states[*plan.state].size_bytes;
    send(end, size_bytes, moved);
    moved += sending_time(*link, size_bytes) + link->latency.mean();
  }
  return std::max(arrival, moved);
}

/// The unit's link is busy with it; what of that is after the end does not count.
void VirtualTime::send(UnitId unit, std::int64_t size_bytes, Nanos from) {
  const Nanos takes = sending_time(*link_of(scenario_.platform, unit), size_bytes);
  books_.charge_link(unit, std::clamp(firings_.end() - from, Nanos::zero(), takes));
}

/// Sets what the step takes, where that is not always the same.
void VirtualTime::measure(JobIndex index, const TaskStep& step) {
  Job& job = jobs_[index];
  const bool constant = step.time.kind == Distribution::Kind::kConstant;
  Nanos unscaled = constant ? step.time.low : step.time.draw(random(index));
  job.takes = constant ? step.scaled : scaled(unscaled, step.scale);
  if (step.servers == job.unit) {
    const Nanos longer = with_effects(index, step, job.takes);
    unscaled += longer - job.takes;
    job.takes = longer + std::exchange(job.handover, Nanos::zero());
  }
  job.powered = step.powered(unscaled);
}

/// While a server works on the step. A scaled stage draws less for longer: its energy stays.
double VirtualTime::power_w(const Job& job, const TaskStep& step) const {
  if (step.servers < scenario_.platform.units.size()) {
    return scenario_.platform.units[step.servers].active_w * step.energy_scale / step.scale;
  }
  return scenario_.platform.links.at(scenario_.platform.units[job.unit].link).active_w;
}

/// What the step takes by what else happened; others that it slows end later from now on.
Nanos VirtualTime::with_effects(JobIndex job, const TaskStep& step, Nanos takes) {
  if (step.conditions == nullptr) return takes;
  const CallEffects::Execution execution{job, jobs_[job].unit, workload_of(jobs_[job]), takes};
  slowed_.clear();
  const Nanos longer =
      call_effects_.executes(execution, *step.conditions, now_, hash_u64(random(job), 2), slowed_);
  for (const auto& [other, unit, by] : slowed_) {
    jobs_[other].takes += by;
    jobs_[other].powered += scaled(by, step_of(jobs_[other]).energy_scale);
    servers_[unit]->lengthen(other, by);
    note_next(unit);
  }
  return longer;
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
