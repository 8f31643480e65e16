// The measured limits of each unit, and how near each workload comes to them.
#pragma once

#include <string>

#include "characterize/profile/roofline.h"
#include "reports/document/document.h"
#include "workloads/base/text/json.h"

namespace pirt {

/// A row for each unit and limit.
[[nodiscard]] Table peak_table(const Rooflines& rooflines);

/// "62% f32", "40% memory"; "-" if there is no fraction.
[[nodiscard]] std::string roofline_cell(const Roofline* roofline);

/// What the fractions mean, and why some are missing; footnotes of a table with roofline_cell().
[[nodiscard]] std::vector<std::string> roofline_footnotes(const Rooflines& rooflines);

/// {"run_id", "unit", "kind", ...}; `per_second` where it is known.
[[nodiscard]] Json peak_json(const PeakRow& peak);

/// {"peaks": [...], "cells": [...]}; a fraction that is not known is absent and `why_not` is there.
[[nodiscard]] Json roofline_json(const Rooflines& rooflines);

}  // namespace pirt
