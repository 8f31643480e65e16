// Whether a run of a mix depends on its seed.
#pragma once

#include "characterize/platform/platform.h"
#include "scheduler/mix/mix.h"

namespace pirt {

/// Whether the platform draws the time of some call of @p mix, or the latency of a link, from a
/// distribution, or the mix the time of some firing.
[[nodiscard]] bool draws_times(const Platform& platform, const Mix& mix);

}  // namespace pirt
