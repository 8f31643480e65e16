// What units take beside their calls, as a part of a campaign: how it is sampled and judged. Who
// knows how a call is handed over gives the parts (cli/commands/measure/unit_times.h).
#pragma once

#include <atomic>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "characterize/campaign/validity.h"
#include "characterize/machine/host_load.h"
#include "characterize/profile/profile.h"
#include "characterize/profile/records.h"

namespace pirt {

/// One row of one unit.
struct UnitTimePart {
  UnitPhase phase = UnitPhase::kHandover;
  Nanos sleep{0};
  int samples = 0;
  int portion = 1;    ///< So many at once: nothing ends the sampling between them.
  Nanos expected{0};  ///< What all samples take on a machine that nobody else uses.
  /// @throws Error, which is a row's reason where there are no samples, else its doubt.
  std::function<std::vector<Nanos>(int samples)> measure;
};

struct PlannedUnitTime {
  std::string unit;
  std::vector<int> cores;  ///< That the unit has; at least one.
  UnitTimePart part;
};

/// By the rules of calls that one process took (validity.h); the clock's cost is part of a
/// hand-over.
[[nodiscard]] Judgement judge_unit_time(const std::vector<Nanos>& samples,
                                        const Interference& others, double precision);

/// Takes the samples of one row after the other.
class UnitTimeSampler {
 public:
  /// @param precision  As CampaignOptions::precision.
  /// @param stop       Ends it between two portions; may be null.
  UnitTimeSampler(double precision, const std::atomic<bool>* stop)
      : precision_(precision), stop_(stop) {}

  /// One that takes much longer than expected ends with the samples that it has.
  /// @return  Nothing if stopped.
  [[nodiscard]] std::optional<UnitTimeRecord> measure(const PlannedUnitTime& planned);

 private:
  [[nodiscard]] bool stopped() const { return stop_ != nullptr && stop_->load(); }
  [[nodiscard]] Interference others_since(const HostCounters& part, const PlannedUnitTime& planned);

  double precision_;
  const std::atomic<bool>* stop_;
  std::string unit_;         ///< The latest,
  HostCounters unit_begun_;  ///< and when its first row began.
};

}  // namespace pirt
