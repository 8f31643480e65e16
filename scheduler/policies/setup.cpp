#include "scheduler/policies/setup.h"

#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <utility>

#include "characterize/platform/elsewhere.h"
#include "scheduler/planner/budget_plan.h"
#include "scheduler/planner/mix_plan.h"
#include "scheduler/policies/unit_order.h"
#include "scheduler/policies/weights.h"
#include "scheduler/services/transfers.h"
#include "workloads/base/error.h"
#include "workloads/base/text/text.h"
#include "workloads/catalog/specs.h"

namespace pirt {
namespace {

/// Of a platform: a mode's name, and what goes for it.
using Defaults = std::map<std::string, ModeDefaults>::value_type;

/// The platform's defaults for the mode; those of its basic scheduler where the platform has none
/// for advanced. Null if there are none.
const Defaults* defaults_of(const Platform& platform, const Mode& mode) {
  const auto known = policy_names();
  for (const auto& [name, defaults] : platform.modes) {
    if (std::ranges::find(known, name) == known.end()) {
      throw_bad_input("platform " + platform.name + ": modes: unknown mode '" + name + "'" +
                      suggestion(name, known));
    }
  }
  for (const std::string_view name : {mode.policy.name, mode.weighed().name}) {
    const auto found = platform.modes.find(std::string(name));
    if (found != platform.modes.end()) return &*found;
  }
  return nullptr;
}

/// Weights, and where they come from; both empty for modes without.
struct ChosenWeights {
  WeightTable table;
  std::optional<std::string> source;
};

ChosenWeights choose_weights(const Scenario& scenario, const ScheduleOptions& options,
                             const Mode& mode, const Defaults* defaults) {
  const Platform& platform = scenario.platform;
  const WeightRule rule = mode.weighed().rule;
  const bool platform_has = defaults != nullptr && !defaults->second.weights.empty();
  const std::string where =
      platform_has ? "platform " + platform.name + ": modes." + defaults->first + ".weights"
                   : "--weights";
  if (rule == WeightRule::kNone) {
    if (options.weights.empty() && !platform_has) return {};
    throw_bad_input(where + ": mode " + std::string(mode.weighed().name) +
                    " has no weights; leave them out");
  }
  if (!options.weights.empty()) {
    return {given_weights(options.weights, platform, scenario.services, "--weights"), "given"};
  }
  if (platform_has) {
    return {given_weights(defaults->second.weights, platform, scenario.services, where),
            "platform"};
  }
  return {derive_weights(rule, platform, scenario.services), "derived"};
}

/// By pipeline; 0 for open loops.
std::vector<int> choose_in_flight(const Scenario& scenario, std::optional<int> given) {
  std::vector<int> in_flight;
  for (std::size_t p = 0; p < scenario.mix.pipelines.size(); ++p) {
    const bool closed = scenario.mix.pipelines[p].frames.has_value();
    int& frames = in_flight.emplace_back(closed ? given.value_or(0) : 0);
    if (!closed || given) continue;
    // What keeps the units busy with the pipeline's most spread-out workload.
    for (const auto& kind : scenario.classes[p]) {
      frames = std::max(frames, in_flight_for(kind, scenario.platform, scenario.services));
    }
  }
  return in_flight;
}

void check_options(const Platform& platform, const Mix& mix, const ScheduleOptions& options,
                   const Mode& mode) {
  if (platform.units.size() > kMaxUnits) {
    throw_bad_input("platform " + platform.name + " has " + std::to_string(platform.units.size()) +
                    " units; at most " + std::to_string(kMaxUnits) + " can be scheduled");
  }
  if (options.in_flight && *options.in_flight < 1) {
    throw_bad_input("--in-flight is " + std::to_string(*options.in_flight) + "; it is at least 1");
  }
  if (options.duration && *options.duration <= Nanos::zero())
    throw_bad_input("--duration must be above 0");
  if (options.duration && !mix.open_loop()) {
    throw_bad_input("--duration is for pipelines with a rate; mix " + mix.name +
                    " has closed loops only");
  }
  if (options.overflow && !mode.weighed().overflows) {
    throw_bad_input("--overflow is about the queues of Algorithms 2 and 3; mode " +
                    std::string(mode.weighed().name) + " has none, leave it out");
  }
}

void check_role(const Platform& platform, const PolicyInfo& policy) {
  if (!policy.needs_role) return;
  std::vector<std::string> units;
  for (const auto& unit : platform.units) {
    if (unit.role == policy.needs_role) return;
    units.push_back(unit.name + " (" + std::string(to_string(unit.role)) + ")");
  }
  throw_bad_input("mode " + std::string(policy.name) + " needs a unit of role " +
                  std::string(to_string(*policy.needs_role)) + "; platform " + platform.name +
                  " has " + join(units, ", "));
}

/// A task that the policy would never give to any unit would wait for ever.
void check_every_task_placeable(const Scenario& scenario, const Policy& policy, const Mode& mode) {
  for (std::size_t p = 0; p < scenario.classes.size(); ++p) {
    for (std::size_t t = 0; t < scenario.classes[p].size(); ++t) {
      const TaskClass& kind = scenario.classes[p][t];
      if (policy.takers(kind, kind.eligible) != 0) continue;
      const auto& pipeline = scenario.mix.pipelines[p];
      const bool weighted = mode.policy.rule != WeightRule::kNone;
      throw_bad_input(task_name(scenario.mix, pipeline, pipeline.tasks[t]) + ": mode " +
                      std::string(mode.policy.name) + " would never place it: only " +
                      unit_list(scenario.platform, kind.eligible) + " may serve it, " +
                      (weighted ? "to which the mode gives no weight; give one with --weights, "
                                  "or another mode"
                                : "which the mode does not use; give another mode"));
    }
  }
}

/// A foreign task that moves nothing is offloaded for less than it costs.
void warn_of_nothing_moved(const Policy& policy, Scenario& scenario) {
  const UnitMask with_link = units_where(
      scenario.platform.units,
      [&scenario](const UnitModel& unit) { return scenario.platform.links.contains(unit.link); });
  for (std::size_t p = 0; p < scenario.classes.size(); ++p) {
    const Pipeline& pipeline = scenario.mix.pipelines[p];
    for (std::size_t t = 0; t < scenario.classes[p].size(); ++t) {
      const TaskClass& kind = scenario.classes[p][t];
      const MixTask& task = pipeline.tasks[t];
      const CallBytes bytes = call_bytes(task);
      if (!bytes.moves || bytes.in + bytes.out > 0 || task.bytes) continue;
      if (moves_tensors(find_spec(task.workload))) continue;
      const UnitMask linked = policy.takers(kind, kind.eligible) & with_link;
      if (linked == 0) continue;
      scenario.services.warnings.push_back(fmt::format(
          "{}: nobody has said what {} moves, so that it goes to {} and back as a message without "
          "data; give the task `bytes:`",
          task_name(scenario.mix, pipeline, task), task.workload,
          unit_list(scenario.platform, linked)));
    }
  }
}

/// What the mode plans before a run: what a planner does, or the beginning of a budget.
void make_plan(const Mode& mode, Scenario& scenario, const ScheduleOptions& options,
               PolicySetup& setup) {
  if (mode.policy.planner == nullptr && !mode.policy.budgets) return;
  std::uint32_t entry = 0;
  for (auto& pipeline : scenario.classes) {
    for (auto& kind : pipeline) kind.entry = entry++;
  }
  if (mode.policy.budgets) {
    setup.budget = first_budget_plan(scenario, options.power_cap_w);
  } else {
    setup.plan = plan_mix(scenario, mode.policy.planner);
  }
}

void check_budget(const Platform& platform, const Mix& mix, const ScheduleOptions& options,
                  const Mode& mode) {
  if (!mode.policy.budgets && options.has_budget()) {
    throw_bad_input("--objective, --min-rate and --power-cap are about mode budget; mode " +
                    std::string(mode.policy.name) + " has no use for them, leave them out");
  }
  if (mix.fires_once() && (options.min_rate_per_ms || options.power_cap_w)) {
    throw_bad_input("--min-rate and --power-cap: mix " + mix.name +
                    " fires once and follows a static plan, which keeps neither; leave them out");
  }
  if (!options.power_cap_w || above_idle_j(platform, *options.power_cap_w) >= 0) return;
  throw_bad_input(infeasible_cap(platform, *options.power_cap_w));
}

constexpr std::array<std::string_view, 3> kObjectives = {"rate", "energy", "latency"};

}  // namespace

std::vector<std::string> objective_names() { return {kObjectives.begin(), kObjectives.end()}; }

std::string_view to_string(Objective objective) {
  return kObjectives[static_cast<std::size_t>(objective)];
}

ScheduleOptions ScheduleOptions::without_budget() const {
  ScheduleOptions others = *this;
  others.objective.reset();
  others.min_rate_per_ms.reset();
  others.power_cap_w.reset();
  return others;
}

Objective find_objective(const std::string& name) {
  const auto found = std::ranges::find(kObjectives, name);
  if (found == kObjectives.end()) {
    throw_bad_input("unknown --objective '" + name + "'" + suggestion(name, objective_names()));
  }
  return static_cast<Objective>(found - kObjectives.begin());
}

ModeSetup set_up_mode(const Platform& platform, const Profile* profile, const Mix& mix,
                      const ScheduleOptions& options) {
  const Mode mode = find_mode(options.mode, options.basic);
  check_options(platform, mix, options, mode);
  check_budget(platform, mix, options, mode);
  const Defaults* const defaults = defaults_of(platform, mode);
  check_role(platform, mode.policy);
  check_role(platform, mode.weighed());
  ServiceOptions service_options;
  service_options.without = options.without;
  service_options.strict = options.strict;
  service_options.draw = options.draw;
  service_options.only = mode.policy.needs_role;
  service_options.slices = options.slices.value_or(mode.policy.budgets);
  if (defaults != nullptr) service_options.stage_scale = defaults->second.stage_scale;
  Scenario scenario = make_scenario(platform, profile, mix, service_options, mode.policy.cloud_use);
  std::optional<int> in_flight = options.in_flight;
  if (!in_flight && defaults != nullptr) in_flight = defaults->second.in_flight;
  scenario.in_flight = choose_in_flight(scenario, in_flight);
  scenario.duration = options.duration.value_or(kDefaultDuration);
  scenario.seed = options.seed;
  scenario.faults = options.faults;

  PolicySetup setup;
  setup.roles = roles_of(platform);
  for (const auto& unit : platform.units) setup.servers.push_back(unit.servers);
  setup.costs = call_costs(scenario);
  make_plan(mode, scenario, options, setup);
  ChosenWeights weights = choose_weights(scenario, options, mode, defaults);
  setup.weights = std::move(weights.table);
  setup.literal_overflow = options.overflow == Overflow::kLiteral;
  setup.basic = mode.basic;
  setup.seed = options.seed;
  auto policy = mode.policy.make(setup);
  check_every_task_placeable(scenario, *policy, mode);
  warn_of_nothing_moved(*policy, scenario);
  std::vector<std::optional<int>> slots;
  // What is handed to a unit that computes can no longer be cancelled, expire or be overtaken.
  for (const auto& unit : platform.units) {
    slots.push_back(unit.slots || !unit.measured() ? unit.slots : std::optional(unit.servers));
    // And what waits for a unit elsewhere can be taken back in time.
    if (is_elsewhere(unit)) slots.back() = std::min(*slots.back(), unit.servers);
  }
  return {.mode = mode,
          .scenario = std::move(scenario),
          .slots = std::move(slots),
          .policy_setup = std::move(setup),
          .policy = std::move(policy),
          .weights_from = std::move(weights.source),
          .in_flight_given = in_flight.has_value()};
}

}  // namespace pirt
