// What a robot without accelerators does: every task to the CPU. Of several units of that role the
// one with the fewest tasks for its servers; ties: the first.
#include "scheduler/policies/baseline.h"
#include "scheduler/policies/policies.h"

namespace pirt {
namespace {

UnitMask cpus(const PolicySetup& setup) {
  UnitMask mask = 0;
  for (UnitId unit = 0; unit < setup.roles.size(); ++unit) {
    if (setup.roles[unit] == Role::kCpu) mask |= unit_bit(unit);
  }
  return mask;
}

class CpuOnlyPolicy final : public Baseline {
 public:
  explicit CpuOnlyPolicy(const PolicySetup& setup)
      : Baseline(setup, cpus(setup)), servers_(setup.servers) {}

  Placement place(const TaskClass& task, const UnitsView& units) override {
    std::optional<UnitId> best;
    const UnitMask mask = takers(task, units.up);
    for (const UnitId unit : order()) {
      if (!contains(mask, unit)) continue;
      // Loads over servers, compared as fractions.
      if (!best || units.load[unit] * servers_[*best] < units.load[*best] * servers_[unit]) {
        best = unit;
      }
    }
    return best ? Placement::on(*best) : Placement::hold();
  }

 private:
  std::vector<int> servers_;
};

}  // namespace

constinit const PolicyInfo policy::cpu_only = {
    .name = "cpu-only",
    .description = "Baseline: every task to the CPU, whatever else the platform has",
    .make = make_policy<CpuOnlyPolicy>,
    .needs_role = Role::kCpu,
};

}  // namespace pirt
