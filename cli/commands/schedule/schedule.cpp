// pirt schedule: runs a robot's mix on a platform under one policy, in virtual time or live.
#include "scheduler/schedule.h"

#include <fmt/core.h>

#include <algorithm>
#include <exception>
#include <limits>
#include <map>
#include <memory>

#include "characterize/campaign/live_rows.h"
#include "characterize/profile/store/reader.h"
#include "characterize/profile/store/writer.h"
#include "cli/commands.h"
#include "cli/long_run.h"
#include "cli/options/duration.h"
#include "cli/options/files.h"
#include "cli/options/output.h"
#include "cli/options/own.h"
#include "cli/options/profile_platform.h"
#include "cli/options/shipped.h"
#include "cli/options/values.h"
#include "cli/options/weights.h"
#include "reports/document/document.h"
#include "reports/run/comparison_report.h"
#include "reports/run/live_report.h"
#include "reports/run/pareto.h"
#include "reports/run/run_report.h"
#include "scheduler/planner/budget_plan.h"
#include "scheduler/policies/policy.h"
#include "scheduler/record/keeping_up.h"
#include "scheduler/schedule_live.h"
#include "scheduler/services/devices.h"
#include "scheduler/services/draws.h"
#include "scheduler/services/services.h"
#include "workloads/backends/registry.h"
#include "workloads/base/error.h"
#include "workloads/base/text/json.h"
#include "workloads/base/text/numbers.h"
#include "workloads/base/text/text.h"

namespace pirt::cli {
namespace {

struct ScheduleFlags {
  std::string mode;
  std::string compare;  ///< Modes, with commas; empty = all.
  bool comparing = false;
  bool pareto = false;
  std::optional<std::string> profile;
  std::optional<std::string> platform;
  std::vector<std::string> settings;
  std::string mix = "full-robot";
  OwnFiles own;
  std::optional<std::string> duration;
  std::optional<std::string> weights;
  std::optional<int> in_flight;
  std::optional<std::string> basic;
  std::optional<std::string> overflow;
  std::vector<std::string> without;
  std::optional<std::string> slices;
  std::optional<std::string> objective;
  std::optional<double> min_rate;
  std::optional<std::string> power_cap;
  std::string draw = "median";
  bool strict = false;
  bool estimate = false;
  std::uint64_t seed = 1;
  bool seed_given = false;
  std::optional<std::string> faults;
  bool live = false;
  bool no_preinit = false;
  bool update_profile = false;
  Output trace, json;
};

/// "seed=7,fail=0.02,return=0.02"; what is not given is as in Faults.
Faults parse_faults(const std::string& text) {
  Faults faults;
  std::vector<std::string> given;
  for (const auto& part : split(text, ',')) {
    const auto equals = part.find('=');
    const std::string key = part.substr(0, equals);
    const std::string value = equals == std::string::npos ? "" : part.substr(equals + 1);
    const std::string what = "--faults " + key;
    if (std::ranges::count(given, key) > 0) throw_bad_input(what + " is given twice");
    given.push_back(key);
    if (key == "seed") {
      faults.seed = whole_number<std::uint64_t>(value, 0, std::numeric_limits<std::uint64_t>::max())
                        .or_refuse(what);
    } else if (key == "fail" || key == "return") {
      (key == "fail" ? faults.failing : faults.returning) =
          decimal_number(value, 0, 1).or_refuse(what);
    } else {
      throw_bad_input("--faults: '" + key + "' is none of its keys" +
                      suggestion(key, std::vector<std::string>{"seed", "fail", "return"}));
    }
  }
  if (faults.failing + faults.returning > 1) {
    throw_bad_input(fmt::format(
        "--faults: fail={} and return={} are parts of all calls, together at most 1 (each is 0.02 "
        "where it is not given)",
        faults.failing, faults.returning));
  }
  return faults;
}

ScheduleOptions schedule_options(const ScheduleFlags& options,
                                 const std::vector<std::string>& modes) {
  const auto falls_back = [](const std::string& mode) { return find_policy(mode).has_basic(); };
  if (options.basic && std::ranges::none_of(modes, falls_back)) {
    throw_bad_input("--basic is about mode advanced, which falls back to it; leave it out");
  }
  ScheduleOptions schedule;
  schedule.mode = options.mode;
  if (options.basic) schedule.basic = *options.basic;
  if (options.weights) schedule.weights = parse_weights(*options.weights);
  schedule.in_flight = options.in_flight;
  if (options.overflow) {
    schedule.overflow = *options.overflow == "literal" ? Overflow::kLiteral : Overflow::kHold;
  }
  schedule.without = options.without;
  if (options.slices) schedule.slices = *options.slices == "on";
  if (options.objective) schedule.objective = find_objective(*options.objective);
  schedule.min_rate_per_ms = options.min_rate;
  if (options.power_cap) schedule.power_cap_w = parse_watts(*options.power_cap);
  schedule.strict = options.strict;
  schedule.draw = find_draw(options.draw);
  if (options.duration) schedule.duration = parse_duration(*options.duration);
  schedule.seed = options.seed;
  if (options.faults) schedule.faults = parse_faults(*options.faults);
  if (options.trace) schedule.trace = options.trace.path();
  return schedule;
}

/// What is scheduled on what.
struct Inputs {
  Platform platform;
  std::optional<Profile> profile;
  Mix mix;

