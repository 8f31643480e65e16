#include "characterize/energy/metered_calls.h"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <thread>

#include "characterize/energy/window.h"
#include "workloads/base/error.h"
#include "workloads/base/text/text.h"

namespace pirt {
namespace {

constexpr int kPeriodsAWindow = 5;
constexpr double kUnstableShare = 0.20;  // as for times, validity.cpp

/// Joules of all meters together, or the first one's complaint.
struct Sum {
  std::optional<double> energy_j;
  Nanos duration{0};
  std::string reason;
  std::vector<std::optional<std::int64_t>> constant_uw = {};  ///< Of each meter, see WindowEnergy.
};

Sum sum_of(std::span<const Meter* const> meters, const std::vector<MeterTrace>& traces) {
  Sum sum{.energy_j = 0.0, .duration = traces.front().end - traces.front().begin, .reason = ""};
  for (std::size_t i = 0; i < meters.size(); ++i) {
    const WindowEnergy energy = integrate(meters[i]->info(), traces[i]);
    if (!energy.energy_j)
      return {.energy_j = std::nullopt, .duration = sum.duration, .reason = energy.reason};
    *sum.energy_j += *energy.energy_j;
    sum.constant_uw.push_back(energy.constant_uw);
  }
  if (*sum.energy_j <= 0)
    return {.energy_j = std::nullopt, .duration = sum.duration, .reason = "meter_frozen"};
  return sum;
}

/// The machine is left alone: this sleep is what is measured.
Sum idle(std::span<const Meter* const> meters, const Clock& clock, Nanos window) {
  MeterRecorder recorder(meters, clock);
  std::this_thread::sleep_for(window);
  return sum_of(meters, recorder.stop());
}

std::optional<double> power_w(const Sum& sum) {
  if (!sum.energy_j || sum.duration.count() <= 0) return std::nullopt;
  return *sum.energy_j / to_s(sum.duration);
}

/// Whether one of the meters read the same idle and under load.
bool stood_still(const Sum& before, const Sum& active, const Sum& after) {
  if (!before.energy_j || !active.energy_j || !after.energy_j) return false;
  for (std::size_t i = 0; i < active.constant_uw.size(); ++i) {
    const auto& value = active.constant_uw[i];
    if (value && before.constant_uw[i] == value && after.constant_uw[i] == value) return true;
  }
  return false;
}

void keep_reason(const Sum& sum, std::vector<std::string>& reasons) {
  if (sum.reason.empty() || std::ranges::find(reasons, sum.reason) != reasons.end()) return;
  reasons.push_back(sum.reason);
}

void judge(MeteredCalls& metered) {
  if (!metered.reasons.empty()) return;
  const auto net_j = metered.call_j();
  if (!net_j) {
    metered.reasons.push_back(fmt::format(
        "not_above_idle: {:.4g} W while calling, {:.4g} W idle before and {:.4g} W after",
        *metered.active_j / to_s(metered.duration), *metered.idle_before_w, *metered.idle_after_w));
    return;
  }
  const double net_w = *net_j * static_cast<double>(metered.calls) / to_s(metered.duration);
  if (std::abs(*metered.idle_after_w - *metered.idle_before_w) > kUnstableShare * net_w) {
    metered.reasons.push_back(
        fmt::format("unstable: {:.4g} W idle before and {:.4g} W after, {:.4g} W above it between",
                    *metered.idle_before_w, *metered.idle_after_w, net_w));
  }
}

}  // namespace

std::optional<double> MeteredCalls::call_j() const {
  if (!active_j || !idle_before_w || !idle_after_w || calls == 0) return std::nullopt;
  const double idle_w = (*idle_before_w + *idle_after_w) / 2;
  const double net_j = *active_j - idle_w * to_s(duration);
  if (net_j <= 0) return std::nullopt;
  return net_j / static_cast<double>(calls);
}

Nanos metering_window(std::span<const Meter* const> meters, Nanos wished) {
  Nanos window = wished;
  for (const Meter* meter : meters) {
    if (meter->info().kind != MeterKind::kPower) continue;
    window = std::max(window, kPeriodsAWindow * meter->info().period);
  }
  return window;
}

MeteredCalls meter_calls(std::span<const Meter* const> meters, const Clock& clock, Nanos window,
                         const std::function<void()>& call, const std::function<bool()>& may_end) {
  MeteredCalls metered;
  metered.source = source_of(meters);
  metered.domain = domain_of(meters);
  const Sum before = idle(meters, clock, window);
  if (!before.energy_j) {
    metered.reasons.push_back(before.reason);
    return metered;
  }

  MeterRecorder recorder(meters, clock);
  const Nanos start = clock.now();
  while (clock.now() - start < window || (may_end && !may_end())) {
    call();
    ++metered.calls;
  }
  const Sum active = sum_of(meters, recorder.stop());

  const Sum after = idle(meters, clock, window);
  metered.duration = active.duration;
  metered.active_j = active.energy_j;
  metered.idle_before_w = power_w(before);
  metered.idle_after_w = power_w(after);
  for (const Sum* sum : {&before, &active, &after}) keep_reason(*sum, metered.reasons);
  if (stood_still(before, active, after)) {
    metered.active_j.reset();
    metered.reasons.emplace_back("meter_frozen");
  }
  judge(metered);
  return metered;
}

void check_call_time(MeteredCalls& metered, Nanos timed) {
  if (metered.calls == 0 || timed.count() <= 0) return;
  const double metered_s = to_s(metered.duration) / static_cast<double>(metered.calls);
  const double timed_s = to_s(timed);
  if (std::abs(metered_s - timed_s) <= kUnstableShare * std::min(metered_s, timed_s)) return;
  metered.reasons.push_back(
      fmt::format("unstable: a call took {:.3g} ms metered and {:.3g} ms timed", metered_s * 1e3,
                  timed_s * 1e3));
}

std::string idle_power_text(const MeterRequest& request) {
  const auto found = discover_meters(request.sysfs);
  std::vector<const Meter*> meters;
  try {
    meters = find_meters(found, request.meters);
  } catch (const Error&) {
    return "";  // gone since it was chosen; each cell's row will say so
  }
  const auto idle_w = power_w(idle(meters, MachineClock(), request.window));
  return idle_w ? fmt::format("{:.4g}", *idle_w) : "";
}

std::string names_of(std::span<const Meter* const> meters) {
  std::vector<std::string> names;
  for (const Meter* meter : meters) names.push_back(meter->info().name);
  return join(names, " + ");
}

std::string source_of(std::span<const Meter* const> meters) {
  return meters.front()->info().driver + ": " + names_of(meters);
}

std::string domain_of(std::span<const Meter* const> meters) {
  std::vector<std::string> parts;
  for (const Meter* meter : meters) parts.push_back(meter->info().covers);
  return join(parts, " + ");
}

EnergyRecord metered_energy(const MeteredCalls& metered) {
  EnergyRecord record;
  record.provenance = Provenance::kMeasured;
  record.source = metered.source;
  record.reasons = metered.reasons;
  record.energy_j = metered.call_j();
  record.domain = metered.domain;
  record.idle_subtracted = true;
  return record;
}

}  // namespace pirt
