// Profiles by hand, of what calls take on the units of a platform `board`.
#pragma once

#include <string>
#include <utility>
#include <vector>

#include "characterize/profile/profile.h"

namespace pirt::test {

/// Every call takes the same.
inline PhaseRow row_of(const std::string& workload, const std::string& unit, Phase phase,
                       Nanos takes) {
  PhaseRow row;
  row.run_id = 1;
  row.platform = "board";
  row.workload = workload;
  row.unit = unit;
  row.backend = "fake";
  row.phase = phase;
  row.samples = 20;
  row.median = row.mean = row.p95 = row.p99 = takes;
  return row;
}

inline Profile profile_of(std::vector<PhaseRow> rows) {
  Profile profile;
  profile.path = "p.db";
  RunInfo& run = profile.runs.emplace_back();
  run.run_id = 1;
  run.platform = "board";
  profile.phases = std::move(rows);
  return profile;
}

}  // namespace pirt::test
