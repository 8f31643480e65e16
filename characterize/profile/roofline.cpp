#include "characterize/profile/roofline.h"

#include <fmt/core.h>

#include <algorithm>
#include <charconv>
#include <map>

#include "characterize/profile/identity.h"
#include "workloads/catalog/catalog.h"

namespace pirt {
namespace {

std::optional<double> cache_of(const RunInfo& run, const std::string& unit) {
  const auto it = run.environment.find("unit." + unit + ".cache_bytes");
  if (it == run.environment.end()) return std::nullopt;
  std::int64_t bytes = 0;
  std::from_chars(it->second.data(), it->second.data() + it->second.size(), bytes);
  return bytes > 0 ? std::optional(static_cast<double>(bytes)) : std::nullopt;
}

/// The limits of one unit, as far as they are valid, and the run that they were measured in.
struct Limits {
  std::map<PeakKind, double> per_second;
  std::map<PeakKind, std::string> missing;    ///< Why a limit is not there.
  Origin provenance = Provenance::kMeasured;  ///< The weakest of them.
  const RunInfo* run = nullptr;

  [[nodiscard]] std::optional<double> find(PeakKind kind) const {
    const auto it = per_second.find(kind);
    return it == per_second.end() ? std::nullopt : std::optional(it->second);
  }
};

Limits limits_of(const Profile& profile, const std::string& unit) {
  Limits limits;
  for (const PeakRow& peak : profile.peaks) {
    if (peak.unit != unit) continue;
    limits.run = profile.find_run(peak.run_id);
    if (is_used(peak) && peak.per_second) {
      limits.per_second[peak.kind] = *peak.per_second;
      limits.provenance = weakest(limits.provenance, peak.provenance);
    } else {
      limits.missing[peak.kind] = peak.reasons.empty() ? "not measured" : peak.reasons.front();
    }
  }
  return limits;
}

/// The least times that the limits allow for one cell.
struct LeastTimes {
  std::optional<PeakKind> arithmetic = {};     ///< Absent: no peak is of its kind.
  PeakKind transfer = PeakKind::kBandwidthL2;  ///< The slowest bandwidth that takes part.
  double arithmetic_s = 0;                     ///< 0 = not known.
  double transfer_s = 0;
};

/// A row of another size, from another version, keeps all of its own operations.
std::optional<double> needed_ops(const PhaseRow& row, const Workload& workload) {
  const auto ops = row.ops == workload.ops ? workload.needed_ops() : row.ops;
  if (!ops) return std::nullopt;
  return static_cast<double>(*ops);
}

LeastTimes least_times(const PhaseRow& row, const Workload& workload, const Limits& limits) {
  LeastTimes times;
  times.arithmetic = arithmetic_of(workload);
  const auto peak = times.arithmetic ? limits.find(*times.arithmetic) : std::nullopt;
  const auto ops = needed_ops(row, workload);
  if (ops && peak) times.arithmetic_s = *ops / *peak;
  const auto cache = cache_of(*limits.run, row.unit);
  const auto bytes = static_cast<double>(row.bytes);
  if (cache && bytes > *cache) times.transfer = PeakKind::kBandwidthMemory;
  times.transfer_s = least_transfer_s(bytes, cache, limits.find(PeakKind::kBandwidthL2),
                                      limits.find(PeakKind::kBandwidthMemory));
  return times;
}

/// Why the cell cannot be held against the unit's limits; empty if it can.
std::string obstacle(const Profile& profile, const PhaseRow& row, const Workload* workload,
                     const Limits& limits) {
  if (workload == nullptr) return "the workload is not in this version's catalog";
  if (limits.run == nullptr) return "the unit's peaks were not measured";
  if (row.run_id == limits.run->run_id) return "";
  const RunInfo* run = profile.find_run(row.run_id);
  if (run == nullptr) return "its run is not known";
  for (const auto& difference : compare_identity(*run, *limits.run, row.unit)) {
    const std::string& field = difference.field;
    // The unit is the same.
    if (field == "seed" || field == "images_hash" || field == "precision") continue;
    return "not comparable with the run of the peaks: " + describe(difference);
  }
  return "";
}

/// Why the limit of the cell's arithmetic is not known; empty if it is.
std::string missing_arithmetic(const Workload& workload, const LeastTimes& times,
                               const Limits& limits) {
  if (!times.arithmetic) {
    return fmt::format("{}: no loop measures its peak", to_string(workload.precision));
  }
  const auto missing = limits.missing.find(*times.arithmetic);
  if (missing == limits.missing.end()) return "";
  return fmt::format("{}: {}", to_string(missing->first), missing->second);
}

Roofline roofline(const PhaseRow& row, const LeastTimes& times, const Workload& workload,
                  const Limits& limits) {
  Roofline result{.workload = row.workload,
                  .unit = row.unit,
                  .provenance = weakest(row.provenance, limits.provenance)};
  const double took_s = to_s(*row.median);
  const double least_s = std::max(times.arithmetic_s, times.transfer_s);
  const auto bytes = static_cast<double>(row.bytes);
  const auto ops = needed_ops(row, workload);
  if (ops && row.bytes > 0) result.intensity = *ops / bytes;
  if (ops) result.missing = missing_arithmetic(workload, times, limits);
  if (least_s <= 0) {
    result.why_not = "no limit of the unit applies";
    return result;
  }
  const bool computing = times.arithmetic && times.arithmetic_s >= times.transfer_s;
  result.bound = computing ? *times.arithmetic : times.transfer;
  const double work = ops.value_or(bytes);
  result.roof_per_second = work / least_s;
  result.reached_per_second = work / took_s;
  result.fraction = least_s / took_s;
  return result;
}

/// Marks the peak of (unit, kind) as exceeded, by the workload that exceeds it most.
class Exceeded {
 public:
  void consider(const PhaseRow& row, PeakKind kind, double least_s) {
    const double fraction = least_s / to_s(*row.median);
    auto& worst = worst_[{row.unit, kind}];
    if (fraction > std::max(1.0, worst.first)) worst = {fraction, row.workload};
  }
  /// Empty if none did.
  [[nodiscard]] std::string by(const std::string& unit, PeakKind kind) const {
    const auto it = worst_.find({unit, kind});
    return it == worst_.end() ? "" : it->second.second;
  }

