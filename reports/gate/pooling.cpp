#include "reports/gate/pooling.h"

#include <algorithm>
#include <string>

#include "characterize/profile/identity.h"
#include "characterize/profile/own_rows.h"
#include "characterize/statistics/statistics.h"
#include "workloads/base/text/json.h"
#include "workloads/own/definition.h"

namespace pirt {
namespace {

/// Process numbers of one run are below this; a pooled row has further ones.
constexpr std::int32_t kProcessesARun = 10'000;

/// Runs differ by more than their processes do, so that the interval is what all of them span.
void add(const PhaseRow& other, std::int32_t offset, PhaseRow& row) {
  const auto contended = std::ranges::find(other.notes, "contended");
  if (contended != other.notes.end() && std::ranges::count(row.notes, *contended) == 0) {
    row.notes.push_back(*contended);  // which a tail asks for
  }
  row.values.insert(row.values.end(), other.values.begin(), other.values.end());
  for (const auto process : other.value_processes) row.value_processes.push_back(offset + process);
  row.pooled_runs.push_back(other.run_id);
  row.samples = std::ssize(row.values);
  row.processes += other.processes;
  row.median = median(row.values, row.value_processes);
  if (!row.ci_low || !other.ci_low) return;
  row.ci_low = std::min(*row.ci_low, *other.ci_low);
  row.ci_high = std::max(*row.ci_high, *other.ci_high);
}

/// Whether both runs measured the same of somebody else's @p workload, wherever its file lay.
bool is_same_definition(const RunInfo& a, const RunInfo& b, const std::string& workload) {
  const auto digest = [&](const RunInfo& run) {
    const auto fact = run.environment.find(std::string(kOwnFact) + own::plain_name(workload));
    return fact == run.environment.end() ? std::string()
                                         : own::definition_from(parse_json(fact->second)).digest;
  };
  return digest(a) == digest(b);
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
      const RunInfo& own = *profile.find_run(row.run_id);
      if (!compare_identity(own, other.runs.front(), row.unit).empty()) continue;
      const PhaseRow* same = other.find(row.workload, row.unit, row.phase, row.state);
      if (same == nullptr || !is_valid(*same) || !compare_work(row, *same).empty()) continue;
      if (!compare_program(own, other.runs.front()).empty() ||
          !is_same_definition(own, other.runs.front(), row.workload)) {
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
