// The unit that is expected to end a task first, beside asking each of them.
#include "scheduler/policies/completion_estimate.h"

#include "scheduler/policies/unit_order.h"
#include "tests/scheduler/support.h"
#include "workloads/base/math/random.h"

namespace pirt::test {
namespace {

PolicySetup any_setup(Random& random, std::size_t units) {
  PolicySetup setup;
  for (std::size_t unit = 0; unit < units; ++unit) {
    setup.roles.push_back(random.below(8) == 0 ? Role::kCloud : Role::kCpu);
    setup.servers.push_back(1 + static_cast<int>(random.below(3)));
  }
  for (int workload = 0; workload < 3; ++workload) {
    auto& row = setup.costs.emplace_back();
    for (std::size_t unit = 0; unit < units; ++unit) {
      const Nanos occupied(random.below(40));
      row.push_back(CallCost{.total = occupied + Nanos(random.below(30)), .occupied = occupied});
    }
  }
  return setup;
}

/// By asking each unit of one that has not been asked before.
std::optional<UnitId> first_to_end(CompletionEstimate estimate, const TaskClass& task,
                                   const UnitsView& units, UnitMask usable) {
  return first_best(task.eligible & units.up & usable, [&](UnitId a, UnitId b) {
    return estimate.completion(task, a, units) < estimate.completion(task, b, units);
  });
}

// Tasks are given to the best unit or any, complete in any order and early or late, so that the
// account is right, short of what is left, and beyond it.
TEST(CompletionEstimate, TheBestUnitIsThatWhichEndsFirstOfAll) {
  for (std::uint64_t seed = 0; seed < 300; ++seed) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    Random random(seed);
    const std::size_t count = 1 + random.below(seed % 10 == 0 ? kMaxUnits : 6);
    const PolicySetup setup = any_setup(random, count);
    const UnitMask all =
        count == kMaxUnits ? ~UnitMask{0} : unit_bit(static_cast<UnitId>(count)) - 1;
    const UnitMask local = local_units(setup.roles);
    CompletionEstimate estimate(setup);
    std::vector<int> load(count, 0);
    Nanos now{0};
    for (int step = 0; step < 300; ++step) {
      now += Nanos(random.below(2) * random.below(40));
      const auto unit = static_cast<UnitId>(random.below(count));
      if (random.below(3) == 0 && load[unit] > 0) --load[unit];
      const TaskClass task{.workload = static_cast<WorkloadId>(random.below(3)),
                           .eligible = all & ~unit_bit(static_cast<UnitId>(random.below(count)))};
      const UnitsView units{.load = load, .up = all, .now = now};
      const auto expected = first_to_end(estimate, task, units, local);
      ASSERT_EQ(estimate.best_unit(task, units), expected) << "step " << step;
      if (!expected || random.below(8) == 0) continue;
      const UnitId taken = random.below(4) == 0 && contains(local, unit) ? unit : *expected;
      estimate.add(task, taken, units);
      ++load[taken];
    }
  }
}

}  // namespace
}  // namespace pirt::test
