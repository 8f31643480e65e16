// The runtime: a robot's program submits tasks and never names a device.
//
// At its start it opens every unit of the platform on a thread of its own and prepares on each what
// it will be asked for. From then on each task goes to the unit that the mode chooses when the task
// is ready, and its outputs, a future and a callback tell of its end. Tasks follow each other by
// taking outputs of others, or by `after`.
//
// Threads: every function here may be called from any thread, and from callbacks, kernels and the
// `release` of a Tensor::over, but for those that wait (TaskFuture::wait and get,
// Runtime::wait_all): there they would wait for themselves, and throw std::logic_error instead. For
// the same reason submit waits there for no room, and there may be more tasks than most_tasks.
// Its threads hear no signals, which are for the robot's own, and are of the class of the process,
// whatever real-time class the thread has that makes the runtime. Who binds that thread to a core
// does not bind the units to it. None of them is in a child that is forked (fork, daemon): there a
// runtime that was made before takes nothing and waits for nothing, but throws Error{kEnvironment}.
// A callback runs on a thread of the runtime's, mostly that of the unit that ended the task, which
// takes nothing new meanwhile, so that it should be short; never on one that submits, cancels or
// asks. What it throws is counted, and told by statistics().
//
// Example:
//     pirt::Runtime runtime({.workloads = {"undistort", "gaussian_blur"}});
//     const auto undistort = runtime.workload("undistort");
//     const auto blur = runtime.workload("gaussian_blur");
//     auto flat = runtime.submit(undistort, {frame});
//     auto blurred = runtime.submit(blur, {flat.output(0)}, {.real_time = true});
//     use(blurred.get()[0]);
// A whole robot: tests/examples/robot.cpp.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <span>
#include <stop_token>
#include <string>
#include <string_view>
#include <utility>
#include <variant>
#include <vector>

#include "characterize/platform/platform.h"
#include "characterize/profile/profile.h"
#include "scheduler/mix/task.h"
#include "scheduler/record/histogram.h"
#include "workloads/base/time.h"
#include "workloads/model/tensor.h"
#include "workloads/model/workload.h"

namespace pirt {

namespace runtime {
struct Submitted;

/// One of those that know of a task, whose record is used again when the last has gone.
class TaskRef {
 public:
  TaskRef() = default;
  /// @param task  Of which the caller is one, and no more from now on.
  explicit TaskRef(Submitted& task) : task_(&task) {}
  TaskRef(const TaskRef& other) : task_(other.task_) {
    if (task_ != nullptr) hold(*task_);
  }
  TaskRef(TaskRef&& other) noexcept : task_(std::exchange(other.task_, nullptr)) {}
  TaskRef& operator=(TaskRef other) noexcept {
    std::swap(task_, other.task_);
    return *this;
  }
  ~TaskRef() {
    if (task_ != nullptr) let_go(*task_);
  }

  [[nodiscard]] Submitted* get() const { return task_; }
  Submitted* operator->() const { return task_; }
  Submitted& operator*() const { return *task_; }
  explicit operator bool() const { return task_ != nullptr; }
  /// The caller is one in its place.
  [[nodiscard]] Submitted& release() { return *std::exchange(task_, nullptr); }

  static void hold(Submitted& task);
  static void let_go(Submitted& task);

 private:
  Submitted* task_ = nullptr;
};

}  // namespace runtime

/// One output of a task.
struct TaskOutput {
  runtime::TaskRef task;
  std::size_t index = 0;
};

/// Of one task; copies are of the same. It may outlive its runtime. What asks one that is of no
/// task throws std::logic_error.
class TaskFuture {
 public:
  TaskFuture() = default;
  explicit TaskFuture(runtime::TaskRef task) : task_(std::move(task)) {}

