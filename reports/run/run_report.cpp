#include "reports/run/run_report.h"

#include <fmt/core.h>

#include <algorithm>
#include <filesystem>
#include <functional>
#include <map>
#include <set>
#include <tuple>

#include "characterize/platform/platform.h"
#include "reports/document/figures.h"
#include "workloads/base/text/shell.h"
#include "workloads/base/text/text.h"
#include "workloads/model/phase.h"

namespace pirt {
namespace {

/// What mode budget follows, and what of.
std::string tried_text(const std::vector<TriedPlan>& tried) {
  std::string follows;
  std::vector<std::string> figures;
  for (const TriedPlan& each : tried) {
    if (each.taken) follows = each.name;
    figures.push_back(fmt::format("{} {} late, {} ms a firing, {} mJ a task", each.name, each.late,
                                  figure(each.latency_ms), figure(each.energy_mj)));
  }
  return "follows: " + follows + "; tried before: " + join(figures, "; ");
}

constexpr double kShownSpread = 0.02;

/// Where what a figure is computed from comes from.
struct Inputs {
  std::set<std::string> names;
  bool mixture = false;
};

/// Where a figure of virtual time comes from: it was computed, so it is modelled, or what the
/// weakest of its inputs is.
Origin simulated(const Inputs& inputs) {
  Origin result{Provenance::kModelled, inputs.mixture};
  for (const std::string& input : inputs.names) {
    result = weakest(result, provenance_from_string(input).value_or(Provenance::kModelled));
  }
  return result;
}

Inputs times_of(const UnitResult& unit) {
  return {{unit.provenance.begin(), unit.provenance.end()}, unit.mixture.value_or(false)};
}

Inputs energies_of(const UnitResult& unit) {
  return {{unit.energy_provenance.begin(), unit.energy_provenance.end()},
          unit.energy_mixture.value_or(false)};
}

/// Of the units that the run used.
Inputs inputs_of(const RunRecord& run, Inputs (*of)(const UnitResult&)) {
  Inputs inputs;
  for (const auto& unit : run.units) {
    if (unit.completed == 0) continue;
    const Inputs each = of(unit);
    inputs.names.insert(each.names.begin(), each.names.end());
    inputs.mixture = inputs.mixture || each.mixture;
  }
  return inputs;
}

std::string percent(const std::optional<double>& value, Origin provenance) {
  return value ? marked(fmt::format("{:.1f}", 100 * *value), provenance) : "-";
}

std::string name_of_device(const UnitResult& unit) {
  if (!unit.device) return "model of the platform file";
  const bool disguised = unit.device_is_cpu.value_or(false) && unit.role != to_string(Role::kCpu);
  return *unit.device + (disguised ? " (computes on the host's cores, not a GPU)" : "");
}

Paragraph header(const RunRecord& run) {
  Paragraph paragraph;
  auto mode = run.mode;
  if (run.basic) mode += " over " + *run.basic;
  if (run.overflow) mode += ", overflow " + *run.overflow;
  auto when = run.time + " time";
  if (run.duration_s) when += fmt::format(", pipelines fire for {} s", figure(*run.duration_s));
  if (run.in_flight) when += fmt::format(", {} frames in flight", *run.in_flight);
  paragraph.lines.push_back(
      fmt::format("Mode {}; mix {} on platform {}", mode, run.mix, run.platform));
  paragraph.lines.push_back(
      fmt::format("{}; seed {}{}", when, run.seed, run.profile ? "; profile " + *run.profile : "") +
      (run.draw.value_or("median") != "median" ? ", its " + *run.draw : ""));
  if (run.assumptions) paragraph.lines.push_back(*run.assumptions);
  return paragraph;
}

Paragraph totals(const RunRecord& run) {
  const RunMarks marks = marks_of(run);
  Paragraph paragraph = {
      {fmt::format("{} tasks submitted: {} completed ({} offloaded to the cloud), {} dropped, {} "
                   "expired, {} "
                   "failed, {} queued",
                   run.submitted, run.completed, run.offloaded, run.dropped, run.expired,
                   run.failed, run.queued),
       fmt::format("makespan {} s, {} tasks/ms, latency mean {} ms, p99 {} ms, energy {} J, "
                   "average power {} W",
                   shown(run.makespan_s, marks.time),
                   shown_figure_of(run, "throughput_per_ms", run.throughput_per_ms, marks.time),
                   shown_figure_of(run, "mean_latency_ms", run.mean_latency_ms, marks.time),
                   shown_figure_of(run, "p99_latency_ms", run.p99_latency_ms, marks.time),
                   shown_figure_of(run, "energy_j", run.energy_j, marks.energy),
                   shown_figure_of(run, "average_power_w", run.average_power_w, marks.energy))}};
  if (const std::string doubts = doubts_text(run); !doubts.empty()) {
    paragraph.lines.push_back(doubts);
  }
  if (run.drain_s && *run.drain_s > 0) {
    paragraph.lines.push_back("all as of the end of the duration; what was unfinished then takes " +
                              shown(run.drain_s, marks.time) + " s more");
  }
  if (run.objective) {
    std::string line = "objective " + *run.objective;
    if (run.min_rate_per_ms) {
      line += fmt::format(", at least {} tasks/ms", figure(*run.min_rate_per_ms));
    }
    if (run.power_cap_w) {
      line += fmt::format(", power cap {} W: {} tasks with a deadline went beyond it",
                          figure(*run.power_cap_w), run.over_cap.value_or(0));
    }
    if (run.power_highest_w) {
      line += "; the fullest second drew " + shown(run.power_highest_w, marks.energy) + " W";
    }
    paragraph.lines.push_back(line);
  }
  if (!run.tried.empty()) paragraph.lines.push_back(tried_text(run.tried));
  if (run.suspensions) {
    paragraph.lines.push_back(
        fmt::format("calls were left between two slices {} times, for tasks with a nearer deadline",
                    *run.suspensions));
  }
  if (run.planned_makespan_s) {
    paragraph.lines.push_back("planned makespan " + shown(run.planned_makespan_s, marks.time) +
                              " s");
  }
  return paragraph;
}

/// Absent for records that were written without.
std::optional<Paragraph> bounds(const RunRecord& run) {
  if (!run.bounds) return std::nullopt;
  const RunMarks marks = marks_of(run);
  const RunBounds& b = *run.bounds;
  std::vector<std::string> parts;
  const auto add = [&](const std::string& limit, const std::string& gap) {
    if (gap != "-") parts.push_back(limit + " (gap " + gap + " %)");
  };
  add("throughput at most " + shown(b.throughput_per_ms, marks.time) + " tasks/ms",
      gap_text(run.throughput_per_ms, b.throughput_per_ms));
  add("energy at least " + shown(b.energy_j, marks.energy) + " J",
      gap_text(run.energy_j, b.energy_j));
  add("makespan at least " + shown(b.makespan_s, marks.time) + " s",
      gap_text(run.makespan_s, b.makespan_s));
  return Paragraph{
      {"what no scheduler can beat here: " + join(parts, ", ") + "; gap = reached / bound - 1"}};
}

/// "opencl: times measured; energy modelled".
std::string input_note(const UnitResult& unit) {
  const auto words = [](const std::vector<std::string>& names, const std::optional<bool>& mixture) {
    const std::string sums = mixture.value_or(false) ? " (of sums the weakest)" : "";
    return names.empty() ? "none" : join(names, " and ") + sums;
  };
  std::string note = fmt::format("{}: service times {}, energy {}", unit.unit,
                                 words(unit.provenance, unit.mixture),
                                 words(unit.energy_provenance, unit.energy_mixture));
  if (unit.prepares) {
    note += fmt::format("; loaded another context {} times, {} s of busy", *unit.prepares,
                        figure(unit.prepare_s));
  }
  return note;
}

Table units_table(const RunRecord& run) {
  Table table{.title = "Units",
              .columns = {{"unit", Align::kLeft},
                          {"role", Align::kLeft},
                          {"tasks"},
                          {"mean ms"},
                          {"p99 ms"},
                          {"busy s"},
                          {"busy %"},
                          {"energy J"},
                          {"device", Align::kLeft}}};
  for (const auto& unit : run.units) {
    const Origin time = time_of(run, unit);
    const Origin energy = simulated(energies_of(unit));
    table.rows.push_back({unit.unit, unit.role, fmt::format("{}", unit.completed),
                          shown(unit.mean_latency_ms, time), shown(unit.p99_latency_ms, time),
                          shown(unit.busy_s, time), percent(unit.utilization, time),
                          shown(unit.energy_j, energy), name_of_device(unit)});
    table.footnotes.push_back(input_note(unit));
    if (unit.round_trip_ms) {
      table.footnotes.push_back(
          fmt::format("{}: a round trip of {} ms{}, measured while it ran.", unit.unit,
                      figure(*unit.round_trip_ms),
                      unit.link_mbit_s ? " and " + figure(*unit.link_mbit_s) + " Mbit/s" : ""));
    }
    if (unit.late_replies.value_or(0) > 0) {
      table.footnotes.push_back(
          fmt::format("{}: {} replies came when nobody waited for them any more, and were dropped.",
                      unit.unit, *unit.late_replies));
    }
  }
  table.footnotes.push_back(
      "ms: dispatch to completion. What virtual time computes from measured inputs is modelled.");
  table.footnotes.emplace_back(provenance_legend());
  return table;
}

/// "yes, 4.5 ms", "no, 7.1 ms", "not analysed (served on another's cores: gpu)".
std::string guarantee_text(const PipelineResult& pipeline, Origin time) {
  if (pipeline.not_analysed) return "not analysed (" + *pipeline.not_analysed + ")";
  if (!pipeline.guaranteed) return "-";
  const std::string bound = pipeline.response_bound_ms
                                ? "at most " + shown(pipeline.response_bound_ms, time) + " ms"
                                : "no limit found";
  return (*pipeline.guaranteed ? "yes, " : "no, ") + bound;
}

/// "3", "3 (1 without a predecessor)".
std::string dropped_text(const PipelineResult& pipeline) {
  const std::int64_t first = pipeline.no_predecessor.value_or(0);
  return fmt::format("{}", pipeline.dropped) +
         (first > 0 ? fmt::format(" ({} without a predecessor)", first) : "");
}

Table pipelines_table(const RunRecord& run) {
  const RunMarks marks = marks_of(run);
  Table table{.title = "Pipelines",
              .columns = {{"pipeline", Align::kLeft},
                          {"fired"},
                          {"completed"},
                          {"dropped"},
                          {"unfinished"},
                          {"rate Hz"},
                          {"p50 ms"},
                          {"p95 ms"},
                          {"p99 ms"},
                          {"deadline ms"},
                          {"misses"}}};
  for (const auto& pipeline : run.pipelines) {
    table.rows.push_back(
        {pipeline.pipeline, fmt::format("{}", pipeline.fired),
         fmt::format("{}", pipeline.completed), dropped_text(pipeline),
         fmt::format("{}", pipeline.unfinished), shown(pipeline.rate_hz, marks.time),
         shown(pipeline.p50_ms, marks.time), shown(pipeline.p95_ms, marks.time),
         shown_figure_of(run, "pipelines." + pipeline.pipeline + ".p99_ms", pipeline.p99_ms,
                         marks.time),
         pipeline.deadline_ms ? figure(*pipeline.deadline_ms) : "-",
         pipeline.deadline_misses ? fmt::format("{}", *pipeline.deadline_misses) : "-"});
    if (run.objective) table.rows.back().push_back(guarantee_text(pipeline, marks.time));
  }
  if (run.objective) {
    table.columns.push_back({"guaranteed", Align::kLeft});
    table.footnotes.emplace_back(
        "guaranteed: what a firing takes at most if no call takes longer than the plan's worst.");
  }
  table.footnotes.emplace_back(
      "Firings, not tasks; ms: firing to the completion of its last task. misses: completed late, "
      "or "
      "unfinished past the deadline.");
  return table;
}

Table plan_table(const RunRecord& run) {
  const RunMarks marks = marks_of(run);
  Table table{
      .title = "Plan",
      .columns = {{"task", Align::kLeft}, {"unit", Align::kLeft}, {"start ms"}, {"finish ms"}}};
  auto plan = run.plan;
  std::ranges::stable_sort(plan, {}, &PlanRow::start_ms);
  for (const auto& each : plan) {
    table.rows.push_back({each.pipeline + "." + each.task, each.unit,
                          shown(each.start_ms, marks.time), shown(each.finish_ms, marks.time)});
  }
  return table;
}

Table weights_table(const RunRecord& run) {
  Table table{.title = "Weights", .columns = {{"workload", Align::kLeft}}};
  for (const auto& unit : run.units) table.columns.push_back({unit.unit});
  for (const auto& [workload, weights] : run.weights) {
    std::vector<std::string> row = {workload};
    for (const auto& unit : run.units) {
      const auto found = weights.find(unit.unit);
      row.push_back(found == weights.end() ? "-" : std::to_string(found->second));
    }
    table.rows.push_back(std::move(row));
  }
  const bool cloud = std::ranges::any_of(
      run.units, [](const UnitResult& unit) { return unit.role == to_string(Role::kCloud); });
  table.footnotes = {std::string("-: the unit has no valid profile or model of the workload") +
                     (cloud ? "; a cloud, to which a task goes or not, has no weights." : ".")};
  return table;
}

/// One figure of a run, as it is printed.
using Cell = std::function<std::string(const RunRecord&)>;

/// Names in order of first appearance.
template <typename Part>
std::vector<std::string> names_of(std::span<const RunRecord> runs,
                                  std::vector<Part> RunRecord::*parts, std::string Part::*name) {
  std::vector<std::string> names;
  for (const auto& run : runs) {
    for (const auto& part : run.*parts) {
      if (std::ranges::find(names, part.*name) == names.end()) names.push_back(part.*name);
    }
  }
  return names;
}

class ModesTable {
 public:
  explicit ModesTable(std::span<const RunRecord> runs) : runs_(runs) {}

