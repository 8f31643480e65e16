// What is behind Runtime: tasks on their way, and the dispatcher that one thread at a time may talk
// to.
#pragma once

#include <cstdint>
#include <deque>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "scheduler/dispatcher/dispatcher.h"
#include "scheduler/policies/setup.h"
#include "scheduler/runtime/begin_thread.h"
#include "scheduler/runtime/bell.h"
#include "scheduler/runtime/live_units.h"
#include "scheduler/runtime/runtime.h"
#include "scheduler/runtime/samples.h"
#include "scheduler/runtime/slab.h"
#include "scheduler/runtime/threads.h"
#include "scheduler/runtime/trace_thread.h"
#include "scheduler/services/recall.h"

namespace pirt {

/// A task from its submission to the last that knows of it. Fields of the engine are read and
/// written by whoever has its turn, the others as is said there.
struct runtime::Submitted {
  enum class Event : std::uint8_t { kSubmit, kEnd, kSliceEnded };
  static constexpr int kLive = -1;

  Slab<Submitted>::Place place;
  runtime::Atomic<std::uint32_t> uses = 0;  ///< TaskRefs; the engine has one until it was told.

  // Before it is submitted, and read only from then on.
  std::uint64_t engine = 0;            ///< A number of its own: addresses come again.
  int forks = 0;                       ///< As forks() was when its runtime was made.
  const Workload* workload = nullptr;  ///< Of a runtime that has not ended.
  std::size_t workload_index = 0;
  UnitMask eligible = 0;
  TaskOptions options;
  Nanos submitted_at{0};
  Runtime::Callback callback;

  // On its way to the engine.
  Submitted* next = nullptr;
  Event event = Event::kSubmit;
  CallEnd call_end;  ///< Of Event::kEnd.
  Call call;         ///< Its unit's while it runs; its outputs stay the task's.

  // The engine's.
  std::vector<TaskInput> inputs;  ///< Until it is told, as `after` of its options.
  TaskId id = kNoTask;
  FiringId firing = kNoTask;
  UnitId unit = 0;
  Nanos dispatched_at{0};
  bool taken_in = false;
  bool known = false;              ///< To the dispatcher.
  bool running = false;            ///< On its unit, whatever has become of it.
  bool suspended = false;          ///< There, between two slices.
  Submitted* told_next = nullptr;  ///< Of those that are told together.

  // Written before `end`, read after it, as are the outputs of `call`.
  std::string unit_name;
  std::string name;  ///< Of the workload, where it did not complete.
  std::string problem;
  Nanos busy{0};
  std::optional<Nanos> started_at;
  Nanos ended_at{0};

  /// A TaskEnd, before the callback; store release -> prospect() and TaskFuture::end().
  runtime::Atomic<int> end = kLive;
  runtime::Latch told;  ///< After it.

  [[nodiscard]] bool is_decided() const { return end.load(std::memory_order_relaxed) != kLive; }
  /// As new.
  void begin();
  /// What it holds on to is somebody else's.
  void forget_all();
};

namespace runtime {

/// How often this process, and those that it comes from, have forked since the first runtime: none
/// of its threads is in a child.
[[nodiscard]] Atomic<int>& forks();
/// @param before  What it was when a runtime was made.
/// @throws Error{kEnvironment} if this is no more the process that made it.
void check_process(int before);

/// So many calls given back one after the other, and a unit is no longer asked for their workload.
inline constexpr int kMostReturns = 3;

/// Tasks in order, for one of which each is the engine.
class TaskChain {
 public:
  [[nodiscard]] bool empty() const { return first_ == nullptr; }
  void push(Submitted& task) {
    task.told_next = nullptr;
    (first_ == nullptr ? first_ : last_->told_next) = &task;
    last_ = &task;
  }
  /// Those of @p other behind these; it has none then.
  void append(TaskChain& other) {
    if (other.empty()) return;
    (first_ == nullptr ? first_ : last_->told_next) = other.first_;
    last_ = other.last_;
    other.first_ = nullptr;
  }
  /// Not of an empty one.
  Submitted& take_first() { return *std::exchange(first_, first_->told_next); }

 private:
  Submitted* first_ = nullptr;
  Submitted* last_ = nullptr;
};

}  // namespace runtime

/// Who has something to say to the dispatcher leaves it in a list and takes the turn if it is free;
/// who has the turn works through the list, what comes meanwhile too. So nobody ever waits for it.
/// What has ended is told when the turn is over, and callbacks on threads of the runtime's alone.
class Runtime::Engine final : private LiveDriver {
 public:
  explicit Engine(RuntimeOptions options);
  ~Engine();

