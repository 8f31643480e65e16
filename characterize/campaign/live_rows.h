// Rows of a profile measured anew by a live run: a run of its own in the database.
#pragma once

#include <cstdint>
#include <map>
#include <span>
#include <string>
#include <vector>

#include "characterize/platform/platform.h"
#include "characterize/profile/profile.h"
#include "characterize/profile/store/writer.h"
#include "workloads/model/backend.h"
#include "workloads/model/phase.h"

namespace pirt {

/// Calls of one workload on one unit.
struct LiveRow {
  PhaseRow replaced;                            ///< Of its calls: work and memory stay as it has.
  bool metered = false;                         ///< Its joules are a meter's.
  std::map<Phase, std::vector<Nanos>> samples;  ///< Of kCall and its phases, in order of time.
};

/// Rows of the phases that have samples: measured, noted as live, not verified. Joules are modelled
/// anew; a meter's stay as they are. Another run's figures are never pooled with them.
/// @param devices  By unit, of all units of @p rows.
/// @param seed     Of the inputs.
/// @return         The number of the run.
/// @throws Error as ProfileWriter.
std::int64_t write_live_rows(ProfileWriter& writer, const Platform& platform,
                             const std::map<std::string, DeviceInfo>& devices, std::uint64_t seed,
                             std::span<const LiveRow> rows);

}  // namespace pirt
