#include "scheduler/runtime/runtime.h"

#include <algorithm>
#include <atomic>
#include <condition_variable>
#include <deque>
#include <mutex>
#include <stdexcept>
#include <thread>
#include <utility>

#include "characterize/platform/unit_request.h"
#include "scheduler/dispatcher/dispatcher.h"
#include "scheduler/policies/setup.h"
#include "scheduler/runtime/kernel_unit.h"
#include "scheduler/runtime/output_pool.h"
#include "scheduler/runtime/samples.h"
#include "scheduler/runtime/time_limit.h"
#include "workloads/base/error.h"
#include "workloads/base/text.h"
#include "workloads/base/thread.h"
#include "workloads/catalog.h"
#include "workloads/registry.h"

namespace pirt {

/// A task from its submission to the last that knows of it. Fields of the engine are read and
/// written by whoever has its turn, the others as is said there.
struct runtime::Submitted {
  enum class Event : std::uint8_t { kSubmit, kEnd };

  // Before it is submitted, and read only from then on.
  const void* engine = nullptr;
  const Workload* workload = nullptr;
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

  // The engine's.
  std::vector<TaskInput> inputs;
  TaskId id = 0;
  UnitId unit = 0;
  Nanos dispatched_at{0};
  bool taken_in = false;
  bool known = false;           ///< To the dispatcher.
  bool running = false;         ///< On its unit, whatever has become of it.
  std::optional<TaskEnd> ends;  ///< Decided; told soon.

  // Written before `end`, read after it.
  std::shared_ptr<std::vector<Tensor>> outputs;
  std::string unit_name;
  std::string problem;

  static constexpr int kLive = -1;
  std::atomic<int> end = kLive;    ///< A TaskEnd; before the callback.
  std::atomic<bool> told = false;  ///< After it.
};

namespace {

using runtime::Submitted;

/// Set where waiting would wait for the waiting thread itself.
thread_local bool must_not_wait = false;

void check_may_wait(const char* what) {
  if (must_not_wait) {
    throw std::logic_error(std::string(what) +
                           " in a callback or a kernel would wait for itself; submit what comes "
                           "next with `after` instead");
  }
}

class MustNotWait {
 public:
  MustNotWait() : before_(std::exchange(must_not_wait, true)) {}
  ~MustNotWait() { must_not_wait = before_; }
  MustNotWait(const MustNotWait&) = delete;
  MustNotWait& operator=(const MustNotWait&) = delete;

 private:
  bool before_;
};

constexpr Nanos kUnknownTime = std::chrono::milliseconds(1);
constexpr Nanos kLook = std::chrono::milliseconds(50);
constexpr std::size_t kMostProblems = 20;
constexpr int kMostReturns = 3;  ///< In a row, after which a unit is out of service.

}  // namespace

std::string_view to_string(TaskEnd end) {
  switch (end) {
    case TaskEnd::kCompleted:
      return "completed";
    case TaskEnd::kFailed:
      return "failed";
    case TaskEnd::kDropped:
      return "dropped";
    case TaskEnd::kExpired:
      return "expired";
    case TaskEnd::kCancelled:
      return "cancelled";
  }
  return "";
}

std::optional<TaskEnd> TaskFuture::end() const {
  const int end = task_->end.load(std::memory_order_acquire);
  return end == Submitted::kLive ? std::nullopt : std::optional(static_cast<TaskEnd>(end));
}

TaskEnd TaskFuture::wait() const {
  // Within its own callback it has ended.
  if (must_not_wait && end()) return *end();
  if (!task_->told.load(std::memory_order_acquire)) check_may_wait("wait()");
  task_->told.wait(false, std::memory_order_acquire);
  return *end();
}

std::span<const Tensor> TaskFuture::get() const {
  const TaskEnd end = wait();
  if (end != TaskEnd::kCompleted) {
    throw_environment(task_->workload->name + " has no outputs, it was " +
                      std::string(to_string(end)) +
                      (task_->problem.empty() ? "" : ": " + task_->problem));
  }
  return *task_->outputs;
}

std::string TaskFuture::unit() const { return end() ? task_->unit_name : ""; }
std::string TaskFuture::problem() const { return end() ? task_->problem : ""; }

/// Who has something to say to the dispatcher leaves it in a list and takes the turn if it is free;
/// who has the turn works through the list, what comes meanwhile too. So nobody ever waits for it.
class Runtime::Engine {
 public:
  explicit Engine(RuntimeOptions options);
  ~Engine();

