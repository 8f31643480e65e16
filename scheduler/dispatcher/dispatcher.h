// The only owner of queues, loads, dependencies and the high-priority queue: a pure state machine.
//
// No threads, no clock, no I/O: each call is an input with its time, and appends what may start
// now. The same inputs in the same order give the same answers, whether virtual time or worker
// threads drive it. One caller at a time.
//
// A firing's tasks are submitted together, and released when nothing that comes later can name
// them: until then a task that ended without completing is known, so that no task runs on missing
// input.
#pragma once

#include <algorithm>
#include <limits>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <span>
#include <utility>
#include <vector>

#include "scheduler/dispatcher/expiries.h"
#include "scheduler/dispatcher/task_list.h"
#include "scheduler/dispatcher/task_store.h"
#include "scheduler/dispatcher/ties.h"
#include "scheduler/dispatcher/waiting.h"
#include "scheduler/mix/task.h"
#include "scheduler/policies/policy.h"

namespace pirt {

/// One call of the dispatcher, as it took it: `now` is never before that of the call before.
struct DispatcherInput {
  enum class Kind : std::uint8_t {
    kSubmit,
    kRelease,
    kComplete,
    kCancel,
    kSetUnit,
    kWake,
    kSliceEnded
  };
  Kind kind = Kind::kWake;
  Nanos now{0};
  FiringId firing = kNoTask;         ///< Of kRelease, and of kSubmit unless that was refused.
  std::span<const Task> tasks = {};  ///< Of kSubmit.
  TaskId task = 0;                   ///< Of kComplete, kCancel and kSliceEnded.
  UnitId unit = 0;                   ///< Of kComplete, kSetUnit and kSliceEnded.
  Outcome outcome = Outcome::kCompleted;
  UnitState state = UnitState::kUp;
};

/// What an input brought about.
struct Answer {
  bool taken = true;                       ///< False: it made no sense and changed nothing.
  std::span<const TaskId> submitted = {};  ///< Of DispatcherInput::tasks.
  std::span<const Start> started;
  std::span<const Ended> ended;
  std::span<const Sliced> suspended = {};
  std::span<const Sliced> resumed = {};
};

/// Hears of every input and what it brought about, in order. Must not call the dispatcher's inputs.
/// What it throws leaves the dispatcher in order, and reaches whoever called.
class DispatcherObserver {
 public:
  virtual ~DispatcherObserver() = default;
  virtual void on_input(const DispatcherInput& input, const Answer& answer) = 0;
};

class Dispatcher {
 public:
  using TemplateId = std::uint32_t;  ///< Of one dispatcher.
  /// Of no template: what is submitted with it is refused.
  static constexpr TemplateId kNoTemplate = std::numeric_limits<TemplateId>::max();

  /// @param slots   By unit: how many tasks may be started on it and not be complete; absent = no
  /// limit. At most kMaxUnits.
  Dispatcher(std::vector<std::optional<int>> slots, std::unique_ptr<Policy> policy);
  Dispatcher(const Dispatcher&) = delete;  // Its parts know each other.
  Dispatcher& operator=(const Dispatcher&) = delete;

  // A `now` before that of an earlier call is taken as that one: callers on several threads read
  // their clock before they wait for their turn. Each input first expires what should have started
  // before `now`; at its last moment a task may still start. An input that makes no sense is
  // refused: it changes nothing, and its caller hears `false`.

