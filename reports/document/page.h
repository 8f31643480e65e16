// A document as one self-contained HTML page: nothing is loaded from anywhere.
//
// Charts are drawn by the page's own script (charts.js) with D3, which is embedded when pirt is
// built, if the machine has it. Without it the page has its tables, and says what is missing.
#pragma once

#include <string>

#include "reports/document/document.h"

namespace pirt {

/// @param document  Printable (base/printable.h); markup in it is escaped.
[[nodiscard]] std::string page(const Document& document);

/// Whether D3 was there when this program was built.
[[nodiscard]] bool page_has_charts();

}  // namespace pirt
