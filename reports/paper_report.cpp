#include "reports/paper_report.h"

#include <fmt/core.h>

#include <algorithm>
#include <cassert>
#include <cmath>
#include <optional>

#include "reports/figures.h"
#include "reports/paper_figures.h"
#include "scheduler/schedule.h"
#include "workloads/base/json_value.h"

namespace pirt {
namespace {

constexpr double kLimit = 0.02;
constexpr double kLimitOfEnergyThroughput = 0.04;

double latency_of(const RunRecord& run, const std::string& unit) {
  const auto found = std::ranges::find(run.units, unit, &UnitResult::unit);
  assert(found != run.units.end() && found->mean_latency_ms && "the mode uses this unit");
  return *found->mean_latency_ms;
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
    add("energy, J", row.energy_j, run.energy_j, kLimit);
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

}  // namespace pirt
