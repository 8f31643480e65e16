#include "characterize/energy/metered_calls.h"

#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <thread>

#include "characterize/energy/window.h"
#include "workloads/base/error.h"
#include "workloads/base/text/text.h"

namespace pirt {
namespace {

constexpr int kPeriodsAWindow = 5;
constexpr double kUnstableShare = 0.20;  // as for times, validity.cpp
constexpr double kStepShare = 0.05;
constexpr double kMargin = 1.1;  // the power so far is known to a step, a part of 20 by then
// A board that was used a moment ago keeps its clocks for seconds: at rest once so many windows
// in a row draw no less than the one before them, or after so many in all.
constexpr int kRestWindows = 5;
constexpr int kMostWindows = 30;
constexpr double kNoLess = 0.97;

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
    // A counter that steps has its own window.
    const Nanos own = traces[i].end - traces[i].begin;
    *sum.energy_j += own == sum.duration || own.count() <= 0
                         ? *energy.energy_j
                         : *energy.energy_j * to_s(sum.duration) / to_s(own);
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

/// How long calls must go on that draw @p active_w, for a step to be below kStepShare of what is
/// above idle; absent if they draw no more than idling.
std::optional<double> needed_s(double active_w, double idle_w, Nanos step) {
  if (active_w <= idle_w) return std::nullopt;
  return active_w * to_s(step) / (kStepShare * (active_w - idle_w));
}

/// @param step  0 = the meters have none.
void judge(MeteredCalls& metered, Nanos step) {
  if (!metered.reasons.empty()) return;
  const auto net_j = metered.call_j();
  if (!net_j) {
    metered.reasons.push_back(fmt::format(
        "not_above_idle: {:.4g} W while calling, {:.4g} W idle before and {:.4g} W after",
        *metered.active_j / to_s(metered.duration), *metered.idle_before_w, *metered.idle_after_w));
    return;
  }
  const double calls_s = to_s(metered.duration);
  const double net_w = *net_j * static_cast<double>(metered.calls) / calls_s;
  const double active_w = *metered.active_j / calls_s;
  if (needed_s(active_w, active_w - net_w, step).value_or(0) > calls_s) {
    metered.reasons.push_back(fmt::format(
        "not_measurable: a step of the meter is {:.3g} J, more than {:.0f} % of the {:.3g} J that "
        "{} calls drew above idle",
        active_w * to_s(step), kStepShare * 100, net_w * calls_s, metered.calls));
  }
  if (std::abs(*metered.idle_after_w - *metered.idle_before_w) > kUnstableShare * net_w) {
    metered.reasons.push_back(
        fmt::format("unstable: {:.4g} W idle before and {:.4g} W after, {:.4g} W above it between",
                    *metered.idle_before_w, *metered.idle_after_w, net_w));
  }
}

/// Half of the 95 % interval of the mean of what repeats gave; 0 of less than two.
double half_width_of(const std::vector<double>& values) {
  if (values.size() < 2) return 0;
  const auto count = static_cast<double>(values.size());
  double mean = 0, squares = 0;
  for (const double value : values) mean += value / count;
  for (const double value : values) squares += (value - mean) * (value - mean);
  constexpr std::array kQuantile = {12.706, 4.303};  // t(0.975) of 1 and 2 degrees of freedom
  static_assert(kQuantile.size() + 1 == kMeteredRepeats);
  return kQuantile[values.size() - 2] * std::sqrt(squares / (count - 1) / count);
}

}  // namespace

std::optional<double> MeteredCalls::call_j() const {
  if (!active_j || !idle_before_w || !idle_after_w || calls == 0) return std::nullopt;
  const double idle_w = (*idle_before_w + *idle_after_w) / 2;
  const double net_j = *active_j - idle_w * to_s(duration);
  if (net_j <= 0) return std::nullopt;
  return net_j / static_cast<double>(calls);
}

Nanos step_of(std::span<const Meter* const> meters, const Clock& clock) {
  Nanos longest{0};
  for (const Meter* meter : meters) {
    if (!meter->info().steps) continue;
    longest = std::max(longest, update_period(*meter, clock).value_or(Nanos(0)));
  }
  return longest;
}

Nanos metering_window(std::span<const Meter* const> meters, Nanos wished, Nanos step) {
  Nanos window = std::max(wished, kPeriodsAWindow * step);
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
  const Nanos step = step_of(meters, clock);
  window = metering_window(meters, window, step);
  if (step.count() > 0) metered.source += fmt::format("; a step each {:.3g} ms", to_ms(step));
  const Sum before = idle(meters, clock, window);
  if (!before.energy_j) {
    metered.reasons.push_back(before.reason);
    return metered;
  }

  MeterRecorder recorder(meters, clock);
  const Nanos start = clock.now();
  Nanos wanted = window;
  Nanos called{0};
  const auto takes_longer = [&] {
    const auto energy_j = step.count() > 0 ? recorder.stepped_j() : std::nullopt;
    if (!energy_j) return false;
    // What is shown may be of a step ago.
    const auto needed = needed_s(*energy_j / to_s(called - step), *power_w(before), step);
    if (!needed || *needed <= to_s(called) || *needed > to_s(kLongestWindow)) return false;
    wanted = from_s(kMargin * *needed);
    return true;
  };
  do {
    while (clock.now() - start < wanted || (may_end && !may_end())) {
      call();
      ++metered.calls;
    }
    called = clock.now() - start;
  } while (takes_longer());
  const Sum active = sum_of(meters, recorder.stop());

  const Sum after = idle(meters, clock, window);
  metered.duration = step.count() > 0 ? called : active.duration;
  metered.active_j = active.energy_j;
  metered.idle_before_w = power_w(before);
  metered.idle_after_w = power_w(after);
  if (metered.active_j && metered.idle_after_w) {
    // From the last call to the next step.
    *metered.active_j -= *metered.idle_after_w * to_s(active.duration - metered.duration);
  }
  for (const Sum* sum : {&before, &active, &after}) keep_reason(*sum, metered.reasons);
  if (stood_still(before, active, after)) {
    metered.active_j.reset();
    metered.reasons.emplace_back("meter_frozen");
  }
  judge(metered, step);
  return metered;
}

MeteredCalls joined_repeats(std::span<const MeteredCalls> repeats) {
  MeteredCalls joined = repeats.front();
  for (const MeteredCalls& each : repeats.subspan(1)) {
    joined.calls += each.calls;
    joined.duration += each.duration;
    for (const auto member :
         {&MeteredCalls::active_j, &MeteredCalls::idle_before_w, &MeteredCalls::idle_after_w}) {
      auto& sum = joined.*member;
      sum = sum && each.*member ? std::optional(*sum + *(each.*member)) : std::nullopt;
    }
    for (const std::string& reason : each.reasons) {
      const auto word = reason.substr(0, reason.find(':'));
      const bool is_new = std::ranges::none_of(
          joined.reasons, [&](const std::string& known) { return known.starts_with(word); });
      if (is_new) joined.reasons.push_back(reason);
    }
  }
  const auto count = static_cast<double>(repeats.size());
  if (joined.idle_before_w) *joined.idle_before_w /= count;
  if (joined.idle_after_w) *joined.idle_after_w /= count;
  for (const MeteredCalls& each : repeats) {
    if (const auto energy_j = each.call_j()) joined.repeats_j.push_back(*energy_j);
  }
  return joined;
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

void check_disturbance(MeteredCalls& metered, std::span<const Meter* const> meters,
                       const Interference& during) {
  const bool of_host = std::ranges::any_of(
      meters, [](const Meter* meter) { return meter->info().domain != MeterDomain::kGpu; });
  if (during.contended) metered.source += "; contended";
  if (during.contended && of_host) metered.reasons.emplace_back("contended");
  if (during.throttled) metered.reasons.emplace_back("throttled");
}

std::string idle_power_text(const MeterRequest& request) {
  const auto found = discover_meters(request.sysfs);
  std::vector<const Meter*> meters;
  try {
    meters = find_meters(found, request.meters);
  } catch (const Error&) {
    return "";  // gone since it was chosen; each cell's row will say so
  }
  const auto draw_w = [&] { return power_w(idle(meters, MachineClock(), request.window)); };
  auto idle_w = draw_w();
  const bool rests = std::ranges::any_of(
      meters, [](const Meter* meter) { return meter->info().domain == MeterDomain::kGpu; });
  int alike = rests ? 0 : kRestWindows;
  for (int i = 1; idle_w && alike < kRestWindows && i < kMostWindows; ++i) {
    const auto next_w = draw_w();
    alike = next_w && *next_w >= kNoLess * *idle_w ? alike + 1 : 0;
    idle_w = next_w;
  }
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
  record.energy_j = metered.call_j();
  hold_against(record, judgement_of(metered.reasons, record.energy_j.has_value()));
  if (record.energy_j) {
    // What idling drew meanwhile is not known better than that it was between the two.
    const double apart_j = std::abs(*metered.idle_after_w - *metered.idle_before_w) / 2 *
                           to_s(metered.duration) / static_cast<double>(metered.calls);
    const double half_j = std::max(apart_j, half_width_of(metered.repeats_j));
    record.ci_low_j = std::max(0.0, *record.energy_j - half_j);
    record.ci_high_j = *record.energy_j + half_j;
  }
  record.domain = metered.domain;
  record.idle_subtracted = true;
  return record;
}

}  // namespace pirt
