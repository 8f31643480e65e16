// Follows a plan that was made before the run: each task on its planned unit, one at a time there,
// in the planned order.
//
// Readings. A unit waits for the task whose turn it is, as the plan says, even if another is ready:
// only so does a run of the graph take what was planned. A pipeline that fires again goes through
// its plan again: of each of its tasks on a unit as many have to have had their turn as of the
// next. A task that was dropped has had its turn. While the planned unit is away the task waits; a
// static plan knows no other.
#include "scheduler/policies/policies.h"

namespace pirt {
namespace {

class PlannedPolicy final : public Policy {
 public:
  explicit PlannedPolicy(const PolicySetup& setup)
      : plan_(setup.plan), turns_(plan_.entries.size(), 0) {}

  Placement place(const TaskClass& task, const UnitsView& units) override {
    const auto& entry = plan_.entries[task.entry];
    const bool free = contains(units.up, entry.unit) && units.load[entry.unit] == 0;
    const bool in_turn = !entry.previous || turns_[*entry.previous] > turns_[task.entry];
    if (!in_turn) return Placement::hold_behind(*entry.previous);
    if (!free) return Placement::hold_for(unit_bit(entry.unit));
    return Placement::on(entry.unit);
  }

  UnitMask takers(const TaskClass& task, UnitMask up) const override {
    return unit_bit(plan_.entries[task.entry].unit) & up;
  }

  void moved(const MovedTask& task, Whereabouts from, Whereabouts, const UnitsView&) override {
    if (from.waits()) ++turns_[task.kind.entry];
  }

 private:
  MixPlan plan_;
  std::vector<std::int64_t> turns_;  ///< By entry: firings in which it was placed or is gone.
};

}  // namespace

std::unique_ptr<Policy> make_planned_policy(const PolicySetup& setup) {
  return std::make_unique<PlannedPolicy>(setup);
}

PolicyInfo planned_policy(const PlannerInfo& planner) {
  return {.name = planner.name,
          .description = planner.description,
          .make = make_planned_policy,
          .cloud_use = CloudUse::kAll,
          .planner = planner.plan};
}

}  // namespace pirt
