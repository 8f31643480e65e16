// Measuring the limits of a unit: the fastest of the loops that its device has for each.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "characterize/profile/records.h"
#include "workloads/model/backend.h"

namespace pirt {

/// One measured limit of a unit.
struct PeakFigure {
  PeakKind kind = PeakKind::kF32;
  std::optional<double> per_second;  ///< Operations or bytes; absent if not measured.
  std::string variant;               ///< The loop that was fastest; empty if not measured.
  std::vector<std::string> reasons;  ///< Why it is not valid; empty = valid.
};

struct PeakOptions {
  Nanos sample = std::chrono::milliseconds(2);  ///< What one sample takes at least; short, so that
                                                ///< some pass undisturbed on a busy machine.
  int samples = 15;                             ///< Of each loop.
};

/// Runs every loop of the device, one after the other. A limit is the rate of the fastest sample:
/// what disturbs a loop only ever makes it slower. Loops whose result is wrong do not count.
/// @return  One figure for each of kAllPeakKinds, in that order; "unavailable: ..." is the reason
/// where
///          the device has no loop, "wrong_output: ..." where none was right.
[[nodiscard]] std::vector<PeakFigure> measure_peaks(Device& device, const Clock& clock,
                                                    const PeakOptions& options = {});

/// The rows of a unit, one a kind.
/// @param figures  Empty if the worker failed.
/// @param error    How, then.
[[nodiscard]] std::vector<PeakRecord> peak_records(const std::string& unit,
                                                   const std::vector<PeakFigure>& figures,
                                                   const std::string& error, Provenance provenance);

/// Of two measurements of one unit, the faster for each kind: what disturbs only makes slower. @p
/// first may be empty.
[[nodiscard]] std::vector<PeakRecord> faster_peaks(const std::vector<PeakRecord>& first,
                                                   std::vector<PeakRecord> second);

}  // namespace pirt
