#include "reports/paper/table3.h"

#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <filesystem>
#include <string_view>

#include "characterize/profile/roofline.h"
#include "reports/document/figures.h"
#include "reports/profile/profile_report.h"
#include "workloads/base/text/text.h"

namespace pirt {
namespace {

/// A processor of Table II, and the backend whose unit stands for it.
struct Board {
  std::string_view name;     ///< The paper's, in Table III.
  std::string_view backend;  ///< Of a profile's unit.
  /// Operations (a multiply-add counts 2) and bytes a second; 0 = counted at the board's size.
  double ops_per_second = 0, bytes_per_second = 0;
  std::string_view source = {};
};

/// @source Table II. An ALU of the GPUs and a lane of the CPUs' vectors does a multiply-add a
/// cycle, as the paper's 160 and 256 GOPS count them, once each; memories transfer twice a cycle,
/// 64 bits wide, as the boards' data sheets have it.
constexpr std::array kBoards = {
    Board{"CPU", "cpu", 4 * 2200e6 * 8, 1866e6 * 2 * 8,
          "Kryo, 4 cores x 2200 MHz x 4 lanes x 2; LPDDR4 1866 MHz x 2 x 8 bytes"},
    Board{"mGPU", "opencl", 256 * 624e6 * 2, 1866e6 * 2 * 8,
          "Adreno 530, 256 ALUs x 624 MHz x 2; LPDDR4 1866 MHz x 2 x 8 bytes"},
    Board{"GPU", "opencl", 256 * 998e6 * 2, 1600e6 * 2 * 8,
          "Jetson TX1, 256 ALUs x 998 MHz x 2; LPDDR4 1600 MHz x 2 x 8 bytes"},
    Board{"DSP", "dsp"}, Board{"FPGA", "fpga"}};

/// A unit of one of the profiles.
struct Source {
  const Profile* profile;
  std::string unit;
  std::string backend;
  std::string name;  ///< As shown: with the platform, if there are several profiles.
};

std::vector<Source> sources_of(std::span<const Profile* const> profiles) {
  std::vector<Source> sources;
  for (const Profile* profile : profiles) {
    for (const std::string& unit : profile->units()) {
      const UnitRecord* record = profile->find_unit(unit);
      const std::string name = profiles.size() > 1 ? profile->platform() + "/" + unit : unit;
      sources.push_back({profile, unit, record != nullptr ? record->backend : "", name});
    }
  }
  return sources;
}

const PhaseRow* valid_row(const Source& source, const std::string& workload, Phase phase) {
  const PhaseRow* row = source.profile->find(workload, source.unit, phase);
  return row != nullptr && is_used(*row) && row->median && row->median->count() > 0 ? row : nullptr;
}

RankedUnit ranked(const std::string& name, const PhaseRow& row, double scale, Origin provenance) {
  return {.unit = name,
          .value = to_ms(*row.median) * scale,
          .low = to_ms(row.ci_low.value_or(*row.median)) * scale,
          .high = to_ms(row.ci_high.value_or(*row.median)) * scale,
          .provenance = provenance};
}

/// What the board's roofline allows over what the unit's does; absent where a limit is not known.
std::optional<double> scale_to(const Board& board, const Source& source, const PhaseRow& row) {
  const auto limit = [&](PeakKind kind) -> std::optional<double> {
    const PeakRow* peak = source.profile->find_peak(source.unit, kind);
    return peak != nullptr && is_used(*peak) ? peak->per_second : std::nullopt;
  };
  const auto peak = limit(PeakKind::kF32), bandwidth = limit(PeakKind::kBandwidthMemory);
  const auto ops = static_cast<double>(row.ops.value_or(0));
  const auto bytes = static_cast<double>(row.bytes);
  if (!bandwidth || (ops > 0 && !peak)) return std::nullopt;
  const double here = std::max(ops > 0 ? ops / *peak : 0, bytes / *bandwidth);
  if (here <= 0) return std::nullopt;
  return std::max(ops / board.ops_per_second, bytes / board.bytes_per_second) / here;
}

/// A board's unit for one workload, and what its figure is made of.
struct BoardFigure {
  RankedUnit unit;
  const Source* from;
  const PhaseRow* row;
};

std::vector<BoardFigure> board_figures(const std::vector<Source>& sources,
                                       const std::string& workload) {
  std::vector<BoardFigure> figures;
  for (const Board& board : kBoards) {
    for (const Source& source : sources) {
      if (source.backend != board.backend) continue;
      const PhaseRow* row = valid_row(source, workload, Phase::kExecute);
      if (row == nullptr) continue;
      const bool counted = board.ops_per_second == 0;
      const auto scale = counted ? std::optional(1.0) : scale_to(board, source, *row);
      if (!scale) continue;
      const Origin origin =
          counted ? row->provenance : weakest(row->provenance, Provenance::kModelled);
      figures.push_back({ranked(std::string(board.name), *row, *scale, origin), &source, row});
      break;
    }
  }
  std::ranges::stable_sort(figures, {}, [](const BoardFigure& each) { return each.unit.value; });
  return figures;
}

/// What the figure of the paper's unit is made of, as far as it can be shown.
std::string made_of(const BoardFigure& figure, const Rooflines& rooflines) {
  if (figure.row->bound && figure.row->bound->count() > 0) {
    return fmt::format("counted; {:.0f}% of it is the core alone, without waiting for memory",
                       100 * to_ms(*figure.row->bound) / to_ms(*figure.row->median));
  }
  const Roofline* cell = rooflines.find(figure.row->workload, figure.from->unit);
  const UnitRecord* unit = figure.from->profile->find_unit(figure.from->unit);
  const std::string device =
      unit != nullptr && unit->device_is_cpu && figure.from->backend == "opencl"
          ? " on a CPU's cores"
          : "";
  if (cell == nullptr || !cell->fraction) {
    return fmt::format("scaled from {}{}", figure.from->name, device);
  }
  return fmt::format("scaled from {}{}, which reaches {:.1f}% of its {} roof", figure.from->name,
                     device, 100 * *cell->fraction, to_string(cell->bound));
}

std::string difference_of(const std::vector<BoardFigure>& figures, const std::string& paper) {
  if (figures.empty() || figures.front().unit.unit == paper) return "";
  const auto theirs = std::ranges::find_if(
      figures, [&](const BoardFigure& each) { return each.unit.unit == paper; });
  if (theirs == figures.end()) return "no profile here has a valid figure of its " + paper;
  const auto& best = figures.front();
  return fmt::format("{} takes {}x what {} takes; {}: {}; {}: {}", paper,
                     figure(theirs->unit.value / best.unit.value), best.unit.unit, paper,
                     made_of(*theirs, rooflines(*theirs->from->profile)), best.unit.unit,
                     made_of(best, rooflines(*best.from->profile)));
}

Table3Row row_of(const std::vector<Source>& sources, const PaperPreference& paper) {
  Table3Row row{.workload = std::string(paper.workload),
                .here = {},
                .energy = {},
                .no_energy = {},
                .boards = {},
                .paper_time = std::string(paper.time),
                .paper_energy = std::string(paper.energy),
                .difference = {}};
  for (const Source& source : sources) {
    const PhaseRow* call = valid_row(source, row.workload, Phase::kCall);
    if (call == nullptr) continue;
    row.here.units.push_back(ranked(source.name, *call, 1, call->provenance));
    const EnergyRow* energy = source.profile->find_energy(row.workload, source.unit);
    if (energy != nullptr && is_used(*energy) && energy->energy_j) {
      const double joules = *energy->energy_j;
      row.energy.units.push_back({source.name, joules, joules, joules, energy->provenance});
    } else {
      row.no_energy.push_back(source.name);
    }
  }
  for (Ranking* ranking : {&row.here, &row.energy}) {
    std::ranges::stable_sort(ranking->units, {}, &RankedUnit::value);
  }
  const auto boards = board_figures(sources, row.workload);
  for (const BoardFigure& each : boards) row.boards.units.push_back(each.unit);
  row.difference = difference_of(boards, row.paper_time);
  return row;
}

std::string source_text(const Source& source) {
  const UnitRecord* record = source.profile->find_unit(source.unit);
  if (record == nullptr) return source.name;
  const bool stands_in = record->device_is_cpu && record->backend == "opencl";
  return fmt::format("{} ({}): backend {}, {}{}", source.name,
                     std::filesystem::path(source.profile->path).filename().string(),
                     record->backend, record->device,
                     stands_in ? ", which is a CPU and no GPU" : "");
}

std::string best_figure(const Ranking& ranking, double scale) {
  if (ranking.units.empty()) return "-";
  return marked(figure(ranking.units.front().value * scale), ranking.units.front().provenance);
}

std::string next_takes(const Ranking& ranking) {
  const auto advantage = ranking.advantage();
  return advantage ? figure(*advantage) + "x" : "-";
}

/// Whether @p preferable is, or may be where intervals overlap, what the paper prefers.
bool agrees(const std::string& preferable, const std::string& paper) {
  const auto names = split(preferable, ' ');
  return std::ranges::find(names, paper) != names.end();
}

Table preferable_table(const Table3& table) {
  Table shown{.title = "Table III of the Pi-RT paper, rebuilt",
              .columns = {{"workload", Align::kLeft},
                          {"paper: time", Align::kLeft},
                          {"at the boards' size", Align::kLeft},
                          {"ms"},
                          {"next takes"},
                          {"as it is here", Align::kLeft},
                          {"ms"},
                          {"paper: energy", Align::kLeft},
                          {"here", Align::kLeft},
                          {"mJ"},
                          {"no figure of", Align::kLeft}}};
  int same = 0, known = 0;
  for (const Table3Row& row : table.rows) {
    const std::string boards = row.boards.preferable();
    if (!row.boards.units.empty()) {
      ++known;
      same += agrees(boards, row.paper_time) ? 1 : 0;
    }
    shown.rows.push_back({row.workload, marked(row.paper_time, Provenance::kPublished), boards,
                          best_figure(row.boards, 1), next_takes(row.boards), row.here.preferable(),
                          best_figure(row.here, 1),
                          marked(row.paper_energy, Provenance::kPublished), row.energy.preferable(),
                          best_figure(row.energy, 1e3),
                          row.no_energy.empty() ? "-" : join(row.no_energy, ", ")});
  }
  shown.footnotes.push_back(fmt::format(
      "At the boards' size {} of {} prefer the paper's unit; nobody promises that, since the "
      "paper's kernels are not known.",
      same, known));
  for (const Table3Row& row : table.rows) {
    if (!row.difference.empty()) {
      shown.footnotes.push_back(row.workload + ": " + row.difference + ".");
    }
  }
  return shown;
}

Table figures_table(const Table3& table) {
  Table shown{.title = "What it follows from: execution at the boards' size, ms",
              .columns = {{"workload", Align::kLeft}}};
  for (const Board& board : kBoards) shown.columns.push_back({std::string(board.name)});
  for (const Table3Row& row : table.rows) {
    std::vector<std::string> cells = {row.workload};
    for (const Board& board : kBoards) {
      const auto found = std::ranges::find(row.boards.units, board.name, &RankedUnit::unit);
      cells.push_back(
          found == row.boards.units.end() ? "-" : marked(figure(found->value), found->provenance));
    }
    shown.rows.push_back(std::move(cells));
  }
  shown.footnotes.push_back(
      "CPU, mGPU and GPU: execute x max(operations / P, bytes / B) / max(operations / p, bytes / "
      "b); p, b: the unit's measured f32 peak and memory bandwidth, P, B: the board's. Launches "
      "and copies of the boards are not known.");
  for (const Board& board : kBoards) {
    if (!board.source.empty()) {
      shown.footnotes.push_back(fmt::format("{}: {}", board.name, board.source));
    }
  }
  for (const std::string& source : table.sources) shown.footnotes.push_back(source);
  shown.footnotes.emplace_back(provenance_legend());
  return shown;
}

}  // namespace

Table3 table3(std::span<const Profile* const> profiles) {
  Table3 table;
  const auto sources = sources_of(profiles);
  for (const PaperPreference& paper : paper_preferences()) {
    Table3Row row = row_of(sources, paper);
    if (!row.here.units.empty() || !row.boards.units.empty()) table.rows.push_back(std::move(row));
  }
  for (const Source& source : sources) table.sources.push_back(source_text(source));
  return table;
}

std::vector<Table> table3_tables(const Table3& table) {
  if (table.rows.empty()) return {};
  return {preferable_table(table), figures_table(table)};
}

Json table3_json(const Table3& table) {
  Json rows = Json::array();
  for (const Table3Row& row : table.rows) {
    Json one = {{"workload", row.workload},
                {"paper_time", row.paper_time},
                {"paper_energy", row.paper_energy},
                {"here", ranking_json(row.here, "call_ms")},
                {"energy", ranking_json(row.energy, "energy_j")},
                {"no_energy", row.no_energy},
                {"boards", ranking_json(row.boards, "execute_ms")}};
    if (!row.difference.empty()) one["difference"] = row.difference;
    rows.push_back(std::move(one));
  }
  return {{"workloads", rows}, {"sources", table.sources}};
}

}  // namespace pirt
