// How near each cell comes to its unit's limits: the roofline.
//
// roof = min(peak, intensity x bandwidth) operations a second, where intensity = operations / bytes
// of the cell, so that fraction = max(operations / peak, bytes / bandwidth) / execution time.
// Operations and bytes are those that the workload cannot do without (Workload::ops without
// padding_ops, bytes()): a kernel that skips what is not needed must not exceed a peak by it.
//
// @source Williams, Waterman, Patterson: Roofline, an insightful visual performance model, CACM
// 2009.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "characterize/profile/profile.h"
#include "workloads/model/workload.h"

namespace pirt {

/// One cell against its unit's limits.
struct Roofline {
  std::string workload, unit;
  std::optional<double> fraction =
      {};                    ///< Of the roof, by the median of `execute`; absent: see why_not.
  std::string why_not = {};  ///< One clause; empty if there is a fraction.
  PeakKind bound = PeakKind::kF32;  ///< The limit that makes the roof.
  double roof_per_second = 0;     ///< Operations a second, or bytes where operations are not known.
  double reached_per_second = 0;  ///< In the same unit.
  std::optional<double> intensity =
      {};                    ///< Operations a byte; absent where operations are not known.
  std::string missing = {};  ///< A limit that is not known, so that the true roof may be lower.
  Origin provenance = Provenance::kMeasured;  ///< The weakest of its time and the limits.
};

struct Rooflines {
  std::vector<Roofline> cells;  ///< Those with a valid `execute` row, in its order.
  /// The profile's peaks; one that some cell exceeds is not valid: "exceeded by <workload>".
  std::vector<PeakRow> peaks;

  /// Null if there is none.
  [[nodiscard]] const Roofline* find(std::string_view workload, std::string_view unit) const;
};

/// Which arithmetic limit holds for a workload: of layers that of their precision, nothing for
/// bf16, which no loop measures; else f32 if any of the tensors is floating point, and int8
/// otherwise.
[[nodiscard]] std::optional<PeakKind> arithmetic_of(const Workload& workload);

/// The least time that @p bytes take: what fits the cache may stay there and come at L2 bandwidth
/// (which no larger cache exceeds), what does not comes from memory. Without a cache size all of it
/// might. A bandwidth that is not known costs no time. @param cache_bytes  The largest cache of the
/// unit.
[[nodiscard]] double least_transfer_s(double bytes, std::optional<double> cache_bytes,
                                      std::optional<double> l2_per_second,
                                      std::optional<double> memory_per_second);

/// Cells of a run whose identity differs from the run that the unit's peaks are of have no
/// fraction; nor have those of a unit with an exceeded peak.
[[nodiscard]] Rooflines rooflines(const Profile& profile);

/// The peaks of a run that some cell exceeds.
[[nodiscard]] std::vector<PeakRow> exceeded_peaks(const Rooflines& rooflines, std::int64_t run_id);

}  // namespace pirt
