#include "reports/profile/side_by_side.h"

#include <fmt/core.h>

#include <algorithm>
#include <filesystem>
#include <set>

#include "characterize/profile/identity.h"
#include "reports/document/figures.h"
#include "reports/profile/preference.h"
#include "reports/profile/shown_row.h"
#include "workloads/base/text/text.h"

namespace pirt {
namespace {

template <typename Names>
std::vector<std::string> all_of(std::span<const Profile> profiles, const Names& names) {
  std::vector<std::string> all;
  for (const Profile& profile : profiles) {
    for (const auto& name : names(profile)) {
      if (std::ranges::find(all, name) == all.end()) all.push_back(name);
    }
  }
  return all;
}

std::vector<std::string> all_workloads(std::span<const Profile> profiles) {
  return all_of(profiles, [](const Profile& profile) { return profile.workloads(); });
}

std::string best_text(const Ranking& ranking, double scale, const char* unit) {
  if (ranking.units.empty()) return "-";
  const RankedUnit& best = ranking.units.front();
  return fmt::format("{}, {} {}", ranking.preferable(),
                     marked(figure(best.value * scale), best.provenance) + best.doubt, unit);
}

}  // namespace

std::vector<std::string> names_of(std::span<const Profile> profiles) {
  std::vector<std::string> names;
  std::multiset<std::string> seen;
  for (const Profile& profile : profiles) {
    names.push_back(std::filesystem::path(profile.path).filename().string());
    seen.insert(names.back());
  }
  for (std::size_t i = 0; i < names.size(); ++i) {
    if (seen.count(names[i]) > 1) names[i] = fmt::format("{} ({})", profiles[i].path, i + 1);
  }
  return names;
}

Table identities_table(std::span<const Profile> profiles) {
  const auto names = names_of(profiles);
  Table table{.title = "Profiles side by side",
              .columns = {{"profile", Align::kLeft},
                          {"platform", Align::kLeft},
                          {"run of", Align::kLeft},
                          {"machine", Align::kLeft},
                          {"differs from the first in", Align::kLeft}}};
  const RunInfo& first = profiles.front().runs.front();
  for (std::size_t i = 0; i < profiles.size(); ++i) {
    const RunInfo& run = profiles[i].runs.front();
    const auto machine = run.environment.find("cpu_model");
    std::vector<std::string> differences;
    if (i > 0) {
      for (const auto& each : compare_identity(first, run)) differences.push_back(describe(each));
    }
    table.rows.push_back({names[i], run.platform, run.started,
                          machine == run.environment.end() ? "not known" : machine->second,
                          i == 0                ? "-"
                          : differences.empty() ? "nothing: they compare"
                                                : join(differences, "; ")});
  }
  table.footnotes = {
      "Figures of runs that differ in one of these facts are of different machines or settings, "
      "not of different programs."};
  return table;
}

Chart side_by_side_chart(std::span<const Profile> profiles) {
  const auto names = names_of(profiles);
  Chart chart{.kind = ChartKind::kDots, .x = {"ms a call", true}};
  chart.table = {.title = "Time a call, side by side",
                 .columns = {{"workload", Align::kLeft},
                             {"unit", Align::kLeft},
                             {"profile", Align::kLeft},
                             {"median ms"},
                             {"of the first"},
                             {"remarks", Align::kLeft}},
                 .footnotes = {"of the first: times what the first profile has for this workload "
                               "and unit.",
                               std::string(provenance_legend())}};
  const auto units = all_of(profiles, [](const Profile& profile) { return profile.units(); });
  for (const auto& workload : all_workloads(profiles)) {
    for (const auto& unit : units) {
      const PhaseRow* first = profiles.front().find(workload, unit, Phase::kCall);
      for (std::size_t i = 0; i < profiles.size(); ++i) {
        const PhaseRow* row = profiles[i].find(workload, unit, Phase::kCall);
        if (row == nullptr) continue;
        chart.table.rows.push_back({workload, unit, names[i],
                                    shown_figure(*row, figure_ms(row->median), row->provenance),
                                    i == 0 ? "-" : times_cell(row, first), judgement_text(*row)});
        Mark mark{.group = fmt::format("{}, {}", workload, unit),
                  .series = names[i],
                  .provenance = row->provenance,
                  .invalid = join(row->reasons, ", "),
                  .doubt = doubt_mark(*row)};
        if (row->median) mark.x = to_ms(*row->median);
        if (row->ci_low) mark.low = to_ms(*row->ci_low);
        if (row->ci_high) mark.high = to_ms(*row->ci_high);
        chart.marks.push_back(std::move(mark));
      }
    }
  }
  chart.summary = fmt::format("{} profiles: {}.", profiles.size(), join(names, ", "));
  return chart;
}

Table best_units_table(std::span<const Profile> profiles) {
  Table table{.title = "The best unit of each workload, side by side",
              .columns = {{"workload", Align::kLeft}},
              .footnotes = {"Of rows that are used; a = b where the intervals of the two overlap.",
                            std::string(provenance_legend())}};
  std::vector<std::vector<Preference>> all;
  const auto names = names_of(profiles);
  for (std::size_t i = 0; i < profiles.size(); ++i) {
    table.columns.push_back({names[i] + ": time", Align::kLeft});
    table.columns.push_back({"energy", Align::kLeft});
    all.push_back(preferences(profiles[i]));
  }
  for (const auto& workload : all_workloads(profiles)) {
    std::vector<std::string> row = {workload};
    for (const auto& each : all) {
      const auto found = std::ranges::find(each, workload, &Preference::workload);
      const bool has = found != each.end();
      row.push_back(has ? best_text(found->by_time, 1, "ms") : "-");
      row.push_back(has ? best_text(found->by_energy, 1e3, "mJ") : "-");
    }
    table.rows.push_back(std::move(row));
  }
  return table;
}

}  // namespace pirt
