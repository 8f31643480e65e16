// Units and calls that do not do what they should, and the thread that looks after them.
#include <algorithm>
#include <iterator>

#include "scheduler/runtime/engine.h"

namespace pirt {
/// A unit that cannot run one workload may well run others.
void Runtime::Engine::count_returns(const Submitted& task) {
  if (!live_units_.at(task.unit).is_reachable()) asked_.fetch_or(kLook);  // Others are to have it.
  auto& returns = units_[task.unit].returns;
  if (task.call_end.outcome != Outcome::kReturned) {
    if (!returns.empty()) returns.erase(task.workload_index);
    return;
  }
  if (task.call_end.excused || ++returns[task.workload_index] < runtime::kMostReturns) return;
  Known& known = workloads_[task.workload_index];
  if (contains(known.gave_up, task.unit)) return;
  known.gave_up |= unit_bit(task.unit);
  add_problem("unit " + options_.platform.units[task.unit].name + " is not asked for " +
              known.workload->name + " any more: it gave back " +
              std::to_string(runtime::kMostReturns) + " calls one after the other");
  const bool asked_for_any = std::ranges::any_of(workloads_, [&](const Known& each) {
    return contains(each.runs_on & ~each.gave_up, task.unit);
  });
  if (!asked_for_any) lose(task.unit);
}

/// Nothing runs there any more.
void Runtime::Engine::lose(UnitId unit) {
  units_[unit].in_service = false;
  dispatcher_->set_unit(unit, UnitState::kGone, now_, effects_);
}

void Runtime::Engine::bring_back(std::string_view name) {
  runtime::check_process(forks_);
  runtime::MustNotWait::check("bringing a unit back");
  const UnitModel& model = options_.platform.unit(name);
  const auto unit = static_cast<UnitId>(&model - options_.platform.units.data());
  const std::lock_guard one_at_a_time(bringing_back_);
  if (!live_units_.has(unit)) throw_bad_input("unit " + model.name + " computes nothing here");
  bool lost = false, busy = false;
  in_turn([&] {
    lost = !units_[unit].in_service;
    if (!lost) ask_for_all(unit, false);
    busy = lost && !live_units_.at(unit).abandoned() &&
           dispatcher_->running(unit) + dispatcher_->suspended(unit) > 0;
  });
  if (!lost) return;
  if (busy) {
    throw_environment("unit " + model.name + " has calls that have not ended; try again later");
  }
  auto other = live_units_.make_ready(unit);
  in_turn([&] {
    other = live_units_.replace(unit, std::move(other));
    ask_for_all(unit, true);
    units_[unit].in_service = true;
    dispatcher_->set_unit(unit, UnitState::kUp, now(), effects_);
    asked_.fetch_or(kLook);  // There may be something to start.
  });
}

/// Also for what it gave back too often; not for what nobody there has.
/// @param says_news  Of the latter.
void Runtime::Engine::ask_for_all(UnitId unit, bool says_news) {
  units_[unit].returns.clear();
  const Remote* const remote = live_units_.at(unit).remote();
  if (remote != nullptr) units_[unit].heard = remote->heard();
  for (Known& each : workloads_) {
    if (!contains(each.runs_on, unit)) continue;
    const Support served = live_units_.at(unit).serves(*each.workload);
    const bool had_it = !contains(each.gave_up, unit);
    each.gave_up = served.ok ? each.gave_up & ~unit_bit(unit) : each.gave_up | unit_bit(unit);
    if (says_news && had_it && !served.ok) {
      add_problem(live_units_.at(unit).name() + ": " + not_asked_for(*each.workload, served));
    }
  }
}

/// Others have come to what is elsewhere, or gone: it may serve what it did not, whatever became of
/// it before. Nobody looks while nothing runs, so that it may also be out of reach by now.
void Runtime::Engine::hear_of_others() {
  if (running_ == 0 && !elsewhere_.empty()) live_units_.look_for_reach();
  for (const UnitId unit : elsewhere_) {
    const KernelUnit& there = live_units_.at(unit);
    if (there.remote()->heard() == units_[unit].heard) continue;
    ask_for_all(unit, true);
    if (std::exchange(units_[unit].in_service, true)) continue;
    dispatcher_->set_unit(unit, there.is_reachable() ? UnitState::kUp : UnitState::kDraining, now_,
                          effects_);
  }
}

/// What time has brought: tasks that were to start by now, and calls that do not end.
void Runtime::Engine::look() {
  dispatcher_->wake(now_, effects_);
  apply();
  live_units_.look_for_hung(began_ + look_at_);
  live_units_.look_for_reach();
  look_at_ =
      std::min(later_by(now_, live_units_.look_every()), live_units_.next_overdue() - began_);
}

void Runtime::Engine::set_unit(UnitId unit, UnitState state) {
  if (state == UnitState::kGone) return lose(unit);
  if (units_[unit].in_service) dispatcher_->set_unit(unit, state, now_, effects_);
  apply();
}

LiveDriver::Expectation Runtime::Engine::expected(UnitId unit, const Call& call) {
  const std::size_t index = task_at(call.token).workload_index;
  const Known& known = workloads_[index];
  if (known.own != nullptr && !known.own->expected.contains(options_.platform.units[unit].name)) {
    return {.otherwise = kUnknownTimeLimit};
  }
  if (known.own == nullptr && !options_.profile) return {};
  return {setup_->scenario.services.find(setup_->scenario.classes[index][0].workload, unit)};
}

/// The record is the call's own from then on, if the call is its unit's.
void Runtime::Engine::give_up(UnitId, Call& call, CallEnd end) {
  Submitted& task = task_at(call.token);
  if (end.outcome == Outcome::kFailed) {
    TaskRef::hold(task);
  } else {
    std::ranges::move(call.inputs, std::back_inserter(freed_));
    call.let_go();
  }
  task.call_end = std::move(end);
  task.event = Submitted::Event::kEnd;
  take_event(task);
}

void Runtime::Engine::watch_by(Nanos due) {
  Nanos at = watch_at_;
  while (due < at) {
    if (watch_at_.compare_exchange_weak(at, due)) return watch_.ring(1);
  }
}

/// With nothing that runs and nothing to come it sleeps until somebody wakes it.
void Runtime::Engine::watch(const std::stop_token& stop) {
  runtime::begin_thread("pirt-watch", live_units_.cores());
  const runtime::MustNotWait within;
  static_cast<void>(take_priority(options_.priority));
  while (!stop.stop_requested()) {
    const Nanos at = watch_at_;
    watch_.sleep_until([&] { return watch_at_.load() < at; }, later_by(began_, at));
    if (now() < at) continue;
    // The turn that follows says when it looks next.
    watch_at_ = Nanos::max();
    asked_.fetch_or(kLook);
    work(Thread::kOurs);
    if (anything_to_tell_) tell_posted();
  }
  if (anything_to_tell_) tell_posted();  // The watcher hears of nothing more.
}

}  // namespace pirt
