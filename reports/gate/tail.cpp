#include "reports/gate/tail.h"

#include <fmt/core.h>

#include <algorithm>
#include <set>

#include "characterize/campaign/validity.h"
#include "characterize/statistics/proportions.h"
#include "characterize/worker/measure.h"

namespace pirt {
namespace {

struct Tail {
  std::int64_t samples = 0, above = 0, processes = 0, with_some = 0;
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
  tail.processes = std::ssize(all);
  tail.with_some = std::ssize(some);
  return tail;
}

bool has_contended_note(const PhaseRow& row) {
  return std::ranges::find(row.notes, "contended") != row.notes.end();
}

}  // namespace

GateRow compare_tails(const PhasePair& pair, const std::string& doubt,
                      const GateThresholds& thresholds) {
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
  const bool beside_others = has_contended_note(base) || has_contended_note(candidate);
  const std::string open =
      !doubt.empty() ? doubt
      : std::min(a.processes, b.processes) < kFewestProcesses
          ? fmt::format("too few processes; {} are needed", kFewestProcesses)
      : more && beside_others                 ? "beside other programs"
      : more && 2 * b.with_some < b.processes ? "in few processes"
      : !more && rate_upper_bound(b.above, b.samples) - a.share() >= *row.needed
          ? "more samples tell"
          : "";
  row.verdict = !open.empty() ? GateVerdict::kUndecided
                : more        ? GateVerdict::kSlower
                              : GateVerdict::kSame;
  if (row.verdict != GateVerdict::kSame) row.reason = open.empty() ? what : what + "; " + open;
  return row;
}

}  // namespace pirt
