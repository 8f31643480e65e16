// What a robot without accelerators does: every task to the CPU. Of several units of that role the
// one with the fewest tasks for its servers; ties: the first.
#include "scheduler/policies/baseline.h"
#include "scheduler/policies/policies.h"

namespace pirt {
namespace {

UnitMask cpus(const PolicySetup& setup) {
  UnitMask mask = 0;
  for (UnitId unit = 0; unit < setup.roles.size(); ++unit) {
    if (setup.roles[unit] == "cpu") mask |= unit_bit(unit);
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

std::unique_ptr<Policy> make_cpu_only_policy(const PolicySetup& setup) {
  return std::make_unique<CpuOnlyPolicy>(setup);
}

}  // namespace pirt
