#include "characterize/profile/records.h"

#include <algorithm>
#include <numeric>

namespace pirt {
namespace {

/// What another process may find where nothing is known of how processes differ: a core's clock,
/// which a virtual machine does not show, lies between its base and its boost.
constexpr double kUnknownSpread = 1.5;
constexpr std::int64_t kFewProcesses = 3;

/// Whether samples of so few processes were taken here that they do not show how processes differ.
bool tells_nothing_of_others(const PhaseRecord& record, const Statistics& found) {
  const auto has = [](const std::vector<std::string>& words, std::string_view word) {
    return std::ranges::find(words, word) != words.end();
  };
  return found.processes < kFewProcesses && has(record.doubts, "few_samples") &&
         !has(record.notes, kMeasuredElsewhere) && !record.deterministic;
}

}  // namespace

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
  const bool is_narrow = tells_nothing_of_others(record, found);
  if (!record.taken && !is_narrow) return found;
  // Of fewer than 3 processes, what they span.
  if (!found.interval) {
    const auto [least, most] =
        std::ranges::minmax(process_medians(record.samples, processes_of(record)));
    found.interval = {least, most};
  }
  Nanos& low = found.interval->low;
  if (record.taken) low = std::min(low, scaled(found.median, 1 - *record.taken));
  if (is_narrow) {
    low = scaled(low, 1 / kUnknownSpread);
    found.interval->high = scaled(found.interval->high, kUnknownSpread);
  }
  return found;
}

}  // namespace pirt
