// Algorithm 4, advanced scheduling: cloud awareness and resource awareness around a basic
// scheduler.
//
//   for each waiting task:
//     if not real-time       : to the cloud
//     else if image input    : to the high-priority queue; Qh++
//     else                   : by the basic scheduler
//
// Readings. There is one global high-priority queue; each unit's callback takes from it first, the
// first task that the unit can serve, and Qh falls then. A unit to which the basic scheduler gives
// no weight for a workload does not take it from there either: it would do what the weights say it
// should not. Strict priority can starve real-time tasks without images; that is the paper's mode.
// Where no cloud unit may serve a non-real-time task, or none is there (an outage), the basic
// scheduler takes it: it would wait for ever otherwise. Only what no unit of the robot's would take
// waits for the cloud.
#include <bit>
#include <stdexcept>

#include "scheduler/policies/policies.h"

namespace pirt {
namespace {

class AdvancedPolicy final : public Policy {
 public:
  explicit AdvancedPolicy(const PolicySetup& setup) {
    if (setup.basic == nullptr) throw std::logic_error("mode advanced without a basic policy");
    basic_ = setup.basic->make(setup);
    cloud_ = units_where(setup.roles, [](Role role) { return role == Role::kCloud; });
  }

  Placement place(const TaskClass& task, const UnitsView& units) override {
    if (offloads(task)) {
      const UnitMask there = task.eligible & cloud_ & units.up;
      if (there != 0) return Placement::on(static_cast<UnitId>(std::countr_zero(there)));
      if (basic_->takers(task, units.up) == 0) return Placement::hold_for(0);
    }
    if (task.real_time && task.image_input) return Placement::high_priority();
    return basic_->place(task, units);
  }

  UnitMask takers(const TaskClass& task, UnitMask up) const override {
    const UnitMask there = offloads(task) ? task.eligible & cloud_ & up : 0;
    return there != 0 ? there : basic_->takers(task, up);
  }

  std::vector<UnitId> order() const override { return basic_->order(); }
  Nanos rank(const Task& task) override { return basic_->rank(task); }
  void moved(const MovedTask& task, Whereabouts from, Whereabouts to,
             const UnitsView& units) override {
    basic_->moved(task, from, to, units);
  }
  void units_changed(UnitMask up) override { basic_->units_changed(up); }
  [[nodiscard]] Nanos ask_again() const override { return basic_->ask_again(); }
  [[nodiscard]] std::int64_t over_cap() const override { return basic_->over_cap(); }

 private:
  bool offloads(const TaskClass& task) const {
    return !task.real_time && (task.eligible & cloud_) != 0;
  }

  std::unique_ptr<Policy> basic_;
  UnitMask cloud_ = 0;
};

}  // namespace

constinit const PolicyInfo policy::advanced = {
    .name = "advanced",
    .description =
        "Algorithm 4: non-real-time tasks to the cloud, image tasks first on any unit, the rest by "
        "--basic",
    .make = make_policy<AdvancedPolicy>,
    .rule = WeightRule::kOfBasic,
    .cloud_use = CloudUse::kNotRealTime,
};

}  // namespace pirt
