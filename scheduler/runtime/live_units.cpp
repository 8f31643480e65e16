#include "scheduler/runtime/live_units.h"

#include <fmt/core.h>

#include "characterize/platform/elsewhere.h"
#include "characterize/platform/unit_request.h"
#include "workloads/backends/registry.h"
#include "workloads/base/error.h"
#include "workloads/base/system/affinity.h"

namespace pirt {
namespace {

/// How often it is asked whether to go on while units start.
constexpr Nanos kLookForStop = std::chrono::milliseconds(50);
constexpr Nanos kLeastLook = std::chrono::milliseconds(1);
/// How often it is asked whether what is elsewhere is within reach.
constexpr Nanos kLookForReach = std::chrono::milliseconds(50);
/// A start takes seconds; with an emulator, and everything compiled anew, some minutes.
constexpr Nanos kLongestStart = std::chrono::minutes(10);
/// What a unit gets for the end of its start when nobody wants it any more.
constexpr Nanos kPatience = std::chrono::seconds(1);

}  // namespace

LiveUnits::LiveUnits(const Platform& platform, LiveUnitsOptions options, Done done)
    : platform_(platform),
      options_(std::move(options)),
      done_(std::move(done)),
      look_every_(std::max(options_.time_limit.value_or(kLeastTimeLimit), kLeastLook)),
      returns_(platform.units.size()),
      out_of_reach_(platform.units.size()),
      units_(platform.units.size()) {}

LiveUnits::~LiveUnits() { close(); }

void LiveUnits::open(std::map<UnitId, std::vector<Preparation>> preparations) {
  const auto here = std::ranges::count_if(preparations, [this](const auto& each) {
    return !is_elsewhere(platform_.units[each.first]);
  });
  // Who spins on the core that a woken thread was put on keeps that from beginning; where each has
  // a core that is rare, and what is woken takes longer than that.
  if (static_cast<std::size_t>(here) <= current_cores().size()) spin_ = options_.spin;
  for (auto& [unit, each] : preparations) units_[unit] = make(unit, std::move(each));
}

std::unique_ptr<KernelUnit> LiveUnits::make(UnitId unit, std::vector<Preparation> preparations) {
  const UnitModel& model = platform_.units[unit];
  say("opening " + model.name);
  return std::make_unique<KernelUnit>(
      UnitSetup{.request = make_unit_request(platform_, model, ""),
                .backend = model.measured() ? &find_backend(model.backend) : nullptr,
                .preparations = std::move(preparations),
                .prepare_first = options_.prepare_first,
                .contexts = model.contexts,
                .lanes = model.measured() ? model.servers : 1,
                .priority = options_.priority,
                .spin = is_elsewhere(model) ? Nanos::zero() : std::min(spin_, model.spin),
                .keeps = options_.keeps,
                .slice_ended = options_.slice_ended && can_suspend_calls(model)
                                   ? std::function([this, unit](Call& call) {
                                       options_.slice_ended(unit, call);
                                     })
                                   : nullptr},
      [this, unit](Call& call, CallEnd& end) { done_(unit, call, end); });
}

namespace {

/// Whether it is ready by now, after a while.
bool look_at(KernelUnit& unit) {
  try {
    return unit.wait_until_ready(kLookForStop);
  } catch (const Error& error) {
    throw Error(error.code(), "unit " + unit.name() + ": " + error.what());
  }
}

}  // namespace

std::vector<std::string> LiveUnits::wait_until_ready() {
  std::vector<std::string> remarks;
  const Nanos until = clock_.now() + kLongestStart;
  for (const auto& unit : units_) {
    if (unit == nullptr) continue;
    wait_until_ready(*unit, until);
    if (!unit->remark().empty()) remarks.push_back(unit->name() + ": " + unit->remark());
    if (unit->is_remote()) look_every_ = kLookForReach;
  }
  return remarks;
}

void LiveUnits::wait_until_ready(KernelUnit& unit, Nanos until) const {
  while (!look_at(unit)) {
    if (options_.stop && options_.stop() > 0) {
      throw_environment("interrupted while unit " + unit.name() + " was being prepared");
    }
    if (clock_.now() > until) {
      throw_environment(fmt::format(
          "unit {} is not ready after {:.0f} s; run `pirt characterize --units {}` to see what "
          "takes it so long, or leave the unit out",
          unit.name(), to_s(kLongestStart), unit.name()));
    }
  }
  say(unit.name() + " is ready");
}

std::unique_ptr<KernelUnit> LiveUnits::make_ready(UnitId unit,
                                                  std::vector<Preparation> preparations) {
  auto fresh = make(unit, std::move(preparations));
  try {
    wait_until_ready(*fresh, clock_.now() + kLongestStart);
  } catch (...) {
    close(std::move(fresh));
    throw;
  }
  return fresh;
}

std::unique_ptr<KernelUnit> LiveUnits::replace(UnitId unit, std::unique_ptr<KernelUnit> fresh) {
  return std::exchange(units_[unit], std::move(fresh));
}

void LiveUnits::close() {
  for (auto& unit : units_) {
    if (unit != nullptr) unit->stop();
  }
  for (auto& unit : units_) {
    if (unit != nullptr) close(std::move(unit));
  }
}

void LiveUnits::close(std::unique_ptr<KernelUnit> unit) {
  unit->stop();
  if (unit->abandoned() || !unit->is_over_start(kPatience)) KernelUnit::leave(std::move(unit));
}

std::vector<LiveUnits::Reach> LiveUnits::changed_reach() {
  std::vector<Reach> changed;
  for (UnitId unit = 0; unit < units_.size(); ++unit) {
    if (units_[unit] == nullptr || units_[unit]->abandoned()) continue;
    const bool out = !units_[unit]->is_reachable();
    if (out == out_of_reach_[unit].has_value()) continue;
    out_of_reach_[unit] = out ? std::optional(clock_.now()) : std::nullopt;
    say(units_[unit]->name() + (out ? " is out of reach" : " is within reach again"));
    // What runs there goes on: its reply may come all the same.
    changed.push_back({unit, out ? UnitState::kDraining : UnitState::kUp});
  }
  return changed;
}

bool LiveUnits::any_may_come_back() const {
  for (UnitId unit = 0; unit < units_.size(); ++unit) {
    const auto& since = out_of_reach_[unit];
    if (since && clock_.now() - *since < units_[unit]->patience()) return true;
  }
  return false;
}

int LiveUnits::count_returns(UnitId unit, WorkloadId workload, const CallEnd& end) {
  auto& returns = returns_[unit];
  if (end.outcome == Outcome::kReturned) {
    return end.excused ? returns[workload] : ++returns[workload];
  }
  if (!returns.empty()) returns.erase(workload);
  return 0;
}

std::optional<Nanos> LiveUnits::limit_of(UnitId unit, const Expectation& expected) const {
  if (options_.time_limit) return options_.time_limit;
  // Waiting for a link, a server or a worker is not hanging: the unit's backend ends it.
  if (units_[unit]->is_remote()) return std::nullopt;
  if (expected.service == nullptr) return expected.otherwise;
  return time_limit(*expected.service, units_[unit]->has_own_clock());
}

}  // namespace pirt
