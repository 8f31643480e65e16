// What `pirt doctor` found, worst first.
#pragma once

#include <vector>

#include "characterize/doctor/doctor.h"
#include "reports/document/document.h"
#include "workloads/base/text/json.h"

namespace pirt {

[[nodiscard]] Document doctor_document(const std::vector<Finding>& findings);

/// {"verdict": "good" | "spoils" | "blocks", "findings": [{check, level, found, why, remedy}]}; why
/// and remedy are absent where there are none.
[[nodiscard]] Json doctor_json(const std::vector<Finding>& findings);

}  // namespace pirt