  [[nodiscard]] bool valid() const { return task_.get() != nullptr; }
  /// Absent until the task has ended.
  [[nodiscard]] std::optional<TaskEnd> end() const;
  /// Until it has ended, and its callback has returned.
  TaskEnd wait() const;
  /// The same, but not longer than @p most; absent if it has not by then.
  [[nodiscard]] std::optional<TaskEnd> wait_for(Nanos most) const;
  /// The outputs, as Workload::outputs; waits for them. They stay as they are while this future or
  /// another of the task, or a tensor that shares one of them, is there.
  /// @throws Error{kEnvironment} with the reason if the task did not complete.
  [[nodiscard]] std::span<const Tensor> get() const&;
  std::span<const Tensor> get() const&& = delete;  // They would go with it.
  /// For tasks that take it as an input.
  [[nodiscard]] TaskOutput output(std::size_t index) const { return {task_, index}; }
  /// The name of the unit that it ran on last; empty if it never did.
  [[nodiscard]] std::string unit() const;
  /// How long its last call occupied that unit; 0 if it never ran. Valid once it has ended.
  [[nodiscard]] Nanos busy() const;
  /// From its submission to its end, and from there to when its unit got it; 0 if that never was.
  /// Valid once it has ended.
  [[nodiscard]] Nanos latency() const;
  [[nodiscard]] Nanos waited() const;
  /// Why it failed; empty if it did not. Valid once it has ended.
  [[nodiscard]] std::string problem() const;

 private:
  friend class Runtime;
  [[nodiscard]] runtime::Submitted& task() const;
  runtime::TaskRef task_;
};

/// A workload of a runtime, found once: Runtime::workload. As long as that runtime is there.
class WorkloadHandle {
 public:
  WorkloadHandle() = default;

 private:
  friend class Runtime;
  std::uint64_t engine_ = 0;
  std::size_t index_ = 0;
};

/// What a task takes: data that is there, shared and not copied, so that nobody may write it until
/// the task has ended; or what another task will have made.
class TaskInput {
 public:
  TaskInput(const Tensor& tensor) : tensor_(tensor.share()) {}  // NOLINT: by design.
  TaskInput(TaskOutput output) : output_(std::move(output)) {}  // NOLINT
  TaskInput(const TaskInput& other) : tensor_(other.tensor_.share()), output_(other.output_) {}
  TaskInput(TaskInput&&) = default;