 private:
  std::map<std::pair<std::string, PeakKind>, std::pair<double, std::string>> worst_;
};

constexpr std::string_view kExceededBy = "exceeded by ";

/// "exceeded by conv2"; empty if the peak is not.
std::string exceeded_reason(const PeakRow& peak) {
  const auto it = std::ranges::find_if(
      peak.reasons, [](const std::string& reason) { return reason.starts_with(kExceededBy); });
  return it == peak.reasons.end() ? "" : *it;
}

/// Of the first of the unit's limits that is exceeded; empty if none is.
std::string exceeded_text(const std::vector<PeakRow>& peaks, const std::string& unit) {
  for (const PeakRow& peak : peaks) {
    const std::string reason = exceeded_reason(peak);
    if (peak.unit != unit || reason.empty()) continue;
    return fmt::format("the unit's {} peak is {}", to_string(peak.kind), reason);
  }
  return "";
}

}  // namespace

std::vector<PeakRow> exceeded_peaks(const Rooflines& rooflines, std::int64_t run_id) {
  std::vector<PeakRow> exceeded;
  for (const PeakRow& peak : rooflines.peaks) {
    if (peak.run_id == run_id && !exceeded_reason(peak).empty()) exceeded.push_back(peak);
  }
  return exceeded;
}

const Roofline* Rooflines::find(std::string_view workload, std::string_view unit) const {
  const auto it = std::ranges::find_if(
      cells, [&](const Roofline& c) { return c.workload == workload && c.unit == unit; });
  return it == cells.end() ? nullptr : &*it;
}

std::optional<PeakKind> arithmetic_of(const Workload& workload) {
  if (workload.precision == Precision::kBf16) return std::nullopt;
  if (workload.precision == Precision::kInt8) return PeakKind::kInt8;
  const auto is_float = [](const TensorSpec& spec) {
    return spec.element == Element::kF32 || spec.element == Element::kF64;
  };
  const bool any = std::ranges::any_of(workload.inputs, is_float) ||
                   std::ranges::any_of(workload.parameters, is_float) ||
                   std::ranges::any_of(workload.outputs, is_float);
  return any ? PeakKind::kF32 : PeakKind::kInt8;
}

double least_transfer_s(double bytes, std::optional<double> cache_bytes,
                        std::optional<double> l2_per_second,
                        std::optional<double> memory_per_second) {
  const double near = std::min(bytes, cache_bytes.value_or(bytes));
  const double far = bytes - near;
  return (l2_per_second ? near / *l2_per_second : 0) +
         (memory_per_second ? far / *memory_per_second : 0);
}

Rooflines rooflines(const Profile& profile) {
  Rooflines result;
  result.peaks = profile.peaks;
  std::map<std::string, Limits> limits;
  for (const auto& unit : profile.units()) limits[unit] = limits_of(profile, unit);
  Exceeded exceeded;
  for (const PhaseRow& row : profile.phases) {
    if (row.phase != Phase::kExecute || !is_used(row) || !row.median || row.median->count() <= 0) {
      continue;
    }
    const Workload* workload = try_find_workload(row.workload);
    const Limits& unit = limits[row.unit];
    std::string why_not = obstacle(profile, row, workload, unit);
    if (!why_not.empty()) {
      result.cells.push_back({.workload = row.workload, .unit = row.unit, .why_not = why_not});
      continue;
    }
    const LeastTimes times = least_times(row, *workload, unit);
    if (is_valid(row)) {  // a doubted row says nothing of a peak
      if (times.arithmetic) exceeded.consider(row, *times.arithmetic, times.arithmetic_s);
      exceeded.consider(row, times.transfer, times.transfer_s);
    }
    result.cells.push_back(roofline(row, times, *workload, unit));
  }
  for (PeakRow& peak : result.peaks) {
    const std::string by = exceeded.by(peak.unit, peak.kind);
    if (by.empty()) continue;
    peak.reasons.push_back(std::string(kExceededBy) + by);
  }
  for (Roofline& cell : result.cells) {
    const std::string why_not = exceeded_text(result.peaks, cell.unit);
    if (why_not.empty() || !cell.fraction) continue;
    cell.fraction.reset();
    cell.why_not = why_not;
  }
  return result;
}

}  // namespace pirt
