#include "reports/paper/paper_report.h"

#include <fmt/core.h>

#include <algorithm>
#include <cassert>
#include <cmath>
#include <optional>

#include "reports/document/figures.h"
#include "reports/paper/paper_figures.h"
#include "scheduler/schedule.h"
#include "workloads/base/text/json.h"

namespace pirt {
namespace {

constexpr double kLimit = 0.02;
constexpr double kLimitOfEnergyThroughput = 0.04;

double latency_of(const RunRecord& run, const std::string& unit) {
  const auto found = std::ranges::find(run.units, unit, &UnitResult::unit);
  assert(found != run.units.end() && found->mean_latency_ms && "the mode uses this unit");
  return *found->mean_latency_ms;
}

/// 0 stands for what the paper does not say.
std::optional<double> said(double value) { return value > 0 ? std::optional(value) : std::nullopt; }

/// @param provenance  Of its figures; a prediction from fitted times is fitted.
std::vector<std::string> section5_cells(const std::string& run, const std::string& modes,
                                        const Section5Row& row, Provenance provenance) {
  const auto cell = [&](double value) {
    const auto known = said(value);
    return known ? marked(figure(known), provenance) : "-";
  };
  return {run,
          modes,
          cell(row.localization_fps),
          cell(row.recognitions_per_s),
          cell(row.planning_p50_ms),
          cell(row.planning_p99_ms),
          cell(row.power_w)};
}

void add_predictions(Table& table, const std::string& run, const std::vector<Section5Row>& rows) {
  std::vector<std::vector<std::string>> groups;
  for (const Section5Row& row : rows) {
    auto cells = section5_cells(run, row.mode, row, Provenance::kFitted);
    const auto same = [&](const std::vector<std::string>& other) {
      return std::equal(cells.begin() + 2, cells.end(), other.begin() + 2);
    };
    const auto known = std::ranges::find_if(groups, same);
    if (known == groups.end()) {
      groups.push_back(std::move(cells));
    } else {
      (*known)[1] += ", " + row.mode;
    }
  }
  table.rows.insert(table.rows.end(), groups.begin(), groups.end());
}

Json row_json(const Section5Row& row) {
  Json json = {{"mode", row.mode}, {"mix", row.mix}};
  const auto put = [&](const char* key, double value) {
    if (const auto known = said(value)) json[key] = *known;
  };
  put("localization_fps", row.localization_fps);
  put("recognitions_per_s", row.recognitions_per_s);
  put("planning_p50_ms", row.planning_p50_ms);
  put("planning_p99_ms", row.planning_p99_ms);
  put("power_w", row.power_w);
  return json;
}

Json rows_json(const std::vector<Section5Row>& rows) {
  auto json = Json::array();
  for (const Section5Row& row : rows) json.push_back(row_json(row));
  return json;
}

}  // namespace

bool PaperCell::holds() const { return std::abs(deviation()) <= limit; }

std::vector<PaperCell> paper_cells() {
  const auto platform = load_platform("snapdragon820");
  const auto mix = load_mix("convolution-1000");
  std::vector<PaperCell> cells;
  for (const paper::Scheduling& row : paper::kTable5) {
    ScheduleOptions options;
    options.mode = row.mode;
    const auto run = run_virtual(platform, nullptr, mix, options);
    const auto add = [&](const std::string& figure, std::optional<double> paper, double ours,
                         double limit) {
      if (paper) cells.push_back({std::string(row.mode), figure, *paper, ours, limit});
    };
    const bool energy_mode = options.mode == "energy";
    add("throughput, frames/ms", row.frames_per_ms, run.throughput_per_ms.value_or(0),
        energy_mode ? kLimitOfEnergyThroughput : kLimit);
    if (row.cpu_ms) add("CPU latency, ms", row.cpu_ms, latency_of(run, "cpu"), kLimit);
    if (row.gpu_ms) add("GPU latency, ms", row.gpu_ms, latency_of(run, "gpu"), kLimit);
    if (row.dsp_ms) add("DSP latency, ms", row.dsp_ms, latency_of(run, "dsp"), kLimit);
    add("energy, J", row.energy_j, run.energy_j.value(), kLimit);
  }
  return cells;
}

Table paper_table(const std::vector<PaperCell>& cells) {
  Table table{
      .title = "Table V of the Pi-RT paper, in virtual time",
      .columns = {{"mode", Align::kLeft},
                  {"figure", Align::kLeft},
                  {"paper"},
                  {"here"},
                  {"off by"},
                  {"limit"},
                  {"", Align::kLeft}},
      .rows = {},
      .footnotes = {
          "Platform snapdragon820, mix convolution-1000: ten parameters fitted to these thirteen "
          "cells, so this shows that the algorithms and the model agree with the paper, and "
          "predicts nothing.",
          "The energy mode's throughput does not fit the latencies printed beside it more closely "
          "in any model.",
          std::string(provenance_legend())}};
  for (const PaperCell& cell : cells) {
    table.rows.push_back({cell.mode, cell.figure,
                          marked(fmt::format("{:.4g}", cell.paper), Provenance::kPublished),
                          marked(fmt::format("{:.4g}", cell.ours), Provenance::kFitted),
                          fmt::format("{:+.1f}%", 100 * cell.deviation()),
                          fmt::format("{:.0f}%", 100 * cell.limit), cell.holds() ? "" : "MISSED"});
  }
  return table;
}

Json paper_json(const std::vector<PaperCell>& cells) {
  auto rows = Json::array();
  for (const PaperCell& cell : cells) {
    rows.push_back({{"mode", cell.mode},
                    {"figure", cell.figure},
                    {"paper", cell.paper},
                    {"here", cell.ours},
                    {"deviation", cell.deviation()},
                    {"limit", cell.limit},
                    {"holds", cell.holds()}});
  }
  return {{"platform", "snapdragon820"}, {"mix", "convolution-1000"}, {"table5", rows}};
}

Table section5_table(const Section5& section) {
  Table table{.title = "Section V of the Pi-RT paper, in virtual time",
              .columns = {{"the robot", Align::kLeft},
                          {"mode", Align::kLeft},
                          {"localization Hz"},
                          {"recognition Hz"},
                          {"planning p50 ms"},
                          {"planning p99 ms"},
                          {"W"}}};
  table.rows.push_back(section5_cells("without the runtime", "the paper", section.paper_without,
                                      Provenance::kPublished));
  table.rows.push_back(section5_cells("without the runtime, FITTED", section.fitted.mode,
                                      section.fitted, Provenance::kFitted));
  table.rows.push_back(
      section5_cells("with the runtime", "the paper", section.paper_with, Provenance::kPublished));
  add_predictions(table, "with the runtime, predicted", section.predictions);
  add_predictions(table, "placed as the paper says, predicted", section.placed);
  table.footnotes = {
      "Platform snapdragon820-section5, mixes section5-cpu-only, section5 and section5-placed, 60 "
      "s. The CPU's times are fitted to the paper's robot without the runtime, so that this row "
      "shows nothing; those of GPU and DSP are the CPU's by the ratios of Tables IV and V, so that "
      "what follows from them is a prediction.",
      "The paper says \"within 6 ms\", without a percentile."};
  for (const auto& line : section.not_run) table.footnotes.push_back("Not run: " + line);
  table.footnotes.emplace_back(provenance_legend());
  table.origin = "pirt schedule --platform snapdragon820-section5 --mix section5 --compare";
  return table;
}

Json section5_json(const Section5& section) {
  return {{"platform", "snapdragon820-section5"},
          {"paper_without", row_json(section.paper_without)},
          {"paper_with", row_json(section.paper_with)},
          {"fitted", row_json(section.fitted)},
          {"predictions", rows_json(section.predictions)},
          {"placed", rows_json(section.placed)},
          {"not_run", section.not_run}};
}

PaperRuns run_paper() { return {paper_cells(), run_section5()}; }

}  // namespace pirt