  [[nodiscard]] bool is_here() const { return runtime::forks() == forks_; }
  [[nodiscard]] WorkloadHandle find(std::string_view workload) const;
  TaskFuture submit(WorkloadHandle workload, std::vector<TaskInput> inputs, TaskOptions options,
                    Callback callback);
  void cancel(const TaskFuture& task);
  void cancel_all();
  void wait_all();
  void bring_back(std::string_view unit);
  RuntimeStatistics statistics();
  std::vector<Tensor> state(std::string_view name);
  void write_trace();

 private:
  using Submitted = runtime::Submitted;
  using TaskRef = runtime::TaskRef;
  using TaskChain = runtime::TaskChain;
  struct Known {
    const Workload* workload = nullptr;
    const OwnWorkload* own = nullptr;
    UnitMask runs_on = 0;
    UnitMask takers = 0, real_time_takers = 0;  ///< Of these: to which the mode may give a task.
    /// Units that gave back too many calls of it, or where nobody has it: of who has the turn.
    UnitMask gave_up = 0;
    bool takes_image = false;           ///< See TaskOptions::image_input.
    std::optional<StateId> state = {};  ///< Of live_units_.
    std::optional<RecallLead> lead = {};
  };
  struct Unit : RuntimeStatistics::Unit {
    std::uint64_t heard = 0;  ///< Remote::heard when it was asked last what it serves.
    int slots = 0, running = 0;
    std::map<std::size_t, int> returns;  ///< In a row, by workload; of those that it gave back.
  };

  /// Since the start.
  [[nodiscard]] Nanos now() const { return clock_.now() - began_; }
  [[nodiscard]] std::string name_of_rows(const Workload& made) const;
  void load_files();
  void list_workloads();
  void list_workload(const Workload& workload, const OwnWorkload* own, const std::string& name);
  void list_workload(Workload& made);
  void list_workload(const OwnWorkload& own);
  void list_states();
  void take_first_inputs();
  void tell_limits();
  void open_units();
  void ended(UnitId unit, Call& call, CallEnd& end) override;
  void slice_ended(UnitId unit, Call& call) override;
  [[nodiscard]] std::vector<Preparation> preparations(UnitId unit) override;
  [[nodiscard]] Support support(const Known& known, const UnitModel& unit) const;
  [[nodiscard]] UnitMask units_of(const Known& known) const;
  [[nodiscard]] Mix mix() const;
  void check_inputs(const Workload& workload, const std::vector<TaskInput>& inputs) const;
  [[nodiscard]] UnitMask units_for(const Known& known, const TaskOptions& options) const;

  /// What is known of a task as it is submitted.
  enum class Prospect : std::uint8_t { kReady, kWaits, kUrgent };
  /// Each task that it comes after, in order.
  template <typename Visit>
  static void visit_before(const Submitted& task, const Visit& visit) {
    for (const TaskInput& input : task.inputs) {
      if (input.output_.task) visit(*input.output_.task);
    }
    for (const TaskFuture& before : task.options.after) {
      if (before.task_) visit(*before.task_);
    }
  }
  [[nodiscard]] static Prospect prospect(const Submitted& task);
  [[nodiscard]] bool may_wait(Prospect prospect, std::uint64_t turns);
  static void post(runtime::Atomic<Submitted*>& list, Submitted& task, Submitted::Event event);
  /// Whose thread it is that works: callbacks run on the runtime's own alone.
  enum class Thread : std::uint8_t { kOurs, kTheirs };
  void work(Thread thread);
  template <typename Body>
  void in_turn(const Body& body) {
    {
      const auto turn = turn_.take();
      body();
    }
    work(Thread::kTheirs);  // What was posted for who had the turn.
  }
  [[nodiscard]] bool has_work() const {
    return ended_calls_.load() != nullptr || asked_.load() != 0 ||
           (submitted_.load() != nullptr && (turns_.load() & 1U) != 0);
  }
  void take_turn();
  void take_all(runtime::Atomic<Submitted*>& list);
  void take_event(Submitted& task);
  void end_turn(runtime::Turn::Held& turn, TaskChain& ended);
  void take_in(Submitted& task);
  [[nodiscard]] Task dispatched(const Submitted& task);
  void take_end(Submitted& task);
  void take_slice(Submitted& task);
  [[nodiscard]] static std::string why_dropped(const Submitted& task);
  void note_arrival(const Submitted& task);
  void count_returns(const Submitted& task);
  void look();
  [[nodiscard]] Expectation expected(UnitId unit, const Call& call) override;
  void set_unit(UnitId unit, UnitState state) override;
  void give_up(UnitId unit, Call& call, CallEnd end) override;
  void lose(UnitId unit);
  void ask_for_all(UnitId unit, bool says_news);
  void hear_of_others();
  void cancel_asked();
  void apply();
  void start(const Start& start);
  void count_running(UnitId unit, int more);
  void fill_call(Submitted& task);
  void decide(Submitted& task, TaskEnd end);
  void finish(Submitted& task, TaskEnd end);
  void forget(Submitted& task);
  void tell(TaskChain& ended, Thread thread);
  void tell_posted();
  void call_back(TaskRef task);
  void told(TaskRef task);
  void post_line(const std::string& line);
  void say(const std::string& line);
  void add_problem(std::string problem) override;
  void watch(const std::stop_token& stop);
  void watch_by(Nanos due);
  void wake_watcher() { watch_by(Nanos::zero()); }
  /// Null if it is none of those that are known.
  [[nodiscard]] Submitted* task_of(TaskId id) {
    Submitted* const task = tasks_[slot_of(id)];
    return task != nullptr && task->id == id ? task : nullptr;
  }
  /// Of a call's token, which is the task's address: the unit's thread has no turn.
  [[nodiscard]] static Submitted& task_at(std::uint64_t token) {
    return *reinterpret_cast<Submitted*>(token);  // NOLINT(performance-no-int-to-ptr): as made.
  }
  const std::uint64_t number_of_engine_;
  const int forks_;
  RuntimeOptions options_;
  runtime::LiveClock clock_;
  Nanos began_ = clock_.now();
  /// And those of the options that are made. A call that hangs may outlive the engine.
  std::shared_ptr<std::deque<Workload>> own_ = std::make_shared<std::deque<Workload>>();
  std::vector<Known> workloads_;
  std::map<std::string, std::size_t, std::less<>> names_;
  Mix mix_;
  std::optional<ModeSetup> setup_;
  Samples samples_;

