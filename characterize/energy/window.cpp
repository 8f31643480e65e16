#include "characterize/energy/window.h"

#include <fmt/core.h>

#include <algorithm>
#include <cassert>
#include <condition_variable>
#include <mutex>
#include <thread>

#include "workloads/base/system/thread.h"

namespace pirt {
namespace {

constexpr double kMicro = 1e-6;
constexpr std::int64_t kReadingsAFailure = 10;  // failures below a tenth of all reads are bridged
constexpr Nanos kPoll = std::chrono::milliseconds(1);  // of a step of 20 ms at least
constexpr Nanos kLongestStep = std::chrono::milliseconds(500);
constexpr int kStepsAPeriod = 8;

WindowEnergy failed(const std::string& text) {
  return {.energy_j = std::nullopt, .reason = "meter_error: " + text};
}

bool stands_still(const std::vector<MeterReading>& readings) {
  return std::ranges::all_of(readings, [&](const MeterReading& reading) {
    return reading.value == readings.front().value;
  });
}

WindowEnergy count(const MeterInfo& meter, const MeterTrace& trace) {
  std::int64_t energy_uj = 0;
  for (std::size_t i = 1; i < trace.readings.size(); ++i) {
    std::int64_t step = trace.readings[i].value - trace.readings[i - 1].value;
    if (step < 0) {
      if (!meter.range_uj) {
        return failed(fmt::format("{} went back from {} to {}, and its range is not known",
                                  meter.path, trace.readings[i - 1].value,
                                  trace.readings[i].value));
      }
      step += *meter.range_uj;
      if (step < 0) {
        return failed(fmt::format("{} went back by more than its range of {} uJ", meter.path,
                                  *meter.range_uj));
      }
    }
    energy_uj += step;
  }
  return {.energy_j = static_cast<double>(energy_uj) * kMicro, .reason = ""};
}

/// The counter's next value after @p first; the same one if there is none for kLongestStep.
Attribute<std::int64_t> next_value(const Meter& meter, const Attribute<std::int64_t>& first,
                                   const Clock& clock) {
  auto latest = first;
  const Nanos begin = clock.now();
  while (latest.value && latest.value == first.value && clock.now() - begin < kLongestStep) {
    std::this_thread::sleep_for(kPoll);
    latest = meter.read();
  }
  return latest;
}

WindowEnergy add_trapezoids(const MeterTrace& trace) {
  const auto& readings = trace.readings;
  const auto power_w = [](const MeterReading& r) { return static_cast<double>(r.value) * kMicro; };
  double energy_j = power_w(readings.front()) * to_s(readings.front().at - trace.begin) +
                    power_w(readings.back()) * to_s(trace.end - readings.back().at);
  for (std::size_t i = 1; i < readings.size(); ++i) {
    energy_j += (power_w(readings[i - 1]) + power_w(readings[i])) / 2 *
                to_s(readings[i].at - readings[i - 1].at);
  }
  return {.energy_j = energy_j, .reason = ""};
}

}  // namespace

WindowEnergy integrate(const MeterInfo& meter, const MeterTrace& trace) {
  const auto reads = static_cast<std::int64_t>(trace.readings.size()) + trace.failures;
  const bool counter = meter.kind == MeterKind::kCounter;
  if (trace.failures > 0 && (counter || trace.failures * kReadingsAFailure > reads)) {
    return failed(fmt::format("{} of {} reads failed, the last with {}", trace.failures, reads,
                              trace.last_error));
  }
  if (trace.readings.size() < 2) return failed(meter.path + ": fewer than two readings");
  const bool still = stands_still(trace.readings);
  const std::int64_t first = trace.readings.front().value;
  if (trace.stood_still || (still && (counter || first == 0))) {
    return {.energy_j = std::nullopt, .reason = "meter_frozen"};
  }
  WindowEnergy energy = counter ? count(meter, trace) : add_trapezoids(trace);
  if (still) energy.constant_uw = first;
  return energy;
}

std::optional<Nanos> update_period(const Meter& meter, const Clock& clock) {
  auto value = next_value(meter, meter.read(), clock);
  const Nanos begin = clock.now();
  for (int i = 0; i < kStepsAPeriod; ++i) {
    const auto next = next_value(meter, value, clock);
    if (!next.value || next.value == value.value) return std::nullopt;
    value = next;
  }
  return (clock.now() - begin) / kStepsAPeriod;
}

struct MeterRecorder::Impl {
  Impl(std::span<const Meter* const> read, const Clock& time)
      : meters(read), clock(time), traces(read.size()) {}

