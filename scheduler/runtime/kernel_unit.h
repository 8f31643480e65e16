// A unit that computes: one thread that opens its device, prepares what it is to run, and then runs
// one call after the other. One that computes elsewhere may have several under way, each in a lane:
// a thread with kernels of its own.
#pragma once

#include <algorithm>
#include <deque>
#include <exception>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <span>
#include <stop_token>
#include <string>
#include <utility>
#include <vector>

#include "characterize/platform/platform.h"
#include "scheduler/mix/task.h"
#include "scheduler/runtime/bell.h"
#include "scheduler/runtime/call.h"
#include "scheduler/runtime/running_call.h"
#include "scheduler/runtime/threads.h"
#include "workloads/model/function_kernel.h"
#include "workloads/model/remote.h"
#include "workloads/model/slices.h"

namespace pirt {

/// What a unit prepares before anything runs.
struct Preparation {
  const Workload* workload = nullptr;
  std::shared_ptr<const Data> sample;  ///< Parameters, and inputs for the first call.
  KernelFunction function = {};        ///< In place of the device's kernel; is not run before it
                                       ///< is needed.
};

struct UnitSetup {
  UnitRequest request;
  const Backend* backend = nullptr;  ///< Null: only functions run there.
  std::vector<Preparation> preparations;
  bool prepare_first = true;  ///< All of them, before the first call.
  /// It holds one program at a time: a call of another one than the last prepares all of that
  /// again. At first it holds that of the first preparation.
  std::optional<Contexts> contexts = {};
  int lanes = 1;                ///< Calls at a time; above 1 only where the device is a Remote.
  std::vector<int> cores = {};  ///< As begin_thread, until the device takes those of `request`.
  int priority = 0;             ///< Above 0: of real-time scheduling, first in first out.
  /// How long who waits for a call stays awake before it sleeps: waking up takes longer than short
  /// kernels do.
  Nanos spin{0};
  std::shared_ptr<const void> keeps =
      {};  ///< There as long as the unit: what its workloads are in.
  /// From the unit's thread: the call has ended a slice, and waits until it goes on (go_on) or one
  /// is let in (let_in), which may be said from within. Must not throw. Empty = calls are not
  /// suspended. Nor are they where making a kernel could fall between two slices: of a unit with
  /// contexts, or that does not prepare first.
  std::function<void(Call& call)> slice_ended = {};
};

/// Real-time scheduling of the calling thread, first in first out, for a priority above 0.
/// @return  Why it did not get it; empty if it did, or wants none.
[[nodiscard]] std::string take_priority(int priority);

/// What to say of a workload that nobody elsewhere has.
[[nodiscard]] std::string not_asked_for(const Workload& workload, const Support& served);

class KernelUnit {
 public:
  /// After each call, from the thread that ran it; must not throw, may call run() and run the call
  /// again.
  using Done = std::function<void(Call& call, CallEnd& end)>;

  /// @throws Error{kEnvironment} if the thread cannot be started.
  KernelUnit(UnitSetup setup, Done done);
  /// Waits for the call that runs; what waits behind it is forgotten.
  ~KernelUnit();
  /// The end of one that may have been abandoned, or never become ready: then its thread may never
  /// return, so that it and what it uses stay.
  struct Close {
    void operator()(KernelUnit* unit) const;
  };
  using Owner = std::unique_ptr<KernelUnit, Close>;
  KernelUnit(const KernelUnit&) = delete;
  KernelUnit& operator=(const KernelUnit&) = delete;

  /// Nothing runs from now on but the call that does. Calls that are under way elsewhere are
  /// withdrawn.
  void stop();
  /// Until its start is over, well or not, or @p most is.
  /// @return  Whether it is.
  [[nodiscard]] bool is_over_start(Nanos most) { return started_.wait_for(most); }
  /// Once that is over. @throws What opening and preparing threw.
  void rethrow_failure() const {
    if (failure_ != nullptr) std::rethrow_exception(failure_);
  }
  /// What is not as it was asked for, once it is ready; empty if all is.
  [[nodiscard]] const std::string& remark() const { return remark_; }
  /// Whether those elsewhere have the workload, which is one of the preparations, by what was heard
  /// of them so far; once it is ready and until it is stopped. One that computes here has it.
  [[nodiscard]] Support serves(const Workload& workload) const;
  /// What computes elsewhere, likewise; null = it computes here.
  [[nodiscard]] const Remote* remote() const { return remote_; }
  /// Runs the call after those before it. Any thread, which waits for nobody; from `done` the
  /// thread that called it goes on with it.
  void run(Call& call);
  /// What waits between two slices stays suspended for this one, and is told of the next step again
  /// when that is done.
  void let_in(Call& call);
  /// What was suspended last, or is to be, goes on.
  void go_on();
  struct Running : runtime::RunningCall::Seen {
    std::size_t lane = 0;
  };
  /// The calls that run now; none from when it was abandoned.
  [[nodiscard]] std::vector<Running> running() const;
  /// Nothing is heard of the call any more, and nothing runs after it. Those that waited behind it;
  /// absent, and nothing changed, if it does not run, or was abandoned before. Of a unit with one
  /// lane.
  [[nodiscard]] std::optional<std::vector<Call*>> abandon(const Running& call);
  [[nodiscard]] bool abandoned() const { return abandoned_; }
  struct Suspended {
    Call* call = nullptr;
    Nanos ran{0};
  };
  /// The calls that are suspended between two slices. Of one that was abandoned, never to end.
  [[nodiscard]] std::vector<Suspended> suspended();
  /// Whoever made the call wants its result no more; it may hear of that. One that waits, or is
  /// under way, elsewhere is withdrawn, and given back soon; so is one that waits here.
  /// @param call  That it was given and that is not done.
  void request_stop(Call& call);
  /// The same of one that runs. @return  Whether that is news.
  bool request_stop(const Running& call) {
    return lanes_[call.lane].running.request_stop(call.number);
  }
  [[nodiscard]] const std::string& name() const { return setup_.request.unit; }
  /// What it computes on, once it is ready; of one with a backend.
  [[nodiscard]] const DeviceInfo& device() const { return *device_info_; }
  /// Where its outputs are best, once it is ready; null = the heap.
  [[nodiscard]] TensorMemory* output_memory() const { return output_memory_.get(); }
  /// Its device computes nothing any more, and is not open: all calls are given back.
  [[nodiscard]] bool is_lost() const { return lost_; }
  /// Of one that is lost: why it has not had its device again; empty = it has not tried.
  [[nodiscard]] std::string why_lost() {
    const std::lock_guard lock(taking_);
    return why_lost_;
  }
  /// Of one that is lost: hands out what output_memory() was, which holds the device as it was, as
  /// does each tensor there.
  [[nodiscard]] std::shared_ptr<TensorMemory> take_output_memory() {
    return std::exchange(output_memory_, nullptr);
  }
  /// One that is lost tries to have its device again; it is not lost any more once it has.
  void open_again();
  /// Whether it computes elsewhere, once it is ready.
  [[nodiscard]] bool is_remote() const { return remote_ != nullptr; }
  /// Whether what it computes on is within reach, and not lost, once it is ready and until it is
  /// stopped.
  [[nodiscard]] bool is_reachable() const {
    const Remote* const remote = remote_;
    return remote == nullptr ? !lost_ : remote->is_reachable();
  }
  /// Whether the device tells the time of its calls by a clock of its own, once it is ready.
  [[nodiscard]] bool has_own_clock() const { return has_own_clock_; }