 private:
  friend class Runtime;
  Tensor tensor_;
  TaskOutput output_;  ///< Without a task: tensor_ it is.
};

/// For a function of one's own while it runs: whether its result is wanted no more, since the task
/// was cancelled, its runtime ends, or the call has passed its time limit. It may return at once
/// then, whatever its outputs hold. A std::stop_callback of it must be quick, and not call the
/// runtime. Elsewhere a token that never stops.
[[nodiscard]] std::stop_token stop_of_this_call();

/// A workload that pirt does not have.
struct OwnWorkload {
  std::string name;
  std::vector<TensorSpec> inputs;
  std::vector<TensorSpec> outputs;
  /// By name of a unit, or of a backend for all its units. Called on the unit's thread; outputs may
  /// hold what was written to them earlier. What one throws fails the task.
  std::map<std::string, std::function<void(std::span<const Tensor>, std::span<Tensor>)>> kernels;
  /// What a call takes, by unit, for modes that look at it; absent = one millisecond.
  std::map<std::string, Nanos> expected = {};
  /// What it is to others: units whose backend has it serve it besides those of `kernels`, such as
  /// workers elsewhere. Of these inputs and outputs, with make_data, without a state.
  std::shared_ptr<const Workload> known_as = {};
};

/// A module or a workload file (workloads/own).
struct WorkloadFile {
  std::string path;
  /// Of its workloads, also in sizes of one's own ("mine.sobel@1280x720"). Empty = all, in the size
  /// that they have by themselves.
  std::vector<std::string> workloads = {};
};

/// What a runtime serves, by
///   a name: of the catalogue or of a file that is loaded, also in a size of one's own
///   ("sobel@1280x720");
///   WorkloadFile: what that defines;
///   Workload: of the catalogue's kinds, made otherwise. Those whose state has the same name share
///   it, and take turns; the first one's beginning counts. A profile's rows are found by their
///   names: of a workload on pictures of another size than the name's, by that size's
///   (sobel@1280x720);
///   OwnWorkload: a function of one's own.
using ServedWorkload = std::variant<std::string, WorkloadFile, Workload, OwnWorkload>;

struct RuntimeOptions {
  /// Its units with a backend are used, and others for which some workload has a kernel.
  Platform platform = load_platform("host");
  /// Measured on the platform. Absent = all units count as equally fast; with one, a unit serves
  /// what it has a usable row of.
  std::optional<Profile> profile = {};
  bool strict = false;                         ///< Rows that are doubted are not used.
  std::string mode = "ect";                    ///< Any that plans nothing ahead (pirt list modes).
  std::vector<ServedWorkload> workloads = {};  ///< That will be submitted.
  bool prepare_first = true;  ///< Else each kernel is prepared when its first task runs.
  /// By workload: inputs of the call that ends its preparation, for kernels that keep what they
  /// made of an input as long as it comes again (plan_path's map). Absent = generated ones.
  std::map<std::string, std::shared_ptr<const std::vector<Tensor>>> first_inputs = {};
  /// Tasks that have not ended: submit waits while there are so many.
  std::size_t most_tasks = 65'536;
  /// A call that takes longer puts its unit out of service for good. Absent = 50 times what it is
  /// expected to take, and at least 5 s, of a program (workloads/own) 5 s beyond its own limits;
  /// 10 s of an own function that does not say what it expects of the unit (`progress` hears of
  /// that); never of the catalog's without a profile. A unit elsewhere stays in service: its call
  /// is withdrawn, and waited for.
  std::optional<Nanos> time_limit = {};
  /// Tasks with a nearer deadline are let in between two slices of a call, where it says that it
  /// can be suspended: some of the catalog's do (WorkloadSpec::slices), and an own function may by
  /// between_slices() of workloads/model/slices.h. Absent = in mode budget alone. Not on units with
  /// contexts, elsewhere or without prepare_first.
  std::optional<bool> slices = {};
  /// How long a unit that has nothing to do stays awake before its thread sleeps, 0 to 20 us: a
  /// task that comes by then begins sooner. It draws active_w meanwhile (`powered`). 0 = not at
  /// all, as where the machine has no core for each unit that computes here. A platform may say
  /// less of a unit (`spin_us`).
  Nanos spin = kMostSpin;
  std::optional<std::string> trace = {};  ///< A file; see write_trace.
  int priority = 0;  ///< Above 0: units' threads at this real-time priority, where permitted.
  /// A line each while it starts, from the thread that makes it; never afterwards.
  std::function<void(const std::string&)> progress = {};
  /// Asked some 20 times a second while units are prepared, as it starts and by bring_back: whether
  /// nobody wants that any more; then they throw Error{kEnvironment}. Empty = never.
  std::function<bool()> stop = {};
  /// A line each for what goes wrong, when it does: failed calls, lost units, callbacks that throw;
  /// once it has started also for units that get out of reach or within it, or are opened again.
  /// Called as a callback is.
  std::function<void(const std::string&)> problem = {};
};

struct TaskOptions {
  bool real_time = false;  ///< May not go to the cloud.
  /// Whether it holds a camera's picture, which mode advanced lets others not wait for. Absent = by
  /// its inputs: it does if one is a picture (u8, two or three dimensions).
  std::optional<bool> image_input = {};
  std::optional<Nanos> deadline = {};      ///< From now on; for modes that look at it.
  std::optional<Nanos> expires = {};       ///< From now on: not started by then, it is given up.
  std::vector<TaskFuture> after = {};      ///< That have to complete first, besides the inputs'.
  std::vector<std::string> eligible = {};  ///< Units that may serve it; empty = all that can.
};

/// Since the runtime's start.
struct RuntimeStatistics {
  struct Unit {
    std::string name;
    bool in_service = true;
    std::int64_t completed = 0;
    Nanos busy{0};
    Nanos powered{0};   ///< Drew active_w: busy or awake for more; elsewhere what moved data.
    Histogram latency;  ///< Of its tasks, from the decision to the end.
  };
  std::vector<Unit> units;
  /// submitted = completed + failed + dropped + expired + cancelled + live, at every moment.
  std::int64_t submitted = 0, completed = 0, failed = 0, dropped = 0, expired = 0, cancelled = 0;
  std::int64_t live = 0;
  std::int64_t late = 0;              ///< Of those that have ended: after their deadline.
  std::int64_t returned = 0;          ///< How often a unit gave a task back, to be tried elsewhere.
  std::int64_t left = 0;              ///< How often a call was suspended for a more urgent one.
  Nanos set_up{0};                    ///< What the start took.
  std::vector<std::string> problems;  ///< The first few: failed calls, lost units, callbacks.
};

class Runtime {
 public:
  /// @throws Error{kBadInput}: an unknown mode or one that plans ahead, an unknown workload, a
  /// workload that no unit can serve (with each unit's reason); Error{kEnvironment}: a device that
  /// cannot be opened, a kernel that cannot be prepared, or RuntimeOptions::stop.
  explicit Runtime(RuntimeOptions options);
  /// Cancels what has not started and waits for what runs, but for calls that hang; nothing can be
  /// submitted any more. Not from a callback or a kernel.
  ~Runtime();
  Runtime(const Runtime&) = delete;
  Runtime& operator=(const Runtime&) = delete;

