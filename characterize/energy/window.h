// What a meter's readings say about a span of time: joules, or why nothing can be said.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "characterize/energy/meter.h"
#include "workloads/base/time.h"

namespace pirt {

struct MeterReading {
  Nanos at{0};
  std::int64_t value = 0;  ///< Microjoules or microwatts, by the meter's kind.
};

/// The readings of one meter between two moments.
struct MeterTrace {
  Nanos begin{0}, end{0};
  std::vector<MeterReading> readings;  ///< In order; those that failed are not among them.
  std::int64_t failures = 0;
  std::string last_error;
  bool stood_still = false;  ///< A counter that steps, where its window begins or ends.
};

struct WindowEnergy {
  std::optional<double> energy_j;
  std::string reason;  ///< Why there is none: "meter_frozen", "meter_error: TEXT"; empty otherwise.
  /// What a power sensor read each time, if that was always the same: frozen if it reads that under
  /// load as well.
  std::optional<std::int64_t> constant_uw = {};
};

/// Joules from trace.begin to trace.end. Counters: the last reading minus the first one, with the
/// meter's range added at each step back. Power: trapezoids between readings; the first and the
/// last one stand for what is before and behind them.
///
/// meter_frozen: a counter's readings are all the same, one that steps did not where its window
/// begins or ends, or a power sensor's are all 0, so that the meter shows nothing. A power above 0
/// may well be constant for as long as the machine idles; whether the sensor moves at all only
/// other windows tell. meter_error: fewer than two readings, a counter that could not be read at
/// the window's begin or end, more than a tenth of a power sensor's readings failed, or a counter
/// that went back without a known range.
[[nodiscard]] WindowEnergy integrate(const MeterInfo& meter, const MeterTrace& trace);

/// How long one value of a counter that steps lasts: the mean over 8 of them. Absent if it cannot
/// be read, or stands still for half a second.
[[nodiscard]] std::optional<Nanos> update_period(const Meter& meter, const Clock& clock);

/// Reads meters while something else happens: counters when it is made and when it is stopped,
/// power sensors at their own rate in between as well, from a thread of its own that stop() or the
/// destructor joins. The window of a counter that steps begins and ends at a step, which is waited
/// for.
class MeterRecorder {
 public:
  /// @param meters  Not empty; they outlive this, and nobody else reads them meanwhile.
  MeterRecorder(std::span<const Meter* const> meters, const Clock& clock);
  ~MeterRecorder();
  MeterRecorder(const MeterRecorder&) = delete;
  MeterRecorder& operator=(const MeterRecorder&) = delete;

  /// Joules so far; absent if a meter is none that steps, or cannot be read.
  [[nodiscard]] std::optional<double> stepped_j() const;
  /// One trace a meter, in their order. Called once.
  [[nodiscard]] std::vector<MeterTrace> stop();

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace pirt
