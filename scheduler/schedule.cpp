#include "scheduler/schedule.h"

#include <algorithm>
#include <memory>
#include <utility>

#include "scheduler/bounds/bounds.h"
#include "scheduler/dispatcher/dispatcher.h"
#include "scheduler/policies/eligibility.h"
#include "scheduler/policies/policy.h"
#include "scheduler/policies/unit_order.h"
#include "scheduler/policies/weights.h"
#include "scheduler/record/summary.h"
#include "scheduler/services/services.h"
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
  std::string name;
};

Defaults defaults_of(const Platform& platform, const ScheduleOptions& options) {
  for (const auto& [name, defaults] : platform.modes) {
    const auto known = policy_names();
    if (std::ranges::find(known, name) == known.end()) {
      throw_bad_input("platform " + platform.name + ": modes: unknown mode '" + name + "'" +
                      suggestion(name, known));
    }
  }
  const bool advanced = find_policy(options.mode).has_basic();
  for (const auto& name : {options.mode, advanced ? options.basic : options.mode}) {
    const auto found = platform.modes.find(name);
    if (found != platform.modes.end()) return {&found->second, name};
  }
  return {};
}

WeightTable choose_weights(const Platform& platform, const ServiceTable& services,
                           const ScheduleOptions& options, const Defaults& defaults) {
  const PolicyInfo& mode = find_policy(options.mode);
  const WeightRule rule = mode.has_basic() ? find_basic_policy(options.basic).rule : mode.rule;
  if (rule == WeightRule::kNone) {
    const bool in_platform = defaults.mode != nullptr && !defaults.mode->weights.empty();
    if (options.weights.empty() && !in_platform) return {};
    throw_bad_input((in_platform
                         ? "platform " + platform.name + ": modes." + defaults.name + ".weights"
                         : std::string("--weights")) +
                    ": mode " + (mode.has_basic() ? options.basic : options.mode) +
                    " has no weights; leave them out");
  }
  if (!options.weights.empty())
    return given_weights(options.weights, platform, services, "--weights");
  if (defaults.mode != nullptr && !defaults.mode->weights.empty()) {
    return given_weights(defaults.mode->weights, platform, services,
                         "platform " + platform.name + ": modes." + defaults.name + ".weights");
  }
  return derive_weights(rule, platform, services);
}

/// By pipeline; 0 for open loops.
std::vector<int> choose_in_flight(const Platform& platform, const Mix& mix,
                                  const ServiceTable& services,
                                  const std::vector<std::vector<TaskClass>>& classes,
                                  const ScheduleOptions& options, const Defaults& defaults) {
  std::vector<int> in_flight;
  for (std::size_t p = 0; p < mix.pipelines.size(); ++p) {
    int frames = 0;
    if (mix.pipelines[p].frames) {
      if (options.in_flight) {
        frames = *options.in_flight;
      } else if (defaults.mode != nullptr && defaults.mode->in_flight) {
        frames = *defaults.mode->in_flight;
      } else {
        // What keeps the units busy with the pipeline's most spread-out workload.
        for (const auto& kind : classes[p]) {
          frames = std::max(frames, in_flight_for(kind, platform, services));
        }
      }
    }
    in_flight.push_back(frames);
  }
  return in_flight;
}

void check_options(const Platform& platform, const Mix& mix, const ScheduleOptions& options) {
  static_cast<void>(find_policy(options.mode));
  static_cast<void>(find_basic_policy(options.basic));
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
}

CloudUse cloud_use(const PolicyInfo& mode) {
  if (mode.planner != nullptr) return CloudUse::kAll;
  return mode.has_basic() ? CloudUse::kNotRealTime : CloudUse::kNone;
}

/// Algorithms 2 and 3 have an `else` for full queues.
bool has_overflow(const std::string& mode) { return mode == "throughput" || mode == "energy"; }

/// What a reader of the result has to know about how the algorithms apply to this platform.
void add_warnings(const Platform& platform, const Mix& mix,
                  const std::vector<std::vector<TaskClass>>& classes,
                  const ScheduleOptions& options, std::vector<std::string>& warnings) {
  std::vector<std::string> roles;
  for (const auto& unit : platform.units) roles.push_back(unit.role);
  const bool advanced = find_policy(options.mode).has_basic();
  const std::string& filling = advanced ? options.basic : options.mode;
  if (has_overflow(filling) &&
      units_by_role(roles, kThroughputOrder) == units_by_role(roles, kEnergyOrder)) {
    warnings.push_back("platform " + platform.name +
                       " has no unit of role dsp: throughput and energy modes fill the same order");
  }
  if (find_policy(options.mode).planner != nullptr) {
    for (const auto& unit : platform.units) {
      if (unit.servers == 1) continue;
      warnings.push_back("mode " + options.mode + " plans one task at a time on a unit: of the " +
                         std::to_string(unit.servers) + " servers of " + unit.name +
                         " it uses one");
    }
  }
  if (!advanced) return;
  const UnitMask cloud = cloud_units(platform);
  for (std::size_t p = 0; p < mix.pipelines.size(); ++p) {
    const auto stays = [&](const TaskClass& kind) {
      return !kind.real_time && (kind.eligible & cloud) == 0;
    };
    if (std::ranges::none_of(classes[p], stays)) continue;
    warnings.push_back("pipeline " + mix.pipelines[p].name +
                       " is not real-time, but no unit of role cloud may serve all of it; " +
                       options.basic + " takes the rest");
  }
}

