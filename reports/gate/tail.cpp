#include "reports/gate/tail.h"

#include <fmt/core.h>

#include <algorithm>
#include <set>

#include "characterize/statistics/proportions.h"
#include "characterize/worker/measure.h"

namespace pirt {
namespace {

struct Tail {
  std::int64_t samples = 0, above = 0;
  std::size_t processes = 0, with_some = 0;
  [[nodiscard]] double share() const {
    return static_cast<double>(above) / static_cast<double>(samples);
  }
};

Tail tail_of(const PhaseRow& row, Nanos limit) {
  Tail tail{.samples = std::ssize(row.values)};
  std::set<std::int32_t> all, some;
  for (std::size_t i = 0; i < row.values.size(); ++i) {
    all.insert(row.value_processes[i]);
    if (row.values[i] <= limit) continue;
    ++tail.above;
    some.insert(row.value_processes[i]);
  }
  tail.processes = all.size();
  tail.with_some = some.size();
  return tail;
}

bool is_contended(const PhaseRow& row) {
  return std::ranges::count(row.notes, "contended") + std::ranges::count(row.doubts, "contended") >
         0;
}

}  // namespace

GateRow compare_tails(const PhasePair& pair, const GateThresholds& thresholds) {
  const PhaseRow& base = *pair.a;
  const PhaseRow& candidate = *pair.b;
  GateRow row{.workload = base.workload,
              .unit = base.unit,
              .phase = "call tail",
              .verdict = GateVerdict::kNotJudged,
              .measure = "share"};
  if (batch_size(std::min(*base.median, *candidate.median)) > 1) {
    row.reason = "samples are means over batches of such short calls";
    return row;
  }
  const Nanos limit = scaled(*base.median, thresholds.tail_multiple);
  const Tail a = tail_of(base, limit);
  const Tail b = tail_of(candidate, limit);
  if (std::min(a.samples, b.samples) < thresholds.tail_samples) {
    row.reason = fmt::format("{} samples, {} are needed", std::min(a.samples, b.samples),
                             thresholds.tail_samples);
    return row;
  }
  row.base = a.share();
  row.candidate = b.share();
  row.change = b.share() - a.share();
  row.needed = thresholds.tail_share;
  row.p = fisher_p(a.above, a.samples, b.above, b.samples);
  const bool more = *row.change >= *row.needed && *row.p < thresholds.tail_p;
  const std::string what =
      fmt::format("{} of {} calls took over {:g} times the base's median, {} of {} in the base",
                  b.above, b.samples, thresholds.tail_multiple, a.above, a.samples);
  if (more && 2 * b.with_some >= b.processes && !is_contended(base) && !is_contended(candidate)) {
    row.verdict = GateVerdict::kSlower;
    row.reason = what;
  } else if (more) {
    row.verdict = GateVerdict::kUndecided;
    row.reason =
        what + (2 * b.with_some < b.processes ? ", in few processes" : ", beside other programs");
  } else if (rate_upper_bound(b.above, b.samples) - a.share() < *row.needed) {
    row.verdict = GateVerdict::kSame;
  } else {
    row.verdict = GateVerdict::kUndecided;
    row.reason = what + "; more samples tell";
  }
  return row;
}

}  // namespace pirt
