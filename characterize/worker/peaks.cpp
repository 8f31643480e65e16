#include "characterize/worker/peaks.h"

#include <fmt/core.h>

#include <algorithm>
#include <limits>

namespace pirt {
namespace {

Nanos time_of(PeakLoop& loop, int repeats, const Clock& clock) {
  const Nanos start = clock.now();
  loop.run(repeats);
  return clock.now() - start;
}

/// How many repeats fill a sample. Doubles until they do, which warms up caches and clock as well;
/// one run that was interrupted is not taken for a long one.
int calibrate(PeakLoop& loop, const Clock& clock, Nanos sample) {
  constexpr int kMost = 1 << 24;  // a clock that stands still must not end in an endless loop
  int repeats = 1;
  const auto too_short = [&] {
    return time_of(loop, repeats, clock) < sample || time_of(loop, repeats, clock) < sample ||
           time_of(loop, repeats, clock) < sample;
  };
  while (repeats < kMost && too_short()) repeats *= 2;
  return repeats;
}

/// Work a second of the fastest sample; absent if the clock saw no time pass.
std::optional<double> rate(PeakLoop& loop, const Clock& clock, const PeakOptions& options) {
  const int repeats = calibrate(loop, clock, options.sample);
  Nanos fastest = Nanos::max();
  for (int i = 0; i < options.samples; ++i) {
    fastest = std::min(fastest, time_of(loop, repeats, clock));
  }
  if (fastest.count() <= 0) return std::nullopt;
  return loop.work() * repeats / to_s(fastest);
}

void take(PeakFigure& figure, PeakLoop& loop, const Clock& clock, const PeakOptions& options) {
  const auto found = rate(loop, clock, options);
  const Verdict verdict = loop.verify();
  if (!verdict.ok) {
    figure.reasons.push_back(fmt::format("wrong_output: {}: {}", loop.variant(), verdict.detail));
  } else if (!found) {
    figure.reasons.push_back(fmt::format("clock_bound: {}: took no time", loop.variant()));
  } else if (*found > figure.per_second.value_or(0)) {
    figure.per_second = found;
    figure.variant = loop.variant();
  }
}

}  // namespace

std::vector<PeakFigure> measure_peaks(Device& device, const Clock& clock,
                                      const PeakOptions& options) {
  const PeakLoops all = device.peak_loops();
  std::vector<PeakFigure> figures;
  for (const PeakKind kind : kAllPeakKinds) {
    PeakFigure figure{.kind = kind, .per_second = {}, .variant = {}, .reasons = {}};
    for (const auto& loop : all.loops) {
      if (loop->kind() == kind) take(figure, *loop, clock, options);
    }
    const auto why = all.unavailable.find(kind);
    if (figure.per_second) {
      figure.reasons.clear();  // one loop that is right is enough
    } else if (figure.reasons.empty()) {
      figure.reasons.push_back("unavailable: " + (why == all.unavailable.end()
                                                      ? "the device has no loop"
                                                      : why->second));
    }
    figures.push_back(std::move(figure));
  }
  return figures;
}

std::vector<PeakRecord> peak_records(const std::string& unit,
                                     const std::vector<PeakFigure>& figures,
                                     const std::string& error, Provenance provenance) {
  std::vector<PeakRecord> records;
  for (const PeakFigure& figure : figures) {
    records.push_back(
        {unit, figure.kind, figure.per_second, figure.variant, provenance, figure.reasons});
  }
  if (!records.empty()) return records;
  for (const PeakKind kind : kAllPeakKinds) {
    records.push_back({unit, kind, {}, "", provenance, {"error: " + error}});
  }
  return records;
}

std::vector<PeakRecord> faster_peaks(const std::vector<PeakRecord>& first,
                                     std::vector<PeakRecord> second) {
  for (PeakRecord& record : second) {
    const auto earlier = std::ranges::find(first, record.kind, &PeakRecord::kind);
    if (earlier == first.end()) continue;
    if (earlier->per_second.value_or(0) > record.per_second.value_or(0)) record = *earlier;
  }
  return second;
}

}  // namespace pirt
