// The energy of a kernel's calls from a machine's meters: idle, then calls for as long as the
// meters need, then idle again; the idle power is subtracted, the rest divided by the calls.
//
// A device that is open idles at more than at rest, when nobody has it open: the two windows beside
// the calls are of an open one, idle_power_text is of one at rest.
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "characterize/energy/meter.h"
#include "characterize/machine/host_load.h"
#include "characterize/profile/records.h"
#include "workloads/base/time.h"

namespace pirt {

/// Which meters of the machine, and how; empty = none.
struct MeterRequest {
  std::string meters;          ///< For find_meters.
  std::string source, domain;  ///< As source_of and domain_of had them, for rows without a reading.
  std::string sysfs = "/sys";
  Nanos window = std::chrono::milliseconds(500);  ///< For metering_window.
  Nanos step{0};  ///< step_of() when it was planned, for metering_time (campaign_meters.h).
};

/// What the readings said; crosses the pipe between worker and coordinator.
struct MeteredCalls {
  std::string source;  ///< "rapl: package-0"
  std::string domain;  ///< "package"
  std::int64_t calls = 0;
  Nanos duration{0};               ///< Of the calls.
  std::optional<double> active_j;  ///< Of the calls, with what the idle machine would have used.
  std::optional<double> idle_before_w, idle_after_w;
  std::vector<std::string> reasons;    ///< Why the figures do not count; empty = they do.
  std::vector<double> repeats_j = {};  ///< Joules a call of each repeat, where there are several.

  /// Joules a call above idle; absent if a reading is, or if the calls drew no more than idling.
  [[nodiscard]] std::optional<double> call_j() const;
};

/// How long one value of the slowest counter that steps lasts; 0 if none steps, or shows it.
[[nodiscard]] Nanos step_of(std::span<const Meter* const> meters, const Clock& clock);

/// How long each of the three windows has to be: @p wished, and at least 5 of @p step and 5 periods
/// of the slowest power sensor.
[[nodiscard]] Nanos metering_window(std::span<const Meter* const> meters, Nanos wished,
                                    Nanos step = Nanos(0));

/// Joules and seconds of the same calls.
///
/// Where all meters step, the calls go on until a step is below 5 % of what they drew above idle.
///
/// reasons: those of integrate (window.h); not_above_idle; unstable, if the idle power before and
/// after differs by more than 20 % of what the calls drew above it: then something else on the
/// machine changed meanwhile; not_measurable, if the step would be above 5 % even after 20 s.
/// @param call    One call, complete on return; whatever it throws ends the measurement.
/// @param window   From metering_window.
/// @param may_end  Whether the calls so far are all that belong together; empty = each by itself.
[[nodiscard]] MeteredCalls meter_calls(std::span<const Meter* const> meters, const Clock& clock,
                                       Nanos window, const std::function<void()>& call,
                                       const std::function<bool()>& may_end = {});

/// How often calls are metered, so that their joules have an interval.
inline constexpr int kMeteredRepeats = 3;
/// Calls go on for so long at most, of a process of 120 s: where a step is too large a part of what
/// they draw, and repeats of them together.
inline constexpr Nanos kLongestWindow = std::chrono::seconds(20);
/// All of them as one: sums, means of the idle power, and what is held against any of them.
/// @param repeats  Not empty.
[[nodiscard]] MeteredCalls joined_repeats(std::span<const MeteredCalls> repeats);

/// Adds the reason `unstable` if a metered call took 20 % more or less than a timed one: power and
/// time of a row must be those of the same conditions, and a sustained load may be throttled.
/// @param timed  A mean, as that of the metered calls is.
void check_call_time(MeteredCalls& metered, Nanos timed);

/// Adds what befell the machine meanwhile: `throttled`; `contended`, which is said of a board of
/// its own in the source alone: what the host's programs draw is no part of it.
void check_disturbance(MeteredCalls& metered, std::span<const Meter* const> meters,
                       const Interference& during);

/// The machine's idle power over one window, in watts with 4 digits; "" if the meters do not show
/// it, or cannot be read any more. Of a GPU's own meter, once it has come to rest: no device may be
/// open.
[[nodiscard]] std::string idle_power_text(const MeterRequest& request);

/// "package-0 + package-0/dram", as find_meters takes it.
[[nodiscard]] std::string names_of(std::span<const Meter* const> meters);
/// "rapl: package-0 + package-0/dram" and "package + dram".
[[nodiscard]] std::string source_of(std::span<const Meter* const> meters);
[[nodiscard]] std::string domain_of(std::span<const Meter* const> meters);

/// The row: provenance measured, idle subtracted.
[[nodiscard]] EnergyRecord metered_energy(const MeteredCalls& metered);

}  // namespace pirt
