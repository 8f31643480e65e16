// What `pirt tune` found, and what it would do.
#pragma once

#include <vector>

#include "characterize/tune/tune.h"
#include "reports/document/document.h"
#include "workloads/base/text/json.h"

namespace pirt {

/// One table a unit: a row for each parameter and workload.
[[nodiscard]] Table tune_table(const TunedUnit& tuned);
/// {"unit", "device", "platform", "version", "tuning", "parameters": [{name, meaning, default,
/// best, fastest, verdict, speed_up, rounds, rounds_faster, p_value, workloads, rejected}],
/// "not_reached", "remarks"}; figures are absent where nothing was measured.
[[nodiscard]] Json tune_json(const TunedUnit& tuned);

/// The same of what is only planned: candidates and workloads.
[[nodiscard]] Table tune_plan_table(const TuneUnit& unit);
[[nodiscard]] Json tune_plan_json(const TuneUnit& unit);

}  // namespace pirt
