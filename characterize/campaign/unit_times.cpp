#include "characterize/campaign/unit_times.h"

#include <algorithm>
#include <string>
#include <thread>
#include <utility>

#include "workloads/base/error.h"

namespace pirt {
namespace {

/// Below, the ticks of a core's counters do not tell what others take (doctor.h).
constexpr Nanos kFewestTicks = std::chrono::milliseconds(200);
/// On a busy machine a row takes several times what is expected; then it has enough samples to tell
/// that.
constexpr int kLongest = 4;
constexpr Nanos kGrace = std::chrono::milliseconds(500);

}  // namespace

Judgement judge_unit_time(const std::vector<Nanos>& samples, const Interference& others,
                          double precision) {
  CellConditions conditions;
  conditions.live = true;
  conditions.contended = others.contended;
  conditions.crowded = others.crowded;
  conditions.throttled = others.throttled;
  conditions.unstable = is_unstable(samples);
  const auto interval = median_interval(samples);
  const auto reached = interval ? relative_half_width(interval, median(samples)) : std::nullopt;
  conditions.precise = reached && *reached <= precision;
  CellSamples all;
  all.samples = samples;
  all.processes.resize(samples.size(), 0);
  return judge(all, conditions);
}

std::optional<UnitTimeRecord> UnitTimeSampler::measure(const PlannedUnitTime& planned) {
  const MachineClock clock;
  const UnitTimePart& part = planned.part;
  UnitTimeRecord record{
      .unit = planned.unit, .phase = part.phase, .sleep = part.sleep, .reasons = {}, .samples = {}};
  const HostCounters before = read_host_counters(planned.cores);
  if (unit_ != planned.unit) {
    unit_ = planned.unit;
    unit_begun_ = before;
  }
  const Nanos given_up = clock.now() + kLongest * part.expected + kGrace;
  std::string failure;
  try {
    while (static_cast<int>(record.samples.size()) < part.samples && clock.now() < given_up) {
      if (stopped()) return std::nullopt;
      const int left = part.samples - static_cast<int>(record.samples.size());
      for (const Nanos each : part.measure(std::min(left, part.portion))) {
        record.samples.push_back(each);
      }
    }
  } catch (const Error& error) {
    failure = error.what();
    if (record.samples.empty()) {
      record.reasons.push_back("error: " + failure);
      return record;
    }
  }
  Judgement found = judge_unit_time(record.samples, others_since(before, planned), precision_);
  if (!failure.empty()) {
    std::erase(found.doubts, "few_samples");
    found.doubts.push_back("few_samples: " + failure);
  }
  hold_against(record, std::move(found));
  return record;
}

Interference UnitTimeSampler::others_since(const HostCounters& part,
                                           const PlannedUnitTime& planned) {
  const MachineClock clock;
  // Of a short row what others took since the unit's first one says more.
  const HostCounters& since = clock.now() - part.at < kFewestTicks ? unit_begun_ : part;
  std::this_thread::sleep_for(since.at + kFewestTicks - clock.now());
  return interference(since, read_host_counters(planned.cores),
                      static_cast<int>(planned.cores.size()));
}

}  // namespace pirt