  using Callback = std::function<void(const TaskFuture& task, TaskEnd end)>;
  /// @param inputs    As Workload::inputs.
  /// @param callback  Called once when the task has ended; may be empty.
  /// @throws Error{kBadInput}: a workload that is not among the options', inputs that do not fit,
  /// units that cannot serve it, or to which the mode gives no such task, an input or predecessor
  /// of another runtime; Error{kEnvironment}: the runtime is ending, or is another process's.
  TaskFuture submit(WorkloadHandle workload, std::vector<TaskInput> inputs,
                    TaskOptions options = {}, Callback callback = {});
  /// The same; the name is looked up each time.
  TaskFuture submit(std::string_view workload, std::vector<TaskInput> inputs,
                    TaskOptions options = {}, Callback callback = {});
  /// For submit.
  /// @throws Error{kBadInput} if it is none of the options'.
  [[nodiscard]] WorkloadHandle workload(std::string_view name) const;
  /// The task ends as cancelled, and what comes after it as dropped, soon. One that runs goes on to
  /// its end; what it makes is lost. Does nothing if it has ended.
  void cancel(const TaskFuture& task);
  /// All that have not ended.
  void cancel_all();
  /// Until all tasks have ended.
  void wait_all();
  /// Opens the unit anew and prepares what it may be asked for; from then on it serves again, also
  /// workloads that it gave back too often. Waits until it is ready, for minutes if need be. Does
  /// nothing if it serves all it could. Not from a callback or a kernel.
  /// @throws Error{kBadInput}: no such unit, or one that computes nothing here;
  /// Error{kEnvironment}: it cannot be opened, or calls that it has been given have not ended.
  void bring_back(std::string_view unit);
  [[nodiscard]] RuntimeStatistics statistics() const;
  /// A copy of what the tasks that have completed made of the state of that name.
  /// @throws Error{kBadInput} if no workload has it.
  [[nodiscard]] std::vector<Tensor> state(std::string_view name) const;
  /// Waits for all tasks, and the file of RuntimeOptions::trace is complete (for Perfetto and `pirt
  /// replay`); without this call it ends in the middle. Once, and nothing is submitted afterwards.
  /// @throws Error{kBadInput} if it cannot be written.
  void write_trace();

 private:
  class Engine;
  std::unique_ptr<Engine> engine_;
};

}  // namespace pirt
