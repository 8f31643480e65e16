#include "scheduler/virtual/virtual_time.h"

#include <algorithm>
#include <cassert>
#include <functional>
#include <iterator>
#include <utility>

#include "characterize/platform/elsewhere.h"
#include "workloads/base/error.h"
#include "workloads/base/math/random.h"

namespace pirt {
namespace {

/// 64 bits of nanoseconds are 292 years, and times are added up.
constexpr Nanos kLongestRun = std::chrono::years(20);

}  // namespace

VirtualTime::VirtualTime(const Scenario& scenario, Dispatcher& dispatcher,
                         std::vector<RunObserver*> observers, Executor* executor, UnitMask computed)
    : scenario_(scenario),
      observers_(std::move(observers)),
      dispatcher_(dispatcher),
      executor_(executor),
      computed_(computed),
      firings_(scenario, executor != nullptr),
      completions_(scenario.platform.units.size() + scenario.platform.links.size()),
      call_effects_(scenario) {
  const std::size_t units = scenario.platform.units.size();
  tally_.units.resize(units);
  computing_.resize(units);
  tally_.calls.assign(scenario.services.workloads.size(), std::vector<Histogram>(units));
  Servers::Begins begins_job;
  if (call_effects_.any()) {
    begins_job = [this](JobId job, Nanos work) { return begins(job, work); };
  }
  for (const auto& unit : scenario.platform.units) {
    servers_.push_back(make_servers(unit.servers, unit.discipline, begins_job));
  }
  for (std::size_t i = 0; i < scenario.platform.links.size(); ++i) {
    servers_.push_back(make_servers(1, Discipline::kFifo));
  }
  for (std::size_t p = 0; p < scenario.mix.pipelines.size(); ++p) {
    first_plans_.push_back(static_cast<std::uint32_t>(plans_.size()));
    std::ranges::move(plan_tasks(scenario, p), std::back_inserter(plans_));
    seeds_.push_back(derive_seed(scenario.seed, scenario.mix.pipelines[p].name));
    templates_.push_back(dispatcher.add_template(firings_.tasks(static_cast<std::uint32_t>(p))));
  }
  lay_out_steps();
  for (UnitId unit = 0; unit < units; ++unit) contexts_.push_back(first_context(unit));
  state_units_.resize(scenario.mix.states.size());
}

void VirtualTime::lay_out_steps() {
  for (const TaskPlan& plan : plans_) {
    for (UnitId unit = 0; unit < plan.calls.size(); ++unit) {
      first_steps_.push_back(static_cast<std::uint32_t>(steps_.size()));
      for (const CallStep& step : plan.calls[unit].steps) {
        const bool same = step.time.kind == Distribution::Kind::kConstant;
        const bool affected = step.servers == unit && call_effects_.any();
        steps_.push_back({.plan = &step,
                          .takes = step.scaled,
                          .powered = same ? step.powered(step.time.low) : Nanos::zero(),
                          .own_w = step.own_w(step.scaled),
                          .constant = same && !step.prepares && !step.for_data && !affected &&
                                      (step.own_j == 0 || step.scaled > Nanos::zero())});
      }
      for (std::size_t i = first_steps_.back(); i + 1 < steps_.size(); ++i) {
        const CallStep& step = *steps_[i].plan;
        const CallStep& next = *steps_[i + 1].plan;
        steps_[i].goes_on = steps_[i + 1].constant && step.servers == next.servers &&
                            step.servers != CallStep::kDelay && step.slices == nullptr &&
                            next.slices == nullptr;
      }
      steps_.emplace_back();
    }
  }
}

Tally VirtualTime::run() {
  begin();
  while (advance()) continue;
  return finish();
}

Tally VirtualTime::finish() {
  if (!at_end_) {
    close_books(scenario_.mix.open_loop() ? firings_.end() : tally_.last_completion);
  }
  at_end_->last_completion = tally_.last_completion;
  at_end_->stalled = dispatcher_.counts().queued();
  return *std::move(at_end_);
}

/// What has been counted by now is what the run returns, with the served part of what is at the
/// servers: steps are charged as they depart.
void VirtualTime::close_books(Nanos end) {
  Tally tally = tally_;
  for (const auto& servers : servers_) {
    for (const auto& [index, remaining] : servers->remaining(end)) {
      charge_served(tally, jobs_[index], remaining);
    }
  }
  for (const Timer& timer : timers_) {
    if (timer.kind != TimerKind::kDelay || jobs_[timer.index].own_w == 0) continue;
    const Job& job = jobs_[timer.index];
    const Nanos passed = job.takes - (timer.moment.time - end);
    tally.units[job.unit].own_j += job.own_w * to_s(std::max(passed, Nanos::zero()));
  }
  for (const auto& of_unit : computing_) {
    for (const JobIndex index : of_unit) {
      const Job& job = jobs_[index];
      if (job.waits || job.started_at >= end) continue;
      const Nanos busy =
          (job.suspended ? std::min(job.suspended_at, end) : end) - job.started_at - job.paused;
      const bool draws = draws_in(scenario_.platform.units[job.unit], Phase::kExecute);
      charge_computed(tally, job, busy, draws ? busy : Nanos::zero(), false);
    }
  }
  tally.end = end;
  tally.tasks = dispatcher_.counts();
  tally.refused_tasks = firings_.refused_tasks();
  tally.pipelines = firings_.tallies();
  firings_.count_unfinished(tally.pipelines, end);
  for (JobIndex job = 0; job < jobs_.size(); ++job) {
    if (dispatcher_.state(jobs_[job].id) != TaskState::kRunning) continue;
    tally.pipelines[firings_.place(job).pipeline].ran = true;
  }
  at_end_ = std::move(tally);
}

WorkloadId VirtualTime::workload_of(const Job& job) const { return plans_[job.plan].workload; }

const Service& VirtualTime::service_of(const Job& job) const {
  return *scenario_.services.find(workload_of(job), job.unit);
}

const CallStep& VirtualTime::step_of(const Job& job) const { return *steps_[job.step].plan; }

void VirtualTime::begin() {
  for (std::uint32_t p = 0; p < scenario_.mix.pipelines.size(); ++p) {
    schedule_firing(p);
    for (std::int64_t i = 0; i < firings_.at_begin(p); ++i)
      add_timer(Nanos::zero(), TimerKind::kFires, p);
  }
}

Nanos VirtualTime::next() const {
  const Nanos timer = timers_.empty() ? Nanos::max() : timers_.front().moment.time;
  return std::min({dispatcher_.next_wake(), completions_.first().time, timer});
}

bool VirtualTime::advance(Nanos now) {
  const Moment& completion = completions_.first();
  const bool completes = timers_.empty() || completion < timers_.front().moment;
  const Nanos event = completes ? completion.time : timers_.front().moment.time;
  // At equal times completions come first: a task may start at its last moment.
  const Nanos wake = dispatcher_.next_wake();
  const bool wakes = wake < event;
  if (!wakes && event == Nanos::max()) return false;
  const Nanos at = wakes ? wake : event;
  const Nanos time = std::max(now_, at);
  if (time > kLongestRun) {
    throw_bad_input(
        "the run takes more than 20 years of virtual time; make its stages or its loops shorter");
  }
  // What was due before counts, however late the clock's driver is.
  if (at > firings_.end() && !at_end_) close_books(firings_.end());
  now_ = std::max(time, now);
  if (wakes) {
    dispatcher_.wake(now_, effects_);
  } else if (completes) {
    const std::size_t position = completions_.first_position();
    if (go_on_serving(position)) return true;
    const JobIndex index = servers_[position]->complete_next();
    note_next(position);
    Job& job = jobs_[index];
    const CallStep& step = step_of(job);
    charge(tally_, job, job.takes, job.powered);
    tell(&RunObserver::departed, step.servers, index);
    if (step.slices != nullptr && job.rest > Nanos::zero()) {
      end_slice(index);
    } else {
      ++job.step;
      begin_step(index);
    }
  } else {
    std::ranges::pop_heap(timers_, std::greater{});
    const Timer due = timers_.back();
    timers_.pop_back();
    switch (due.kind) {
      case TimerKind::kFires:
        fire(due.index, due.moment.time);
        break;
      case TimerKind::kDelay:
        charge_delay(due.index, jobs_[due.index].takes);
        ++jobs_[due.index].step;
        begin_step(due.index);
        break;
      case TimerKind::kDrawn:
        tell(&RunObserver::drawing, draws_[due.index].first, -draws_[due.index].second);
        draws_.give_back(due.index);
        break;
    }
  }
  settle();
  return true;
}

/// What most steps come to: the first task there goes on with its next one, which concerns nobody
/// else. False, and nothing has happened, where it is not so.
bool VirtualTime::go_on_serving(std::size_t servers) {
  Servers& its = *servers_[servers];
  const auto index = observers_.empty() ? its.unchallenged() : std::nullopt;
  if (!index) return false;
  Job& job = jobs_[*index];
  const Step& step = steps_[job.step];
  if (!step.goes_on) return false;
  charge(tally_, job, job.takes, job.powered);
  const Step& next = steps_[++job.step];
  job.takes = next.takes;
  job.powered = next.powered;
  job.own_w = next.own_w;
  its.go_on(next.takes, sequence_++);
  completions_.set(servers, its.next());
  return true;
}

/// All that was due by now has happened.
void VirtualTime::catch_up(Nanos now) {
  while (next() <= now) advance(now);
  now_ = std::max(now_, now);
  if (now_ > firings_.end() && !at_end_) close_books(firings_.end());
}

void VirtualTime::finished(JobIndex index, ComputedEnd end, Nanos now) {
  catch_up(now);
  Job& job = jobs_[index];
  std::vector<JobIndex>& there = computing_[job.unit];
  std::erase(there, index);
  if (!job.waits) {  // The unit begins with the next one.
    const auto next =
        std::ranges::find_if(there, [this](JobIndex each) { return jobs_[each].waits; });
    if (next != there.end()) {
      jobs_[*next].waits = false;
      jobs_[*next].started_at = now_;
    }
  }
  charge_computed(tally_, job, end.busy, end.powered.value_or(end.busy),
                  end.outcome == Outcome::kCompleted);
  if (end.preparing) {
    tally_.units[job.unit].preparing += *end.preparing;
    prepared(job, job.started_at, *end.preparing);
  }
  if (!std::exchange(job.suspended, false)) tell(&RunObserver::departed, job.unit, index);
  complete(index, end.outcome, end.busy, std::move(end.data));
  settle();
}

void VirtualTime::set_unit(UnitId unit, UnitState state, Nanos now) {
  catch_up(now);
  must(dispatcher_.set_unit(unit, state, now_, effects_));
  settle();
}

void VirtualTime::stop(Nanos now) {
  catch_up(now);
  firings_.stop(now_);
  if (!at_end_) close_books(now_);
  std::erase_if(timers_, [](const Timer& each) { return each.kind == TimerKind::kFires; });
  std::ranges::make_heap(timers_, std::greater{});
}

void VirtualTime::add_timer(Nanos at, TimerKind kind, std::uint32_t index) {
  timers_.push_back({{at, sequence_++}, kind, index});
  std::ranges::push_heap(timers_, std::greater{});
}

void VirtualTime::schedule_firing(std::uint32_t pipeline) {
  if (const auto at = firings_.due(pipeline)) add_timer(*at, TimerKind::kFires, pipeline);
}

/// @param due  When it was to; a driver with a clock may notice that later, and its firing's clock
/// runs from then all the same.
void VirtualTime::fire(std::uint32_t pipeline, Nanos due) {
  const auto tasks = firings_.fire(pipeline, due);
  schedule_firing(pipeline);
  if (!tasks) return;
  const auto firing = dispatcher_.submit(templates_[pipeline], *tasks, now_, effects_);
  must(firing.has_value());
  firings_.submitted(pipeline, *firing, effects_.submitted, due);
  for (const TaskId id : effects_.submitted) {
    const JobIndex job = Firings::job_of(id);
    const Firings::TaskPlace& place = firings_.place(job);
    if (job >= jobs_.size()) jobs_.resize(job + std::size_t{1});
    jobs_[job].begin(id, first_plans_[pipeline] + place.task);
    tell(&RunObserver::submitted, id, pipeline, place.task, place.firing);
  }
  effects_.submitted.clear();
}

/// Carries out what the dispatcher said, and what follows at the same moment.
void VirtualTime::settle() {
  if (!effects_.empty()) apply_starts();
  for (auto loop = firings_.next_loop(now_); loop != Firings::kNoLoop;
       loop = firings_.next_loop(now_)) {
    fire(loop, now_);
    apply_starts();
  }
  note_next(kNone);
  if (observers_.empty()) return;
  dispatcher_.list_waiting(waiting_);
  tell(&RunObserver::settled, now_, waiting_);
}

void VirtualTime::apply_starts() {
  // A step ends through an event only, even one that takes no time, so that effects_ does not grow
  // here.
  for (const Start& start : effects_.started) {
    const JobIndex index = Firings::job_of(start.task);
    Job& job = jobs_[index];
    assert(job.id == start.task);
    job.unit = start.unit;
    job.step = first_steps_[job.plan * scenario_.platform.units.size() + start.unit];
    job.dispatched_at = start.dispatched_at;
    job.started_at = now_;
    job.preparing = Nanos::zero();
    job.suspended = false;
    job.paused = job.rest = Nanos::zero();
    if (!is_computed(job)) {
      job.handover = call_effects_.any()
                         ? call_effects_.handed_over(start.unit, now_, hash_u64(random(index), 1))
                         : Nanos::zero();
      begin_step(index);
      continue;
    }
    // What is let in begins in the place of what is suspended.
    const auto servers = static_cast<std::size_t>(scenario_.platform.units[start.unit].servers);
    job.waits = !start.let_in && computing_[start.unit].size() >= servers;
    computing_[start.unit].push_back(index);
    note_arrival(index);
    executor_->start(index, start.unit, start.let_in);
  }
  for (const Sliced& each : effects_.resumed) go_on(Firings::job_of(each.task));
  for (const Ended& ended : effects_.ended) {
    release(firings_.end_task(Firings::job_of(ended.task), ended.how, now_));
  }
  const auto recalled = std::exchange(effects_.recalled, {});
  effects_.clear();
  if (recalled.empty()) return;
  for (const Recalled& each : recalled) take_back(each);
  apply_starts();  // What goes on in its place.
}

/// Of a computed task on its unit.
void VirtualTime::note_arrival(JobIndex index) {
  if (observers_.empty()) return;
  const Job& job = jobs_[index];
  const double active_w = scenario_.platform.units[job.unit].active_w;
  const CallPlan& call = plans_[job.plan].calls[job.unit];
  const Nanos expected = call.takes(Taken::kMean);
  const double own_w = expected > Nanos::zero() ? call.own_j() / to_s(expected) : 0;
  tell(&RunObserver::arrived, job.unit, index, own_w + (service_of(job).metered_j ? 0 : active_w));
}

/// What the unit holds at first: the first of the mix that it may have to.
std::optional<std::uint32_t> VirtualTime::first_context(UnitId unit) const {
  for (const TaskPlan& plan : plans_) {
    const auto& steps = plan.calls[unit].steps;
    const auto first = std::ranges::find_if(steps, &CallStep::prepares);
    if (first != steps.end()) return first->context;
  }
  return std::nullopt;
}

void VirtualTime::prepared(Job& job, Nanos at, Nanos takes) {
  job.preparing = takes;
  ++tally_.units[job.unit].prepares;
  tell(&RunObserver::preparing, job.id, at, takes);
}

/// The job's current step, or its end.
void VirtualTime::begin_step(JobIndex index) {
  Job& job = jobs_[index];
  while (steps_[job.step].plan != nullptr && holds_context(job, *steps_[job.step].plan)) ++job.step;
  const Step& step = steps_[job.step];
  if (step.plan == nullptr) {
    return complete(index, intended(index), now_ - job.started_at - job.paused, nullptr);
  }
  if (step.constant) {
    job.takes = step.takes;
    job.powered = step.powered;
    job.own_w = step.own_w;
  } else if (step.plan->for_data) {
    const Nanos arrival = data_arrival(index);
    job.takes = arrival - now_;
    job.own_w = 0;
    return add_timer(arrival, TimerKind::kDelay, index);
  } else {
    measure(index, *step.plan);
  }
  if (step.plan->slices != nullptr) {
    job.whole = job.rest = job.takes;
    job.whole_powered = job.powered;
    job.slice = 0;
    cut(job, *step.plan);
  }
  if (step.plan->servers == CallStep::kDelay) {
    if (job.own_w > 0) tell(&RunObserver::drawing, job.unit, job.own_w);
    return add_timer(now_ + job.takes, TimerKind::kDelay, index);
  }
  work_on(index, *step.plan);
}

void VirtualTime::work_on(JobIndex index, const CallStep& step) {
  // A server that begins at once says what it takes.
  servers_[step.servers]->arrive(index, jobs_[index].takes, sequence_++, now_);
  note_next(step.servers);
  if (observers_.empty()) return;
  Job& job = jobs_[index];
  job.told_w = power_w(job, step);
  tell(&RunObserver::arrived, step.servers, index, job.told_w);
}

/// @param job      At the servers of its step, which have worked on that for so long.
/// @param powered  The part that draws the unit's active_w.
void VirtualTime::charge(Tally& tally, const Job& job, Nanos served, Nanos powered) const {
  const CallStep& step = step_of(job);
  UnitTally& its = tally.units[job.unit];
  if (job.own_w != 0) its.own_j += job.own_w * to_s(served);
  if (step.servers < tally.units.size()) {
    UnitTally& served_by = tally.units[step.servers];
    served_by.busy += served;
    served_by.powered += powered;
    if (step.prepares) served_by.preparing += std::min(served, step.scaled);
  } else {
    its.transferring += served;
  }
}

/// The same of one that still needs so much.
void VirtualTime::charge_served(Tally& tally, const Job& job, Nanos remaining) const {
  const Nanos served = job.takes - remaining;
  if (served <= Nanos::zero()) return;
  charge(tally, job, served, scaled(job.powered, to_s(served) / to_s(job.takes)));
}

/// A call that is computed has occupied its unit, and drawn its active_w for part of that.
/// @param complete  Otherwise of its own joules the part counts that was served.
void VirtualTime::charge_computed(Tally& tally, const Job& job, Nanos busy, Nanos powered,
                                  bool complete) const {
  UnitTally& unit = tally.units[job.unit];
  const Service& service = service_of(job);
  const Nanos expected = plans_[job.plan].calls[job.unit].takes(Taken::kMean);
  const double part = complete || busy >= expected ? 1 : to_s(busy) / to_s(expected);
  unit.busy += busy;
  if (!service.metered_j) unit.powered += powered;
  unit.own_j += part * service.fixed_j();
}

/// Of the job's delay so much has passed, and no more of it will.
void VirtualTime::charge_delay(JobIndex index, Nanos passed) {
  const Job& job = jobs_[index];
  if (job.own_w == 0) return;
  tally_.units[job.unit].own_j += job.own_w * to_s(passed);
  tell(&RunObserver::drawing, job.unit, -job.own_w);
}

/// Whether the step prepares what its unit holds already. From now on it holds it.
bool VirtualTime::holds_context(Job& job, const CallStep& step) {
  if (!step.prepares) return false;
  if (std::exchange(contexts_[job.unit], step.context) == step.context) return true;
  prepared(job, now_, step.scaled);
  return false;
}

Outcome VirtualTime::intended(JobIndex job) const {
  if (!scenario_.faults) return Outcome::kCompleted;
  const Firings::TaskPlace& place = firings_.place(job);
  return scenario_.faults->outcome(place.pipeline, place.firing, place.task, jobs_[job].tries);
}

void VirtualTime::complete(JobIndex job, Outcome outcome, Nanos took,
                           std::shared_ptr<const std::vector<Tensor>> data) {
  Job& done = jobs_[job];
  if (call_effects_.any() && !is_computed(done)) {
    call_effects_.ended(done.unit, workload_of(done), job, now_);
  }
  must(dispatcher_.complete(done.unit, done.id, outcome, now_, effects_));
  tally_.last_completion = now_;
  if (outcome == Outcome::kReturned) {
    ++done.tries;
    return;
  }
  if (outcome == Outcome::kFailed) return release(firings_.end_task(job, TaskEnd::kFailed, now_));
  UnitTally& unit = tally_.units[done.unit];
  ++unit.completed;
  unit.latency.add(now_ - done.dispatched_at);
  tally_.calls[workload_of(done)][done.unit].add(took - done.preparing);
  release(firings_.complete(job, done.unit, now_, std::move(data)));
}

/// @param firing  Over, if there is one.
void VirtualTime::release(const std::optional<FiringId>& firing) {
  if (firing) must(dispatcher_.release(*firing, now_));
}

}  // namespace pirt