  TaskFuture submit(std::string_view workload, std::vector<TaskInput> inputs, TaskOptions options,
                    Callback callback);
  void cancel(const TaskFuture& task);
  void wait_all();
  RuntimeStatistics statistics();

 private:
  struct Known {
    const Workload* workload = nullptr;
    const OwnWorkload* own = nullptr;
    UnitMask runs_on = 0;
  };
  struct Unit {
    std::unique_ptr<KernelUnit> runner;  ///< Null: nothing runs there.
    bool in_service = true;
    int returns = 0;  ///< In a row.
    std::int64_t completed = 0;
    Nanos busy{0};
    Histogram latency;
  };

  void list_workloads();
  void open_units();
  std::vector<Preparation> preparations(UnitId unit);
  [[nodiscard]] UnitMask units_of(const Known& known) const;
  [[nodiscard]] Mix mix() const;
  [[nodiscard]] std::size_t find(std::string_view workload) const;
  void check_inputs(const Workload& workload, const std::vector<TaskInput>& inputs) const;
  [[nodiscard]] UnitMask units_named(const std::vector<std::string>& names) const;
  void wait_until(std::size_t most);

  void post(Submitted& task, Submitted::Event event);
  void work();
  void take_turn();
  void end_turn();
  void take_in(Submitted& task, Nanos now);
  void take_end(Submitted& task, Nanos now);
  void look(Nanos now);
  void lose(UnitId unit, const KernelUnit::Running& call, Nanos now);
  void out_of_service(UnitId unit, const std::string& why, Nanos now);
  void cancel_asked(Nanos now);
  void apply(Nanos now);
  void start(const Start& start);
  void finish(Submitted& task, TaskEnd end, Nanos now);
  void forget(Submitted& task, Nanos now);
  void tell(std::vector<std::shared_ptr<Submitted>>& ended);
  void add_problem(std::string problem);
  void watch(const std::stop_token& stop);
  [[nodiscard]] Submitted& task_of(TaskId id) { return *tasks_[static_cast<std::uint32_t>(id)]; }
  /// Of a call that has not ended, whose token is the task's address: the unit's thread has no
  /// turn.
  [[nodiscard]] static Submitted& task_of(const auto& call) {
    return *reinterpret_cast<Submitted*>(call.token);
  }

  RuntimeOptions options_;
  MachineClock clock_;
  std::deque<Workload> own_;
  std::vector<Known> workloads_;
  std::map<std::string, std::size_t, std::less<>> names_;
  Mix mix_;
  std::optional<ModeSetup> setup_;
  Samples samples_;

  std::atomic<Submitted*> posted_ = nullptr;
  std::atomic<bool> asked_ = false;  ///< Something is wanted that is not in posted_.
  std::atomic<bool> turn_ = false;

  // Of who has the turn.
  std::optional<Dispatcher> dispatcher_;
  Starts starts_;
  Starts applied_;  ///< For its memory.
  std::vector<Unit> units_;
  OutputPool pool_;
  std::shared_ptr<std::vector<Tensor>> nothing_ = std::make_shared<std::vector<Tensor>>();
  std::vector<std::shared_ptr<StateValue>> states_;  ///< By workload; null where it has none.
  std::vector<std::shared_ptr<Submitted>> tasks_;    ///< By the lower half of their id.
  std::vector<std::uint32_t> free_;
  std::vector<TaskId> after_;
  std::vector<std::shared_ptr<Submitted>> ended_;  ///< To be told when the turn is over.
  std::vector<std::shared_ptr<Submitted>> lost_;   ///< What hung calls have is never used again.
  std::uint32_t number_ = 0;
  std::int64_t running_ = 0;
  RuntimeStatistics counts_;
  Nanos set_up_{0};

  std::mutex asking_;
  std::vector<std::shared_ptr<Submitted>> cancels_;
  bool cancels_all_ = false;

