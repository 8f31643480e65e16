// Virtual time: drives a dispatcher from events whose durations come from the services of a
// platform.
//
// Exact in whole nanoseconds and deterministic: the same inputs and seed give the same run. No
// clock is read. Whoever has one (runtime/) lets the events happen when their time has come, and
// runs the tasks of some units himself.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "scheduler/dispatcher/dispatcher.h"
#include "scheduler/record/tally.h"
#include "scheduler/services/scenario.h"
#include "scheduler/virtual/firings.h"
#include "scheduler/virtual/servers.h"

namespace pirt {

/// Hears of what a run does beyond what its dispatcher is asked. Must not throw.
class RunObserver {
 public:
  virtual ~RunObserver() = default;
  /// Before the dispatcher gets the task.
  virtual void submitting(TaskId task, std::size_t pipeline, std::size_t position,
                          std::uint64_t firing) = 0;
  /// A stage arrives at, and leaves, the servers of a unit, or of a link (numbered after the
  /// units).
  /// @param job      Unique among those that have arrived and not left.
  /// @param power_w  Drawn while a server works on it at full rate.
  virtual void arrived(std::size_t servers, std::uint32_t job, double power_w) = 0;
  virtual void left(std::size_t servers, std::uint32_t job) = 0;
  /// The unit of @p task, which it has begun, prepares its kernel from @p now on, which takes that
  /// long: a unit with contexts that holds another, or a live one that has not prepared it before.
  virtual void preparing(TaskId task, Nanos now, Nanos takes) {
    static_cast<void>(task), static_cast<void>(now), static_cast<void>(takes);
  }
  /// All that happens at once at this moment has happened; more may follow at the same time.
  /// @param waiting  Tasks that wait: by unit those in its queue, then those that are in none.
  virtual void settled(Nanos now, std::span<const int> waiting) = 0;
};

/// How a computed task ended.
struct ComputedEnd {
  Outcome outcome = Outcome::kCompleted;
  Nanos busy{0};                     ///< How long it occupied its unit,
  std::optional<Nanos> preparing{};  ///< of which its kernel was prepared; absent = it was there.
  std::shared_ptr<const std::vector<Tensor>> data = nullptr;  ///< What it made.
};

/// Runs the tasks of units whose services are not modelled but computed.
class Executor {
 public:
  virtual ~Executor() = default;
  /// The task may start; VirtualTime::finished hears of its end, and not from here.
  virtual void start(JobIndex job, UnitId unit) = 0;
};

/// One run. Its references must outlive it.
class VirtualTime {
 public:
  /// @param observer  Null = none.
  /// @param executor  Of the units of @p computed; null = all are modelled.
  VirtualTime(const Scenario& scenario, Dispatcher& dispatcher, RunObserver* observer = nullptr,
              Executor* executor = nullptr, UnitMask computed = 0);
  ~VirtualTime();
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
  /// The unit is up or not from now on; see Dispatcher.
  void set_unit(UnitId unit, UnitState state, Nanos now);
  /// Nothing fires any more, and what is counted is counted by now; what has fired is finished.
  void stop(Nanos now);
  [[nodiscard]] Tally finish();
  [[nodiscard]] const Firings& firings() const { return firings_; }
  /// What is to become of a call, on purpose: kCompleted where no faults are wanted.
  [[nodiscard]] Outcome intended(JobIndex job) const;
  /// Where a task that has started is.
  [[nodiscard]] UnitId unit_of(JobIndex job) const;

 private:
  struct Step;
  struct DataEdge;
  struct TaskPlan;
  struct Job;
  struct Timer;

  void plan_tasks(std::uint32_t pipeline);
  [[nodiscard]] std::vector<DataEdge> data_edges(const Pipeline& pipeline, std::size_t task) const;
  std::vector<Step> plan_steps(const MixTask& task, const TaskPlan& plan, UnitId unit) const;
  void add_transfer(std::vector<Step>& steps, UnitId unit, std::int64_t size_bytes) const;

  [[nodiscard]] Servers* first_servers() const;
  void close_books(Nanos end);
  void count_served(Tally& tally) const;
  void fire(std::uint32_t pipeline);
  void schedule_firing(std::uint32_t pipeline);
  void settle();
  void apply_starts();
  void proceed(JobIndex job);
  void begin_step(JobIndex job, const Step& step);
  Nanos data_arrival(JobIndex job);
  void send(UnitId unit, std::int64_t size_bytes, Nanos from);
  void charge(Tally& tally, const Job& job, const Step& step, Nanos served, Nanos powered) const;
  [[nodiscard]] const Step& step_of(const Job& job) const;
  [[nodiscard]] bool is_metered(const Job& job) const;
  [[nodiscard]] std::optional<WorkloadId> first_context(UnitId unit) const;
  void prepared(Job& job, Nanos at, Nanos takes);
  [[nodiscard]] Nanos draw(JobIndex job, const Step& step) const;
  [[nodiscard]] double power_w(const Job& job, const Step& step) const;
  void complete(JobIndex job, Outcome outcome, Nanos took,
                std::shared_ptr<const std::vector<Tensor>> data);
  void release(const std::optional<FiringId>& firing);
  void add_timer(Nanos at, bool fires, std::uint32_t index);

  const Scenario& scenario_;
  RunObserver* observer_;
  Dispatcher& dispatcher_;
  Executor* executor_;
  UnitMask computed_;
  Firings firings_;
  std::vector<std::unique_ptr<Servers>> servers_;  ///< Units in order, then links.
  std::vector<TaskPlan> plans_;                    ///< Of all tasks of all pipelines.
  std::vector<std::uint32_t> first_plans_;         ///< By pipeline,
  std::vector<std::uint64_t> seeds_;               ///< and likewise.
  std::vector<std::optional<UnitId>>
      state_units_;  ///< By state: where it is; absent = nowhere yet.
  std::vector<std::optional<WorkloadId>> contexts_;  ///< By unit with contexts: which it holds.
  std::vector<Job> jobs_;
  std::vector<Timer> timers_;  ///< A heap, earliest first.
  std::uint64_t sequence_ = 0;
  Starts starts_;
  std::vector<int> waiting_;     ///< For the observer.
  Tally tally_;                  ///< Of all that has happened at units and links.
  std::optional<Tally> at_end_;  ///< What is returned.
  Nanos now_{0};
};

}  // namespace pirt