 private:
  struct Prepared {
    std::unique_ptr<Kernel> kernel;
    FunctionKernel* function = nullptr;    ///< The kernel, if it is one: it has no phases.
    bool own = false;                      ///< A function of the robot's own.
    const StateValue* resident = nullptr;  ///< Whose value the device has,
    std::uint64_t version = 0;             ///< and which.
  };
  /// Calls one after the other, on a thread of their own. What others may touch is `running`.
  struct Lane final : SliceListener {
    void slice_ended() override { unit->between_slices_of(*this); }

    KernelUnit* unit = nullptr;
    std::map<const Workload*, Prepared> kernels;
    runtime::RunningCall running;
    bool telling = false;  ///< The thread is within done_.
    Call* next = nullptr;  ///< Before those that wait.
    Nanos awake{0};        ///< Since the last call.
    Nanos paused{0};       ///< How long the call that runs was suspended.
    // What was said of a call that waits between two slices.
    runtime::Atomic<Call*> let_in = nullptr;
    runtime::Atomic<bool> goes_on = false;
    std::vector<Suspended> suspended;  ///< The innermost last; with taking_.
  };

  void serve();
  void serve_calls(Lane& lane);
  void set_up();
  Call* wait_for_call(Lane& lane);
  bool spin(Lane& lane) const;
  [[nodiscard]] bool anything_waits() const {
    return posted_.load() != nullptr || queued_.load() != nullptr || opens_again_.load();
  }
  Call* take_first();
  [[nodiscard]] bool go_together(const Workload& one, const Workload& other) const;
  Prepared& prepare(Lane& lane, const Preparation& preparation);
  void run_once(Lane& lane, const Preparation& preparation, Prepared& prepared);
  Prepared& prepared(Lane& lane, const Workload& workload, CallEnd& end);
  [[nodiscard]] bool suspends_calls() const;
  void between_slices_of(Lane& lane);
  bool run_let_in(Lane& lane);
  bool run_call(Lane& lane, Call& call, CallEnd& end);
  bool execute(Lane& lane, Call& call, CallEnd& end);
  void lose_device(Lane& lane, CallEnd& end);
  void try_to_open();
  std::uint64_t compute(Lane& lane, Prepared& prepared, Call& call, CallTimes& times);

  UnitSetup setup_;
  Done done_;
  runtime::LiveClock clock_;
  std::unique_ptr<Device> device_;  ///< Made and ended by the unit's thread.
  std::deque<Lane> lanes_;          ///< The first one's thread is the unit's.

  runtime::Latch started_;  ///< Or it has failed; what follows is written before.
  std::string remark_;
  std::optional<DeviceInfo> device_info_;
  std::shared_ptr<TensorMemory> output_memory_;
  runtime::Atomic<Remote*> remote_ = nullptr;  ///< The device, if it is one.
  bool has_own_clock_ = false;
  std::exception_ptr failure_;
  runtime::Atomic<bool> stopping_ = false;
  runtime::Atomic<bool> abandoned_ = false;
  runtime::Atomic<bool> lost_ = false;         ///< Written by the unit's thread.
  runtime::Atomic<bool> opens_again_ = false;  ///< It was asked to.

  // Calls that wait. Who brings one leaves it in a list, the newest first; lanes turn that round.
  runtime::Atomic<Call*> posted_ = nullptr;
  runtime::Mutex taking_;  ///< Lanes' alone, and of who abandons one or asks why it is lost.
  runtime::Atomic<Call*> queued_ =
      nullptr;            ///< Oldest first, before posted_; changed with taking_.
  std::string why_lost_;  ///< With taking_.
  runtime::Bell bell_;
  KernelUnit* stayed_before_ = nullptr;  ///< Of those that stay for ever.
  runtime::Thread thread_;               ///< Last: all else is there before it and after it.
};

}  // namespace pirt
