#include "reports/run/robot_report.h"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "reports/document/figures.h"
#include "scheduler/services/devices.h"
#include "workloads/base/text/json.h"

namespace pirt {
namespace {

std::string sensors_of(const slam::Setup& setup) {
  return fmt::format("{} camera{}, {}", setup.cameras.size(), setup.cameras.size() == 1 ? "" : "s",
                     setup.imu ? "IMU" : "no IMU");
}

/// "found", "not found", or "sought" where the run was stopped before it could be.
std::string map_status(const RobotRun& run) {
  if (run.summary.known_map->found_after_s) return "found";
  return run.result.stopped ? "sought" : "not found";
}

std::string known_map_text(const RobotRun& run) {
  if (!run.summary.known_map) return "";
  const auto& known = *run.summary.known_map;
  return fmt::format("loaded map     {} ({} points){}\n", map_status(run), known.points,
                     known.found_after_s
                         ? fmt::format(", {:.2f} s after the start; all poses are in its world",
                                       *known.found_after_s)
                         : "; the poses are in a world of the run's own");
}

std::string frames_text(const RobotRun& run) {
  const auto& s = run.summary;
  const auto& r = run.result;
  std::string text =
      fmt::format("frames         {}: {} tracking, {} starting, {} lost; {} without contrast\n",
                  s.frames, s.tracking, s.starting, s.lost, s.unusable);
  if (r.dropped + r.failed > 0 || !run.mode.empty()) {
    text += fmt::format("               of {} that came; {} dropped, {} failed\n", r.arrived,
                        r.dropped, r.failed);
  }
  if (r.run.left_out > 0) {
    text +=
        fmt::format("               {} left out: their pictures cannot be read\n", r.run.left_out);
  }
  const char* rate = "as fast as it goes";
  if (run.own_rate) rate = "at the sequence's own rate";
  if (!run.own_rate && run.mode.empty()) rate = "as fast as it goes, pictures are read apart";
  text += fmt::format("rate           {:.1f} Hz ({})\n", s.rate_hz, rate);
  text += fmt::format("latency, ms    p50 {:.2f}, p95 {:.2f}, p99 {:.2f}, from arrival to pose\n",
                      run.latency.p50_ms, run.latency.p95_ms, run.latency.p99_ms);
  return text +
         fmt::format("map            {} landmarks in the filter, {} points outside\n", s.landmarks,
                     s.map_points) +
         known_map_text(run);
}

slam::StageSummary summary_of(const ActivityCounts& counts) {
  std::vector<double> ms;
  for (const Nanos latency : counts.latencies) ms.push_back(to_ms(latency));
  return slam::summary_of(counts.name, std::move(ms));
}

const ActivityCounts* find(const RobotRun& run, std::string_view name) {
  const auto found = std::ranges::find(run.activities, name, &ActivityCounts::name);
  return found == run.activities.end() ? nullptr : &*found;
}

/// Of what recognizes, whatever does.
const ActivityCounts* recognitions(const RobotRun& run) {
  const auto* own = find(run, "recognize");
  return own != nullptr ? own : find(run, "alexnet");
}

double per_second(const RobotRun& run, const ActivityCounts& counts) {
  const double s = to_s(run.result.duration);
  return s > 0 ? static_cast<double>(counts.completed) / s : 0.0;
}

/// Servers at work, and what units draw whatever they do, by the platform's watts; 0 if it states
/// none of a unit that served, or also joules an operation, a byte or a call, which nobody counts
/// here.
double energy_of(const RuntimeOptions& runtime, const LocalizationResult& result, bool live) {
  const Platform platform =
      on_devices(runtime.platform, runtime.profile ? &*runtime.profile : nullptr);
  double energy_j = 0;
  bool charged = live;  // Without the runtime all is the work of one unit.
  for (const UnitModel& unit : platform.units) {
    if (!unit.measured()) continue;
    Nanos busy{0};
    for (const auto& each : result.statistics.units) {
      if (each.name == unit.name) busy = each.powered;
    }
    if (unit.backend == "cpu" && !std::exchange(charged, true)) busy = result.busy;
    const bool by_watts =
        platform.states_power(unit) && unit.op_pj + unit.byte_pj + unit.call_j == 0;
    if (busy > Nanos::zero() && !by_watts) return 0;
    energy_j += unit.active_w * to_s(busy) + unit.standing_w() * to_s(result.duration);
  }
  return energy_j;
}

/// Which unit served what, and what went wrong.
std::string units_text(const RobotRun& run) {
  if (run.mode.empty()) return "";
  std::string text = "\n";
  for (const auto& [workload, units] : run.result.served) {
    std::string served;
    for (const auto& [unit, calls] : units) {
      served += fmt::format("{}{} {}", served.empty() ? "" : ", ", unit, calls);
    }
    text += fmt::format("{:<17} {}\n", workload, served);
  }
  for (const auto& unit : run.result.statistics.units) {
    text += fmt::format("unit {:<12} busy for {:.2f} s{}\n", unit.name, to_s(unit.busy),
                        unit.in_service ? "" : ", out of service");
  }
  return text;
}

bool is_some(const slam::MapChange& change) {
  return change.replaced + change.added + change.refused > 0;
}

std::string activities_text(const RobotRun& run) {
  if (run.activities.empty()) return "";
  std::string text =
      fmt::format("\n{:<17} {:>8} {:>8} {:>8} {:>8} {:>8} {:>8} {:>8}\n", "besides, ms", "deadline",
                  "p50", "p95", "p99", "late", "done", "of");
  for (const ActivityCounts& each : run.activities) {
    const auto latency = summary_of(each);
    text += fmt::format(
        "{:<17} {:>8} {:>8.2f} {:>8.2f} {:>8.2f} {:>8} {:>8} {:>8}{}\n", each.name,
        each.deadline > Nanos::zero() ? fmt::format("{:.1f}", to_ms(each.deadline)) : "-",
        latency.p50_ms, latency.p95_ms, latency.p99_ms, each.late, each.completed, each.fired,
        each.skipped > 0 ? fmt::format(", {} skipped", each.skipped) : "");
  }
  if (const auto* plans = find(run, "plan_path")) {
    text += fmt::format("paths          found by {} of {} plans, the last of {:.2f} m\n",
                        run.plans.found, plans->completed, run.plans.last_m);
  }
  if (run.keyframes_after) {
    text += fmt::format("keyframes      RMS {:.4f} m before they were adjusted, {:.4f} m after\n",
                        run.keyframes_before->ate_rms_m, run.keyframes_after->ate_rms_m);
  }
  if (const auto& change = run.summary.map_change; is_some(change)) {
    text += fmt::format("               {} points of the map replaced by theirs, {} added{}\n",
                        change.replaced, change.added,
                        change.refused > 0 ? fmt::format(", {} too far off", change.refused) : "");
  }
  if (run.energy_j > 0) {
    text += fmt::format("power          {}{:.2f} W ({}{:.1f} J by the platform's watts)\n",
                        mark(run.watts), run.energy_j / to_s(run.result.duration), mark(run.watts),
                        run.energy_j);
  }
  return text;
}

/// Not by less than a centimetre, of which an error is no part that tells anything.
bool moves(const TrajectoryError& error) { return error.path_m >= 0.01; }

std::string errors_text(const slam::RunSummary& s) {
  if (!s.error) return "\nfewer than 3 poses have truth: errors are not known\n";
  const auto& e = *s.error;
  std::string text = fmt::format(
      "\nposition       RMS {:.4f} m, most {:.4f} m, {} ({})\n", e.ate_rms_m, e.ate_max_m,
      moves(e)
          ? fmt::format("{:.3f} % of the path of {:.2f} m", 100 * e.ate_rms_m / e.path_m, e.path_m)
          : "standing still",
      s.scale_known ? "SE(3)-aligned" : "Sim(3)-aligned: the scale is not known");
  if (s.constant_velocity_ate_rms_m) {
    text += fmt::format("               (constant velocity: RMS {:.4f} m)\n",
                        *s.constant_velocity_ate_rms_m);
  }
  for (const auto& turn : s.turns) {
    text += fmt::format("{:<15}{:.4f} degrees over {} (no turn at all: {:.4f})\n",
                        turn.frames == 1 ? "rotation" : "", turn.mean_deg,
                        turn.frames == 1 ? "1 frame" : fmt::format("{} frames", turn.frames),
                        turn.trivial_deg);
  }
  return text +
         (e.rotation_error_mean_deg
              ? fmt::format("attitude       {:.4f} degrees, aligned\n", *e.rotation_error_mean_deg)
              : "attitude       not known: the path is too straight to align it\n");
}

Json stage_json(const slam::StageSummary& stage) {
  return {{"name", stage.name},
          {"mean_ms", stage.mean_ms},
          {"p50_ms", stage.p50_ms},
          {"p95_ms", stage.p95_ms},
          {"p99_ms", stage.p99_ms}};
}

void add_errors(const slam::RunSummary& s, Json& json) {
  if (!s.error) return;
  json["alignment"] = s.scale_known ? "se3" : "sim3";
  json["path_m"] = s.error->path_m;
  json["ate_rms_m"] = s.error->ate_rms_m;
  json["ate_max_m"] = s.error->ate_max_m;
  json["scale"] = s.error->scale;
  for (const auto& turn : s.turns) {
    const auto over = turn.frames == 1 ? "mean" : fmt::format("{}_frames", turn.frames);
    json["rotation_error_" + over + "_deg"] = turn.mean_deg;
    json["rotation_trivial_" + over + "_deg"] = turn.trivial_deg;
  }
  if (s.error->rotation_error_mean_deg) {
    json["attitude_error_mean_deg"] = *s.error->rotation_error_mean_deg;
  }
  if (s.constant_velocity_ate_rms_m) {
    json["constant_velocity_ate_rms_m"] = *s.constant_velocity_ate_rms_m;
  }
}

}  // namespace

RobotRun robot_run(std::string driver, std::string mode, const Sequence& sequence,
                   const LocalizationOptions& options, LocalizationResult result,
                   const Activities* activities) {
  RobotRun run{.driver = std::move(driver),
               .mode = std::move(mode),
               .own_rate = options.own_rate,
               .setup = options.setup,
               .summary = {},
               .latency = {},
               .result = std::move(result),
               .activities = {},
               .keyframes_before = {},
               .keyframes_after = {}};
  run.summary = slam::summarize(sequence, run.result.run, options.setup);
  std::vector<double> ms;
  for (const Nanos latency : run.result.latencies) ms.push_back(to_ms(latency));
  run.latency = slam::summary_of("latency", std::move(ms));
  run.summary.rate_hz = run.result.rate_hz();
  if (activities != nullptr) {
    run.activities = activities->counts();
    run.plans = activities->plans();
    run.scenes = activities->scenes();
    run.map_from_world = activities->map_from_world();
    const auto [before, after] = activities->adjusted();
    if (can_align(before, sequence.truth)) {
      const auto alignment = run.summary.scale_known ? Alignment::kSe3 : Alignment::kSim3;
      run.keyframes_before = evaluate(before, sequence.truth, alignment);
      run.keyframes_after = evaluate(after, sequence.truth, alignment);
    }
  }
  if (options.own_rate) {
    run.energy_j = energy_of(options.runtime, run.result, !run.mode.empty());
  }
  return run;
}

std::string robot_text(const RobotRun& run) {
  std::string text =
      fmt::format("driver         {}{}\nsensors        {}\n", run.driver,
                  run.result.stopped ? ", stopped before its time" : "", sensors_of(run.setup));
  text += frames_text(run);
  text +=
      fmt::format("\n{:<17} {:>8} {:>8} {:>8} {:>8}\n", "stage, ms", "mean", "p50", "p95", "p99");
  for (const auto& stage : run.summary.stages) {
    text += fmt::format("{:<17} {:>8.3f} {:>8.3f} {:>8.3f} {:>8.3f}\n", stage.name, stage.mean_ms,
                        stage.p50_ms, stage.p95_ms, stage.p99_ms);
  }
  return text + activities_text(run) + units_text(run) + errors_text(run.summary);
}

Json robot_json(const RobotRun& run, const std::string& dataset) {
  const auto& s = run.summary;
  const auto& r = run.result;
  Json json = {{"schema_version", 1},
               {"dataset", dataset},
               {"driver", run.driver},
               {"own_rate", run.own_rate},
               {"stopped", r.stopped},
               {"cameras", run.setup.cameras.size()},
               {"imu", run.setup.imu.has_value()},
               {"update", run.setup.update},
               {"arrived", r.arrived},
               {"dropped", r.dropped},
               {"failed", r.failed},
               {"left_out", r.run.left_out},
               {"frames", s.frames},
               {"frames_tracking", s.tracking},
               {"frames_starting", s.starting},
               {"frames_lost", s.lost},
               {"frames_without_contrast", s.unusable},
               {"rate_hz", s.rate_hz},
               {"latency_p50_ms", run.latency.p50_ms},
               {"latency_p95_ms", run.latency.p95_ms},
               {"latency_p99_ms", run.latency.p99_ms},
               {"landmarks", s.landmarks},
               {"map_points", s.map_points}};
  if (s.known_map) {
    json["map"] = map_status(run);
    json["known_map_points"] = s.known_map->points;
    if (s.known_map->found_after_s) json["map_found_after_s"] = *s.known_map->found_after_s;
  }
  if (!run.mode.empty()) {
    json["mode"] = run.mode;
    json["served"] = r.served;
    for (const auto& unit : r.statistics.units) {
      json["units"].push_back({{"name", unit.name},
                               {"in_service", unit.in_service},
                               {"completed", unit.completed},
                               {"busy_s", to_s(unit.busy)}});
    }
  }
  json["problems"] = r.problems;
  for (const ActivityCounts& each : run.activities) {
    const auto latency = summary_of(each);
    json["activities"].push_back({{"name", each.name},
                                  {"fired", each.fired},
                                  {"completed", each.completed},
                                  {"failed", each.failed},
                                  {"skipped", each.skipped},
                                  {"problem", each.problem},
                                  {"late", each.late},
                                  {"rate_hz", per_second(run, each)},
                                  {"p50_ms", latency.p50_ms},
                                  {"p95_ms", latency.p95_ms},
                                  {"p99_ms", latency.p99_ms}});
    if (each.deadline > Nanos::zero()) {
      json["activities"].back()["deadline_ms"] = to_ms(each.deadline);
    }
  }
  if (find(run, "plan_path") != nullptr) {
    json["paths_found"] = run.plans.found;
    json["last_path_m"] = run.plans.last_m;
  }
  if (run.keyframes_after) {
    json["keyframes_ate_rms_m"] = {{"before", run.keyframes_before->ate_rms_m},
                                   {"after", run.keyframes_after->ate_rms_m}};
  }
  if (const auto& change = s.map_change; is_some(change)) {
    json["map_corrected"] = {
        {"replaced", change.replaced}, {"added", change.added}, {"refused", change.refused}};
  }
  if (run.energy_j > 0) {
    json["power_w"] = run.energy_j / to_s(r.duration);
    json["energy_j"] = run.energy_j;
    json["energy_provenance"] = to_string(run.watts);
  }
  for (const auto& stage : s.stages) json["stages"].push_back(stage_json(stage));
  add_errors(s, json);
  return json;
}

namespace {

std::string in_short(std::span<const RobotRun> runs) {
  std::vector<NamedFigure> medians, tails, joules;
  for (const RobotRun& run : runs) {
    const std::string name = run.mode.empty() ? "serial" : run.mode;
    medians.push_back({name, run.latency.p50_ms});
    tails.push_back({name, run.latency.p99_ms});
    if (run.energy_j > 0) joules.push_back({name, run.energy_j});
  }
  return fmt::format("In short: least p50: {}; least p99: {}; least energy: {}.", best_of(medians),
                     best_of(tails), best_of(joules));
}

}  // namespace

Table robot_comparison(std::span<const RobotRun> runs) {
  Table table;
  table.columns = {{"driver", Align::kLeft},
                   {"Hz"},
                   {"p50 ms"},
                   {"p99 ms"},
                   {"dropped"},
                   {"failed"},
                   {"lost"},
                   {"map", Align::kLeft},
                   {"recogn./s"},
                   {"plan p99 ms"},
                   {"late"},
                   {"W"},
                   {"J"},
                   {"RMS m"},
                   {"% of path"},
                   {"degrees a frame"}};
  const auto number = [](bool known, const char* format, double value) {
    return known ? fmt::format(fmt::runtime(format), value) : "-";
  };
  for (const RobotRun& run : runs) {
    const auto& s = run.summary;
    const bool known = s.error.has_value();
    const auto* plans = find(run, "plan_path");
    const auto* seen = recognitions(run);
    const bool powered = run.energy_j > 0;
    table.rows.push_back(
        {run.driver, fmt::format("{:.1f}", s.rate_hz), fmt::format("{:.2f}", run.latency.p50_ms),
         fmt::format("{:.2f}", run.latency.p99_ms), fmt::format("{}", run.result.dropped),
         fmt::format("{}", run.result.failed), fmt::format("{}", s.lost),
         s.known_map ? map_status(run) : "-",
         number(seen != nullptr, "{:.2f}", seen != nullptr ? per_second(run, *seen) : 0),
         number(plans != nullptr, "{:.2f}", plans != nullptr ? summary_of(*plans).p99_ms : 0),
         plans != nullptr ? fmt::format("{}", plans->late) : "-",
         powered ? mark(run.watts) + fmt::format("{:.2f}", run.energy_j / to_s(run.result.duration))
                 : "-",
         powered ? mark(run.watts) + fmt::format("{:.1f}", run.energy_j) : "-",
         number(known, "{:.4f}", known ? s.error->ate_rms_m : 0),
         number(known && moves(*s.error), "{:.3f}",
                known ? 100 * s.error->ate_rms_m / s.error->path_m : 0),
         s.turns.empty() ? "-" : fmt::format("{:.4f}", s.turns.front().mean_deg)});
  }
  table.footnotes = {
      "Localization: Hz and times from a frame's arrival to its pose. recogn./s, plan p99 and late "
      "(plans past their deadline): what it does besides. W and J are by the platform's watts, at "
      "the sequence's own rate only."};
  if (runs.size() > 1) table.footnotes.push_back(in_short(runs));
  return table;
}

}  // namespace pirt
