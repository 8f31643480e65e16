#include "reports/profile/profile_charts.h"

#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <map>

#include "reports/document/figures.h"
#include "reports/profile/roofline_report.h"
#include "reports/profile/shown_row.h"
#include "workloads/base/text/shell.h"
#include "workloads/base/text/text.h"
#include "workloads/catalog/catalog.h"

namespace pirt {
namespace {

/// Workloads that the paper shows together.
struct Family {
  const char* tag;  ///< Null = those of no other family.
  const char* name;
  const char* time_figure;  ///< The paper's.
  const char* energy_figure;
};
constexpr std::array kFamilies = {Family{"vision", "vision workloads", "Fig. 3", "Fig. 4"},
                                  Family{"dnn", "AlexNet and its layers", "Fig. 5", "Fig. 6"},
                                  Family{nullptr, "other workloads", nullptr, nullptr}};

bool belongs(const std::string& workload, const Family& family) {
  const Workload* found = try_find_workload(workload);
  const auto has = [&](const char* tag) { return found != nullptr && found->has_tag(tag); };
  if (family.tag != nullptr) return has(family.tag);
  return !has("vision") && !has("dnn");
}

std::string title_of(const char* what, const Family& family, const char* figure) {
  return fmt::format("{}: {}{}", what, family.name,
                     figure == nullptr ? "" : fmt::format(" (the paper's {})", figure));
}

std::string remarks_of(const std::string& judged, const std::vector<std::string>& notes) {
  auto parts = notes;
  if (!judged.empty()) parts.insert(parts.begin(), judged);
  return join(parts, "; ");
}

std::optional<double> ms(std::optional<Nanos> time) {
  return time ? std::optional(to_ms(*time)) : std::nullopt;
}

/// Group and series of a cell, with what is the same for each of its figures.
Mark cell_mark(const std::string& workload, const std::string& unit, Origin provenance) {
  return {.group = workload, .series = unit, .provenance = provenance};
}

/// That of a row, with what it is worth.
template <typename Row>
Mark cell_mark(const Row& row, bool has_figure) {
  Mark mark = cell_mark(row.workload, row.unit, row.provenance);
  if (!is_used(row)) mark.invalid = join(row.reasons, ", ");
  if (mark.invalid.empty() && !has_figure) mark.invalid = "no samples";
  mark.doubt = doubt_mark(row);
  return mark;
}

/// The fastest unit of each workload, counted.
std::string time_summary(const Profile& profile, const Chart& chart) {
  std::map<std::string, int> wins;
  std::map<std::string, const Mark*> best;
  for (const Mark& mark : chart.marks) {
    if (!mark.invalid.empty() || !mark.x) continue;
    const Mark*& known = best[mark.group];
    if (known == nullptr || *mark.x < *known->x) known = &mark;
  }
  if (best.empty()) return "No valid figures.";
  for (const auto& [group, mark] : best) ++wins[mark->series];
  std::vector<std::string> parts;
  for (const auto& unit : profile.units()) {
    if (wins.contains(unit)) parts.push_back(fmt::format("{} in {}", unit, wins[unit]));
  }
  return fmt::format("Least of {} workloads: {}.", best.size(), join(parts, ", "));
}

Chart time_chart(const Profile& profile, const Family& family) {
  Chart chart{.kind = ChartKind::kDots, .x = {"ms a call", true}, .series = profile.units()};
  chart.table = {.title = title_of("Time a call", family, family.time_figure),
                 .columns = {{"workload", Align::kLeft},
                             {"unit", Align::kLeft},
                             {"median ms"},
                             {"from"},
                             {"to"},
                             {"p95"},
                             {"p99"},
                             {"samples"},
                             {"remarks", Align::kLeft}},
                 .footnotes = {"Medians with their 95 % intervals; transfers included."},
                 .origin = origin_of(profile)};
  for (const auto& workload : profile.workloads()) {
    if (!belongs(workload, family)) continue;
    for (const auto& unit : profile.units()) {
      const PhaseRow* row = profile.find(workload, unit, Phase::kCall);
      if (row == nullptr) continue;
      const auto shown = [&](std::optional<Nanos> time) {
        return time ? marked(figure_ms(time), row->provenance) : "-";
      };
      const std::string doubt = row->median ? doubt_mark(*row) : "";
      chart.table.rows.push_back({workload, unit, shown(row->median) + doubt, shown(row->ci_low),
                                  shown(row->ci_high), shown(row->p95), shown(row->p99),
                                  fmt::format("{}", row->samples),
                                  remarks_of(judgement_text(*row), row->notes)});
      Mark mark = cell_mark(*row, row->median.has_value());
      mark.x = ms(row->median);
      mark.low = ms(row->ci_low);
      mark.high = ms(row->ci_high);
      chart.marks.push_back(std::move(mark));
    }
  }
  chart.summary = time_summary(profile, chart);
  return chart;
}

Chart energy_chart(const Profile& profile, const Family& family) {
  Chart chart{.kind = ChartKind::kDots, .x = {"mJ a call", true}, .series = profile.units()};
  chart.table = {.title = title_of("Energy a call", family, family.energy_figure),
                 .columns = {{"workload", Align::kLeft},
                             {"unit", Align::kLeft},
                             {"mJ"},
                             {"source", Align::kLeft},
                             {"remarks", Align::kLeft}},
                 .footnotes = {std::string(provenance_legend())},
                 .origin = origin_of(profile)};
  for (const auto& workload : profile.workloads()) {
    if (!belongs(workload, family)) continue;
    for (const auto& unit : profile.units()) {
      const EnergyRow* row = profile.find_energy(workload, unit);
      if (row == nullptr) continue;
      chart.table.rows.push_back(
          {workload, unit,
           row->energy_j ? marked(figure(*row->energy_j * 1e3), row->provenance) + doubt_mark(*row)
                         : "-",
           row->source, remarks_of(judgement_text(*row), {})});
      Mark mark = cell_mark(*row, row->energy_j.has_value());
      if (row->energy_j) mark.x = *row->energy_j * 1e3;
      if (row->ci_low_j) mark.low = *row->ci_low_j * 1e3;
      if (row->ci_high_j) mark.high = *row->ci_high_j * 1e3;
      chart.marks.push_back(std::move(mark));
    }
  }
  chart.summary = time_summary(profile, chart);
  return chart;
}

std::vector<Chart> of_families(const Profile& profile,
                               Chart (*make)(const Profile&, const Family&)) {
  std::vector<Chart> charts;
  for (const Family& family : kFamilies) {
    auto chart = make(profile, family);
    if (!chart.marks.empty()) charts.push_back(std::move(chart));
  }
  return charts;
}

/// All samples if they are few, else kMostQuantiles of them, the least and the most among them.
std::vector<Nanos> quantiles_of(std::vector<Nanos> samples) {
  std::ranges::sort(samples);
  if (samples.size() <= kMostQuantiles) return samples;
  std::vector<Nanos> chosen;
  for (std::size_t i = 0; i < kMostQuantiles; ++i) {
    chosen.push_back(samples[i * (samples.size() - 1) / (kMostQuantiles - 1)]);
  }
  return chosen;
}

/// Four digits are more than a picture shows.
double rounded(double value) { return value > 0 ? std::stod(fmt::format("{:.4g}", value)) : value; }

const PeakRow* find_peak(const Rooflines& roofs, const std::string& unit, PeakKind kind) {
  const auto found = std::ranges::find_if(roofs.peaks, [&](const PeakRow& peak) {
    return peak.unit == unit && peak.kind == kind && is_used(peak) &&
           peak.per_second.value_or(0) > 0;
  });
  return found == roofs.peaks.end() ? nullptr : &*found;
}

/// The limits of a unit as lines over operations a byte from @p least to @p most.
std::vector<ReferenceLine> roofs_of(const Rooflines& roofs, const std::string& unit, double least,
                                    double most) {
  double highest = 0;  // of all that computes, in Gop/s
  for (const PeakKind kind : {PeakKind::kF32, PeakKind::kInt8}) {
    if (const auto* peak = find_peak(roofs, unit, kind)) {
      highest = std::max(highest, *peak->per_second / 1e9);
    }
  }
  std::vector<ReferenceLine> lines;
  if (highest == 0) return lines;
  double steepest = 0;  // in GB/s
  for (const PeakKind kind : {PeakKind::kBandwidthMemory, PeakKind::kBandwidthL2}) {
    const auto* peak = find_peak(roofs, unit, kind);
    if (peak == nullptr) continue;
    const double gb_s = *peak->per_second / 1e9;
    steepest = std::max(steepest, gb_s);
    const double knee = highest / gb_s;
    if (knee > least) {
      lines.push_back({kind == PeakKind::kBandwidthL2 ? "L2" : "memory",
                       {{least, least * gb_s}, {knee, highest}}});
    }
  }
  for (const PeakKind kind : {PeakKind::kF32, PeakKind::kInt8}) {
    const auto* peak = find_peak(roofs, unit, kind);
    if (peak == nullptr) continue;
    const double gop_s = *peak->per_second / 1e9;
    const double from = steepest > 0 ? gop_s / steepest : least;
    lines.push_back(
        {std::string(to_string(kind)), {{from, gop_s}, {std::max(most, from * 2), gop_s}}});
  }
  return lines;
}

/// "limit: f32", ...
std::string limit_name(PeakKind kind) { return "limit: " + std::string(to_string(kind)); }

std::vector<std::string> limits_by_name() {
  std::vector<std::string> names;
  for (const PeakKind kind : kAllPeakKinds) names.push_back(limit_name(kind));
  return names;
}

Chart roofline_chart(const Profile& profile, const Rooflines& roofs, const std::string& unit) {
  Chart chart{.kind = ChartKind::kScatter,
              .x = {"operations a byte", true},
              .y = {"Gop/s", true},
              .series = limits_by_name()};
  chart.table = {
      .title = "Roofline of " + unit,
      .columns = {{"workload", Align::kLeft},
                  {"limit", Align::kLeft},
                  {"ops/byte"},
                  {"Gop/s"},
                  {"roof Gop/s"},
                  {"of the roof"}},
      .footnotes = {"Lines: what the unit reached at most, by loops that do nothing else. "
                    "Cells whose operations depend on the data stand in the next chart."},
      .origin = origin_of(profile)};
  double least = 0, most = 0;
  for (const Roofline& cell : roofs.cells) {
    if (cell.unit != unit || !cell.fraction || !cell.intensity) continue;
    const auto shown = [&](double value) { return marked(figure(value), cell.provenance); };
    chart.table.rows.push_back({cell.workload, std::string(to_string(cell.bound)),
                                figure(*cell.intensity), shown(cell.reached_per_second / 1e9),
                                shown(cell.roof_per_second / 1e9), roofline_cell(&cell)});
    Mark mark = cell_mark(cell.workload, limit_name(cell.bound), cell.provenance);
    mark.x = *cell.intensity;
    mark.y = cell.reached_per_second / 1e9;
    least = chart.marks.empty() ? *mark.x : std::min(least, *mark.x);
    most = std::max(most, *mark.x);
    chart.marks.push_back(std::move(mark));
  }
  chart.lines = roofs_of(roofs, unit, least, most);
  chart.summary = "Operations a second over operations a byte, below the limits of the unit.";
  return chart;
}

Chart share_chart(const Profile& profile, const Rooflines& roofs) {
  Chart chart{.kind = ChartKind::kDots, .x = {"% of the roof", false}, .series = profile.units()};
  chart.table = {.title = "How near each cell comes to its roof",
                 .columns = {{"workload", Align::kLeft},
                             {"unit", Align::kLeft},
                             {"of the roof"},
                             {"remarks", Align::kLeft}},
                 .footnotes = roofline_footnotes(roofs),
                 .origin = origin_of(profile)};
  double most = 0;
  for (const Roofline& cell : roofs.cells) {
    const auto remark = cell.missing.empty() ? cell.why_not : "without: " + cell.missing;
    chart.table.rows.push_back({cell.workload, cell.unit, roofline_cell(&cell), remark});
    Mark mark = cell_mark(cell.workload, cell.unit, cell.provenance);
    if (cell.fraction) {
      mark.x = 100 * *cell.fraction;
      most = std::max(most, *mark.x);
    } else {
      mark.word = "not known";
    }
    chart.marks.push_back(std::move(mark));
  }
  chart.summary = fmt::format("The nearest reaches {:.0f} % of what its unit can do.", most);
  return chart;
}

}  // namespace

std::string origin_of(const Profile& profile) {
  const RunInfo& run = profile.runs.front();
  std::string text =
      fmt::format("run {} of {}, platform {}", run.run_id, run.started, run.platform);
  const auto fact = [&run](const char* key) {
    const auto found = run.environment.find(key);
    return found == run.environment.end() ? std::string() : found->second;
  };
  if (const std::string command = fact("command"); !command.empty()) {
    text += "; again: " + command + " --db " + path_in_shell(profile.path);
  } else if (const std::string source = fact("source"); !source.empty()) {
    text += "; published: " + source;
  }
  return text;
}

std::vector<Chart> time_charts(const Profile& profile) { return of_families(profile, time_chart); }

std::vector<Chart> energy_charts(const Profile& profile) {
  return of_families(profile, energy_chart);
}

Chart distribution_chart(const Profile& profile) {
  Chart chart{.kind = ChartKind::kQuantiles,
              .summary = "Samples of each cell over its median: narrow is steady.",
              .x = {"times the median", true},
              .series = profile.units()};
  chart.table = {
      .title = "How samples of a call are spread",
      .columns = {{"workload", Align::kLeft},
                  {"unit", Align::kLeft},
                  {"median ms"},
                  {"least"},
                  {"p95"},
                  {"p99"},
                  {"most"},
                  {"samples"},
                  {"processes"},
                  {"shown"},
                  {"remarks", Align::kLeft}},
      .footnotes = {fmt::format("least to most: times the median, which is that of the "
                                "processes' medians. shown: quantiles in the picture, {} "
                                "at most.",
                                kMostQuantiles)},
      .origin = origin_of(profile)};
  for (const auto& row : profile.phases) {
    if (row.phase != Phase::kCall) continue;
    const auto quantiles = quantiles_of(row.values);
    const double median_ns = row.median ? static_cast<double>(row.median->count()) : 0;
    const auto ratio = [&](std::optional<Nanos> time) {
      return time && median_ns > 0
                 ? fmt::format("{:.3g}x", static_cast<double>(time->count()) / median_ns)
                 : "-";
    };
    const auto end = [&](bool last) {
      return quantiles.empty() ? std::nullopt
                               : std::optional(last ? quantiles.back() : quantiles.front());
    };
    chart.table.rows.push_back(
        {row.workload, row.unit, row.median ? marked(figure_ms(row.median), row.provenance) : "-",
         ratio(end(false)), ratio(row.p95), ratio(row.p99), ratio(end(true)),
         fmt::format("{}", row.samples), fmt::format("{}", row.processes),
         fmt::format("{}", quantiles.size()), remarks_of(judgement_text(row), row.notes)});
    Mark mark = cell_mark(row, row.median.has_value());
    mark.group += ", " + row.unit;
    if (median_ns > 0) mark.x = 1;
    for (const Nanos each : quantiles) {
      if (median_ns > 0) {
        mark.values.push_back(rounded(static_cast<double>(each.count()) / median_ns));
      }
    }
    chart.marks.push_back(std::move(mark));
  }
  return chart;
}

std::vector<Chart> roofline_charts(const Profile& profile) {
  const Rooflines roofs = rooflines(profile);
  std::vector<Chart> charts;
  for (const auto& unit : profile.units()) {
    auto chart = roofline_chart(profile, roofs, unit);
    if (!chart.marks.empty()) charts.push_back(std::move(chart));
  }
  if (!roofs.cells.empty()) charts.push_back(share_chart(profile, roofs));
  return charts;
}

}  // namespace pirt