  /// Registers the tasks of a firing (Effects::submitted), and then places those that are ready.
  /// What the policy would give to no unit fails when it could start.
  /// Absent if refused: a task that comes after itself or a later one of @p tasks, or that no unit
  /// may serve; a state or series out of range.
  std::optional<FiringId> submit(std::span<const Task> tasks, Nanos now, Effects& out);
  /// What firings that come again and again have in common: all but times. kNoTemplate if a task
  /// makes no sense, or comes after one of an earlier submission.
  [[nodiscard]] TemplateId add_template(std::span<const Task> tasks);
  /// The same in the end, without looking again at what the template says. Refused: also what is
  /// not as many tasks as that has, or of no template.
  /// @param tasks  As those of the template, but for times.
  std::optional<FiringId> submit(TemplateId of, std::span<const Task> tasks, Nanos now,
                                 Effects& out);
  /// No task that is submitted from now on names one of this firing: those of it that ended
  /// without completing are forgotten, and those that have yet to end will be as they do. A firing
  /// that is never released is kept. Refused: a firing that is not known, or released.
  bool release(FiringId firing, Nanos now);
  /// The paper's per-unit callback: @p task ended on @p unit, where it was started. A failed task
  /// drops its successors; one that is given back keeps its place in line, and fails if there
  /// is no other unit that the policy would let try. The unit goes on with the high-priority queue,
  /// then with its own.
  /// Refused: a task that does not run there, as after a second completion.
  bool complete(UnitId unit, TaskId task, Outcome outcome, Nanos now, Effects& out);
  /// @p task, which runs on @p unit, has ended a slice there and another one follows. What waits
  /// for the unit with a nearer deadline, and is of another workload than all that is suspended
  /// there, starts in its place: the task is suspended (Effects::suspended), keeps the unit and
  /// counts as one. It is resumed (Effects::resumed) when what was let in has ended and nothing
  /// waits that is more urgent; where it is not suspended, it goes on at once. Refused: a task that
  /// does not run there, or is suspended already.
  bool slice_ended(UnitId unit, TaskId task, Nanos now, Effects& out);
  /// Drops a task in any state, and its successors. One that runs keeps its slot until it is
  /// completed. Does nothing if the task is done already (which its caller cannot always know).
  void cancel(TaskId task, Nanos now, Effects& out);
  /// A unit that is not up hands what waits in its queue to others. What only units that are gone
  /// could take fails, from now on when it could start. Refused: no such unit.
  bool set_unit(UnitId unit, UnitState state, Nanos now, Effects& out);
  /// Expires what should have started by @p now, takes back what should have completed on some
  /// units, and asks the policy again where it wanted to be. Call it after the completions of that
  /// time: a task may start at its last moment.
  void wake(Nanos now, Effects& out);
  /// @param observer  Null = none (the default); must outlive what follows.
  void observe(DispatcherObserver* observer) { observer_ = observer; }
  /// When to call wake next; Nanos::max() = never.
  [[nodiscard]] Nanos next_wake() const { return next_wake_; }

  [[nodiscard]] const TaskCounts& counts() const { return counts_; }
  [[nodiscard]] const Policy& policy() const { return *policy_; }
  /// Q of the paper: tasks queued and running on the unit.
  [[nodiscard]] int load(UnitId unit) const { return load_[unit]; }
  /// Without those that are suspended.
  [[nodiscard]] int running(UnitId unit) const { return units_[unit].running; }
  [[nodiscard]] int suspended(UnitId unit) const {
    return static_cast<int>(units_[unit].suspended.size());
  }
  /// Tasks that could start: by unit those in its queue, then those that are in none.
  void list_waiting(std::vector<int>& waiting) const;
  /// Absent if the task is done or unknown.
  [[nodiscard]] std::optional<TaskState> state(TaskId task) const;
  /// When the task is taken back, if it has not ended; absent if it never is, as where nobody else
  /// would take it.
  [[nodiscard]] std::optional<Recall> recall(TaskId task) const;
  /// What takes memory.
  [[nodiscard]] std::size_t known_tasks() const { return tasks_.tasks(); }
  [[nodiscard]] std::size_t known_firings() const { return tasks_.firings(); }

