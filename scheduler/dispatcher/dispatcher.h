// The only owner of queues, loads, dependencies and the high-priority queue: a pure state machine.
//
// No threads, no clock, no I/O: each call is an input with its time, and appends what may start
// now. The same inputs in the same order give the same answers, whether virtual time or worker
// threads drive it. One caller at a time.
//
// A firing's tasks are submitted together, and released when nothing that comes later can name
// them: until then an id that ended without completing is known, so that no task runs on missing
// input.
#pragma once

#include <compare>
#include <memory>
#include <optional>
#include <span>
#include <unordered_map>
#include <vector>

#include "scheduler/dispatcher/task_store.h"
#include "scheduler/mix/task.h"
#include "scheduler/policies/policy.h"

namespace pirt {

/// One call of the dispatcher, as it took it: `now` is never before that of the call before.
struct DispatcherInput {
  enum class Kind : std::uint8_t { kSubmit, kRelease, kComplete, kCancel, kSetUnit, kWake };
  Kind kind = Kind::kWake;
  Nanos now{0};
  FiringId firing = 0;               ///< Of kSubmit and kRelease.
  std::span<const Task> tasks = {};  ///< Of kSubmit.
  TaskId task = 0;                   ///< Of kComplete and kCancel.
  UnitId unit = 0;                   ///< Of kComplete and kSetUnit.
  Outcome outcome = Outcome::kCompleted;
  UnitState state = UnitState::kUp;
};

/// What an input brought about.
struct Decisions {
  bool taken = true;  ///< False: it made no sense and changed nothing.
  std::span<const Start> started;
  std::span<const Ended> ended;
};

/// Hears of every input and what it brought about, in order. Must not call the dispatcher's inputs.
/// What it throws leaves the dispatcher in order, and reaches whoever called.
class DispatcherObserver {
 public:
  virtual ~DispatcherObserver() = default;
  virtual void on_input(const DispatcherInput& input, const Decisions& decisions) = 0;
};

class Dispatcher {
 public:
  /// @param slots   By unit: how many tasks may be started on it and not be complete; absent = no
  /// limit. At most kMaxUnits.
  Dispatcher(std::vector<std::optional<int>> slots, std::unique_ptr<Policy> policy);

  // A `now` before that of an earlier call is taken as that one: callers on several threads read
  // their clock before they wait for their turn. Each input first expires what should have started
  // before `now`; at its last moment a task may still start. An input that makes no sense is
  // refused: it changes nothing, is counted, and its caller hears `false`.

  /// Registers the tasks of a firing, or more of them, and then places those that are ready.
  /// Refused: a task whose id is known, that comes after itself or a later one of @p tasks, or that
  /// no unit may serve; a state or series out of range; a firing that is released.
  bool submit(FiringId firing, std::span<const Task> tasks, Nanos now, Starts& out);
  /// No task that is submitted from now on names one of this firing: those of its ids that ended
  /// without completing are forgotten, and those that have yet to end will be as they do. A firing
  /// that is never released is kept. Refused: a firing that is not known, or released.
  bool release(FiringId firing, Nanos now);
  /// The paper's per-unit callback: @p task ended on @p unit, where it was started. A failed task
  /// drops its successors; one that is given back keeps its place in line, and leaves as kFailed if
  /// no unit is left that the policy would let try. The unit goes on with the high-priority queue,
  /// then with its own.
  /// Refused: a task that does not run there, as after a second completion.
  bool complete(UnitId unit, TaskId task, Outcome outcome, Nanos now, Starts& out);
  /// Drops a task in any state, and its successors. One that runs keeps its slot until it is
  /// completed. Does nothing if the task is done already (which its caller cannot always know).
  void cancel(TaskId task, Nanos now, Starts& out);
  /// A unit that is not up hands what waits in its queue to others. What only units that are gone
  /// could take fails, from now on when it could start. Refused: no such unit.
  bool set_unit(UnitId unit, UnitState state, Nanos now, Starts& out);
  /// Expires what should have started by @p now. Call it after the completions of that time: a task
  /// may start at its last moment.
  void wake(Nanos now, Starts& out);
  /// @param observer  Null = none (the default); must outlive what follows.
  void observe(DispatcherObserver* observer) { observer_ = observer; }
  /// When to call wake next; Nanos::max() = never.
  [[nodiscard]] Nanos next_wake() const {
    return expiries_.empty() ? Nanos::max() : expiries_.front().at;
  }

