// Virtual time: drives a dispatcher from events whose durations come from the services of a
// platform.
//
// Exact in whole nanoseconds and deterministic: the same inputs and seed give the same run. No
// clock is read. Whoever has one (runtime/) lets the events happen when their time has come, and
// runs the tasks of some units himself.
#pragma once

#include <compare>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <type_traits>
#include <utility>
#include <vector>

#include "scheduler/dispatcher/dispatcher.h"
#include "scheduler/dispatcher/slot_table.h"
#include "scheduler/record/tally.h"
#include "scheduler/services/call_plan.h"
#include "scheduler/services/scenario.h"
#include "scheduler/trace/run_observer.h"
#include "scheduler/virtual/call_effects.h"
#include "scheduler/virtual/firings.h"
#include "scheduler/virtual/moments.h"
#include "scheduler/virtual/servers.h"
#include "workloads/base/contract.h"

namespace pirt {

/// How a computed task ended.
struct ComputedEnd {
  Outcome outcome = Outcome::kCompleted;
  Nanos busy{0};                     ///< How long it occupied its unit,
  std::optional<Nanos> preparing{};  ///< of which its kernel was prepared; absent = it was there;
  std::optional<Nanos> powered{};    ///< and of which it drew active_w; absent = all of it.
  std::shared_ptr<const std::vector<Tensor>> data = nullptr;  ///< What it made.
};

/// Runs the tasks of units whose services are not modelled but computed.
class Executor {
 public:
  virtual ~Executor() = default;
  /// The task may start; VirtualTime::finished hears of its end, and not from here.
  /// @param let_in  As Start.
  virtual void start(JobIndex job, UnitId unit, bool let_in) = 0;
  /// The task was suspended between two slices and goes on.
  virtual void resume(JobIndex job, UnitId unit) = 0;
  /// It is wanted back from there, if it has not ended.
  virtual void recall(JobIndex job, UnitId unit) = 0;
};

/// One run. Its references must outlive it.
class VirtualTime final {
 public:
  /// @param observers  Hear of it, one after the other.
  /// @param executor  Of the units of @p computed; null = all are modelled.
  VirtualTime(const Scenario& scenario, Dispatcher& dispatcher,
              std::vector<RunObserver*> observers = {}, Executor* executor = nullptr,
              UnitMask computed = 0);
  /// Until nothing is left to happen. Call once.
  /// @return  What was counted by the end: the duration with an open loop, else the last event.
  [[nodiscard]] Tally run();

  // The same in steps, for a driver with a clock: begin, then advance whenever next() has come,
  // finished whenever a computed task ends, finish once nothing is left.

  void begin();
  /// When the next event is due; Nanos::max() = none is.
  [[nodiscard]] Nanos next() const;
  /// Lets the next event happen, and what follows at the same moment.
  /// @param now  What the clock says; not before next(), unless time is virtual.
  /// @return     False if there is none.
  bool advance(Nanos now = Nanos::min());
  void finished(JobIndex job, ComputedEnd end, Nanos now);
  /// A computed task has ended a slice, and another one follows.
  /// @return  Whether it goes on at once; otherwise when Executor::resume says so.
  [[nodiscard]] bool slice_ended(JobIndex job, Nanos now);
  /// The unit is up or not from now on; see Dispatcher.
  void set_unit(UnitId unit, UnitState state, Nanos now);
  /// Nothing fires any more, and what is counted is counted by now; what has fired is finished.
  void stop(Nanos now);
  [[nodiscard]] Tally finish();
  [[nodiscard]] const Firings& firings() const { return firings_; }
  /// What is to become of a call, on purpose: kCompleted where no faults are wanted.
  [[nodiscard]] Outcome intended(JobIndex job) const;
  /// Dispatcher::recall, of a job.
  [[nodiscard]] std::optional<Recall> recall(JobIndex job) const {
    return dispatcher_.recall(jobs_[job].id);
  }

 private:
  /// What it knows of a live task.
  struct Job {
    TaskId id = 0;
    std::uint32_t plan = 0;
    UnitId unit = 0;
    std::uint32_t step = 0;   ///< Position in steps_.
    std::uint32_t tries = 0;  ///< Before this one.
    bool waits = false;       ///< On a unit that computes: for what that got before.
    Nanos started_at{0};      ///< Of one that waited: since it does no more.
    Nanos dispatched_at{0};
    Nanos takes{0};      ///< Server time of its step,
    Nanos powered{0};    ///< the part of it that draws the unit's active_w,
    double own_w = 0;    ///< and what it draws beside that, of the call's own joules.
    double told_w = 0;   ///< What who follows was told that it draws.
    Nanos preparing{0};  ///< What this try has spent on it.
    Nanos handover{0};   ///< Until its first step on its unit; then zero.
    // Of a step with slices: all of it, and what follows the slice that is served.
    Nanos whole{0}, whole_powered{0}, rest{0};
    std::uint32_t slice = 0;
    // Of a task that was suspended between two slices.
    bool suspended = false;  ///< It is,
    Nanos suspended_at{0};   ///< since then,
    Nanos paused{0};         ///< and was before for so long.
    CallEffects::Rest effects = {};

