#include "scheduler/runtime/live_units.h"

#include <fmt/core.h>

#include "characterize/platform/elsewhere.h"
#include "characterize/platform/unit_request.h"
#include "workloads/backends/registry.h"
#include "workloads/base/error.h"
#include "workloads/base/time.h"

namespace pirt {
namespace {

constexpr Nanos kLeastLook = std::chrono::milliseconds(1);
constexpr Nanos kMostLook = std::chrono::seconds(1);
/// Who looks so much later than he was to was stopped himself (Ctrl-Z, a debugger).
constexpr Nanos kStoodStill = std::chrono::seconds(2);
/// A start takes seconds; with an emulator, and everything compiled anew, some minutes.
constexpr Nanos kLongestStart = std::chrono::minutes(10);

}  // namespace

LiveUnits::LiveUnits(const Platform& platform, LiveUnitsOptions options, LiveDriver& driver)
    : platform_(platform),
      options_(std::move(options)),
      driver_(driver),
      look_every_(std::clamp(options_.time_limit.value_or(kMostLook), kLeastLook, kMostLook)),
      out_of_reach_(platform.units.size()),
      units_(platform.units.size()) {}

LiveUnits::~LiveUnits() { close(); }

void LiveUnits::open() {
  std::map<UnitId, std::vector<Preparation>> prepared;
  std::size_t here = 0;
  for (UnitId unit = 0; unit < units_.size(); ++unit) {
    auto each = driver_.preparations(unit);
    if (each.empty()) continue;
    prepared.emplace(unit, std::move(each));
    if (!is_elsewhere(platform_.units[unit])) ++here;
  }
  // Who spins on the core that a woken thread was put on keeps that from beginning; where each has
  // a core that is rare, and what is woken takes longer than that.
  if (here <= cores_.size()) spin_ = options_.spin;
  for (auto& [unit, each] : prepared) units_[unit] = make(unit, std::move(each));
  const Nanos until = clock_.now() + kLongestStart;
  for (const auto& unit : units_) {
    if (unit == nullptr) continue;
    wait_until_ready(*unit, until);
    if (!unit->remark().empty()) driver_.add_problem(unit->name() + ": " + unit->remark());
    if (unit->is_remote()) look_every_ = std::min(look_every_, kLookEvery);
  }
}

KernelUnit::Owner LiveUnits::make(UnitId unit, std::vector<Preparation> preparations) {
  const UnitModel& model = platform_.units[unit];
  say("opening " + model.name);
  return KernelUnit::Owner(new KernelUnit(
      UnitSetup{.request = make_unit_request(platform_, model, ""),
                .backend = model.measured() ? &find_backend(model.backend) : nullptr,
                .preparations = std::move(preparations),
                .prepare_first = options_.prepare_first,
                .contexts = model.contexts,
                .lanes = model.measured() ? model.servers : 1,
                .cores = cores_,
                .priority = options_.priority,
                .spin = is_elsewhere(model) ? Nanos::zero() : std::min(spin_, model.spin),
                .keeps = options_.keeps,
                .slice_ended = options_.slices && can_suspend_calls(model)
                                   ? std::function([this, unit](Call& call) {
                                       driver_.slice_ended(unit, call);
                                     })
                                   : nullptr},
      [this, unit](Call& call, CallEnd& end) {
        call.inputs.clear();  // What it shares is to be written again when nobody else has it.
        if (end.outcome == Outcome::kReturned) call.outputs = nullptr;  // They may hold the device.
        driver_.ended(unit, call, end);
      }));
}

void LiveUnits::wait_until_ready(KernelUnit& unit, Nanos until) const {
  while (!unit.is_over_start(kLookEvery)) {
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
  try {
    unit.rethrow_failure();
  } catch (const Error& error) {
    throw Error(error.code(), "unit " + unit.name() + ": " + error.what());
  }
  say(unit.name() + " is ready");
}

KernelUnit::Owner LiveUnits::make_ready(UnitId unit) {
  auto fresh = make(unit, driver_.preparations(unit));
  wait_until_ready(*fresh, clock_.now() + kLongestStart);
  return fresh;
}

KernelUnit::Owner LiveUnits::replace(UnitId unit, KernelUnit::Owner fresh) {
  lost_.erase(unit);
  out_of_reach_[unit].reset();
  return std::exchange(units_[unit], std::move(fresh));
}

void LiveUnits::close() {
  for (auto& unit : units_) {
    if (unit != nullptr) unit->stop();
  }
  for (auto& unit : units_) unit.reset();
}

void LiveUnits::fill(UnitId unit, Call& call, const Workload& workload,
                     std::optional<std::size_t> state, const std::optional<Recall>& recall,
                     Nanos began) {
  call.let_go();
  call.workload = &workload;
  if (!workload.outputs.empty()) {
    call.outputs = outputs_.take(workload, units_[unit]->output_memory());
  }
  if (state) call.state = states_[*state];
  call.unwanted.store(false, std::memory_order_relaxed);
  call.wanted_until.reset();
  if (recall && contains(recall->from, unit)) call.wanted_until = later_by(began, recall->at);
}

void LiveUnits::look_for_hung(Nanos due) {
  const Nanos now = clock_.now();
  if (now - due > kStoodStill) counts_from_ = now;
  next_overdue_ = Nanos::max();
  for (UnitId unit = 0; unit < units_.size(); ++unit) {
    if (units_[unit] == nullptr) continue;
    for (const KernelUnit::Running& call : units_[unit]->running()) {
      const auto limit = limit_of(unit, *call.call);
      if (!limit) continue;
      const Nanos since = std::max(call.since, counts_from_);
      const Nanos ran = now - since;
      if (ran <= *limit) {
        next_overdue_ = std::min(next_overdue_, later_by(since, *limit));
      } else if (!units_[unit]->is_remote()) {
        // Before the next unit is looked at, whose call hangs as well: what starts there meanwhile
        // is behind that one.
        if (const auto behind = units_[unit]->abandon(call)) {
          give_up(unit, *call.call, ran, *behind);
        }
      } else if (units_[unit]->request_stop(call)) {
        say(units_[unit]->name() + " has not answered a call in time; it is withdrawn");
      }
    }
  }
}

void LiveUnits::give_up(UnitId unit, Call& call, Nanos ran, const std::vector<Call*>& behind) {
  driver_.set_unit(unit, UnitState::kGone);
  // What waits for it between two slices never ends either.
  for (const auto& [outer, ran_before] : units_[unit]->suspended()) {
    give_up_for_good(
        unit, *outer,
        {.outcome = Outcome::kFailed,
         .busy = ran_before,
         .problem = outer->workload->name + ": left for " + call.workload->name + ", which hangs"});
  }
  give_up_for_good(
      unit, call,
      {.outcome = Outcome::kFailed,
       .busy = ran,
       .problem = call.workload->name + " on " + units_[unit]->name() + ": no end after " +
                  std::to_string(to_ms(ran)) + " ms; the unit is out of service from then on"});
  for (Call* const each : behind) {
    driver_.give_up(unit, *each, {.outcome = Outcome::kReturned, .excused = true});
  }
}

/// What it reads and writes is its own from then on.
void LiveUnits::give_up_for_good(UnitId unit, Call& call, CallEnd end) {
  for (auto& state : states_) {
    if (state == call.state) state = std::make_shared<StateValue>(*state);
  }
  driver_.give_up(unit, call, std::move(end));
}

void LiveUnits::look_for_reach() {
  for (UnitId unit = 0; unit < units_.size(); ++unit) {
    if (units_[unit] == nullptr || units_[unit]->abandoned()) continue;
    if (units_[unit]->is_lost()) {
      if (!lost_[unit].for_good) look_for_lost(unit);
      if (lost_[unit].for_good) {
        out_of_reach_[unit].reset();
        continue;
      }
    }
    const bool out = !units_[unit]->is_reachable();
    if (out == out_of_reach_[unit].has_value()) continue;
    out_of_reach_[unit] = out ? std::optional(clock_.now()) : std::nullopt;
    const bool was_lost = lost_.contains(unit);
    if (!out) lost_.erase(unit);
    say(units_[unit]->name() + (was_lost ? out ? " has lost its device" : " has its device again"
                                : out    ? " is out of reach"
                                         : " is within reach again"));
    // What runs there goes on: its reply may come all the same.
    driver_.set_unit(unit, out ? UnitState::kDraining : UnitState::kUp);
  }
}

void LiveUnits::look_for_lost(UnitId unit) {
  Lost& lost = lost_[unit];
  look_every_ = std::min(look_every_, kLookEvery);
  if (!lost.memory) {  // Once: the unit's thread brings another one with the device.
    const auto memory = units_[unit]->take_output_memory();
    if (memory != nullptr) outputs_.forget(memory.get());
    lost.memory = memory;
  }
  if (lost.memory->expired()) units_[unit]->open_again();
  const auto& since = out_of_reach_[unit];
  lost.for_good = since && clock_.now() - *since > kLongestLost;
  if (!lost.for_good) return;
  const std::string why = units_[unit]->why_lost();
  driver_.add_problem("unit " + units_[unit]->name() + " is out of service: its device is lost" +
                      (why.empty() ? "" : " (" + why + ")"));
  driver_.set_unit(unit, UnitState::kGone);
}

bool LiveUnits::any_may_come_back() const {
  for (UnitId unit = 0; unit < units_.size(); ++unit) {
    const auto& since = out_of_reach_[unit];
    if (!since) continue;
    const Remote* const remote = units_[unit]->remote();
    if (clock_.now() - *since < (remote != nullptr ? remote->patience() : kLongestLost))
      return true;
  }
  return false;
}

std::optional<Nanos> LiveUnits::limit_of(UnitId unit, const Call& call) const {
  if (options_.time_limit) return options_.time_limit;
  // Waiting for a link, a server or a worker is not hanging: the unit's backend ends it.
  if (units_[unit]->is_remote()) return std::nullopt;
  const LiveDriver::Expectation expected = driver_.expected(unit, call);
  if (expected.service == nullptr) return expected.otherwise;
  return time_limit(*expected.service, units_[unit]->has_own_clock(), *call.workload);
}

}  // namespace pirt
