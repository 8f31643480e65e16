#include "scheduler/schedule.h"

#include <fmt/core.h>

#include <algorithm>
#include <cstdint>
#include <utility>

#include "scheduler/bounds/bounds.h"
#include "scheduler/budget/guarantees.h"
#include "scheduler/budget/planning.h"
#include "scheduler/dispatcher/dispatcher.h"
#include "scheduler/policies/policy.h"
#include "scheduler/policies/unit_order.h"
#include "scheduler/record/interval.h"
#include "scheduler/record/keeping_up.h"
#include "scheduler/record/summary.h"
#include "scheduler/services/devices.h"
#include "scheduler/services/recall.h"
#include "scheduler/services/scenario.h"
#include "scheduler/trace/power_peak.h"
#include "scheduler/trace/trace_writer.h"
#include "scheduler/virtual/virtual_time.h"
#include "workloads/base/error.h"
#include "workloads/base/hash.h"
#include "workloads/base/text/text.h"

namespace pirt {
namespace {

/// Units that may serve something, and nobody knows what that draws.
std::vector<std::string> units_without_joules(const Scenario& scenario) {
  std::vector<std::string> names;
  for (UnitId unit = 0; unit < scenario.platform.units.size(); ++unit) {
    for (const auto& row : scenario.services.entries) {
      if (!row[unit].service || row[unit].service->energy_known) continue;
      names.push_back(scenario.platform.units[unit].name);
      break;
    }
  }
  return names;
}

/// What a reader of the result has to know about how the algorithms apply to this platform.
void add_warnings(const Scenario& scenario, const Mode& mode, std::vector<std::string>& warnings) {
  const Platform& platform = scenario.platform;
  const auto roles = roles_of(platform);
  const PolicyInfo& filling = mode.weighed();
  const auto without_joules = units_without_joules(scenario);
  if (!without_joules.empty() && !filling.without_joules.empty()) {
    warnings.push_back(fmt::format("mode {} {}: nobody knows the joules of {}", filling.name,
                                   filling.without_joules, join(without_joules, ", ")));
  }
  if (filling.overflows &&
      units_by_role(roles, kThroughputOrder) == units_by_role(roles, kEnergyOrder)) {
    warnings.push_back("platform " + platform.name +
                       " has no unit of role dsp: throughput and energy modes fill the same order");
  }
  if (filling.rule != WeightRule::kNone) {
    for (const auto& unit : platform.units) {
      if (unit.role != Role::kOther) continue;
      warnings.push_back(
          fmt::format("unit {} is of role other, which the paper's algorithms do not speak of: "
                      "mode {} takes it for an accelerator like the DSP; give it a `role:` to "
                      "change that",
                      unit.name, filling.name));
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
  const Mix& mix = scenario.mix;
  if (!mix.states.empty() || mix.reads_earlier()) {
    // A plan has the states within a firing, and all of them where all is one firing.
    const bool plan = mode.policy.planner != nullptr && (!mix.fires_once() || mix.reads_earlier());
    warnings.push_back(
        std::string(plan ? "the plan and the bounds" : "the bounds") +
        " leave out that tasks wait for data of earlier firings (@-1) and for states");
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

/// What mode budget guarantees of pipelines with a rate and a deadline: nothing where it follows
/// another mode.
void add_guarantees(const Scenario& scenario, const PolicySetup& setup, RunRecord& record) {
  const BudgetPlan& plan = setup.budget;
  const auto guarantees = guarantees_of(scenario, plan);
  for (std::size_t p = 0; p < guarantees.size(); ++p) {
    const Guarantee& guarantee = guarantees[p];
    PipelineResult& result = record.pipelines[p];
    if (!guarantee.not_analysed.empty()) result.not_analysed = guarantee.not_analysed;
    if (!guarantee.analysed) continue;
    const bool bounded = guarantee.response && setup.follows == nullptr;
    result.guaranteed = bounded && *guarantee.response <= *plan.pipelines[p].deadline;
    if (bounded) result.response_bound_ms = to_ms(*guarantee.response);
  }
}

/// The same for each copy of the database.
std::string profile_hash(const Profile& profile) {
  Hash64 hash;
  for (const RunInfo& run : profile.runs) {
    hash.add(static_cast<std::uint64_t>(run.run_id)).add(run.started);
  }
  return fmt::format("{:016x}", hash.value());
}

std::vector<std::string> besides_of(const ScheduleOptions& options, const Profile* profile) {
  std::vector<std::string> flags;
  if (!options.without.empty()) flags.push_back("--without " + join(options.without, ","));
  if (options.strict) flags.emplace_back("--strict");
  const auto is_estimated = [](const PhaseRow& row) {  // As add_estimate notes.
    return std::ranges::any_of(
        row.notes, [](const std::string& note) { return note.starts_with("estimated through"); });
  };
  if (profile != nullptr && std::ranges::any_of(profile->phases, is_estimated)) {
    flags.emplace_back("--estimate");
  }
  if (options.faults) {
    flags.push_back(fmt::format("--faults seed={},fail={},return={}", options.faults->seed,
                                options.faults->failing, options.faults->returning));
  }
  return flags;
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

}  // namespace

RunRecord run_mix(const Platform& named, const Profile* profile, const Mix& mix,
                  const ScheduleOptions& options, const Driver& driver, const std::string& time,
                  std::optional<PlannedBudget>* planned) {
  const Platform platform = on_devices(named, profile, options.without);
  ModeSetup setup = set_up_mode(platform, profile, mix, options);
  const Mode& mode = setup.mode;
  std::optional<PlannedBudget> own;  // Where the caller keeps none.
  std::vector<TriedPlan> tried;
  if (mode.policy.budgets) {
    std::optional<PlannedBudget>& known = planned == nullptr ? own : *planned;
    if (!known) {
      known = mix.fires_once() ? plan_once(setup, options) : plan_budget(setup, options);
    }
    follow(*known, setup);
    if (time == "live") plan_for_losses(setup, options);
    tried = known->tried;
  }
  if (options.redraw) redraw(platform, *options.redraw, setup.scenario.services);
  const Scenario& scenario = setup.scenario;
  Dispatcher dispatcher(setup.slots, std::move(setup.policy));
  std::optional<TraceWriter> trace;
  if (options.trace) {
    trace.emplace(
        *options.trace, scenario,
        DispatcherSetup{&mode.policy, platform.unit_names(), setup.slots, setup.policy_setup},
        time);
  }
  const Tally tally = driver(scenario, dispatcher, trace ? &*trace : nullptr);

  RunRecord record = summarize(scenario, profile, setup.policy_setup.weights, tally);
  if (trace) {
    try {
      trace->finish(tally);
    } catch (const Error& error) {
      if (time != "live") throw;
      record.trace_problem = error.what();  // The run cannot be had again.
    }
  }
  record.time = time;
  if (time == "live" || may_return(scenario, mode.policy.cloud_use)) {
    record.returned = tally.tasks.returned;
  }
  record.mode = mode.policy.name;
  if (mode.policy.budgets) {
    record.objective = to_string(options.objective.value_or(Objective::kRate));
    record.min_rate_per_ms = options.min_rate_per_ms;
    record.power_cap_w = options.power_cap_w;
    if (options.power_cap_w) record.over_cap = dispatcher.policy().over_cap();
    record.tried = std::move(tried);
    if (!mix.fires_once()) add_guarantees(scenario, setup.policy_setup, record);
  }
  if (tally.tasks.suspended > 0) record.suspensions = tally.tasks.suspended;
  if (profile != nullptr) record.draw = to_string(options.draw);
  // Of a redrawn run only its figures are asked for.
  if (!options.redraw) {
    record.bounds = bounds_of(scenario, mode.policy.cloud_use, record);
    record.platform_hash = platform_hash(named);
    if (profile != nullptr) record.profile_hash = profile_hash(*profile);
    record.besides = besides_of(options, profile);
    record.slices = options.slices;
  }
  if (!setup.policy_setup.plan.entries.empty() && mix.fires_once()) {
    record.planned_makespan_s = to_s(setup.policy_setup.plan.makespan);
    record.plan = planned_tasks(scenario, setup.policy_setup.plan);
  }
  if (mode.basic != nullptr) record.basic = mode.basic->name;
  record.weights_from = setup.weights_from;
  if (mode.weighed().overflows)
    record.overflow = setup.policy_setup.literal_overflow ? "literal" : "hold";
  record.uncertain = is_uncertain(scenario.services);
  record.warnings = scenario.services.warnings;
  if (record.stalled > 0) {
    record.warnings.push_back("stalled: nothing is ever going to start " +
                              std::to_string(record.stalled) + " of the tasks that are queued");
  }
  if (misses_rate(record)) {
    record.warnings.push_back(fmt::format("--min-rate {:g} tasks/ms is not reached: {:g}",
                                          *record.min_rate_per_ms,
                                          record.throughput_per_ms.value_or(0)));
  }
  for (const PipelineResult& pipeline : record.pipelines) {
    if (!pipeline.never_ran) continue;
    record.warnings.push_back(
        fmt::format("never ran: {}: of {} firings no task was ever begun; it has to have another "
                    "unit, or shorter calls, or less beside it",
                    pipeline.pipeline, pipeline.fired));
  }
  add_warnings(scenario, mode, record.warnings);
  return record;
}

RunRecord run_virtual(const Platform& named, const Profile* profile, const Mix& mix,
                      const ScheduleOptions& options, std::optional<PlannedBudget>* planned) {
  std::optional<PowerPeak> peak;
  const auto driver = [&](const Scenario& scenario, Dispatcher& dispatcher, TraceWriter* trace) {
    dispatcher.observe(trace);
    std::vector<RunObserver*> observers;
    if (options.power_cap_w || options.watch_power)
      observers.push_back(&peak.emplace(scenario.platform));
    if (trace != nullptr) observers.push_back(trace);
    return VirtualTime(scenario, dispatcher, std::move(observers)).run();
  };
  RunRecord record = run_mix(named, profile, mix, options, driver, "virtual", planned);
  if (peak) record.power_highest_w = peak->highest_w();
  return record;
}

namespace {

constexpr std::int64_t kMostRedrawnTasks = 100'000;

/// Of a run of so many tasks, a part that has no more than are redrawn.
void shorten(std::int64_t tasks, Nanos given, ScheduleOptions& options, Mix& mix) {
  const double part = static_cast<double>(kMostRedrawnTasks) / static_cast<double>(tasks);
  if (part >= 1) return;
  if (mix.open_loop()) options.duration = scaled(given, part);
  for (Pipeline& pipeline : mix.pipelines) {
    if (pipeline.frames) {
      pipeline.frames = std::max<std::int64_t>(
          1, static_cast<std::int64_t>(part * static_cast<double>(*pipeline.frames)));
    }
  }
}

/// What a part of the run says of the whole.
RunFigures as_whole(RunFigures redrawn, const RunFigures& part, const RunFigures& whole) {
  for (auto& [name, value] : redrawn) {
    const auto of_part = part.find(name);
    const auto of_whole = whole.find(name);
    if (of_part == part.end() || of_whole == whole.end() || of_part->second == 0) continue;
    value *= of_whole->second / of_part->second;
  }
  return redrawn;
}

}  // namespace

RunRecord run_with_intervals(const Platform& platform, const Profile* profile, const Mix& mix,
                             const ScheduleOptions& options) {
  std::optional<PlannedBudget> planned;  // By the medians, and once of each length.
  RunRecord record = run_virtual(platform, profile, mix, options, &planned);
  if (!record.uncertain || options.trace) return record;
  Mix part = mix;
  ScheduleOptions redrawn = options;
  shorten(record.submitted, options.duration.value_or(kDefaultDuration), redrawn, part);
  const RunFigures whole = figures_of(record);
  RunFigures of_part = whole;
  if (record.submitted > kMostRedrawnTasks) {
    planned.reset();
    of_part = figures_of(run_virtual(platform, profile, part, redrawn, &planned));
  }
  for (int i = 0; i < kRedraws; ++i) {
    redrawn.redraw = Redraw{.number = i};
    const auto figures = figures_of(run_virtual(platform, profile, part, redrawn, &planned));
    record.redrawn.push_back(as_whole(figures, of_part, whole));
  }
  record.intervals = intervals_of(record.redrawn);
  return record;
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
  const ScheduleOptions given = options;
  const auto budgets = [](const std::string& name) { return find_policy(name).budgets; };
  if (given.has_budget() && std::ranges::none_of(modes, budgets)) {
    throw_bad_input(
        "--objective, --min-rate and --power-cap are about mode budget, which is none of these; "
        "leave them out");
  }
  ModeRuns result;
  for (const auto& name : modes) {
    options = budgets(name) ? given : given.without_budget();
    options.mode = name;
    options.overflow = overflows(name) ? overflow : std::nullopt;
    try {
      result.runs.push_back(run_with_intervals(platform, profile, mix, options));
    } catch (const Error& error) {
      result.skipped.push_back({name, error.what()});
    }
  }
  return result;
}

}  // namespace pirt