  [[nodiscard]] RunRecord run(const ScheduleOptions& options) const {
    return run_with_intervals(platform, profile ? &*profile : nullptr, mix, options);
  }
  [[nodiscard]] RunRecord run_live(const ScheduleOptions& options, const LiveOptions& live) const {
    return pirt::run_live(platform, profile ? &*profile : nullptr, mix, options, live);
  }
};

Inputs read_inputs(const ScheduleFlags& options) {
  Inputs inputs;
  const auto own = options.own.all(options.mix);
  if (options.live) load(own);
  if (!options.profile) learn(own);
  if (!options.profile) inputs.mix = load_mix(options.mix);  // First: it costs nothing to mend.
  if (!options.profile && !options.platform) {
    throw_bad_input(
        "give --profile FILE (from pirt characterize), or --platform with a modelled one (pirt "
        "list platforms)");
  }
  if (find_draw(options.draw) != Draw::kMedian && !options.profile) {
    throw_bad_input("--draw " + options.draw +
                    " is about the rows of a profile; give one with --profile");
  }
  const auto overrides = parse_overrides(options.settings);
  auto read = read_platform(options.platform, options.profile, overrides, own, options.mix);
  // The profile says what workloads of its own it has.
  if (options.profile) inputs.mix = load_mix(options.mix);
  if (read.profile && find_draw(options.draw) == Draw::kSamples) {
    ProfileReader(*options.profile).read_samples(*read.profile);
  }
  fill_sizes(read, inputs.mix, options.estimate);
  inputs.platform = std::move(read.platform);
  inputs.profile = std::move(read.profile);
  if (options.seed_given && !options.live && find_draw(options.draw) != Draw::kSamples &&
      !draws_times(inputs.platform, inputs.mix)) {
    warn("--seed changes nothing: every call takes the time that is known of it" +
         std::string(inputs.profile ? "; --draw samples draws one of its samples" : "") +
         (options.faults ? "; --faults has a seed of its own" : ""));
  }
  if (options.slices == "on" && std::ranges::none_of(inputs.platform.units, can_suspend_calls)) {
    warn("--slices on changes nothing: no unit of platform " + inputs.platform.name +
         " suspends calls; one does of the host's cores, or modelled, with one slot, one server "
         "and no contexts");
  }
  const auto closed = [](const Pipeline& pipeline) { return pipeline.frames.has_value(); };
  if (options.in_flight && std::ranges::none_of(inputs.mix.pipelines, closed)) {
    throw_bad_input("--in-flight is about closed loops, and every pipeline of mix " +
                    inputs.mix.name + " has a rate; leave it out");
  }
  return inputs;
}

/// Whether it did less than was asked of it.
bool is_short(const RunRecord& run) { return run.stalled > 0 || misses_rate(run); }

/// A cap that no schedule keeps is an answer, and no bad input.
bool is_infeasible(const Inputs& inputs, const ScheduleOptions& settings) {
  const Platform opened =
      on_devices(inputs.platform, inputs.profile ? &*inputs.profile : nullptr, settings.without);
  if (!settings.power_cap_w || above_idle_j(opened, *settings.power_cap_w) >= 0) return false;
  say(infeasible_cap(opened, *settings.power_cap_w));
  return true;
}

int compare(const ScheduleFlags& options) {
  const auto modes = options.compare.empty() ? policy_names() : find_policies(options.compare);
  const auto settings = schedule_options(options, modes);
  const Inputs inputs = read_inputs(options);
  if (is_infeasible(inputs, settings)) return kExitCheckFailed;
  const ModeRuns runs = run_modes(inputs.platform, inputs.profile ? &*inputs.profile : nullptr,
                                  inputs.mix, modes, settings);
  if (runs.runs.empty()) throw_bad_input(runs.skipped.front().reason);
  emit(render(comparison_document(runs, inputs.mix), Format::kText), comparison_json(runs),
       options.json);
  return std::ranges::any_of(runs.runs, is_short) ? kExitCheckFailed : 0;
}

int show_pareto(const ScheduleFlags& options) {
  const auto settings = schedule_options(options, paper_modes());
  const Inputs inputs = read_inputs(options);
  if (is_infeasible(inputs, settings)) return kExitCheckFailed;
  const ModeRuns runs = run_frontier(inputs.platform, inputs.profile ? &*inputs.profile : nullptr,
                                     inputs.mix, paper_modes(), settings);
  emit(render(pareto_document(runs), Format::kText), pareto_json(runs), options.json);
  return 0;
}

/// The phases of calls, each with its times.
/// @param launch  Of the profile, whose row stays where nobody asked the device: a part of what the
/// calls took to execute.
std::map<Phase, std::vector<Nanos>> samples_of(const std::vector<CallTimes>& calls,
                                               const std::vector<Phase>& phases, Nanos launch) {
  std::map<Phase, std::vector<Nanos>> samples;
  const bool stamped =
      std::ranges::all_of(calls, [](const CallTimes& call) { return call.launch.has_value(); });
  for (const Phase phase : phases) {
    if (is_setup(phase) || (phase == Phase::kLaunch && !stamped)) continue;
    const Nanos other = phase == Phase::kExecute && !stamped ? launch : Nanos(0);
    for (const CallTimes& call : calls) {
      samples[phase].push_back(std::max(Nanos(0), call.of(phase) - other));
    }
  }
  return samples;
}

/// Rows of the profile that the run contradicts, measured anew by its calls. Those of units whose
/// time the machine's clock does not tell stay as they are.
std::vector<LiveRow> rows_to_update(const RunRecord& record, const LiveCalls& calls,
                                    const Profile& profile) {
  std::vector<LiveRow> rows;
  for (const RowCheck& check : check_rows(record, &profile)) {
    if (check.finding != RowFinding::kContradicted) continue;
    const auto unit = std::ranges::find(calls.units, check.live.unit, &LiveCalls::Unit::unit);
    const auto series = std::ranges::find_if(calls.series, [&](const auto& each) {
      return each.workload == check.live.workload && each.unit == check.live.unit;
    });
    if (unit == calls.units.end() || series == calls.series.end()) continue;
    const PhaseRow& row = *profile.find(series->workload, series->unit, Phase::kCall);
    const EnergyRow* energy = profile.find_energy(series->workload, series->unit);
    const PhaseRow* launch = profile.find(series->workload, series->unit, Phase::kLaunch);
    const bool metered = energy != nullptr && energy->provenance == Provenance::kMeasured;
    rows.push_back(
        {.replaced = row,
         .metered = metered,
         .samples = samples_of(series->calls, find_backend(row.backend).phases(),
                               launch != nullptr ? launch->median.value_or(Nanos(0)) : Nanos(0))});
  }
  return rows;
}

void update_profile(ProfileWriter& writer, const Inputs& inputs, const RunRecord& record,
                    const LiveCalls& calls) {
  const auto rows = rows_to_update(record, calls, *inputs.profile);
  if (rows.empty()) {
    say(inputs.profile->path + ": the run contradicts no row, nothing is updated");
    return;
  }
  std::map<std::string, DeviceInfo> devices;
  std::vector<std::string> names;
  for (const LiveRow& row : rows) {
    const std::string& unit = row.replaced.unit;
    devices[unit] = std::ranges::find(calls.units, unit, &LiveCalls::Unit::unit)->device;
    names.push_back(row.replaced.workload + " on " + unit);
  }
  const auto run_id = write_live_rows(writer, inputs.platform, devices, record.seed, rows);
  say(fmt::format("{}: run {} has what the live run contradicts, measured anew: {}",
                  inputs.profile->path, run_id, join(names, ", ")));
}

int schedule(const ScheduleFlags& options) {
  if (options.comparing) return compare(options);
  if (options.pareto) return show_pareto(options);
  if (options.mode.empty()) {
    throw_bad_input("give --mode (" + join(policy_names(), ", ") + "), --compare or --pareto");
  }
  const auto settings = schedule_options(options, {options.mode});
  const Inputs inputs = read_inputs(options);
  if (is_infeasible(inputs, settings)) return kExitCheckFailed;
  LiveOptions live;
  live.prepare_first = !options.no_preinit;
  const auto* stops = options.live ? count_stop_signals() : nullptr;
  if (options.live) live.stop = [stops] { return stops->load(); };
  live.progress = say;
  std::optional<ProfileWriter> writer;  // Before the run: what cannot be written is said now.
  LiveCalls calls;
  if (options.update_profile) {
    FileWait waiting;
    waiting.longest.reset();  // The run cannot be had again.
    waiting.notice = warn;
    writer.emplace(*options.profile, waiting);
    live.calls = [&calls](LiveCalls made) { calls = std::move(made); };
  }
  const auto record = options.live ? inputs.run_live(settings, live) : inputs.run(settings);
  warn_all(record.warnings);
  Results results;
  results.emit(render(run_document(record), Format::kText), to_json(record), options.json);
  if (!record.trace_problem.empty()) results.add(record.trace_problem);
  std::exception_ptr not_updated;
  try {
    if (writer) update_profile(*writer, inputs, record, calls);
  } catch (const Error&) {
    not_updated = std::current_exception();
  }
  results.check();
  if (not_updated) std::rethrow_exception(not_updated);
  if (stops != nullptr && *stops > 0) return kExitEnvironment;
  return is_short(record) ? kExitCheckFailed : 0;
}

}  // namespace

void add_schedule(CLI::App& app, Action& action) {
  auto options = std::make_shared<ScheduleFlags>();
  Command command(app, "schedule", "Schedule a robot's mix on a platform, in virtual time or live");
  add_choice(command, "--mode", &options->mode, "MODE", policy_names(), "Policy");
  const Option compare = command.add(
      "--compare", &options->compare,
      "Instead of --mode: run these modes, with commas (default: all), and show them as one table");
  compare.takes(0, 1).type("MODE,...").offers(offer_modes());
  command.add_flag("--pareto", options->pareto,
                   "Instead of --mode: what mode budget reaches with several goals, beside the "
                   "paper's modes, and who is beaten by whom in rate, energy and p99");
  add_input(command, "--profile", &options->profile, "Profile database of pirt characterize");
  add_input(command, "--platform", &options->platform,
            "A name of `pirt list platforms`, or a YAML file (default: the profile's)",
            FileUse::kReadIfFile)
      .offers(offer_platforms());
  add_settings(command, options->settings);
  add_input(command, "--mix", &options->mix, "A name of `pirt list mixes`, or a YAML file",
            FileUse::kReadIfFile)
      .offers(offer_mixes())
      .shows_default();
  add_workloads(command, options->own);
  add_value(command, "--duration", &options->duration, "DURATION", no_duration,
            "Time in which pipelines with a rate fire, e.g. 60s (the default) or 2min");
  add_value(command, "--weights", &options->weights, "UNIT=WEIGHT,...", no_weights,
            "Weights of the units, e.g. gpu=4,cpu=3 (default: the platform's, else derived)")
      .offers(offer_units("="));
  add_value(command, "--in-flight", &options->in_flight, "INTEGER", not_within(1, 1'000'000),
            "Frames in flight of closed loops (default: the platform's, else derived)");
  add_text(command, "--basic", &options->basic, "MODE",
           "Fallback of mode advanced (default: throughput)")
      .offers(offer_modes());
  add_choice(
      command, "--overflow", &options->overflow, "HOW", {"hold", "literal"},
      "When all queues are full, Algorithms 2 and 3 hold the task (the default) or take their "
      "literal `else`");
  add_choice(command, "--objective", &options->objective, "WHAT", objective_names(),
             "What mode budget is for once deadlines are met: most tasks a millisecond, then least "
             "energy (rate, the default), or least energy or latency first");
  add_value(command, "--min-rate", &options->min_rate, "NUMBER", not_within(1e-9, 1e9),
            "Mode budget: complete at least so many tasks a millisecond, whatever the objective");
  add_value(command, "--power-cap", &options->power_cap, "WATTS", no_watts,
            "Mode budget: draw no more in any second, e.g. 11W; tasks with a deadline may, and are "
            "counted");
  add_list_of(command, "--without", options->without, "UNIT,...",
              "Units that serve nothing, as if they were away from the beginning")
      .offers(offer_units());
  add_choice(command, "--slices", &options->slices, "WHETHER", {"on", "off"},
             "Let tasks with a nearer deadline in between two slices of a call, where its workload "
             "can be left there (default: on in mode budget, off in others)");
  add_strict(command, options->strict);
  add_estimate_option(command, options->estimate);
  add_choice(command, "--draw", &options->draw, "HOW", draw_names(),
             "What a call on a profiled unit takes; samples: one of its samples at a time, drawn "
             "with --seed")
      .shows_default();
  const Option seed =
      add_seed(command, options->seed, "Seed of drawn durations, and live of inputs");
  command.add_flag("--live", options->live,
                   "By the machine's clock: real kernels on units with a backend; the others are "
                   "paced by their stages");
  command.add_flag("--no-preinit", options->no_preinit,
                   "Prepare a kernel only when its first task comes");
  command.add_flag(
      "--update-profile", options->update_profile,
      "Rows that the run contradicts are measured anew by it, as a run of their own in "
      "the database");
  add_text(command, "--faults", &options->faults, "seed=N,...",
           "Let calls fail (fail=0.02 of them) and units give tasks back (return=0.02), by a seed");
  add_output(command, "--trace", options->trace,
             "Write what happened to a file, for Perfetto (ui.perfetto.dev) and pirt replay",
             StdoutUse::kRefused);
  add_json(command, options->json);
  for (const auto* name : {"--mode", "--live", "--trace"}) compare.excludes(command.option(name));
  for (const auto* name : {"--mode", "--compare", "--live", "--trace", "--objective", "--min-rate"})
    command.option("--pareto").excludes(command.option(name));
  for (const auto* name : {"--no-preinit", "--update-profile"})
    command.option(name).needs(command.option("--live"));
  for (const auto* name : {"--strict", "--estimate", "--update-profile"})
    command.option(name).needs(command.option("--profile"));
  command.footer(
      "Example: pirt schedule --mode energy --platform snapdragon820 --mix convolution-1000");
  command.runs(action, [options, compare, seed] {
    options->comparing = compare.given();
    options->seed_given = seed.given();
    return schedule(*options);
  });
}

}  // namespace pirt::cli
