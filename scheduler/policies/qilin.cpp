// Qilin's static split of a divisible workload: of N frames unit u gets N * r_u / sum of r, with
// r_u its measured rate alone, so that all units end at the same time.
//
// Readings. The split is of each workload by itself. The rate of a unit is its servers over the
// time that a frame occupies one. The number of frames need not be known: each goes to the unit
// whose share would, with it, end first. After any N frames that is the whole-numbered split that
// ends first, and within one frame of the shares. Load plays no part; Qilin maps before it runs.
//
// Source: Luk, Hong, Kim: Qilin: Exploiting Parallelism on Heterogeneous Multiprocessors with
// Adaptive Mapping, MICRO 2009. (The rounding is d'Hondt's.)
#include "scheduler/policies/baseline.h"
#include "scheduler/policies/policies.h"

namespace pirt {
namespace {

class QilinPolicy final : public Baseline {
 public:
  explicit QilinPolicy(const PolicySetup& setup)
      : Baseline(setup),
        frames_(setup.costs.size(), std::vector<std::int64_t>(setup.roles.size(), 0)) {}

  Placement place(const TaskClass& task, const UnitsView& units) override {
    const auto best = first_best(takers(task, units.up), [&](UnitId a, UnitId b) {
      return ends_before(task.workload, a, b);
    });
    if (best) ++frames_[task.workload][*best];
    return on_or_hold(best);
  }

 private:
  /// Whether the share of @p a, with one more frame, ends before that of @p b: frames x occupied /
  /// servers, compared as fractions.
  bool ends_before(WorkloadId workload, UnitId a, UnitId b) const {
    return end(workload, a) * servers_[b] < end(workload, b) * servers_[a];
  }
  __extension__ using Wide = __int128;  ///< A day of nanoseconds times 64 servers passes 2^52.
  Wide end(WorkloadId workload, UnitId unit) const {
    return Wide{frames_[workload][unit] + 1} * costs_[workload][unit]->occupied.count();
  }

  std::vector<std::vector<std::int64_t>> frames_;  ///< [workload][unit]: given so far.
};

}  // namespace

constinit const PolicyInfo policy::qilin = {
    .name = "qilin",
    .description =
        "Qilin's static split: each workload's frames over the units in proportion to their rates",
    .make = make_policy<QilinPolicy>,
};

}  // namespace pirt
