// The only owner of queues, loads, dependencies and the high-priority queue: a pure state machine.
//
// No threads, no clock, no I/O: each call is an input with its time, and appends what may start
// now. The same inputs in the same order give the same answers, whether virtual time or worker
// threads drive it. One caller at a time.
#pragma once

#include <compare>
#include <memory>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "scheduler/policy.h"
#include "scheduler/task.h"
#include "scheduler/task_store.h"

namespace pirt {

/// One call of the dispatcher, as it came.
struct DispatcherInput {
  enum class Kind : std::uint8_t { kSubmit, kComplete, kCancel, kSetUnit, kWake };
  Kind kind = Kind::kWake;
  Nanos now{0};
  Task task = {};   ///< Of kSubmit as a whole; of kComplete and kCancel its id.
  UnitId unit = 0;  ///< Of kComplete and kSetUnit.
  Outcome outcome = Outcome::kCompleted;
  UnitState state = UnitState::kUp;
};

/// Hears of every input and what it brought about, in order. Must not call
/// the dispatcher's inputs, nor throw.
class DispatcherObserver {
 public:
  virtual ~DispatcherObserver() = default;
  virtual void on_input(const DispatcherInput& input, std::span<const Start> started,
                        std::span<const Ended> ended) = 0;
};

class Dispatcher {
 public:
  /// @param slots   By unit: how many tasks may be started on it and not be complete; absent = no
  /// limit. At most kMaxUnits.
  Dispatcher(std::vector<std::optional<int>> slots, std::unique_ptr<Policy> policy);

  // `now` must never fall from call to call.

  void submit(const Task& task, Nanos now, Starts& out);
  /// The paper's per-unit callback: @p task ended on @p unit, where it was started. A failed task
  /// drops its successors. The unit goes on with the high-priority queue, then with its own.
  void complete(UnitId unit, TaskId task, Outcome outcome, Nanos now, Starts& out);
  /// Drops a task in any state, and its successors. One that runs keeps its slot until it is
  /// completed. Does nothing if the task is done already (which its caller cannot always know).
  void cancel(TaskId task, Nanos now, Starts& out);
  /// A unit that is not up hands what waits in its queue to others.
  void set_unit(UnitId unit, UnitState state, Nanos now, Starts& out);
  /// Expires what should have started by @p now. Call it after the completions of that time: a task
  /// may start at its last moment.
  void wake(Nanos now, Starts& out);
  /// @param observer  Null = none (the default); must outlive what follows.
  void observe(DispatcherObserver* observer) { observer_ = observer; }
  /// When to call wake next.
  [[nodiscard]] std::optional<Nanos> next_wake() const;

  [[nodiscard]] const TaskCounts& counts() const { return counts_; }
  /// Q of the paper: tasks queued and running on the unit.
  [[nodiscard]] int load(UnitId unit) const { return load_[unit]; }
  [[nodiscard]] int running(UnitId unit) const { return units_[unit].running; }
  /// Tasks that could start and are in no unit's queue: held, or in the high-priority queue.
  [[nodiscard]] std::size_t waiting() const { return held_count_ + high_priority_count_; }
  /// Absent if the task is done or unknown.
  [[nodiscard]] std::optional<TaskState> state(TaskId task) const;

 private:
  struct Unit {
    int slots = 0;
    int running = 0;
    UnitState state = UnitState::kUp;
    TaskList queue = {};
  };
  /// Tasks of one class are refused together, so that a long backlog costs one question.
  struct Class {
    TaskClass kind;
    UnitMask takers = 0;  ///< Of the units that are up.
    TaskList held = {};
    TaskList high_priority = {};
  };
  struct Expiry {
    Nanos at{0};
    std::uint64_t sequence = 0;  ///< Ties expire in order of submission.
    TaskSlot slot = kNoSlot;
    std::uint32_t generation = 0;
    friend auto operator<=>(const Expiry&, const Expiry&) = default;
  };

  /// Tells the observer at the end of the call, by whatever way it is left. The input is made only
  /// where somebody listens.
  template <typename Make>
  class Report {
   public:
    Report(const Dispatcher& dispatcher, const Starts& out, Make make)
        : observer_(dispatcher.observer_),
          out_(out),
          make_(std::move(make)),
          started_(out.started.size()),
          ended_(out.ended.size()) {}
    ~Report() {
      if (observer_ == nullptr) return;
      observer_->on_input(make_(), std::span(out_.started).subspan(started_),
                          std::span(out_.ended).subspan(ended_));
    }
    Report(const Report&) = delete;
    Report& operator=(const Report&) = delete;

   private:
    DispatcherObserver* observer_;
    const Starts& out_;
    Make make_;
    std::size_t started_, ended_;
  };

  std::uint32_t class_of(const TaskClass& kind);
  void make_ready(TaskSlot slot, Nanos now);
  bool place(TaskSlot slot, Nanos now);
  void hold(TaskSlot slot);
  void place_held(Nanos now);
  void start_all(Nanos now, Starts& out);
  void start(TaskSlot slot, UnitId unit, Starts& out);
  TaskSlot take_high_priority(UnitId unit, Nanos now);
  void unlink(TaskSlot slot);
  void drop(TaskSlot slot, Starts& out);
  void drop_successors(TaskSlot slot, Starts& out);
  void forget(TaskSlot slot);
  void watch_expiry(TaskSlot slot, Nanos at);
  [[nodiscard]] bool is_stale(const Expiry& expiry) const;
  void tidy_expiries();
  void advance(Nanos now);

  std::unique_ptr<Policy> policy_;
  DispatcherObserver* observer_ = nullptr;
  std::vector<Unit> units_;
  std::vector<int> load_;
  UnitMask up_ = 0;
  std::vector<UnitId> start_order_;  ///< The policy's order, then the units that it does not name.
  TaskStore tasks_;
  std::vector<Class> classes_;
  std::size_t held_count_ = 0;
  std::size_t high_priority_count_ = 0;
  std::vector<Expiry>
      expiries_;  ///< A heap, earliest first; may hold entries of tasks that have started or ended.
  std::size_t expiring_count_ = 0;
  std::uint64_t ready_sequence_ = 0;
  std::vector<TaskSlot> scratch_;
  std::vector<Class*> asking_;  ///< Of place_held; kept for its memory.
  TaskCounts counts_;
  Nanos now_ = Nanos::min();
};

}  // namespace pirt
