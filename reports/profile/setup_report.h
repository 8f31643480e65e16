// `pirt report setup`: total offloading time by phase, and crossovers between units.
#pragma once

#include "reports/document/chart.h"
#include "reports/document/document.h"
#include "reports/profile/offloading.h"
#include "workloads/base/text/json.h"

namespace pirt {

/// The paper's Fig. 7 as a table, for every workload and unit: set-up, cold and warm, and one call.
[[nodiscard]] Table offloading_table(const OffloadingCosts& costs);

/// For each workload and pair of units, from how many calls on the second beats the first, and
/// between which numbers that lies.
[[nodiscard]] Table crossover_table(const OffloadingCosts& costs);

/// offloading_table() with a bar a row, up to the end of the first call.
[[nodiscard]] Chart offloading_chart(const OffloadingCosts& costs);

/// The crossovers of crossover_table() with a dot each: a row a workload, pair of units and set-up.
[[nodiscard]] Chart crossover_chart(const OffloadingCosts& costs);

/// "offloading", "crossovers" and "missing"; times in ms. A crossover is {"wins": "never" |
/// "always" | "from" | "up_to", "calls"}, with two of its kind, "soonest" and "latest", where
/// intervals are known.
[[nodiscard]] Json setup_json(const OffloadingCosts& costs);

}  // namespace pirt
