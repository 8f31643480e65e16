// What becomes of calls that are suspended between two slices, or wanted back before they have
// ended.
#include <algorithm>
#include <functional>
#include <utility>

#include "scheduler/virtual/virtual_time.h"
#include "workloads/base/contract.h"
#include "workloads/base/math/random.h"

namespace pirt {

bool VirtualTime::slice_ended(JobIndex index, Nanos now) {
  catch_up(now);
  Job& job = jobs_[index];
  must(dispatcher_.slice_ended(job.unit, job.id, now_, effects_));
  const bool suspends = !effects_.suspended.empty();
  if (suspends) suspend(index);
  settle();
  return !suspends;
}

/// Of a modelled task.
void VirtualTime::end_slice(JobIndex index) {
  const Job& job = jobs_[index];
  must(dispatcher_.slice_ended(job.unit, job.id, now_, effects_));
  if (effects_.suspended.empty()) return go_on(index);
  suspend(index);
}

void VirtualTime::suspend(JobIndex index) {
  Job& job = jobs_[index];
  job.suspended = true;
  job.suspended_at = now_;
  if (is_computed(job)) {
    tell(&RunObserver::departed, job.unit, index);
  } else if (call_effects_.any()) {
    job.effects = step_of(job).conditions != nullptr ? call_effects_.suspend(job.unit, now_)
                                                     : CallEffects::Rest{};
  }
}

/// Between two slices, whether it was suspended there or not.
void VirtualTime::go_on(JobIndex index) {
  Job& job = jobs_[index];
  const bool was_suspended = std::exchange(job.suspended, false);
  if (was_suspended) job.paused += now_ - job.suspended_at;
  if (is_computed(job)) {
    note_arrival(index);
    return executor_->resume(index, job.unit);
  }
  const CallStep& step = step_of(job);
  Nanos passes{0};
  if (was_suspended && call_effects_.any()) {
    const auto resumed = call_effects_.resume(
        job.unit, job.effects, now_, hash_u64(random(index), 4 + std::uint64_t{job.slice}));
    passes = resumed.passes;
    job.whole = scaled(job.whole, resumed.part);
    job.whole_powered = scaled(job.whole_powered, resumed.part);
    job.rest = scaled(job.rest, resumed.part);
    lengthen_slowed();
  }
  cut(job, step, passes);
  work_on(index, step);
}

/// The next slice is what it takes, with what passes before that; of a new step, the first.
void VirtualTime::cut(Job& job, const CallStep& step, Nanos passes) const {
  const double share = (*step.slices)[job.slice];
  const bool last = ++job.slice == step.slices->size();
  job.takes = last ? job.rest : std::min(job.rest, scaled(job.whole, share));
  job.rest -= job.takes;
  const double part = job.whole > Nanos::zero() ? to_s(job.takes) / to_s(job.whole) : 0;
  job.powered = scaled(job.whole_powered, part);
  job.takes += passes;
  job.own_w = part * step.own_w(job.takes);
}

/// The task does not go on where it is, and is placed anew.
void VirtualTime::take_back(const Recalled& recalled) {
  const JobIndex index = Firings::job_of(recalled.task);
  Job& job = jobs_[index];
  if (is_computed(job)) return executor_->recall(index, recalled.unit);
  const CallStep& step = step_of(job);
  if (!step.for_data && step.servers != CallStep::kDelay) {
    charge_served(tally_, job, servers_[step.servers]->remove(index, now_).value());
    note_next(step.servers);
    tell(&RunObserver::departed, step.servers, index);
  } else {
    const auto timer = std::ranges::find_if(timers_, [index](const Timer& each) {
      return each.kind == TimerKind::kDelay && each.index == index;
    });
    expect(timer != timers_.end(), "a call that is wanted back is nowhere");
    charge_delay(index, job.takes - (timer->moment.time - now_));
    timers_.erase(timer);
    std::ranges::make_heap(timers_, std::greater{});
  }
  complete(index, Outcome::kReturned, now_ - job.started_at - job.paused, nullptr);
}

}  // namespace pirt
