#include "characterize/profile/records.h"

#include <algorithm>
#include <numeric>

namespace pirt {

std::vector<std::int32_t> processes_of(const PhaseRecord& record) {
  if (!record.processes.empty()) {
    return record.processes;
  }
  std::vector<std::int32_t> processes(record.samples.size(), 0);
  if (record.state != State::kSteady) std::iota(processes.begin(), processes.end(), 0);
  return processes;
}

Statistics statistics_of(const PhaseRecord& record) {
  Statistics found = summarize(record.samples, processes_of(record));
  if (record.deterministic) {
    found.interval = {found.median, found.median};
  } else if (record.provenance.provenance == Provenance::kPublished) {
    // Each is a mean of somebody else's: nobody measured how far they may be off.
    found.interval.reset();
  }
  if (record.p95) {
    found.p95 = *record.p95;
    found.p99 = std::max(found.p99, found.p95);
  }
  if (!record.taken) return found;
  // Of fewer than 3 processes, what they span.
  if (!found.interval) {
    const auto [least, most] =
        std::ranges::minmax(process_medians(record.samples, processes_of(record)));
    found.interval = {least, most};
  }
  found.interval->low = std::min(found.interval->low, scaled(found.median, 1 - *record.taken));
  return found;
}

}  // namespace pirt
