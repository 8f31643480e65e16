#include "reports/gate/pooling.h"

#include <algorithm>
#include <set>
#include <string>

#include "characterize/profile/identity.h"
#include "characterize/profile/store/reader.h"
#include "characterize/statistics/statistics.h"

namespace pirt {
namespace {

/// Process numbers of one run are below this.
constexpr std::int32_t kProcessesARun = 10'000;

const RunInfo& run_of(const Profile& profile, std::int64_t run_id) {
  return *std::ranges::find(profile.runs, run_id, &RunInfo::run_id);
}

/// Units whose rows must not be put together; "" = all.
std::set<std::string> units_apart(const RunInfo& a, const RunInfo& b) {
  std::set<std::string> units;
  for (const auto& difference : compare_identity(a, b)) units.insert(difference.unit);
  return units;
}

bool is_same(const PhaseRow& a, const PhaseRow& b) {
  return is_valid(b) && a.ops == b.ops && a.bytes == b.bytes && a.provenance == b.provenance;
}

/// Runs differ by more than their processes do, so that the interval is what all of them span.
void add(const PhaseRow& other, std::int32_t offset, PhaseRow& row) {
  row.values.insert(row.values.end(), other.values.begin(), other.values.end());
  for (const auto process : other.value_processes) row.value_processes.push_back(offset + process);
  row.samples = std::ssize(row.values);
  row.processes += other.processes;
  row.median = median(row.values, row.value_processes);
  if (!row.ci_low || !other.ci_low) return;
  row.ci_low = std::min(*row.ci_low, *other.ci_low);
  row.ci_high = std::max(*row.ci_high, *other.ci_high);
}

}  // namespace

Pooled pool_samples(const ProfileReader& reader, Profile& profile) {
  reader.read_samples(profile);
  Pooled pooled;
  const std::string platform = profile.platform();
  for (const std::int64_t id : reader.finished_runs(platform)) {
    Profile other = reader.read(platform, {id, id});
    reader.read_samples(other);
    bool any = false;
    bool others = false;
    for (PhaseRow& row : profile.phases) {
      if (row.run_id == id || !is_valid(row) || row.is_deterministic()) continue;
      const RunInfo& own = run_of(profile, row.run_id);
      const auto apart = units_apart(own, other.runs.front());
      if (apart.contains("") || apart.contains(row.unit)) continue;
      const PhaseRow* same = other.find(row.workload, row.unit, row.phase, row.state);
      if (same == nullptr || !is_same(row, *same)) continue;
      if (!compare_program(own, other.runs.front()).empty()) {
        others = true;
        continue;
      }
      add(*same, pooled.runs * kProcessesARun, row);
      any = true;
    }
    pooled.runs += any ? 1 : 0;
    pooled.left_out += others && !any ? 1 : 0;
  }
  return pooled;
}

}  // namespace pirt