 private:
  [[nodiscard]] bool is_urgent(TaskSlot slot) const {
    return waiting_.slices_end() && tasks_[slot].deadline != Nanos::max();
  }
  void note_urgent();
  struct Unit {
    int slots = 0;
    int running = 0;
    TaskList queue = {};
    /// Those there with a deadline, by workload; once calls suspend.
    std::map<WorkloadId, std::set<ByDeadline>> urgent = {};
    std::vector<TaskSlot> suspended = {};  ///< The innermost last.
  };
  [[nodiscard]] std::set<ByDeadline>& urgent_with(TaskSlot slot, UnitId unit) {
    return units_[unit].urgent[waiting_.class_at(slot).kind.workload];
  }
  struct Template {
    std::vector<std::uint32_t> class_of;  ///< By task; kNone until it was submitted once.
    bool binds = false;                   ///< By states and series.
  };
  template <typename Body>
  bool take(DispatcherInput input, Nanos now, Effects& out, const Body& body);
  std::optional<FiringId> submit_if(bool sound, Template* known, std::span<const Task> tasks,
                                    Nanos now, Effects& out);
  void add(Slot firing, std::span<const Task> tasks, Template* known, Effects& out);
  void place_added(Effects& out);
  [[nodiscard]] bool are_sound(std::span<const Task> tasks) const;
  void link(TaskSlot slot, std::span<const TaskId> after);
  void bind(std::span<const Task> tasks);
  void drop_unmet(Effects& out);
  void give_back(TaskSlot slot, UnitId unit, Effects& out);
  void fail(TaskSlot slot, Effects& out);
  void leave_gone(TaskSlot slot);
  void hand_on(UnitId unit);
  void expire(Nanos before, Effects& out) {
    if (expiries_.any() || recalls_.any()) expire_watched(before, out);
  }
  void expire_watched(Nanos before, Effects& out);
  void take_back(TaskSlot slot, Effects& out);
  [[nodiscard]] TaskClass once_back(TaskSlot slot, const TaskTies& ties) const;
  void settle(Effects& out);
  void take_news(Effects& out);
  void make_ready(TaskSlot slot, bool alone);
  bool place(TaskSlot slot);
  void start_all(Effects& out);
  void fill(UnitId id, Effects& out);
  void note_running(UnitId id);
  TaskSlot next_for(UnitId id);
  void start(TaskSlot slot, UnitId unit, Effects& out);
  void enter(TaskSlot slot, UnitId unit, const UnitsView& shown);
  void depart(TaskSlot slot, UnitId unit, Whereabouts to);
  void tell_moved(TaskSlot slot, Whereabouts from, Whereabouts to, const UnitsView& shown);
  void put_in_queue(TaskSlot slot, UnitId unit, const UnitsView& shown);
  void take_from_queue(TaskSlot slot, UnitId unit);
  void suspend(TaskSlot slot, UnitId unit);
  void resume(UnitId unit);
  bool let_in(UnitId unit, Nanos before, Effects& out);
  bool take_in(TaskSlot slot, UnitId unit);
  void resume_suspended(Effects& out);
  void unlink(TaskSlot slot, Whereabouts to);
  void drop(TaskSlot slot, TaskEnd how, Effects& out);
  void drop_successors(TaskSlot slot, TaskEnd how, Effects& out);
  void count_drop(TaskSlot slot, TaskEnd how, Effects& out);
  void end(TaskSlot slot);
  [[nodiscard]] UnitsView view() const { return {.load = load_, .up = up_, .now = now_}; }

  std::unique_ptr<Policy> policy_;
  DispatcherObserver* observer_ = nullptr;
  std::vector<Unit> units_;
  std::vector<int> load_;
  UnitMask all_ = 0;
  UnitMask up_ = 0;
  UnitMask gone_ = 0;
  UnitMask idle_ = 0;                ///< Those that are up and have a free slot.
  UnitMask queued_ = 0;              ///< Those with something in their queue.
  UnitMask suspending_ = 0;          ///< Those with tasks that are suspended.
  std::vector<UnitId> start_order_;  ///< The policy's order, then the units that it does not name.
  TaskStore tasks_;
  Ties ties_{tasks_};
  Waiting waiting_{tasks_, *policy_};
  Expiries expiries_{tasks_, &TaskRecord::expires};
  Expiries recalls_{tasks_, &TaskRecord::recalled};
  std::uint64_t ready_sequence_ = 0;
  std::vector<Template> templates_;
  // Kept for their memory.
  std::vector<TaskSlot> added_;     ///< Of submit.
  std::vector<TaskSlot> doomed_;    ///< Those of them with a predecessor that did not complete.
  std::vector<TaskSlot> released_;  ///< Of complete.
  std::vector<TaskSlot> urgent_;    ///< Of let_in,
  std::vector<int> shown_;          ///< and the loads that a policy sees then.
  TaskCounts counts_;
  Nanos ask_again_ = Nanos::max();  ///< The policy's wish, while something is held.
  Nanos next_wake_ = Nanos::max();
  Nanos now_ = Nanos::min();
};

/// Every input goes through here.
/// @param input  Without its time.
/// @param body   bool(DispatcherInput&): carries it out; false if it is refused, and then has
/// changed nothing.
template <typename Body>
bool Dispatcher::take(DispatcherInput input, Nanos now, Effects& out, const Body& body) {
  input.now = now_ = std::max(now_, now);
  std::size_t submitted = 0, started = 0, ended = 0, suspended = 0, resumed = 0;
  if (observer_ != nullptr) {
    submitted = out.submitted.size();
    started = out.started.size();
    ended = out.ended.size();
    suspended = out.suspended.size();
    resumed = out.resumed.size();
  }
  const bool taken = body(input);
  if (observer_ != nullptr) {
    observer_->on_input(input, {.taken = taken,
                                .submitted = std::span(out.submitted).subspan(submitted),
                                .started = std::span(out.started).subspan(started),
                                .ended = std::span(out.ended).subspan(ended),
                                .suspended = std::span(out.suspended).subspan(suspended),
                                .resumed = std::span(out.resumed).subspan(resumed)});
  }
  return taken;
}

}  // namespace pirt
