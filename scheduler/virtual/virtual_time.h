// Virtual time: drives a dispatcher from events whose durations come from the services of a
// platform.
//
// Exact in whole nanoseconds and deterministic: the same inputs and seed give the same run. No
// clock is read.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
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
  /// All that happens at once at this moment has happened; more may follow at the same time.
  virtual void settled(Nanos now) = 0;
};

/// One run. Its references must outlive it.
class VirtualTime {
 public:
  /// @param observer  Null = none.
  VirtualTime(const Scenario& scenario, Dispatcher& dispatcher, RunObserver* observer = nullptr);
  ~VirtualTime();
  /// Until nothing is left to happen. Call once.
  /// @return  What was counted by the end: the duration with an open loop, else the last event.
  [[nodiscard]] Tally run();

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

  void begin();
  bool advance();
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
  [[nodiscard]] Nanos draw(JobIndex job, const Step& step) const;
  [[nodiscard]] double power_w(const Job& job, const Step& step) const;
  [[nodiscard]] Outcome outcome(JobIndex job) const;
  void complete(JobIndex job);
  void release(const std::optional<FiringId>& firing);
  void add_timer(Nanos at, bool fires, std::uint32_t index);

  const Scenario& scenario_;
  RunObserver* observer_;
  Dispatcher& dispatcher_;
  Firings firings_;
  std::vector<std::unique_ptr<Servers>> servers_;  ///< Units in order, then links.
  std::vector<TaskPlan> plans_;                    ///< Of all tasks of all pipelines.
  std::vector<std::uint32_t> first_plans_;         ///< By pipeline,
  std::vector<std::uint64_t> seeds_;               ///< and likewise.
  std::vector<std::optional<UnitId>>
      state_units_;  ///< By state: where it is; absent = nowhere yet.
  std::vector<Job> jobs_;
  std::vector<Timer> timers_;  ///< A heap, earliest first.
  std::uint64_t sequence_ = 0;
  Starts starts_;
  Tally tally_;                  ///< Of all that has happened at units and links.
  std::optional<Tally> at_end_;  ///< What is returned.
  Nanos now_{0};
};

}  // namespace pirt