  [[nodiscard]] const TaskCounts& counts() const { return counts_; }
  /// Inputs that were refused.
  [[nodiscard]] std::int64_t refused() const { return refused_; }
  /// Q of the paper: tasks queued and running on the unit.
  [[nodiscard]] int load(UnitId unit) const { return load_[unit]; }
  [[nodiscard]] int running(UnitId unit) const { return units_[unit].running; }
  /// Tasks that could start: by unit those in its queue, then those that are in none.
  void list_waiting(std::vector<int>& waiting) const;
  /// Absent if the task is done or unknown.
  [[nodiscard]] std::optional<TaskState> state(TaskId task) const;
  /// What takes memory.
  [[nodiscard]] std::size_t known_tasks() const { return tasks_.tasks(); }
  [[nodiscard]] std::size_t known_firings() const { return tasks_.firings(); }

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
    bool in_holding = false;      ///< It is in holding_,
    bool in_prioritized = false;  ///< and in prioritized_.
    bool refused = false;         ///< Since the last fall of a load.
    bool hopeless = false;        ///< All that would have taken it are gone.
  };
  struct ClassHash {
    std::size_t operator()(const TaskClass& kind) const;
  };
  /// A task that is of interest if it is still the same one.
  struct Noted {
    TaskSlot slot = kNoSlot;
    std::uint32_t generation = 0;
  };
  struct StateQueue {
    TaskSlot head =
        kNoSlot;  ///< Holds the state, or will when the rest of what it waits for is there.
    TaskSlot tail = kNoSlot;
  };
  struct Expiry {
    Nanos at{0};
    std::uint64_t sequence = 0;  ///< Ties expire in order of submission.
    TaskSlot slot = kNoSlot;
    std::uint32_t generation = 0;
    friend auto operator<=>(const Expiry&, const Expiry&) = default;
  };

  template <typename Make, typename Body>
  bool take(Nanos now, Starts& out, const Make& input, const Body& body);
  bool add(FiringId firing, std::span<const Task> tasks);
  bool link(TaskSlot slot, const Task& task);
  void await_earlier(TaskSlot slot, const Task& task);
  void join(TaskSlot slot, const Task& task);
  void leave_state(TaskSlot slot);
  void decide(TaskSlot slot, bool completed);
  void free_from_one(TaskSlot slot);
  void drop_unmet(Starts& out);
  void give_back(TaskSlot slot, UnitId unit, Starts& out);
  void fail(TaskSlot slot, Starts& out);
  void fail_hopeless(Starts& out);
  void leave_gone(TaskSlot slot);
  void hand_on(UnitId unit);
  enum class Expire : std::uint8_t { kBeforeNow, kByNow };
  void expire(Expire which, Starts& out);
  void settle(Starts& out);
  std::uint32_t class_of(const TaskClass& kind);
  void make_ready(TaskSlot slot, bool alone);
  bool place(TaskSlot slot);
  void hold(TaskSlot slot);
  void place_held();
  void start_all(Starts& out);
  void start(TaskSlot slot, UnitId unit, Starts& out);
  TaskSlot take_high_priority(UnitId unit);
  void unlink(TaskSlot slot);
  void drop(TaskSlot slot, Ending how, Starts& out);
  void drop_successors(TaskSlot slot, Ending how, Starts& out);
  void count_drop(TaskSlot slot, Ending how, Starts& out);
  void end(TaskSlot slot);
  void watch_expiry(TaskSlot slot, Nanos at);
  [[nodiscard]] bool is_stale(const Expiry& expiry) const;
  void tidy_expiries();
  [[nodiscard]] UnitsView view() const { return {.load = load_, .up = up_, .now = now_}; }

  std::unique_ptr<Policy> policy_;
  DispatcherObserver* observer_ = nullptr;
  std::vector<Unit> units_;
  std::vector<int> load_;
  UnitMask all_ = 0;
  UnitMask up_ = 0;
  UnitMask gone_ = 0;
  std::vector<UnitId> start_order_;  ///< The policy's order, then the units that it does not name.
  TaskStore tasks_;
  std::vector<StateQueue> states_;
  std::vector<TaskSlot>
      series_;  ///< By series: the newest that is not decided, kDoneSlot, kNoSlot.
  std::vector<Class> classes_;
  std::unordered_map<TaskClass, std::uint32_t, ClassHash> class_indices_;
  std::uint32_t last_class_ = 0;
  std::vector<std::uint32_t> holding_;      ///< Classes with held tasks, and some that had.
  std::vector<std::uint32_t> prioritized_;  ///< The same for the high-priority queue.
  bool refusals_stand_ = true;  ///< No load fell, no unit changed and nothing left since.
  std::size_t held_count_ = 0;
  std::size_t high_priority_count_ = 0;
  std::vector<Expiry>
      expiries_;  ///< A heap, earliest first; may hold entries of tasks that have started or ended.
  std::size_t expiring_count_ = 0;
  std::uint64_t expiry_sequence_ = 0;
  std::uint64_t ready_sequence_ = 0;
  // Kept for their memory.
  std::vector<TaskSlot> added_;     ///< Of submit.
  std::vector<TaskSlot> doomed_;    ///< Those of them with a predecessor that did not complete.
  std::vector<TaskSlot> released_;  ///< Of complete.
  std::vector<TaskSlot> readers_;   ///< Of decide.
  // Empty between two inputs.
  std::vector<Noted> unmet_;    ///< Nothing that they read will ever be there.
  std::vector<Noted> freed_;    ///< They wait for a state, or for what they read, no longer.
  bool despair_ = false;        ///< A hopeless class has held tasks.
  std::vector<Class*> asking_;  ///< Of place_held: a heap, that of the first task on top.
  TaskCounts counts_;
  std::int64_t refused_ = 0;
  Nanos now_ = Nanos::min();
};

}  // namespace pirt
