#include "scheduler/schedule.h"

#include <algorithm>
#include <ranges>
#include <utility>

#include "scheduler/bounds/bounds.h"
#include "scheduler/dispatcher/dispatcher.h"
#include "scheduler/policies/policy.h"
#include "scheduler/policies/unit_order.h"
#include "scheduler/policies/weights.h"
#include "scheduler/record/summary.h"
#include "scheduler/runtime/live_run.h"
#include "scheduler/services/scenario.h"
#include "scheduler/trace/trace_writer.h"
#include "scheduler/virtual/virtual_time.h"
#include "workloads/base/error.h"
#include "workloads/base/text.h"

namespace pirt {
namespace {

/// The platform's defaults for the mode; those of its basic scheduler where the platform has none
/// for advanced.
struct Defaults {
  const ModeDefaults* mode = nullptr;  ///< Null if there are none.
  std::string_view name;
};

Defaults defaults_of(const Platform& platform, const Mode& mode) {
  const auto known = policy_names();
  for (const auto& [name, defaults] : platform.modes) {
    if (std::ranges::find(known, name) == known.end()) {
      throw_bad_input("platform " + platform.name + ": modes: unknown mode '" + name + "'" +
                      suggestion(name, known));
    }
  }
  for (const std::string_view name : {mode.policy.name, mode.weighed().name}) {
    const auto found = platform.modes.find(std::string(name));
    if (found != platform.modes.end()) return {&found->second, name};
  }
  return {};
}

/// Weights, and where they come from; both empty for modes without.
struct ChosenWeights {
  WeightTable table;
  std::optional<std::string> source;
};

ChosenWeights choose_weights(const Scenario& scenario, const ScheduleOptions& options,
                             const Mode& mode, const Defaults& defaults) {
  const Platform& platform = scenario.platform;
  const WeightRule rule = mode.weighed().rule;
  const std::string in_platform =
      "platform " + platform.name + ": modes." + std::string(defaults.name) + ".weights";
  const bool platform_has = defaults.mode != nullptr && !defaults.mode->weights.empty();
  if (rule == WeightRule::kNone) {
    if (options.weights.empty() && !platform_has) return {};
    throw_bad_input((platform_has ? in_platform : std::string("--weights")) + ": mode " +
                    std::string(mode.weighed().name) + " has no weights; leave them out");
  }
  if (!options.weights.empty()) {
    return {given_weights(options.weights, platform, scenario.services, "--weights"), "given"};
  }
  if (platform_has) {
    return {given_weights(defaults.mode->weights, platform, scenario.services, in_platform),
            "platform"};
  }
  return {derive_weights(rule, platform, scenario.services), "derived"};
}

/// By pipeline; 0 for open loops.
std::vector<int> choose_in_flight(const Scenario& scenario, const ScheduleOptions& options,
                                  const Defaults& defaults) {
  std::vector<int> in_flight;
  for (std::size_t p = 0; p < scenario.mix.pipelines.size(); ++p) {
    int frames = 0;
    if (scenario.mix.pipelines[p].frames) {
      if (options.in_flight) {
        frames = *options.in_flight;
      } else if (defaults.mode != nullptr && defaults.mode->in_flight) {
        frames = *defaults.mode->in_flight;
      } else {
        // What keeps the units busy with the pipeline's most spread-out workload.
        for (const auto& kind : scenario.classes[p]) {
          frames = std::max(frames, in_flight_for(kind, scenario.platform, scenario.services));
        }
      }
    }
    in_flight.push_back(frames);
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

/// What a reader of the result has to know about how the algorithms apply to this platform.
void add_warnings(const Scenario& scenario, const Mode& mode, std::vector<std::string>& warnings) {
  const Platform& platform = scenario.platform;
  const auto roles = roles_of(platform);
  const PolicyInfo& filling = mode.weighed();
  if (filling.overflows &&
      units_by_role(roles, kThroughputOrder) == units_by_role(roles, kEnergyOrder)) {
    warnings.push_back("platform " + platform.name +
                       " has no unit of role dsp: throughput and energy modes fill the same order");
  }
  if (filling.rule != WeightRule::kNone) {
    for (const auto& unit : platform.units) {
      if (unit.role != Role::kOther) continue;
      warnings.push_back("unit " + unit.name +
                         " is of role other, which the paper's algorithms do "
                         "not speak of: mode " +
                         std::string(filling.name) +
                         " takes it for an accelerator like the DSP; give it a `role:` to change "
                         "that");
    }
  }
  if (mode.policy.planner != nullptr) {
    for (const auto& unit : platform.units) {
      if (unit.servers == 1) continue;
      warnings.push_back(
          "mode " + std::string(mode.policy.name) + " plans one task at a time on a unit: of the " +
          std::to_string(unit.servers) + " servers of " + unit.name + " it uses one");
    }
  }
  if (scenario.mix.reads_earlier() || !scenario.mix.states.empty()) {
    warnings.push_back(std::string(mode.policy.planner != nullptr ? "the plan and the bounds leave"
                                                                  : "the bounds leave") +
                       " out that tasks wait for data of earlier firings (@-1) and for states");
  }
  if (mode.policy.cloud_use != CloudUse::kNotRealTime) return;
  const UnitMask cloud = cloud_units(platform);
  for (std::size_t p = 0; p < scenario.mix.pipelines.size(); ++p) {
    const auto stays = [&](const TaskClass& kind) {
      return !kind.real_time && (kind.eligible & cloud) == 0;
    };
    if (std::ranges::none_of(scenario.classes[p], stays)) continue;
    warnings.push_back("pipeline " + scenario.mix.pipelines[p].name +
                       " is not real-time, but no unit of role cloud may serve all of it; " +
                       std::string(filling.name) + " takes the rest");
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

/// Plans the mix if the mode does, and gives each task its entry in the plan.
MixPlan make_plan(const Mode& mode, Scenario& scenario) {
  if (mode.policy.planner == nullptr) return {};
  std::uint32_t entry = 0;
  for (auto& pipeline : scenario.classes) {
    for (auto& kind : pipeline) kind.entry = entry++;
  }
  return plan_mix(scenario, mode.policy.planner);
}

std::vector<PlanRow> planned_tasks(const Scenario& scenario, const MixPlan& plan) {
  std::vector<PlanRow> tasks;
  for (const auto& pipeline : scenario.mix.pipelines) {
    for (const auto& task : pipeline.tasks) {
      const MixPlan::Entry& entry = plan.entries[tasks.size()];
      tasks.push_back({.pipeline = pipeline.name,
                       .task = task.name,
                       .unit = scenario.platform.units[entry.unit].name,
                       .start_ms = to_ms(entry.start),
                       .finish_ms = to_ms(entry.finish)});
    }
  }
  return tasks;
}

/// What was not as it should be in a live run.
void add_live(const Scenario& scenario, const LiveResult& result, RunRecord& record) {
  record.time = "live";
  record.set_up_s = to_s(result.set_up);
  if (result.first_call) record.first_call_ms = to_ms(*result.first_call);
  for (const std::string& problem : result.problems)
    record.warnings.push_back("failed: " + problem);
  const auto told = static_cast<std::int64_t>(result.problems.size());
  if (result.failed_calls > told) {
    record.warnings.push_back("and " + std::to_string(result.failed_calls - told) +
                              " calls more have failed");
  }
  const auto paced = [](const UnitModel& unit) { return !unit.measured(); };
  std::vector<std::string> names;
  for (const auto& unit : scenario.platform.units | std::views::filter(paced)) {
    names.push_back(unit.name);
  }
  if (!names.empty()) {
    record.warnings.push_back(
        "units without a backend are paced by their stages and compute "
        "nothing: " +
        join(names, ", "));
  }
}

/// @param live  Null = in virtual time.
RunRecord run_mix(const Platform& platform, const Profile* profile, const Mix& mix,
                  const ScheduleOptions& options, const LiveOptions* live) {
  const Mode mode = find_mode(options.mode, options.basic);
  check_options(platform, mix, options, mode);
  const Defaults defaults = defaults_of(platform, mode);
  check_role(platform, mode.policy);
  check_role(platform, mode.weighed());
  ServiceOptions service_options;
  service_options.allow_invalid = options.allow_invalid;
  service_options.draw = options.draw;
  if (defaults.mode != nullptr) service_options.stage_scale = defaults.mode->stage_scale;
  Scenario scenario =
      make_scenario(platform, profile, mix, std::move(service_options), mode.policy.cloud_use);
  scenario.in_flight = choose_in_flight(scenario, options, defaults);
  scenario.duration = options.duration.value_or(kDefaultDuration);
  scenario.seed = options.seed;
  scenario.faults = options.faults;

  PolicySetup setup;
  setup.roles = roles_of(platform);
  for (const auto& unit : platform.units) setup.servers.push_back(unit.servers);
  setup.costs = call_costs(platform, scenario.services);
  setup.plan = make_plan(mode, scenario);
  ChosenWeights weights = choose_weights(scenario, options, mode, defaults);
  setup.weights = std::move(weights.table);
  setup.literal_overflow = options.overflow == Overflow::kLiteral;
  setup.basic = mode.basic;
  auto policy = mode.policy.make(setup);
  check_every_task_placeable(scenario, *policy, mode);

  std::vector<std::optional<int>> slots;
  for (const auto& unit : platform.units) slots.push_back(unit.slots);
  Dispatcher dispatcher(slots, std::move(policy));
  std::optional<TraceWriter> trace;
  if (options.trace) {
    trace.emplace(*options.trace, scenario, dispatcher,
                  DispatcherSetup{&mode.policy, platform.unit_names(), slots, setup},
                  live != nullptr ? "live" : "virtual");
    dispatcher.observe(&*trace);
  }
  LiveResult result;
  if (live != nullptr) {
    result = pirt::run_live(scenario, dispatcher, *live, trace ? &*trace : nullptr);
  } else {
    result.tally = VirtualTime(scenario, dispatcher, trace ? &*trace : nullptr).run();
  }
  const Tally& tally = result.tally;

  RunRecord record = summarize(scenario, profile, setup.weights, tally);
  if (trace) trace->finish(tally);
  record.mode = mode.policy.name;
  if (profile != nullptr) record.draw = to_string(options.draw);
  record.bounds = bounds_of(scenario, mode.policy.cloud_use, record);
  if (mode.policy.planner != nullptr && mix.fires_once()) {
    record.planned_makespan_s = to_s(setup.plan.makespan);
    record.plan = planned_tasks(scenario, setup.plan);
  }
  if (mode.basic != nullptr) record.basic = mode.basic->name;
  record.weights_from = weights.source;
  if (mode.weighed().overflows) record.overflow = setup.literal_overflow ? "literal" : "hold";
  record.warnings = scenario.services.warnings;
  if (live != nullptr) add_live(scenario, result, record);
  if (record.stalled > 0) {
    record.warnings.push_back("stalled: nothing is ever going to start " +
                              std::to_string(record.stalled) + " of the tasks that are queued");
  }
  add_warnings(scenario, mode, record.warnings);
  return record;
}

}  // namespace

RunRecord run_virtual(const Platform& platform, const Profile* profile, const Mix& mix,
                      const ScheduleOptions& options) {
  return run_mix(platform, profile, mix, options, nullptr);
}

RunRecord run_live(const Platform& platform, const Profile* profile, const Mix& mix,
                   const ScheduleOptions& options, const LiveOptions& live) {
  return run_mix(platform, profile, mix, options, &live);
}

std::vector<std::string> reason_lines(const std::vector<ModeRuns::Skipped>& skipped) {
  std::vector<ModeRuns::Skipped> groups;  // Of several modes each.
  for (const auto& [mode, reason] : skipped) {
    const auto known = std::ranges::find(groups, reason, &ModeRuns::Skipped::reason);
    if (known == groups.end()) {
      groups.push_back({mode, reason});
    } else {
      known->mode += ", " + mode;
    }
  }
  std::vector<std::string> lines;
  for (auto& [modes, reason] : groups) lines.push_back(modes.append(": ").append(reason));
  return lines;
}

std::vector<std::string> paper_modes() { return {"latency", "throughput", "energy", "advanced"}; }

ModeRuns run_modes(const Platform& platform, const Profile* profile, const Mix& mix,
                   const std::vector<std::string>& modes, ScheduleOptions options) {
  const auto overflow = options.overflow;
  const auto overflows = [&](const std::string& name) {
    return find_mode(name, options.basic).weighed().overflows;
  };
  if (overflow && std::ranges::none_of(modes, overflows)) {
    throw_bad_input(
        "--overflow is about the queues of Algorithms 2 and 3; none of these modes has "
        "them, leave it out");
  }
  ModeRuns result;
  for (const auto& name : modes) {
    options.mode = name;
    options.overflow = overflows(name) ? overflow : std::nullopt;
    try {
      result.runs.push_back(run_virtual(platform, profile, mix, options));
    } catch (const Error& error) {
      result.skipped.push_back({name, error.what()});
    }
  }
  return result;
}

}  // namespace pirt
