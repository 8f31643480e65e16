// What is behind Runtime: tasks on their way, and the dispatcher that one thread at a time may talk
// to.
#pragma once

#include <atomic>
#include <condition_variable>
#include <cstdint>
#include <deque>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <thread>
#include <utility>
#include <vector>

#include "scheduler/dispatcher/dispatcher.h"
#include "scheduler/dispatcher/slot_table.h"
#include "scheduler/policies/setup.h"
#include "scheduler/runtime/latch.h"
#include "scheduler/runtime/live_units.h"
#include "scheduler/runtime/output_pool.h"
#include "scheduler/runtime/room.h"
#include "scheduler/runtime/runtime.h"
#include "scheduler/runtime/samples.h"
#include "scheduler/runtime/turn.h"
#include "scheduler/services/recall.h"
#include "scheduler/trace/trace_thread.h"

namespace pirt {

/// A task from its submission to the last that knows of it. Fields of the engine are read and
/// written by whoever has its turn, the others as is said there.
struct runtime::Submitted {
  enum class Event : std::uint8_t { kSubmit, kEnd };

  // Before it is submitted, and read only from then on.
  std::uint64_t engine = 0;            ///< A number of its own: addresses come again.
  const Workload* workload = nullptr;  ///< Of a runtime that has not ended.
  std::size_t workload_index = 0;
  UnitMask eligible = 0;
  TaskOptions options;
  Nanos submitted_at{0};
  Runtime::Callback callback;

  // On its way to the engine.
  Submitted* next = nullptr;
  Event event = Event::kSubmit;
  std::shared_ptr<Submitted> self;  ///< Until the engine has it.
  CallEnd call_end;                 ///< Of Event::kEnd.
  Call call;                        ///< Its unit's while it runs; its outputs stay the task's.

  // The engine's.
  std::vector<TaskInput> inputs;
  TaskId id = 0;
  std::optional<Recall> recall;
  UnitId unit = 0;
  Nanos dispatched_at{0};
  bool taken_in = false;
  bool known = false;           ///< To the dispatcher.
  bool running = false;         ///< On its unit, whatever has become of it.
  std::optional<TaskEnd> ends;  ///< Decided; told soon.

  // Written before `end`, read after it, as are the outputs of `call`.
  std::string unit_name;
  std::string name;  ///< Of the workload, where it did not complete.
  std::string problem;
  Nanos busy{0};
  std::optional<Nanos> started_at;
  Nanos ended_at{0};

  static constexpr int kLive = -1;
  std::atomic<int> end = kLive;  ///< A TaskEnd; before the callback.
  runtime::Latch told;           ///< After it.
};

namespace runtime {

/// While one of these is there, its thread must not wait for tasks: it would wait for itself.
class MustNotWait {
 public:
  MustNotWait() : before_(std::exchange(here_, true)) {}
  ~MustNotWait() { here_ = before_; }
  MustNotWait(const MustNotWait&) = delete;
  MustNotWait& operator=(const MustNotWait&) = delete;

  [[nodiscard]] static bool here() { return here_; }
  /// @throws std::logic_error if the calling thread must not.
  static void check(const char* what);

 private:
  static thread_local bool here_;
  bool before_;
};

}  // namespace runtime

/// Who has something to say to the dispatcher leaves it in a list and takes the turn if it is free;
/// who has the turn works through the list, what comes meanwhile too. So nobody ever waits for it.
/// What has ended is told when the turn is over, and callbacks on threads of the runtime's alone.
class Runtime::Engine {
 public:
  explicit Engine(RuntimeOptions options);
  ~Engine();