void check_role(const Platform& platform, const PolicyInfo& mode) {
  if (mode.needs_role.empty()) return;
  std::vector<std::string> units;
  for (const auto& unit : platform.units) {
    if (unit.role == mode.needs_role) return;
    units.push_back(unit.name + " (" + unit.role + ")");
  }
  throw_bad_input("mode " + std::string(mode.name) + " needs a unit of role " +
                  std::string(mode.needs_role) + "; platform " + platform.name + " has " +
                  join(units, ", "));
}

PolicySetup policy_setup(const Platform& platform, const ServiceTable& services) {
  PolicySetup setup;
  for (const auto& unit : platform.units) {
    setup.roles.push_back(unit.role);
    setup.servers.push_back(unit.servers);
  }
  for (WorkloadId workload = 0; workload < services.workloads.size(); ++workload) {
    auto& row = setup.times.emplace_back();
    for (UnitId unit = 0; unit < platform.units.size(); ++unit) {
      const Service* service = services.find(workload, unit);
      row.emplace_back();
      if (service != nullptr) row.back() = {service->total(), service->bottleneck(unit)};
    }
  }
  return setup;
}

/// Plans the mix if the mode does, and gives each task its entry in the plan.
MixPlan make_plan(const Platform& platform, const Mix& mix, const ServiceTable& services,
                  const PolicyInfo& mode, std::vector<std::vector<TaskClass>>& classes) {
  if (mode.planner == nullptr) return {};
  std::uint32_t entry = 0;
  for (auto& pipeline : classes) {
    for (auto& kind : pipeline) kind.entry = entry++;
  }
  return plan_mix(platform, mix, services, classes, mode.planner);
}

std::vector<PlanRow> planned_tasks(const Platform& platform, const Mix& mix, const MixPlan& plan) {
  std::vector<PlanRow> tasks;
  for (const auto& pipeline : mix.pipelines) {
    for (const auto& task : pipeline.tasks) {
      const MixPlan::Entry& entry = plan.entries[tasks.size()];
      tasks.push_back({.pipeline = pipeline.name,
                       .task = task.name,
                       .unit = platform.units[entry.unit].name,
                       .start_ms = to_ms(entry.start),
                       .finish_ms = to_ms(entry.finish)});
    }
  }
  return tasks;
}

}  // namespace

RunRecord run_virtual(const Platform& platform, const Profile* profile, const Mix& mix,
                      const ScheduleOptions& options) {
  check_options(platform, mix, options);
  const Defaults defaults = defaults_of(platform, options);
  ServiceOptions service_options;
  service_options.given = given_services(platform, mix);
  service_options.allow_invalid = options.allow_invalid;
  service_options.draw = options.draw;
  if (defaults.mode != nullptr) service_options.stage_scale = defaults.mode->stage_scale;
  const ServiceTable services =
      resolve_services(platform, profile, workloads_of(mix), service_options);
  const PolicyInfo& mode = find_policy(options.mode);
  check_role(platform, mode);
  if (mode.has_basic()) check_role(platform, find_basic_policy(options.basic));
  check_every_workload_served(platform, profile, mix, services, cloud_use(mode));
  auto classes = task_classes(platform, mix, services);

  PolicySetup setup = policy_setup(platform, services);
  setup.plan = make_plan(platform, mix, services, mode, classes);
  setup.weights = choose_weights(platform, services, options, defaults);
  setup.literal_overflow = options.literal_overflow;
  setup.basic = options.basic;
  auto policy = mode.make(setup);
  check_every_task_placeable(platform, mix, classes, *policy, options.mode);

  VirtualSetup run{
      .platform = platform,
      .services = services,
      .mix = mix,
      .classes = classes,
      .in_flight = choose_in_flight(platform, mix, services, classes, options, defaults),
      .duration = options.duration.value_or(kDefaultDuration),
      .seed = options.seed};
  std::vector<std::optional<int>> slots;
  for (const auto& unit : platform.units) slots.push_back(unit.slots);
  Dispatcher dispatcher(slots, std::move(policy));
  std::optional<TraceWriter> trace;
  if (options.trace) {
    trace.emplace(*options.trace, run, dispatcher,
                  DispatcherSetup{options.mode, platform.unit_names(), slots, setup});
    dispatcher.observe(&*trace);
    run.observer = &*trace;
  }
  const Tally tally = VirtualTime(run, dispatcher).run();

  RunRecord record = summarize(run, profile, setup.weights, tally);
  if (trace) trace->finish(tally);
  record.mode = options.mode;
  if (profile != nullptr) record.draw = to_string(options.draw);
  record.bounds = bounds_of(run, cloud_use(mode), record);
  if (mode.planner != nullptr && mix.fires_once()) {
    record.planned_makespan_s = to_s(setup.plan.makespan);
    record.plan = planned_tasks(platform, mix, setup.plan);
  }
  if (mode.has_basic()) record.basic = options.basic;
  if (has_overflow(record.basic.value_or(options.mode))) {
    record.overflow = options.literal_overflow ? "literal" : "hold";
  }
  record.warnings = services.warnings;
  if (record.stalled > 0) {
    record.warnings.push_back("stalled: nothing is ever going to start " +
                              std::to_string(record.stalled) + " of the tasks that are queued");
  }
  add_warnings(platform, mix, classes, options, record.warnings);
  return record;
}

}  // namespace pirt