  std::atomic<std::size_t> live_ = 0;
  std::size_t resume_at_ = 0;
  std::atomic<int> waiting_ = 0;
  std::mutex waiting_mutex_;
  std::condition_variable fewer_;

  std::mutex watch_mutex_;
  std::condition_variable_any watch_sooner_;
  Nanos watch_at_ = Nanos::max();
  std::atomic<bool> calls_run_ = false;
  std::jthread watcher_;
};

Runtime::Engine::Engine(RuntimeOptions options) : options_(std::move(options)), samples_(1) {
  const Nanos begin = clock_.now();
  if (options_.most_tasks == 0) throw_bad_input("most_tasks is 0; it is at least 1");
  resume_at_ = options_.most_tasks - 1 - (options_.most_tasks - 1) / 4;
  units_.resize(options_.platform.units.size());
  list_workloads();
  mix_ = mix();
  ScheduleOptions schedule;
  schedule.mode = options_.mode;
  setup_.emplace(set_up_mode(options_.platform, options_.profile ? &*options_.profile : nullptr,
                             mix_, schedule));
  if (setup_->mode.policy.planner != nullptr) {
    throw_bad_input("mode " + options_.mode +
                    " plans a whole mix ahead, and a runtime does not know what comes; take "
                    "another (pirt list modes)");
  }
  for (std::size_t w = 0; w < workloads_.size(); ++w) {
    Known& known = workloads_[w];
    known.runs_on &= setup_->scenario.classes[w][0].eligible;
    if (known.runs_on == 0) {
      throw_bad_input("no unit of platform " + options_.platform.name + " can run " +
                      known.workload->name + " here");
    }
    states_.push_back(known.workload->state ? std::make_shared<StateValue>(*known.workload)
                                            : nullptr);
  }
  dispatcher_.emplace(setup_->slots, std::move(setup_->policy));
  open_units();
  set_up_ = clock_.now() - begin;
  watcher_ = std::jthread([this](const std::stop_token& stop) { watch(stop); });
}

void Runtime::Engine::list_workloads() {
  const auto add = [this](const Workload& workload, const OwnWorkload* own) {
    if (!names_.emplace(workload.name, workloads_.size()).second) {
      throw_bad_input("workload '" + workload.name + "' is given twice");
    }
    workloads_.push_back({.workload = &workload, .own = own});
    workloads_.back().runs_on = units_of(workloads_.back());
  };
  for (const std::string& name : options_.workloads) add(find_workload(name), nullptr);
  for (const OwnWorkload& own : options_.own) {
    if (own.kernels.empty()) throw_bad_input("workload '" + own.name + "' has no kernel");
    Workload& workload = own_.emplace_back();
    workload.name = own.name;
    workload.inputs = own.inputs;
    workload.outputs = own.outputs;
    add(workload, &own);
  }
  if (workloads_.empty()) throw_bad_input("a runtime needs workloads: name them in its options");
}

/// Those that have a kernel for it.
UnitMask Runtime::Engine::units_of(const Known& known) const {
  UnitMask mask = 0;
  for (UnitId unit = 0; unit < options_.platform.units.size(); ++unit) {
    const UnitModel& model = options_.platform.units[unit];
    bool runs = false;
    if (known.own != nullptr) {
      runs = known.own->kernels.contains(model.name) || known.own->kernels.contains(model.backend);
    } else if (model.measured()) {
      runs = find_backend(model.backend)
                 .supports_on(make_unit_request(options_.platform, model), *known.workload)
                 .ok;
    }
    if (runs) mask |= unit_bit(unit);
  }
  return mask;
}

/// Of each workload a pipeline of one task, for whoever asks what it costs and who may serve it.
Mix Runtime::Engine::mix() const {
  Mix mix;
  mix.name = "runtime";
  for (const Known& known : workloads_) {
    MixTask task;
    task.name = task.workload = known.workload->name;
    task.service_location = "runtime: " + task.name;
    for (UnitId unit = 0; unit < units_.size(); ++unit) {
      const std::string& name = options_.platform.units[unit].name;
      if (!contains(known.runs_on, unit)) continue;
      if (known.own == nullptr && options_.profile) continue;
      const bool said = known.own != nullptr && known.own->expected.contains(name);
      task.service[name] = said ? known.own->expected.at(name) : kUnknownTime;
    }
    Pipeline pipeline;
    pipeline.name = task.name;
    pipeline.frames = 1;
    pipeline.tasks.push_back(std::move(task));
    mix.pipelines.push_back(std::move(pipeline));
  }
  return mix;
}

std::vector<Preparation> Runtime::Engine::preparations(UnitId unit) {
  const UnitModel& model = options_.platform.units[unit];
  std::vector<Preparation> preparations;
  for (const Known& known : workloads_) {
    if (!contains(known.runs_on, unit)) continue;
    Preparation& each = preparations.emplace_back();
    each.workload = known.workload;
    if (known.own == nullptr) {
      each.sample = samples_.of(*known.workload, 0);
    } else {
      const auto by_unit = known.own->kernels.find(model.name);
      each.function = [function = by_unit != known.own->kernels.end()
                                      ? by_unit->second
                                      : known.own->kernels.at(model.backend)](
                          std::span<const Tensor> inputs, std::span<Tensor> outputs) {
        const MustNotWait within;
        function(inputs, outputs);
      };
    }
  }
  return preparations;
}

void Runtime::Engine::open_units() {
  const auto say = [this](const std::string& line) {
    if (options_.progress) options_.progress(line);
  };
  for (UnitId unit = 0; unit < units_.size(); ++unit) {
    auto prepared = preparations(unit);
    if (prepared.empty()) continue;
    const UnitModel& model = options_.platform.units[unit];
    say("opening " + model.name);
    UnitSetup setup{.request = make_unit_request(options_.platform, model),
                    .backend = model.measured() ? &find_backend(model.backend) : nullptr,
                    .preparations = std::move(prepared),
                    .prepare_first = options_.prepare_first,
                    .priority = options_.priority};
    units_[unit].runner =
        std::make_unique<KernelUnit>(std::move(setup), [this](Call& call, CallEnd end) {
          Submitted& task = task_of(call);
          task.call_end = std::move(end);
          post(task, Submitted::Event::kEnd);
          work();
        });
  }
  for (Unit& unit : units_) {
    if (unit.runner == nullptr) continue;
    const std::string remark = unit.runner->wait_until_ready();
    if (!remark.empty()) add_problem(unit.runner->name() + ": " + remark);
    say(unit.runner->name() + " is ready");
  }
}

Runtime::Engine::~Engine() {
  {
    const std::lock_guard lock(asking_);
    cancels_all_ = true;
  }
  asked_ = true;
  work();
  wait_until(0);
  // Calls that were cancelled as they ran still do, unless they are lost.
  {
    std::unique_lock lock(waiting_mutex_);
    ++waiting_;
    fewer_.wait(lock, [this] { return !calls_run_; });
    --waiting_;
  }
  watcher_ = {};
  for (Unit& unit : units_) {
    if (unit.runner && unit.runner->abandoned()) KernelUnit::leave(std::move(unit.runner));
  }
  for (Unit& unit : units_) unit.runner.reset();
}

std::size_t Runtime::Engine::find(std::string_view workload) const {
  const auto known = names_.find(workload);
  if (known != names_.end()) return known->second;
  std::vector<std::string> names;
  for (const auto& [name, index] : names_) names.push_back(name);
  throw_bad_input("'" + std::string(workload) + "' is none of the runtime's workloads" +
                  suggestion(std::string(workload), names) + "; name it in its options");
}

void Runtime::Engine::check_inputs(const Workload& workload,
                                   const std::vector<TaskInput>& inputs) const {
  if (inputs.size() != workload.inputs.size()) {
    throw_bad_input(workload.name + " takes " + std::to_string(workload.inputs.size()) +
                    " inputs, not " + std::to_string(inputs.size()));
  }
  for (std::size_t i = 0; i < inputs.size(); ++i) {
    const TaskOutput& output = inputs[i].output_;
    const TensorSpec* given = &inputs[i].tensor_.spec();
    if (output.task != nullptr) {
      const auto& outputs = output.task->workload->outputs;
      if (output.task->engine != this || output.index >= outputs.size()) {
        throw_bad_input(workload.name + ": input " + workload.inputs[i].name +
                        " is of a task of another runtime, or an output that is not there");
      }
      given = &outputs[output.index];
    }
    const TensorSpec& wanted = workload.inputs[i];
    if (given->element != wanted.element || given->shape != wanted.shape ||
        given->varies != wanted.varies) {
      throw_bad_input(workload.name + " takes " + wanted.describe() + ", not " + given->describe());
    }
  }
}

UnitMask Runtime::Engine::units_named(const std::vector<std::string>& names) const {
  if (names.empty()) return ~UnitMask{0};
  UnitMask mask = 0;
  for (const std::string& name : names) {
    const UnitModel& unit = options_.platform.unit(name);
    mask |= unit_bit(static_cast<UnitId>(&unit - options_.platform.units.data()));
  }
  return mask;
}

TaskFuture Runtime::Engine::submit(std::string_view workload, std::vector<TaskInput> inputs,
                                   TaskOptions options, Callback callback) {
  const std::size_t index = find(workload);
  const Known& known = workloads_[index];
  check_inputs(*known.workload, inputs);
  const UnitMask eligible = known.runs_on & units_named(options.eligible);
  if (eligible == 0) {
    throw_bad_input(known.workload->name + ": none of the units " + join(options.eligible, ", ") +
                    " can run it; leave `eligible` out, or name one of " +
                    unit_list(options_.platform, known.runs_on));
  }
  if (live_.fetch_add(1) >= options_.most_tasks && !must_not_wait) {
    live_.fetch_sub(1);
    wait_until(resume_at_);
    live_.fetch_add(1);
  }
  auto task = std::make_shared<Submitted>();
  task->engine = this;
  task->workload = known.workload;
  task->workload_index = index;
  task->eligible = eligible;
  task->inputs = std::move(inputs);
  task->options = std::move(options);
  task->callback = std::move(callback);
  task->submitted_at = clock_.now();
  task->self = task;
  post(*task, Submitted::Event::kSubmit);
  work();
  return TaskFuture(std::move(task));
}

void Runtime::Engine::cancel(const TaskFuture& task) {
  if (!task.valid() || task.task_->engine != this) {
    throw_bad_input("cancel: the task is none of this runtime");
  }
  {
    const std::lock_guard lock(asking_);
    cancels_.push_back(task.task_);
  }
  asked_ = true;
  work();
}

/// Until at most so many tasks have not ended.
void Runtime::Engine::wait_until(std::size_t most) {
  check_may_wait("waiting for tasks");
  std::unique_lock lock(waiting_mutex_);
  ++waiting_;
  fewer_.wait(lock, [&] { return live_ <= most; });
  --waiting_;
}

void Runtime::Engine::wait_all() { wait_until(0); }

RuntimeStatistics Runtime::Engine::statistics() {
  while (turn_.exchange(true)) std::this_thread::yield();
  RuntimeStatistics statistics = counts_;
  statistics.returned = dispatcher_->counts().returned;
  statistics.set_up = set_up_;
  statistics.live = statistics.submitted - statistics.completed - statistics.failed -
                    statistics.dropped - statistics.expired - statistics.cancelled;
  for (UnitId unit = 0; unit < units_.size(); ++unit) {
    const Unit& each = units_[unit];
    if (each.runner == nullptr) continue;
    statistics.units.push_back({.name = options_.platform.units[unit].name,
                                .in_service = each.in_service,
                                .completed = each.completed,
                                .busy = each.busy,
                                .latency = each.latency});
  }
  turn_ = false;
  work();  // What was left to who had the turn.
  return statistics;
}

void Runtime::Engine::post(Submitted& task, Submitted::Event event) {
  task.event = event;
  task.next = posted_.load(std::memory_order_relaxed);
  while (!posted_.compare_exchange_weak(task.next, &task)) continue;
}

void Runtime::Engine::work() {
  while (posted_.load() != nullptr || asked_) {
    // Who has it looks again after it has given it back.
    if (turn_.exchange(true)) return;
    take_turn();
    end_turn();
  }
}

void Runtime::Engine::end_turn() {
  std::vector<std::shared_ptr<Submitted>> ended;
  std::swap(ended, ended_);
  const Nanos wake = dispatcher_->next_wake();
  const bool idle = running_ == 0;
  calls_run_ = !idle;
  turn_ = false;
  if (idle && waiting_ > 0) {
    const std::lock_guard lock(waiting_mutex_);
    fewer_.notify_all();
  }
  if (wake != Nanos::max()) {
    const std::lock_guard lock(watch_mutex_);
    if (wake < watch_at_) {
      watch_at_ = wake;
      watch_sooner_.notify_one();
    }
  }
  tell(ended);
}

void Runtime::Engine::take_turn() {
  const Nanos now = clock_.now();
  Submitted* newest = posted_.exchange(nullptr);
  Submitted* oldest = nullptr;
  while (newest != nullptr) {
    Submitted* before = newest->next;
    newest->next = oldest;
    oldest = newest;
    newest = before;
  }
  while (oldest != nullptr) {
    Submitted& task = *oldest;
    oldest = task.next;
    if (task.event == Submitted::Event::kSubmit) {
      take_in(task, now);
    } else {
      take_end(task, now);
    }
    apply(now);
  }
  if (!asked_.exchange(false)) return;
  cancel_asked(now);
  look(now);
  apply(now);
}

void Runtime::Engine::take_in(Submitted& task, Nanos now) {
  ++counts_.submitted;
  if (free_.empty()) {
    free_.push_back(static_cast<std::uint32_t>(tasks_.size()));
    tasks_.emplace_back();
  }
  const std::uint32_t slot = free_.back();
  free_.pop_back();
  tasks_[slot] = std::move(task.self);
  task.id = TaskId{number_++} << 32 | slot;
  task.taken_in = true;
  after_.clear();
  bool doomed = false;
  const auto follow = [&](const Submitted* before) {
    if (before == nullptr || before->ends == TaskEnd::kCompleted) return;
    doomed = doomed || before->ends.has_value();
    after_.push_back(before->id);
  };
  for (const TaskInput& input : task.inputs) follow(input.output_.task.get());
  for (const TaskFuture& before : task.options.after) follow(before.task_.get());
  if (doomed) return finish(task, TaskEnd::kDropped, now);
  Task submitted;
  submitted.id = task.id;
  submitted.kind = setup_->scenario.classes[task.workload_index][0];
  submitted.kind.eligible = task.eligible;
  submitted.kind.real_time = task.options.real_time;
  if (task.options.deadline) submitted.deadline = task.submitted_at + *task.options.deadline;
  if (task.options.expires) submitted.expires_at = task.submitted_at + *task.options.expires;
  submitted.after = after_;
  if (task.workload->state) submitted.state = static_cast<StateId>(task.workload_index);
  task.known = true;
  if (!dispatcher_->submit(task.id, std::span(&submitted, 1), now, starts_)) {
    throw std::logic_error("the dispatcher refused a task of the runtime");
  }
}

void Runtime::Engine::take_end(Submitted& task, Nanos now) {
  --running_;
  task.running = false;
  Unit& unit = units_[task.unit];
  const CallEnd& end = task.call_end;
  unit.busy += end.busy;
  if (!end.problem.empty()) add_problem(end.problem);
  if (!task.ends) task.problem = end.problem;
  dispatcher_->complete(task.unit, task.id, end.outcome, now, starts_);
  if (end.outcome == Outcome::kReturned) {
    if (++unit.returns >= kMostReturns && unit.in_service) {
      out_of_service(task.unit,
                     "it gave back " + std::to_string(unit.returns) + " calls one after the other",
                     now);
    }
    if (task.ends) forget(task, now);
    return;
  }
  unit.returns = 0;
  if (!task.ends && end.outcome == Outcome::kCompleted && states_[task.workload_index]) {
    states_[task.workload_index]->commit(end.version);
  }
  if (task.ends) return forget(task, now);  // Cancelled as it ran.
  if (end.outcome == Outcome::kCompleted) {
    ++unit.completed;
    unit.latency.add(std::max(now - task.dispatched_at, Nanos::zero()));
  }
  finish(task, end.outcome == Outcome::kCompleted ? TaskEnd::kCompleted : TaskEnd::kFailed, now);
}

/// What time has brought: tasks that were to start by now, and calls that do not end.
void Runtime::Engine::look(Nanos now) {
  dispatcher_->wake(now, starts_);
  apply(now);
  for (UnitId unit = 0; unit < units_.size(); ++unit) {
    if (units_[unit].runner == nullptr || units_[unit].runner->abandoned()) continue;
    const auto call = units_[unit].runner->running();
    if (!call) continue;
    const std::size_t index = task_of(*call).workload_index;
    const Known& known = workloads_[index];
    const bool expected =
        options_.profile || (known.own != nullptr && !known.own->expected.empty());
    if (!expected && !options_.time_limit) continue;
    const Service* service = setup_->scenario.services.find(static_cast<WorkloadId>(index), unit);
    const Nanos limit = options_.time_limit ? *options_.time_limit : time_limit(service->total());
    if (now - call->since > limit) lose(unit, *call, now);
  }
}

/// The call never comes back to anybody.
void Runtime::Engine::lose(UnitId unit, const KernelUnit::Running& call, Nanos now) {
  const auto behind = units_[unit].runner->abandon(call.token);
  if (!behind) return;
  Submitted& task = task_of(call);
  lost_.push_back(tasks_[static_cast<std::uint32_t>(task.id)]);
  auto& state = states_[task.workload_index];
  if (state) state = std::make_shared<StateValue>(*state);
  out_of_service(unit,
                 overdue(task.workload->name, options_.platform.units[unit].name, now - call.since),
                 now);
  const auto ended = [&](std::uint64_t token, Outcome outcome) {
    auto& each = *reinterpret_cast<Submitted*>(token);
    each.call_end = {.outcome = outcome, .problem = counts_.problems.back()};
    each.event = Submitted::Event::kEnd;
    take_end(each, now);
    apply(now);
  };
  ended(call.token, Outcome::kFailed);
  for (const std::uint64_t token : *behind) ended(token, Outcome::kReturned);
}

void Runtime::Engine::out_of_service(UnitId unit, const std::string& why, Nanos now) {
  units_[unit].in_service = false;
  add_problem("unit " + options_.platform.units[unit].name + " is out of service: " + why);
  dispatcher_->set_unit(unit, UnitState::kDown, now, starts_);
}

void Runtime::Engine::cancel_asked(Nanos now) {
  std::vector<std::shared_ptr<Submitted>> cancels;
  {
    const std::lock_guard lock(asking_);
    std::swap(cancels, cancels_);
    if (std::exchange(cancels_all_, false)) cancels = tasks_;
  }
  for (const auto& task : cancels) {
    if (task == nullptr || task->ends) continue;
    if (!task->taken_in) {  // It was submitted after this turn began.
      const std::lock_guard lock(asking_);
      cancels_.push_back(task);
      asked_ = true;
      continue;
    }
    // First, so that the dispatcher's word for it, dropped, is not taken.
    const TaskId id = task->id;
    finish(*task, TaskEnd::kCancelled, now);
    dispatcher_->cancel(id, now, starts_);
    apply(now);
    if (!task->running) forget(*task, now);
  }
}

/// Carries out what the dispatcher has decided.
void Runtime::Engine::apply(Nanos now) {
  std::swap(starts_, applied_);
  for (const Start& each : applied_.started) start(each);
  for (const Ended& each : applied_.ended) {
    const auto& task = tasks_[static_cast<std::uint32_t>(each.task)];
    if (task == nullptr || task->id != each.task || task->ends) continue;
    switch (each.how) {
      case Ending::kExpired:
        finish(*task, TaskEnd::kExpired, now);
        break;
      case Ending::kFailed:
        finish(*task, TaskEnd::kFailed, now);
        break;
      default:
        finish(*task, TaskEnd::kDropped, now);
    }
  }
  applied_.clear();
}

void Runtime::Engine::start(const Start& start) {
  Submitted& task = task_of(start.task);
  task.unit = start.unit;
  task.dispatched_at = start.dispatched_at;
  task.unit_name = options_.platform.units[start.unit].name;
  task.running = true;
  ++running_;
  task.outputs = task.workload->outputs.empty() ? nothing_ : pool_.take(*task.workload);
  Call call{.workload = task.workload,
            .inputs = {},
            .outputs = task.outputs,
            .state = states_[task.workload_index],
            .token = reinterpret_cast<std::uintptr_t>(&task)};
  call.inputs.reserve(task.inputs.size());
  for (const TaskInput& input : task.inputs) {
    const TaskOutput& output = input.output_;
    call.inputs.push_back(output.task ? (*output.task->outputs)[output.index].share()
                                      : input.tensor_.share());
  }
  units_[start.unit].runner->run(std::move(call));
}

void Runtime::Engine::finish(Submitted& task, TaskEnd end, Nanos now) {
  task.ends = end;
  switch (end) {
    case TaskEnd::kCompleted:
      ++counts_.completed;
      break;
    case TaskEnd::kFailed:
      ++counts_.failed;
      break;
    case TaskEnd::kDropped:
      ++counts_.dropped;
      break;
    case TaskEnd::kExpired:
      ++counts_.expired;
      break;
    case TaskEnd::kCancelled:
      ++counts_.cancelled;
      break;
  }
  ended_.push_back(tasks_[static_cast<std::uint32_t>(task.id)]);
  if (!task.running && end != TaskEnd::kCancelled) forget(task, now);
}

/// Nothing refers to its slot any more.
void Runtime::Engine::forget(Submitted& task, Nanos now) {
  if (task.known) dispatcher_->release(task.id, now);
  const auto slot = static_cast<std::uint32_t>(task.id);
  task.inputs.clear();
  task.options.after.clear();
  free_.push_back(slot);
  tasks_[slot] = nullptr;
}

void Runtime::Engine::add_problem(std::string problem) {
  if (counts_.problems.size() < kMostProblems) counts_.problems.push_back(std::move(problem));
}

/// Without the turn: callbacks may submit.
void Runtime::Engine::tell(std::vector<std::shared_ptr<Submitted>>& ended) {
  for (auto& task : ended) {
    task->end.store(static_cast<int>(*task->ends), std::memory_order_release);
    if (task->callback) {
      const MustNotWait within;
      try {
        task->callback(TaskFuture(task), *task->ends);
      } catch (const std::exception& error) {
        while (turn_.exchange(true)) std::this_thread::yield();
        add_problem("callback of " + task->workload->name + ": " + error.what());
        turn_ = false;
      }
      task->callback = nullptr;
    }
    task->told.store(true, std::memory_order_release);
    task->told.notify_all();
    task.reset();
    const std::size_t left = live_.fetch_sub(1) - 1;
    if ((left == resume_at_ || left == 0) && waiting_ > 0) {
      const std::lock_guard lock(waiting_mutex_);
      fewer_.notify_all();
    }
  }
}

void Runtime::Engine::watch(const std::stop_token& stop) {
  std::unique_lock lock(watch_mutex_);
  while (!stop.stop_requested()) {
    const Nanos until = std::min(watch_at_, clock_.now() + kLook);
    const auto sooner = [&] { return watch_at_ < until; };
    watch_sooner_.wait_until(lock, stop, std::chrono::steady_clock::time_point(until), sooner);
    watch_at_ = Nanos::max();
    lock.unlock();
    asked_ = true;
    work();
    lock.lock();
  }
}

Runtime::Runtime(RuntimeOptions options) : engine_(std::make_unique<Engine>(std::move(options))) {}
Runtime::~Runtime() = default;

TaskFuture Runtime::submit(std::string_view workload, std::vector<TaskInput> inputs,
                           TaskOptions options, Callback callback) {
  return engine_->submit(workload, std::move(inputs), std::move(options), std::move(callback));
}
void Runtime::cancel(const TaskFuture& task) { engine_->cancel(task); }
void Runtime::wait_all() { engine_->wait_all(); }
RuntimeStatistics Runtime::statistics() const { return engine_->statistics(); }

}  // namespace pirt
