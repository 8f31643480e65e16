// What pirt what-if found, as a document and as JSON.
#pragma once

#include "reports/document/document.h"
#include "scheduler/what_if.h"
#include "workloads/base/text/json.h"

namespace pirt {

[[nodiscard]] Document what_if_document(const WhatIf& found, const Platform& platform,
                                        const Mix& mix);
[[nodiscard]] Json what_if_json(const WhatIf& found, const Platform& platform, const Mix& mix);

}  // namespace pirt
