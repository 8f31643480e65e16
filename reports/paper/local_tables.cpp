#include "reports/paper/local_tables.h"

#include <fmt/core.h>

#include <algorithm>

#include "reports/document/figures.h"
#include "reports/paper/paper_figures.h"
#include "reports/run/run_report.h"

namespace pirt {
namespace {

std::string range_text(std::optional<double> low, std::optional<double> high, Origin from) {
  if (!low || !high) return "-";
  if (*low == *high) return marked(figure(*low), from);
  return marked(fmt::format("{} to {}", figure(*low), figure(*high)), from);
}

std::optional<Inference> in_the_cloud(const Platform& platform, const UnitModel& unit) {
  const auto model = platform.workloads.find(paper::kInference);
  if (unit.role != Role::kCloud || model == platform.workloads.end()) return std::nullopt;
  const auto stages = model->second.stages.find(unit.name);
  if (stages == model->second.stages.end()) return std::nullopt;
  Nanos low{0}, high{0};
  for (const Stage& stage : stages->second) {
    low += stage.time.low;
    high += stage.time.high;
  }
  Inference found{.where = unit.name,
                  .energy_j = std::nullopt,
                  .low_s = to_s(low),
                  .high_s = to_s(high),
                  .energy_provenance = model->second.provenance,
                  .time_provenance = model->second.provenance};
  const auto joules = model->second.call_j.find(unit.name);
  if (joules != model->second.call_j.end()) found.energy_j = joules->second;
  return found;
}

/// Units of the paper's Table V by their role; what they are called elsewhere is in the header.
std::vector<std::string> unit_names(std::span<const RunRecord> runs) {
  std::vector<std::string> names;
  for (const auto& run : runs) {
    for (const auto& unit : run.units) {
      const bool used = unit.completed > 0;
      if (used && std::ranges::find(names, unit.unit) == names.end()) names.push_back(unit.unit);
    }
  }
  return names;
}

std::vector<std::string> row_of(const RunRecord& run, const std::vector<std::string>& units) {
  const RunMarks marks = marks_of(run);
  std::vector<std::string> row = {run.mode, "here", shown(run.throughput_per_ms, marks.time)};
  for (const auto& name : units) {
    const auto unit = std::ranges::find(run.units, name, &UnitResult::unit);
    row.push_back(unit == run.units.end() ? "-" : shown(unit->mean_latency_ms, marks.time));
  }
  row.push_back(shown(run.energy_j, marks.energy));
  return row;
}

std::vector<std::string> printed_row(const paper::Scheduling& printed, const RunRecord& run,
                                     const std::vector<std::string>& units) {
  const auto said = [](std::optional<double> value) {
    return value ? marked(fmt::format("{}", *value), Provenance::kPublished) : "-";
  };
  std::vector<std::string> row = {run.mode, "paper", said(printed.frames_per_ms)};
  for (const auto& name : units) {
    const auto unit = std::ranges::find(run.units, name, &UnitResult::unit);
    const std::string role = unit == run.units.end() ? "" : unit->role;
    row.push_back(role == "cpu"   ? said(printed.cpu_ms)
                  : role == "gpu" ? said(printed.gpu_ms)
                  : role == "dsp" ? said(printed.dsp_ms)
                                  : "-");
  }
  row.push_back(said(printed.energy_j));
  return row;
}

}  // namespace

std::vector<Inference> inferences(const Profile& profile, const Platform* platform) {
  std::vector<Inference> found;
  for (const auto& unit : profile.units()) {
    const PhaseRow* call = profile.find(paper::kInference, unit, Phase::kCall);
    if (call == nullptr || !is_used(*call) || !call->median) continue;
    const EnergyRow* energy = profile.find_energy(paper::kInference, unit);
    Inference here{.where = unit, .energy_j = std::nullopt};
    here.low_s = here.high_s = to_s(*call->median);
    here.time_provenance = call->provenance;
    if (energy != nullptr && is_used(*energy)) {
      here.energy_j = energy->energy_j;
      here.energy_provenance = energy->provenance;
    }
    found.push_back(std::move(here));
  }
  if (platform == nullptr) return found;
  for (const UnitModel& unit : platform->units) {
    if (auto cloud = in_the_cloud(*platform, unit)) found.push_back(std::move(*cloud));
  }
  return found;
}

Table cloud_table(const std::vector<Inference>& here) {
  Table table{
      .title = "Inference locally against the cloud (the paper's Table IV for this machine)",
      .columns = {{"where", Align::kLeft}, {"", Align::kLeft}, {"energy J"}, {"latency s"}},
      .footnotes = {"One image through AlexNet, set-up excluded.",
                    std::string(provenance_legend())}};
  for (const Inference& each : here) {
    table.rows.push_back(
        {each.where, "here",
         each.energy_j ? marked(figure(*each.energy_j), each.energy_provenance) : "-",
         range_text(each.low_s, each.high_s, each.time_provenance)});
  }
  for (const paper::Inference& each : paper::kTable4) {
    table.rows.push_back({std::string(each.where), "paper",
                          marked(fmt::format("{:.3f}", each.energy_j), Provenance::kPublished),
                          range_text(each.low_s, each.high_s, Provenance::kPublished)});
  }
  return table;
}

Table scheduling_table(std::span<const RunRecord> runs) {
  Table table{
      .title = "Scheduling algorithms (the paper's Table V for this machine)",
      .columns = {{"mode", Align::kLeft}, {"", Align::kLeft}, {"frames/ms"}},
      .footnotes = {"Frames of a 7x7 convolution in a closed loop, in virtual time; ms: mean "
                    "from dispatch to completion on that unit; J: for 1000 frames. The "
                    "paper's rows are of a Snapdragon 820, by the roles of the units.",
                    std::string(provenance_legend())}};
  if (!runs.empty()) {
    table.origin = compare_command(runs[0], "throughput,latency,energy");
  }
  const auto units = unit_names(runs);
  for (const auto& unit : units) table.columns.push_back({unit + " ms"});
  table.columns.push_back({"energy J"});
  for (const auto& run : runs) {
    table.rows.push_back(row_of(run, units));
    const auto printed = std::ranges::find(paper::kTable5, run.mode, &paper::Scheduling::mode);
    if (printed != paper::kTable5.end()) table.rows.push_back(printed_row(*printed, run, units));
  }
  return table;
}

}  // namespace pirt
