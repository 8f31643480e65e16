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
  if (still && (counter || first == 0)) return {.energy_j = std::nullopt, .reason = "meter_frozen"};
  WindowEnergy energy = counter ? count(meter, trace) : add_trapezoids(trace);
  if (still) energy.constant_uw = first;
  return energy;
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
    const auto reading = meters[i]->read();
    // Behind the read: what a sensor gives is never newer than that.
    const Nanos at = clock.now();
    if (reading.value) {
      traces[i].readings.push_back({at, *reading.value});
    } else {
      ++traces[i].failures;
      traces[i].last_error = reading.error;
    }
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
  for (std::size_t i = 0; i < meters.size(); ++i) impl_->read(i);
  for (auto& trace : impl_->traces) trace.begin = clock.now();
  if (const auto every = impl_->period()) {
    impl_->thread = start_thread([impl = impl_.get(), every] { impl->sample(*every); });
  }
}

MeterRecorder::~MeterRecorder() { impl_->end(); }

std::vector<MeterTrace> MeterRecorder::stop() {
  impl_->end();
  for (auto& trace : impl_->traces) trace.end = impl_->clock.now();
  for (std::size_t i = 0; i < impl_->meters.size(); ++i) impl_->read(i);
  return std::move(impl_->traces);
}

}  // namespace pirt