    /// The task is submitted. What else is here is set where it comes to that.
    void begin(TaskId task, std::uint32_t its_plan) {
      id = task;
      plan = its_plan;
      tries = 0;
      suspended = false;
    }
  };
  enum class TimerKind : std::uint8_t {
    kFires,  ///< A pipeline.
    kDelay,  ///< A job's delay ends.
    kDrawn,  ///< Something has been drawn: a slot of draws_.
  };
  struct Timer {
    Moment moment;
    TimerKind kind = TimerKind::kFires;
    std::uint32_t index = 0;  ///< Of the pipeline, the job or the draw.
    friend auto operator<=>(const Timer&, const Timer&) = default;
  };
  /// A step of a plan, laid out for the run: those of a task on a unit follow each other, and then
  /// one without a plan.
  struct Step {
    const CallStep* plan = nullptr;
    Nanos takes{0}, powered{0};  ///< As Job, if it is always the same,
    double own_w = 0;            ///< and likewise.
    bool constant = false;       ///< It is, and begins whatever happened before.
    /// The one behind it is, too, and is served by the same servers; neither has slices.
    bool goes_on = false;
  };

  /// What the dispatcher refuses here would be this driver's mistake.
  static void must(bool taken) { expect(taken, "the dispatcher refused an input of virtual time"); }
  void lay_out_steps();
  void catch_up(Nanos now);
  /// Who follows hears of it.
  template <typename... Args>
  void tell(void (RunObserver::*what)(Args...), std::type_identity_t<Args>... args) {
    for (RunObserver* const each : observers_) (each->*what)(args...);
  }
  void close_books(Nanos end);
  void fire(std::uint32_t pipeline, Nanos due);
  void schedule_firing(std::uint32_t pipeline);
  void settle();
  void apply_starts();
  void take_back(const Recalled& recalled);
  void begin_step(JobIndex job);
  [[nodiscard]] bool holds_context(Job& job, const CallStep& step);
  void measure(JobIndex job, const CallStep& step);
  Nanos begins(JobIndex job, Nanos work);
  void charge(Tally& tally, const Job& job, Nanos served, Nanos powered) const;
  void charge_served(Tally& tally, const Job& job, Nanos remaining) const;
  void charge_computed(Tally& tally, const Job& job, Nanos busy, Nanos powered,
                       bool complete) const;
  void charge_delay(JobIndex job, Nanos passed);
  void work_on(JobIndex job, const CallStep& step);
  void cut(Job& job, const CallStep& step, Nanos passes = Nanos::zero()) const;
  void end_slice(JobIndex job);
  void suspend(JobIndex job);
  void go_on(JobIndex job);
  void note_arrival(JobIndex job);
  bool go_on_serving(std::size_t servers);
  /// They have changed: their next completion may be another. It is looked for when others have, or
  /// all that happens now is settled: a task's next step is mostly where the last one was.
  void note_next(std::size_t servers) {
    if (servers != changed_) note_changed(std::exchange(changed_, servers));
  }
  void note_changed(std::size_t servers) {
    if (servers != kNone) completions_.set(servers, servers_[servers]->next());
  }
  static constexpr std::size_t kNone = SIZE_MAX;
  Nanos data_arrival(JobIndex job);
  void send(UnitId unit, std::int64_t size_bytes, Nanos from, Nanos wait);
  void draw_for(std::size_t servers, double watts, Nanos time);
  [[nodiscard]] bool is_computed(const Job& job) const { return contains(computed_, job.unit); }
  [[nodiscard]] const CallStep& step_of(const Job& job) const;
  [[nodiscard]] WorkloadId workload_of(const Job& job) const;
  [[nodiscard]] const Service& service_of(const Job& job) const;
  [[nodiscard]] std::optional<std::uint32_t> first_context(UnitId unit) const;
  void prepared(Job& job, Nanos at, Nanos takes);
  [[nodiscard]] std::uint64_t random(JobIndex job) const;
  void add_effects(JobIndex job, const CallStep& step);
  void lengthen_slowed();
  [[nodiscard]] double power_w(const Job& job, const CallStep& step) const;
  void complete(JobIndex job, Outcome outcome, Nanos took,
                std::shared_ptr<const std::vector<Tensor>> data);
  void release(const std::optional<FiringId>& firing);
  void add_timer(Nanos at, TimerKind kind, std::uint32_t index);

  const Scenario& scenario_;
  std::vector<RunObserver*> observers_;
  Dispatcher& dispatcher_;
  Executor* executor_;
  UnitMask computed_;
  Firings firings_;
  std::vector<std::unique_ptr<Servers>> servers_;  ///< Units in order, then links.
  Moments completions_;                            ///< The next of each of these,
  std::size_t changed_ = kNone;                    ///< but of one that may have another by now.
  std::vector<TaskPlan> plans_;                    ///< Of all tasks of all pipelines.
  std::vector<Step> steps_;                        ///< Of these.
  std::vector<std::uint32_t> first_steps_;         ///< By plan and unit: positions in steps_.
  std::vector<std::uint32_t> first_plans_;         ///< By pipeline,
  std::vector<std::uint64_t> seeds_;               ///< likewise,
  std::vector<Dispatcher::TemplateId> templates_;  ///< and likewise.
  std::vector<std::optional<UnitId>>
      state_units_;  ///< By state: where it is; absent = nowhere yet.
  std::vector<std::optional<std::uint32_t>> contexts_;  ///< By unit with contexts: which it holds.
  std::vector<Job> jobs_;
  /// By unit that computes: the tasks that it has, in the order in which it got them.
  std::vector<std::vector<JobIndex>> computing_;
  std::vector<Timer> timers_;  ///< A heap, earliest first.
  std::uint64_t sequence_ = 0;
  Effects effects_;
  std::vector<int> waiting_;  ///< For the observers.
  Tally tally_;               ///< Of all that has happened, but for what others count.
  CallEffects call_effects_;
  /// Servers, and what is drawn beside them; only where somebody follows.
  SlotTable<std::pair<std::size_t, double>> draws_;
  std::optional<Tally> at_end_;  ///< What is returned.
  Nanos now_{0};
};

}  // namespace pirt
