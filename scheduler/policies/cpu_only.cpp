// What a robot without accelerators does: every task to the CPU. Of several units of that role the
// one with the fewest tasks for its servers; ties: the first.
#include "scheduler/policies/baseline.h"
#include "scheduler/policies/policies.h"

namespace pirt {
namespace {

class CpuOnlyPolicy final : public Baseline {
 public:
  explicit CpuOnlyPolicy(const PolicySetup& setup)
      : Baseline(setup, units_where(setup.roles, [](Role role) { return role == Role::kCpu; })) {}

  Placement place(const TaskClass& task, const UnitsView& units) override {
    // Loads over servers, compared as fractions.
    return on_or_hold(first_best(takers(task, units.up), [&](UnitId a, UnitId b) {
      return units.load[a] * servers_[b] < units.load[b] * servers_[a];
    }));
  }
};

}  // namespace

constinit const PolicyInfo policy::cpu_only = {
    .name = "cpu-only",
    .description = "Baseline: every task to the CPU, whatever else the platform has",
    .make = make_policy<CpuOnlyPolicy>,
    .needs_role = Role::kCpu,
};

}  // namespace pirt
