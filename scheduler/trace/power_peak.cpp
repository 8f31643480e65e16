#include "scheduler/trace/power_peak.h"

#include <algorithm>
#include <utility>

#include "scheduler/services/call_plan.h"

namespace pirt {

PowerPeak::PowerPeak(const Platform& platform) : LoadObserver(platform) {
  for (ServerLoad& load : loads_) idle_w_ += std::exchange(load.idle_w, 0);
}

/// @param time  Not before the first change that is kept.
double PowerPeak::joules_until(Nanos time) const {
  const auto behind = std::ranges::upper_bound(changes_, time, {}, &Change::at);
  if (behind == changes_.begin()) return 0;
  const Change& last = *std::prev(behind);
  return last.before_j + last.power_w * to_s(time - last.at);
}

void PowerPeak::consider(Nanos end) {
  highest_w_ = std::max(highest_w_, joules_until(end) - joules_until(end - kPowerWindow));
}

/// What a second draws, by its end, rises and falls in straight lines: it is highest where the
/// power changes at its end or its beginning.
void PowerPeak::settled(Nanos now, std::span<const int> /*waiting*/) {
  double power_w = 0;
  for (const ServerLoad& load : loads_) power_w += load.power_w();
  if (!changes_.empty() && changes_.back().power_w == power_w) return;
  if (!changes_.empty() && changes_.back().at == now) {
    changes_.back().power_w = power_w;
    return;
  }
  const double before_j = joules_until(now);
  if (!changes_.empty()) {
    const Nanos since = changes_.back().at;
    for (const Change& change : changes_) {
      const Nanos end = change.at + kPowerWindow;
      if (end >= now) break;
      if (end > since) consider(end);
    }
    consider(now);
  }
  while (changes_.size() > 1 && changes_[1].at <= now - kPowerWindow) changes_.pop_front();
  changes_.push_back({now, power_w, before_j});
}

}  // namespace pirt
