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

GateRow compare_tails(const PhasePair& pair, const std::string& doubt, double machine,
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
  const double multiple = thresholds.tail_multiple * machine;
  const Nanos limit = scaled(*base.median, thresholds.tail_multiple);
  const Tail a = tail_of(base, limit);  // which the machine made none longer of
  const Tail b = tail_of(candidate, scaled(*base.median, multiple));
  const Tail most = tail_of(candidate, limit);
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
      fmt::format("{} of {} calls took over {:.3g} times the base's median, {} of {} in the base{}",
                  b.above, b.samples, multiple, a.above, a.samples,
                  machine > 1 ? fmt::format(" over {:g} times", thresholds.tail_multiple) : "");
  const auto may_be_more = [&](const Tail& tail) {
    return rate_upper_bound(tail.above, tail.samples) - a.share() >= *row.needed;
  };
  const bool beside_others = has_contended_note(base) || has_contended_note(candidate);
  const std::string open = !doubt.empty() ? doubt
                           : std::min(a.processes, b.processes) < kFewestProcesses
                               ? fmt::format("too few processes; {} are needed", kFewestProcesses)
                           : more && beside_others                 ? "beside other programs"
                           : more && 2 * b.with_some < b.processes ? "in few processes"
                           : !more && may_be_more(b)               ? "more samples tell"
                           : !more && may_be_more(most)
                               ? fmt::format("{} over {:g} times, which may be the machine's",
                                             most.above, thresholds.tail_multiple)
                               : "";
  row.verdict = !open.empty() ? GateVerdict::kUndecided
                : more        ? GateVerdict::kSlower
                              : GateVerdict::kSame;
  if (row.verdict != GateVerdict::kSame) row.reason = open.empty() ? what : what + "; " + open;
  return row;
}

}  // namespace pirt