  std::span<const Meter* const> meters;
  const Clock& clock;
  std::vector<MeterTrace> traces;
  std::mutex mutex;
  std::condition_variable stopping;
  bool stop = false;
  std::jthread thread;

  void read(std::size_t i) {
    const bool steps = meters[i]->info().steps;
    const auto first = meters[i]->read();
    const auto reading = steps ? next_value(*meters[i], first, clock) : first;
    // Behind the read: what a sensor gives is never newer than that.
    const Nanos at = clock.now();
    if (reading.value) {
      traces[i].readings.push_back({at, *reading.value});
      traces[i].stood_still |= steps && reading.value == first.value;
    } else {
      ++traces[i].failures;
      traces[i].last_error = reading.error;
    }
  }

  /// Those that step, or all others.
  void read_those(bool steps) {
    for (std::size_t i = 0; i < meters.size(); ++i) {
      if (meters[i]->info().steps == steps) read(i);
    }
  }

  /// Where the window of meter @p i begins or ends: with its last reading if it steps.
  [[nodiscard]] Nanos edge(std::size_t i, Nanos of_others) const {
    const auto& readings = traces[i].readings;
    return meters[i]->info().steps && !readings.empty() ? readings.back().at : of_others;
  }

  /// The shortest period of the power sensors; nothing if there are only counters.
  [[nodiscard]] std::optional<Nanos> period() const {
    std::optional<Nanos> shortest;
    for (const Meter* meter : meters) {
      if (meter->info().kind != MeterKind::kPower) continue;
      shortest = std::min(shortest.value_or(meter->info().period), meter->info().period);
    }
    return shortest;
  }

  void sample(Nanos every) {
    std::unique_lock lock(mutex);
    auto next = std::chrono::steady_clock::now() + every;
    while (!stopping.wait_until(lock, next, [this] { return stop; })) {
      for (std::size_t i = 0; i < meters.size(); ++i) {
        if (meters[i]->info().kind == MeterKind::kPower) read(i);
      }
      // Late or slow reads are not caught up with: that would only give the same reading twice.
      next = std::max(next + every, std::chrono::steady_clock::now());
    }
  }

  void end() {
    {
      const std::lock_guard lock(mutex);
      stop = true;
    }
    stopping.notify_all();
    if (thread.joinable()) thread.join();
  }
};

MeterRecorder::MeterRecorder(std::span<const Meter* const> meters, const Clock& clock)
    : impl_(new Impl(meters, clock)) {
  assert(!meters.empty());
  impl_->read_those(true);
  impl_->read_those(false);
  const Nanos begin = clock.now();
  for (std::size_t i = 0; i < meters.size(); ++i) impl_->traces[i].begin = impl_->edge(i, begin);
  if (const auto every = impl_->period()) {
    impl_->thread = start_thread([impl = impl_.get(), every] { impl->sample(*every); });
  }
}

std::optional<double> MeterRecorder::stepped_j() const {
  std::int64_t energy_uj = 0;
  for (std::size_t i = 0; i < impl_->meters.size(); ++i) {
    const auto reading = impl_->meters[i]->read();
    const auto& begin = impl_->traces[i].readings;
    if (!impl_->meters[i]->info().steps || !reading.value || begin.empty()) return std::nullopt;
    energy_uj += *reading.value - begin.front().value;
  }
  return static_cast<double>(energy_uj) * kMicro;
}

MeterRecorder::~MeterRecorder() { impl_->end(); }

std::vector<MeterTrace> MeterRecorder::stop() {
  impl_->end();
  const Nanos end = impl_->clock.now();
  impl_->read_those(false);
  impl_->read_those(true);
  for (std::size_t i = 0; i < impl_->meters.size(); ++i) impl_->traces[i].end = impl_->edge(i, end);
  return std::move(impl_->traces);
}

}  // namespace pirt
