#include "scheduler/unit_times/handover.h"

#include <array>
#include <semaphore>
#include <string>
#include <thread>

#include "scheduler/runtime/kernel_unit.h"
#include "workloads/base/error.h"
#include "workloads/base/system/affinity.h"

namespace pirt {
namespace {

using std::chrono::microseconds;
using std::chrono::milliseconds;

constexpr std::array<SleepPlan, 5> kPlans = {{{Nanos(0), 200},
                                              {microseconds(100), 60},
                                              {milliseconds(1), 40},
                                              {milliseconds(10), 20},
                                              {milliseconds(100), 20}}};

/// A unit that computes nothing, and who hands it calls.
class EmptyUnit {
 public:
  explicit EmptyUnit(const std::vector<int>& cores)
      : cores_(cores), unit_(setup(), [this](Call&, const CallEnd& end) { ended(end); }) {
    run(1);  // Binds the thread.
  }

  std::vector<Nanos> measure(const SleepPlan& plan) {
    times_.clear();
    if (plan.sleep == Nanos(0)) {
      run(plan.samples + 1);
      times_.erase(times_.begin());  // That one did not follow.
    } else {
      for (int i = 0; i < plan.samples; ++i) {
        std::this_thread::sleep_for(plan.sleep);
        run(1);
      }
    }
    return times_;
  }

 private:
  UnitSetup setup() {
    workload_.name = "handover";
    call_.workload = &workload_;
    UnitSetup setup;
    setup.request.unit = "handover";
    setup.preparations.push_back(
        {.workload = &workload_, .sample = nullptr, .function = [this](auto, auto) { compute(); }});
    return setup;
  }
  /// So many calls, each but the first handed over from the end of the one before.
  void run(int calls) {
    to_end_ = calls;
    handed_at_ = clock_.now();
    unit_.run(call_);
    over_.acquire();
    if (!problem_.empty()) throw_environment(problem_);
  }
  void compute() {
    const Nanos begin = clock_.now();
    if (!bound_) {
      bind_to_cores(cores_, "handover");
      bound_ = true;
    }
    times_.push_back(begin - handed_at_);
    handed_at_ = clock_.now();
  }

  void ended(const CallEnd& end) {
    problem_ = end.problem;
    if (--to_end_ == 0 || !problem_.empty()) return over_.release();
    unit_.run(call_);
  }

  std::vector<int> cores_;
  Workload workload_;
  Call call_;  ///< One at a time.
  MachineClock clock_;
  // Of the unit's thread until the last call has ended.
  bool bound_ = false;
  Nanos handed_at_{0};
  std::vector<Nanos> times_;
  int to_end_ = 0;  ///< Calls.
  std::string problem_;
  std::binary_semaphore over_{0};
  KernelUnit unit_;  ///< Last: its thread uses all else.
};

}  // namespace

std::span<const SleepPlan> handover_plans() { return kPlans; }

std::vector<Nanos> measure_handover(const std::vector<int>& cores, const SleepPlan& plan) {
  return EmptyUnit(cores).measure(plan);
}

}  // namespace pirt
