// A unit that computes: one thread that opens its device, prepares what it is to run, and then runs
// one call after the other.
#pragma once

#include <condition_variable>
#include <deque>
#include <exception>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <span>
#include <string>
#include <thread>
#include <vector>

#include "scheduler/mix/task.h"
#include "workloads/backend.h"

namespace pirt {

/// The value of a state, in two sets: a call reads the committed one and writes the other.
/// Used by who holds the state, and by nobody meanwhile.
class StateValue {
 public:
  explicit StateValue(const Workload& workload);
  [[nodiscard]] std::span<const Tensor> committed() const { return sets_[current_]; }
  [[nodiscard]] std::span<Tensor> next() { return sets_[1 - current_]; }
  /// What was written is the state from now on.
  void commit();
  /// Rises with each commit.
  [[nodiscard]] std::uint64_t version() const { return version_; }

 private:
  std::vector<Tensor> sets_[2];
  std::size_t current_ = 0;
  std::uint64_t version_ = 0;
};

/// One call of a workload. Whoever makes it keeps its tensors and its state to it until it is done.
struct Call {
  const Workload* workload = nullptr;
  std::vector<Tensor> inputs;
  std::shared_ptr<std::vector<Tensor>> outputs;
  StateValue* state = nullptr;             ///< Null if the workload has none.
  Outcome intended = Outcome::kCompleted;  ///< Otherwise it runs, and commits nothing.
  std::uint64_t token = 0;                 ///< The caller's.
};

/// How a call ended.
struct CallEnd {
  Outcome outcome = Outcome::kCompleted;
  Nanos busy{0};
  std::string problem;  ///< Of one that failed, with the names of workload and unit.
};

/// What a unit prepares before anything runs.
struct Preparation {
  const Workload* workload = nullptr;
  std::shared_ptr<const Data> sample;  ///< Parameters, and inputs for the first call.
};

class KernelUnit {
 public:
  /// @param done  Called from the unit's thread after each call; must not throw, may call run().
  /// @throws Error{kEnvironment} if the thread cannot be started.
  KernelUnit(UnitRequest request, const Backend& backend, std::vector<Preparation> preparations,
             bool prepare_first, std::function<void(Call&, CallEnd)> done);
  /// Waits for the call that runs; what waits behind it is forgotten.
  ~KernelUnit();
  KernelUnit(const KernelUnit&) = delete;
  KernelUnit& operator=(const KernelUnit&) = delete;

  /// Until the device is open and all is prepared.
  /// @throws What opening and preparing throw.
  void wait_until_ready();
  /// Runs the call after those before it. Any thread.
  void run(Call call);
  [[nodiscard]] const std::string& name() const { return request_.unit; }

 private:
  struct Prepared {
    std::unique_ptr<Kernel> kernel;
    const StateValue* resident = nullptr;  ///< Whose value the device has,
    std::uint64_t version = 0;             ///< and which.
  };
  void serve();
  void set_up();
  Prepared& prepare(const Preparation& preparation);
  Prepared& prepared(const Workload& workload);
  CallEnd execute(Call& call);
  void compute(Prepared& prepared, Call& call);

  UnitRequest request_;
  const Backend& backend_;
  std::vector<Preparation> preparations_;
  bool prepare_first_;
  std::function<void(Call&, CallEnd)> done_;
  MachineClock clock_;
  std::unique_ptr<Device> device_;  ///< As kernels_: of the unit's thread.
  std::map<const Workload*, Prepared> kernels_;

  std::mutex mutex_;
  std::condition_variable changed_;
  bool ready_ = false;
  bool stopping_ = false;
  std::exception_ptr failure_;
  std::deque<Call> calls_;
  std::jthread thread_;  ///< Last: all else is there before it and after it.
};

}  // namespace pirt