  TaskFuture submit(std::string_view workload, std::vector<TaskInput> inputs, TaskOptions options,
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
  using Tasks = std::vector<std::shared_ptr<Submitted>>;
  struct Known {
    const Workload* workload = nullptr;
    const OwnWorkload* own = nullptr;
    UnitMask runs_on = 0;
    UnitMask gave_up = 0;      ///< Units that gave back too many calls of it: of who has the turn.
    bool takes_image = false;  ///< See TaskOptions::image_input.
    std::optional<StateId> state = {};  ///< Index of states_.
    std::optional<RecallLead> lead = {};
  };
  struct Unit {
    bool in_service = true;
    std::int64_t completed = 0;
    Nanos busy{0}, powered{0};
    Histogram latency;
  };

  /// Since the start.
  [[nodiscard]] Nanos now() const { return clock_.now() - began_; }
  void list_workloads();
  void list_states();
  void take_first_inputs();
  void open_units();
  void ended(Call& call, CallEnd& end);
  std::vector<Preparation> preparations(UnitId unit);
  [[nodiscard]] Support support(const Known& known, const UnitModel& unit) const;
  [[nodiscard]] UnitMask units_of(const Known& known) const;
  [[nodiscard]] Mix mix() const;
  [[nodiscard]] std::size_t find(std::string_view workload) const;
  void check_inputs(const Workload& workload, const std::vector<TaskInput>& inputs) const;
  [[nodiscard]] UnitMask units_named(const std::vector<std::string>& names) const;

  void post(Submitted& task, Submitted::Event event);
  /// Whose thread it is that works: callbacks run on the runtime's own alone.
  enum class Thread : std::uint8_t { kOurs, kTheirs };
  void work(Thread thread);
  [[nodiscard]] bool has_work() const { return posted_.load() != nullptr || asked_; }
  void take_turn();
  void take_event(Submitted& task, Nanos now);
  void end_turn(runtime::Turn::Held& turn, Tasks& ended);
  void take_in(Submitted& task, Nanos now);
  [[nodiscard]] Task dispatched(const Submitted& task);
  TaskId never(Nanos now);
  void take_end(Submitted& task, Nanos now);
  void count_returns(const Submitted& task, Nanos now);
  void look(Nanos now);
  [[nodiscard]] const Service* expected(UnitId unit, std::uint64_t token);
  void give_up(const LiveUnits::Hung& hung, Nanos now);
  void lose(UnitId unit, Nanos now);
  void note_reach(Nanos now);
  void ask_for_all(UnitId unit);
  void cancel_asked(Nanos now);
  void apply(Nanos now);
  void start(const Start& start);
  void request_stop(Submitted& task);
  void fill_call(Submitted& task);
  void finish(Submitted& task, TaskEnd end, Nanos now);
  void forget(Submitted& task, Nanos now);
  void tell(Tasks& ended, Thread thread);
  void tell_left();
  void call_back(std::shared_ptr<Submitted> task);
  void told(std::shared_ptr<Submitted> task);
  void add_problem(std::string problem);
  void watch(const std::stop_token& stop);
  void wake_watcher();
  [[nodiscard]] Submitted& task_of(TaskId id) { return *tasks_[static_cast<std::uint32_t>(id)]; }
  /// Of a call's token, which is the task's address: the unit's thread has no turn.
  [[nodiscard]] static Submitted& task_at(std::uint64_t token) {
    return *reinterpret_cast<Submitted*>(token);  // NOLINT(performance-no-int-to-ptr): as made.
  }
  const std::uint64_t number_of_engine_;
  RuntimeOptions options_;
  MachineClock clock_;
  Nanos began_ = clock_.now();
  /// And RuntimeOptions::made. A call that hangs may outlive the engine.
  std::shared_ptr<std::deque<Workload>> own_ = std::make_shared<std::deque<Workload>>();
  std::vector<Known> workloads_;
  std::map<std::string, std::size_t, std::less<>> names_;
  Mix mix_;
  std::optional<ModeSetup> setup_;
  Samples samples_;

  std::atomic<Submitted*> posted_ = nullptr;
  std::atomic<bool> asked_ = false;  ///< Something is wanted that is not in posted_.
  std::atomic<bool> closing_ = false;
  runtime::Turn turn_;

  // Of who has the turn.
  std::optional<Dispatcher> dispatcher_;
  std::unique_ptr<TraceWriter> writer_;  ///< Null: nobody wants a trace.
  std::unique_ptr<TraceThread> trace_;   ///< Tells it.
  std::vector<int> queued_;              ///< For the trace.
  Effects effects_;
  Effects applied_;  ///< For its memory.
  std::vector<Unit> units_;
  OutputPool pool_;
  std::vector<std::shared_ptr<StateValue>> states_;  ///< Workloads may share them.
  std::map<std::string, StateId, std::less<>> state_names_;
  SlotTable<std::shared_ptr<Submitted>> tasks_;  ///< By the lower half of their id.
  std::vector<TaskId> after_;
  Tasks ended_;                  ///< To be told when the turn is over.
  std::optional<TaskId> never_;  ///< For the dispatcher: what comes after it is dropped.
  std::uint32_t number_ = 0;
  std::int64_t running_ = 0;
  RuntimeStatistics counts_;
  Problems problems_;
  Nanos set_up_{0};

  std::mutex bringing_back_;  ///< One unit at a time.

  std::mutex asking_;
  Tasks cancels_;
  bool cancels_all_ = false;

  std::mutex telling_;
  Tasks to_tell_;  ///< Those that ended in the turn of a thread that is not the runtime's.
  std::vector<std::string> to_say_;          ///< Problems, where somebody wants to hear of them.
  std::atomic<bool> anything_left_ = false;  ///< Of these two.

  runtime::Room room_;

  std::mutex watch_mutex_;
  std::condition_variable_any watch_sooner_;
  Nanos watch_at_ = Nanos::max();
  bool watch_now_ = false;
  std::atomic<bool> watcher_rests_ = false;  ///< It looks at nothing until it is woken.
  std::atomic<bool> calls_run_ = false;
  std::atomic<bool> out_of_reach_ = false;  ///< Some unit is, and may be within it again.
  std::jthread watcher_;
  LiveUnits live_units_;  ///< Last: their threads use all of it.
};

}  // namespace pirt