  void row(const std::string& what, const Cell& cell) {
    std::vector<std::string> cells = {what};
    for (const auto& run : runs_) cells.push_back(cell(run));
    rows_.push_back(std::move(cells));
  }
  void count(const std::string& what, std::int64_t RunRecord::*member) {
    row(what, [member](const RunRecord& run) { return fmt::format("{}", run.*member); });
  }
  void unit_row(const std::string& unit, const std::string& what,
                const std::function<std::string(const UnitResult&, Origin)>& cell) {
    row(unit + ": " + what, [&](const RunRecord& run) {
      const auto* found = run.find_unit(unit);
      return found == nullptr ? std::string("-") : cell(*found, time_of(run, *found));
    });
  }
  void pipeline_row(const std::string& pipeline, const std::string& what,
                    const std::function<std::string(const PipelineResult&, Origin)>& cell) {
    row(pipeline + ": " + what, [&](const RunRecord& run) {
      const auto* found = run.find_pipeline(pipeline);
      return found == nullptr ? std::string("-") : cell(*found, marks_of(run).time);
    });
  }
  [[nodiscard]] std::vector<std::vector<std::string>> take() { return std::move(rows_); }

 private:
  std::span<const RunRecord> runs_;
  std::vector<std::vector<std::string>> rows_;
};

void add_totals(ModesTable& table) {
  table.count("tasks submitted", &RunRecord::submitted);
  table.count("completed", &RunRecord::completed);
  table.count("dropped", &RunRecord::dropped);
  table.count("expired", &RunRecord::expired);
  table.count("failed", &RunRecord::failed);
  table.count("queued", &RunRecord::queued);
  table.count("offloaded to the cloud", &RunRecord::offloaded);
  table.row("throughput, tasks/ms", [](const RunRecord& run) {
    return shown_figure_of(run, "throughput_per_ms", run.throughput_per_ms, marks_of(run).time);
  });
  table.row("task latency, mean ms", [](const RunRecord& run) {
    return shown_figure_of(run, "mean_latency_ms", run.mean_latency_ms, marks_of(run).time);
  });
  table.row("task latency, p99 ms", [](const RunRecord& run) {
    return shown_figure_of(run, "p99_latency_ms", run.p99_latency_ms, marks_of(run).time);
  });
  table.row("energy, J", [](const RunRecord& run) {
    return shown_figure_of(run, "energy_j", run.energy_j, marks_of(run).energy);
  });
  table.row("average power, W", [](const RunRecord& run) {
    return shown_figure_of(run, "average_power_w", run.average_power_w, marks_of(run).energy);
  });
  table.row("throughput gap to the bound, %", [](const RunRecord& run) {
    return run.bounds ? gap_text(run.throughput_per_ms, run.bounds->throughput_per_ms) : "-";
  });
  table.row("energy gap to the bound, %", [](const RunRecord& run) {
    return run.bounds ? gap_text(run.energy_j, run.bounds->energy_j) : "-";
  });
}

void add_unit(ModesTable& table, const std::string& name) {
  table.unit_row(name, "tasks",
                 [](const UnitResult& unit, Origin) { return fmt::format("{}", unit.completed); });
  table.unit_row(name, "mean latency, ms", [](const UnitResult& unit, Origin time) {
    return shown(unit.mean_latency_ms, time);
  });
  table.unit_row(name, "busy, %", [](const UnitResult& unit, Origin time) {
    return percent(unit.utilization, time);
  });
}

void add_pipeline(ModesTable& table, const std::string& name) {
  table.pipeline_row(name, "rate, Hz",
                     [](const PipelineResult& p, Origin time) { return shown(p.rate_hz, time); });
  table.pipeline_row(name, "p99, ms",
                     [](const PipelineResult& p, Origin time) { return shown(p.p99_ms, time); });
  table.pipeline_row(name, "unfinished", [](const PipelineResult& p, Origin) {
    return fmt::format("{}", p.unfinished);
  });
  table.pipeline_row(name, "deadline misses", [](const PipelineResult& p, Origin) {
    return p.deadline_misses ? fmt::format("{}", *p.deadline_misses) : std::string("-");
  });
}

/// What distinguishes it from the platform of that name: " (cpu.active_w=15, --without gpu)".
std::string changes_of(const RunRecord& run) {
  std::vector<std::string> changes = run.settings;
  changes.insert(changes.end(), run.besides.begin(), run.besides.end());
  return changes.empty() ? "" : " (" + join(changes, ", ") + ")";
}

bool has_one_time(std::span<const RunRecord> runs) {
  return std::ranges::all_of(runs, [&](const RunRecord& run) { return run.time == runs[0].time; });
}

std::vector<std::string> footnotes(std::span<const RunRecord> runs) {
  std::vector<std::string> notes;
  const auto add = [&](const std::string& note) {
    if (std::ranges::find(notes, note) == notes.end()) notes.push_back(note);
  };
  const auto as_first = [&](const RunRecord& run) { return ran_the_same(run, runs[0]); };
  if (!std::ranges::all_of(runs, as_first)) {
    for (const auto& run : runs) {
      add(fmt::format(
          "NOT COMPARABLE: {} ran {} on {}{}, seed {}{}{}", run.mode, run.mix, run.platform,
          changes_of(run), run.seed,
          run.duration_s ? fmt::format(", {} s", figure(*run.duration_s)) : "",
          run.profile ? ", profile " + *run.profile + ", " + run.draw.value_or("median") : ""));
    }
  }
  for (const auto& run : runs) {
    for (const auto& unit : run.units) add(input_note(unit));
  }
  for (const auto& run : runs) {
    if (run.assumptions) add(*run.assumptions);
  }
  for (const auto& run : runs) {
    for (const auto& warning : run.warnings) add("Note: " + warning);
  }
  add("Task latency: dispatch to completion. What virtual time computes from measured inputs is "
      "modelled; what a live run took is measured.");
  add(std::string(provenance_legend()));
  return notes;
}

}  // namespace

Origin time_of(const RunRecord& run, const UnitResult& unit) {
  if (run.is_live() && unit.backend) return Provenance::kMeasured;
  return simulated(times_of(unit));
}

RunMarks marks_of(const RunRecord& run) {
  Origin time = run.is_live() ? Origin{Provenance::kMeasured} : Origin{Provenance::kModelled};
  for (const auto& unit : run.units) {
    if (unit.completed > 0) time = weakest(time, time_of(run, unit));
  }
  return {.time = time, .energy = simulated(inputs_of(run, energies_of))};
}

std::string shown(const std::optional<double>& value, Origin provenance) {
  return value ? marked(figure(*value), provenance) : "-";
}

std::string gap_text(std::optional<double> reached, std::optional<double> bound) {
  const auto value = gap(reached, bound);
  return value ? fmt::format("{:+.1f}", 100 * *value) : "-";
}

Document run_document(const RunRecord& run) {
  Document document{.title = "pirt schedule", .parts = {header(run), totals(run)}};
  if (auto paragraph = bounds(run)) document.parts.emplace_back(std::move(*paragraph));
  document.parts.emplace_back(units_table(run));
  document.parts.emplace_back(pipelines_table(run));
  if (!run.plan.empty()) document.parts.emplace_back(plan_table(run));
  if (!run.weights.empty()) document.parts.emplace_back(weights_table(run));
  return document;
}

bool on_same_machine(const RunRecord& a, const RunRecord& b) {
  const bool same_text = !a.platform_hash || !b.platform_hash || a.platform_hash == b.platform_hash;
  return a.platform == b.platform && same_text && a.besides == b.besides;
}

bool ran_the_same(const RunRecord& a, const RunRecord& b) {
  const auto key = [](const RunRecord& r) { return std::tie(r.mix, r.draw, r.duration_s, r.seed); };
  const bool same_profile =
      a.profile_hash && b.profile_hash ? a.profile_hash == b.profile_hash : a.profile == b.profile;
  return on_same_machine(a, b) && key(a) == key(b) && same_profile;
}

std::int64_t dropped_tasks(const RunRecord& run) {
  return run.dropped + run.expired - run.no_predecessor.value_or(0);
}

std::string column_name(const RunRecord& run, std::span<const RunRecord> runs) {
  return has_one_time(runs) ? run.mode : run.mode + ", " + run.time;
}

Table modes_table(std::span<const RunRecord> runs) {
  Table table{.title = "Modes side by side (the paper's Table V for this platform and mix)",
              .columns = {{"", Align::kLeft}}};
  if (!runs.empty()) {
    table.title = fmt::format(
        "Modes side by side: mix {} on {}, {} time (the paper's Table V for this platform)",
        runs[0].mix, runs[0].platform, has_one_time(runs) ? runs[0].time : "virtual and live");
  }
  for (const auto& run : runs) table.columns.push_back({column_name(run, runs)});
  ModesTable rows(runs);
  add_totals(rows);
  for (const auto& unit : names_of(runs, &RunRecord::units, &UnitResult::unit))
    add_unit(rows, unit);
  for (const auto& pipeline : names_of(runs, &RunRecord::pipelines, &PipelineResult::pipeline)) {
    add_pipeline(rows, pipeline);
  }
  table.rows = rows.take();
  table.footnotes = footnotes(runs);
  return table;
}

std::string shown_figure_of(const RunRecord& run, const std::string& name,
                            const std::optional<double>& value, Origin origin) {
  if (!value) return "-";
  const auto interval = run.intervals.find(name);
  const bool wide = interval != run.intervals.end() &&
                    interval->second.high - interval->second.low > kShownSpread * *value;
  const std::string text = marked(figure(*value), origin);
  if (!wide) return text;
  return text +
         fmt::format(" ({} to {})", figure(interval->second.low), figure(interval->second.high));
}

std::string doubts_text(const RunRecord& run) {
  if (run.doubted.empty()) return "";
  std::set<std::string> words;
  std::map<std::string, double> taken;
  bool wild = false;
  for (const DoubtedFigure& each : run.doubted) {
    for (const std::string& doubt : each.doubts) words.insert(doubt.substr(0, doubt.find(':')));
    if (each.taken) taken[each.unit] = std::max(taken[each.unit], *each.taken);
    wild = wild || each.wild.value_or(false);
  }
  std::string text =
      fmt::format("{} of {} figures are uncertain ({})", run.doubted.size(),
                  run.figures.value_or(0), join(std::vector(words.begin(), words.end()), ", "));
  std::vector<std::string> parts;
  for (const auto& [unit, share] : taken) {
    parts.push_back(fmt::format("{:.0f} % of the time of {}", 100 * share, unit));
  }
  if (!parts.empty()) text += ": other programs took up to " + join(parts, " and ");
  if (wild) text += "; some by more than a factor of 4, marked ??";
  return text + "; `pirt doctor` says what disturbs this machine.";
}

std::string scenario_flags(const RunRecord& run) {
  const auto name = [](const std::string& shipped, const std::optional<std::string>& file) {
    return file ? path_in_shell(*file) : in_shell(shipped);
  };
  std::string flags;
  if (run.profile) {
    // Records of before have it as it was typed.
    const auto file = std::filesystem::current_path() / run.profile_file.value_or(*run.profile);
    flags += " --profile " + path_in_shell(file.string());
  }
  // One that was imported is in its database alone.
  const auto shipped = shipped_platforms();
  const bool is_named =
      run.platform_file || std::ranges::find(shipped, run.platform) != shipped.end();
  if (is_named || !run.profile) flags += " --platform " + name(run.platform, run.platform_file);
  for (const std::string& setting : run.settings) flags += " --set " + in_shell(setting);
  flags += " --mix " + name(run.mix, run.mix_file);
  // To the last digit: only a run of just that duration is held beside it.
  if (run.duration_s) flags += fmt::format(" --duration {}s", *run.duration_s);
  for (const std::string& flag : run.besides) flags += " " + flag;
  return flags;
}

std::string flags_of(const RunRecord& run) {
  std::string flags;
  if (run.basic) flags += " --basic " + *run.basic;
  if (run.in_flight) flags += fmt::format(" --in-flight {}", *run.in_flight);
  if (run.objective) flags += " --objective " + *run.objective;
  if (run.min_rate_per_ms) flags += fmt::format(" --min-rate {}", *run.min_rate_per_ms);
  if (run.power_cap_w) flags += fmt::format(" --power-cap {}W", *run.power_cap_w);
  if (run.overflow == "literal") flags += " --overflow literal";
  if (run.slices) flags += *run.slices ? " --slices on" : " --slices off";
  if (run.draw.value_or("median") != "median") flags += " --draw " + *run.draw;
  return flags;
}

std::string compare_command(const RunRecord& run, const std::string& modes) {
  std::string text =
      "pirt schedule --compare" + (modes.empty() ? "" : " " + modes) + scenario_flags(run);
  if (run.draw.value_or("median") != "median") text += " --draw " + *run.draw;
  return text + fmt::format(" --seed {}", run.seed);
}

}  // namespace pirt
