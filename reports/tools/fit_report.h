// What fitting the energy model to a run's meter readings gave: parameters with their standard
// errors, each cell's error, and what could not be told.
#pragma once

#include <span>
#include <vector>

#include "characterize/energy/fitted_platform.h"
#include "reports/document/document.h"
#include "workloads/base/text/json.h"

namespace pirt {

/// Two tables a unit, one if its fit was refused.
[[nodiscard]] std::vector<Table> fit_tables(std::span<const UnitFit> fits);

/// An array with one entry a unit: "parameters", "residuals", "dropped", "refusal".
[[nodiscard]] Json fit_json(std::span<const UnitFit> fits);

}  // namespace pirt