  struct CloseSlab {
    void operator()(runtime::Slab<Submitted>* slab) const { slab->close(); }
  };
  std::unique_ptr<runtime::Slab<Submitted>, CloseSlab> records_{&runtime::Slab<Submitted>::make()};

  // What is posted for who has the turn, the newest first.
  runtime::Atomic<Submitted*> submitted_ = nullptr;
  runtime::Atomic<Submitted*> ended_calls_ = nullptr;
  enum : unsigned { kTakeIn = 1, kLook = 2 };
  runtime::Atomic<unsigned> asked_ = 0;  ///< What else is wanted.
  runtime::Atomic<bool> closing_ = false;
  runtime::Turn turn_;
  /// How many turns have ended, times two; one more if what is submitted is not to wait for the
  /// next one: some unit could start it, or what it comes after may not have completed.
  /// store(turns_) -> load(submitted_) of who ends a turn, seq_cst; pairs with post(submitted_) ->
  /// load(turns_) of submit: one of the two sees the other.
  runtime::Atomic<std::uint64_t> turns_ = 1;

  // Of who has the turn.
  std::optional<Dispatcher> dispatcher_;
  std::unique_ptr<TraceWriter> writer_;  ///< Null: nobody wants a trace.
  std::unique_ptr<TraceThread> trace_;   ///< Tells it.
  std::vector<int> queued_;              ///< For the trace.
  Effects effects_;
  Effects applied_;  ///< For its memory.
  std::vector<Unit> units_;
  std::vector<UnitId> elsewhere_;                            ///< Those that compute there.
  std::map<std::string, StateId, std::less<>> state_names_;  ///< Workloads may share them.
  std::vector<Submitted*> tasks_;  ///< By slot of their ids; null = not known.
  std::vector<TaskId> after_;
  TaskChain ended_;                     ///< To be told when the turn is over.
  std::vector<Tensor> freed_;           ///< Inputs to let go of then: who hears may call it.
  bool some_did_not_complete_ = false;  ///< Of those that ended in the turn.
  UnitMask with_room_ = 0;              ///< Units that could start another task.
  Nanos now_{0};                        ///< Of the last event.
  Nanos look_at_{0};                    ///< At calls that run.
  std::uint32_t number_ = 0;
  std::int64_t running_ = 0;
  RuntimeStatistics counts_;
  Problems problems_;
  Nanos set_up_{0};
  bool starting_ = true;  ///< Written before it has any task.

  runtime::Mutex bringing_back_;  ///< One unit at a time.

  runtime::Mutex asking_;
  std::vector<TaskRef> cancels_;
  bool cancels_all_ = false;

  runtime::Mutex telling_;
  TaskChain to_tell_;  ///< Those that ended in the turn of a thread that is not the runtime's.
  std::vector<std::string> to_say_;  ///< Lines, where somebody wants to hear of them.
  runtime::Atomic<bool> anything_to_tell_ = false;  ///< Of these two.

  runtime::Room room_;

  runtime::Bell watch_;
  runtime::Atomic<Nanos> watch_at_ = Nanos::max();  ///< When it looks.
  runtime::Atomic<bool> calls_run_ = false;         ///< Written in turns.
  runtime::Thread watcher_;
  LiveUnits live_units_;  ///< Last: their threads use all of it.
};

}  // namespace pirt
