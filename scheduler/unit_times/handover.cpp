#include "scheduler/unit_times/handover.h"

#include <array>
#include <condition_variable>
#include <mutex>
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
    unit_.run(call_);  // Binds the thread.
    wait_for(1);
  }

  std::vector<Nanos> measure(const SleepPlan& plan) {
    const auto first = static_cast<std::size_t>(count());
    const auto last = static_cast<std::int64_t>(first) + plan.samples;
    std::vector<Nanos> handed;
    if (plan.sleep == Nanos(0)) {
      // One more, to follow.
      {
        const std::lock_guard lock(mutex_);
        to_follow_ = plan.samples;
      }
      unit_.run(call_);
      wait_for(last + 1);
    } else {
      for (std::int64_t i = 0; i < plan.samples; ++i) {
        std::this_thread::sleep_for(plan.sleep);
        handed.push_back(clock_.now());
        unit_.run(call_);
        wait_for(static_cast<std::int64_t>(first) + i + 1);
      }
    }
    std::vector<Nanos> times;
    const std::lock_guard lock(mutex_);
    for (std::size_t i = 0; i < static_cast<std::size_t>(plan.samples); ++i) {
      times.push_back(plan.sleep == Nanos(0) ? begun_[first + i + 1] - ended_[first + i]
                                             : begun_[first + i] - handed[i]);
    }
    return times;
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
  void compute() {
    const Nanos begin = clock_.now();
    if (!bound_) {
      bind_to_cores(cores_, "handover");
      bound_ = true;
    }
    begun_.push_back(begin);
    ended_.push_back(clock_.now());
  }

  void ended(const CallEnd& end) {
    bool follows = false;
    {
      const std::lock_guard lock(mutex_);
      if (!end.problem.empty()) problem_ = end.problem;
      ++count_;
      follows = to_follow_ > 0 && problem_.empty();
      if (follows) --to_follow_;
    }
    if (follows) {
      unit_.run(call_);
    } else {
      changed_.notify_one();
    }
  }

  [[nodiscard]] std::int64_t count() {
    const std::lock_guard lock(mutex_);
    return count_;
  }
  void wait_for(std::int64_t calls) {
    std::unique_lock lock(mutex_);
    changed_.wait(lock, [&] { return count_ >= calls || !problem_.empty(); });
    if (!problem_.empty()) throw_environment(problem_);
  }

  std::vector<int> cores_;
  Workload workload_;
  Call call_;  ///< One at a time.
  MachineClock clock_;
  bool bound_ = false;                ///< Of the unit's thread, as those below until it has ended
  std::vector<Nanos> begun_, ended_;  ///< the last call that somebody waits for.
  std::mutex mutex_;
  std::condition_variable changed_;
  std::int64_t count_ = 0;      ///< Calls that have ended.
  std::int64_t to_follow_ = 0;  ///< That the unit's thread is to hand over itself.
  std::string problem_;
  KernelUnit unit_;  ///< Last: its thread uses all else.
};

}  // namespace

std::span<const SleepPlan> handover_plans() { return kPlans; }

std::vector<Nanos> measure_handover(const std::vector<int>& cores, const SleepPlan& plan) {
  return EmptyUnit(cores).measure(plan);
}

}  // namespace pirt
