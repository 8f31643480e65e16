#include "reports/profile/profile_diff.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <map>
#include <set>
#include <utility>

#include "characterize/machine/environment_keys.h"
#include "characterize/profile/identity.h"
#include "reports/document/figures.h"
#include "reports/profile/shown_row.h"
#include "workloads/base/error.h"
#include "workloads/base/text/json.h"
#include "workloads/base/text/text.h"

namespace pirt {
namespace {

using Information = std::map<std::string, std::set<std::string>>;

std::string text_of(const std::set<std::string>& values) {
  return fmt::format("{}", fmt::join(values, " / "));
}

/// Whether a fact is about something that both profiles have: "unit.gpu.version" is, if both have
/// a unit gpu.
bool in_common(const std::string& fact, const std::set<std::string>& units) {
  constexpr std::string_view kPrefix = "unit.";
  if (!fact.starts_with(kPrefix)) return true;
  const auto end = fact.find('.', kPrefix.size());
  return units.contains(fact.substr(kPrefix.size(), end - kPrefix.size()));
}

std::set<std::string> units_in_common(const Profile& a, const Profile& b) {
  std::set<std::string> units;
  for (const auto& unit : a.units()) {
    const auto others = b.units();
    if (std::ranges::find(others, unit) != others.end()) units.insert(unit);
  }
  return units;
}

/// Not of one that came to none, which the gate reads besides.
bool has_rows(const Profile& profile, const RunInfo& run) {
  const auto are_its = [&run](const auto& rows) {
    return std::ranges::any_of(rows, [&run](const auto& row) { return row.run_id == run.run_id; });
  };
  return are_its(profile.phases) || are_its(profile.conditions) || are_its(profile.unit_times) ||
         are_its(profile.energies) || are_its(profile.peaks);
}

/// All facts of the runs that are no identity.
Information information_of(const Profile& profile, const std::set<std::string>& units) {
  Information facts;
  for (const RunInfo& run : profile.runs) {
    if (!has_rows(profile, run)) continue;
    const auto identity = identity_of(run);
    for (const auto& [key, value] : run.environment) {
      const bool of_identity = identity.contains(key) || fact_kind(key) == FactKind::kIdentity;
      if (!of_identity && in_common(key, units)) facts[key].insert(value);
    }
  }
  return facts;
}

/// The identity of every pair of runs that rows come from; fields in the order of
/// environment_keys().
std::vector<FactDifference> identity_differences(const Profile& a, const Profile& b,
                                                 const std::set<std::string>& units) {
  std::vector<std::string> fields;
  Information values_a;
  Information values_b;
  for (const RunInfo& run_a : a.runs) {
    for (const RunInfo& run_b : b.runs) {
      if (!has_rows(a, run_a) || !has_rows(b, run_b)) continue;
      for (const auto& found : compare_identity(run_a, run_b)) {
        if (!found.unit.empty() && !units.contains(found.unit)) continue;
        if (std::ranges::find(fields, found.field) == fields.end()) fields.push_back(found.field);
        if (found.a) values_a[found.field].insert(*found.a);
        if (found.b) values_b[found.field].insert(*found.b);
      }
    }
  }
  std::vector<FactDifference> differences;
  for (const std::string& field : fields) {
    const auto text = [&field](const Information& values) -> std::optional<std::string> {
      const auto it = values.find(field);
      return it == values.end() ? std::nullopt : std::optional(text_of(it->second));
    };
    differences.push_back({field, text(values_a), text(values_b)});
  }
  return differences;
}

void diff_facts(ProfileDiff& diff) {
  const auto units = units_in_common(*diff.a, *diff.b);
  diff.identity = identity_differences(*diff.a, *diff.b, units);
  const Information a = information_of(*diff.a, units);
  const Information b = information_of(*diff.b, units);
  std::set<std::string> keys;
  for (const auto& [key, values] : a) keys.insert(key);
  for (const auto& [key, values] : b) keys.insert(key);
  for (const auto& key : keys) {
    const auto value = [&key](const Information& facts) -> std::optional<std::string> {
      const auto it = facts.find(key);
      return it == facts.end() ? std::nullopt : std::optional(text_of(it->second));
    };
    FactDifference difference{key, value(a), value(b)};
    if (difference.a != difference.b) diff.information.push_back(std::move(difference));
  }
}

std::vector<std::string> cells_only_in(const Profile& profile, const Profile& other) {
  std::vector<std::string> cells;
  for (const PhaseRow& row : profile.phases) {
    const bool there = std::ranges::any_of(other.phases, [&row](const PhaseRow& r) {
      return r.workload == row.workload && r.unit == row.unit;
    });
    auto cell = row.workload + " on " + row.unit;
    if (!there && std::ranges::find(cells, cell) == cells.end()) cells.push_back(std::move(cell));
  }
  return cells;
}

std::string phase_name(const PhaseRow& row) {
  std::string name = row.phase_name();
  if (row.condition != Condition::kSteady) name += fmt::format(" {}", to_string(row.condition));
  return name;
}

std::string shown(const PhaseRow& row) {
  return shown_figure(row, figure_ms(row.median), row.provenance);
}

std::string shown(const EnergyRow& row) {
  if (!row.energy_j) return "invalid";
  return shown_figure(row, figure(*row.energy_j * 1e3), row.provenance);
}

/// Three decimals: differences of a percent are what is looked for.
std::string ratio_text(std::optional<double> ratio) {
  return ratio ? fmt::format("{:.3f}", *ratio) : "-";
}

std::string remarks(const std::vector<std::string>& a, const std::vector<std::string>& b) {
  std::vector<std::string> parts;
  if (!a.empty()) parts.push_back("a INVALID: " + join(a, ", "));
  if (!b.empty()) parts.push_back("b INVALID: " + join(b, ", "));
  return join(parts, "; ");
}

std::string description(std::string_view name, const Profile& profile) {
  std::vector<std::string> runs;
  for (const RunInfo& run : profile.runs) {
    runs.push_back(fmt::format("{} of {}", run.run_id, run.started));
  }
  return fmt::format("{}: {}, platform {}, run {}", name, profile.path, profile.platform(),
                     join(runs, ", "));
}

Table identity_table(const ProfileDiff& diff) {
  Table table{.title = "Identity differs: ratios compare different things",
              .columns = {{"fact", Align::kLeft}, {"a", Align::kLeft}, {"b", Align::kLeft}}};
  for (const auto& [fact, a, b] : diff.identity) {
    table.rows.push_back({fact, a.value_or("-"), b.value_or("-")});
  }
  return table;
}

Table figure_table(const ProfileDiff& diff) {
  Table table{.title = "Figures side by side (medians, ms)",
              .columns = {{"workload", Align::kLeft},
                          {"unit", Align::kLeft},
                          {"phase", Align::kLeft},
                          {"a"},
                          {"b"},
                          {"b/a"},
                          {"intervals", Align::kLeft},
                          {"remarks", Align::kLeft}}};
  const auto add = [&table](const PhasePair& pair) {
    const auto overlap = pair.overlap();
    table.rows.push_back({pair.a->workload, pair.a->unit, phase_name(*pair.a), shown(*pair.a),
                          shown(*pair.b), ratio_text(pair.ratio()),
                          overlap ? (*overlap ? "overlap" : "apart") : "-",
                          remarks(pair.a->reasons, pair.b->reasons)});
  };
  for (const PhasePair& pair : diff.phases) add(pair);
  for (const PhasePair& pair : diff.conditions) add(pair);
  table.footnotes = {
      "intervals: whether the 95 % intervals of the two medians meet; - where one has none (a "
      "set-up of few samples). Apart is no verdict: runs of the same program are apart at times.",
      std::string(provenance_legend())};
  for (const auto& [name, cells] : {std::pair("a", &diff.only_a), std::pair("b", &diff.only_b)}) {
    if (cells->empty()) continue;
    table.footnotes.push_back(fmt::format("Only in {}: {}", name, join(*cells, ", ")));
  }
  return table;
}

Table unit_time_table(const ProfileDiff& diff) {
  Table table{.title = "What units take beside their calls, side by side (medians, us)",
              .columns = {{"unit", Align::kLeft},
                          {"phase", Align::kLeft},
                          {"it slept, ms"},
                          {"a"},
                          {"b"},
                          {"b/a"}}};
  for (const UnitTimePair& pair : diff.unit_times) {
    const auto us = [](const UnitTimeRow& row) {
      return row.median ? shown_figure(row, figure(1e6 * to_s(*row.median)), Provenance::kMeasured)
                        : std::string("invalid");
    };
    table.rows.push_back({pair.a->unit, std::string(to_string(pair.a->phase)),
                          figure_ms(pair.a->sleep), us(*pair.a), us(*pair.b),
                          ratio_text(pair.ratio())});
  }
  return table;
}

Table energy_table(const ProfileDiff& diff) {
  Table table{.title = "Energy side by side (mJ a call)",
              .columns = {{"workload", Align::kLeft},
                          {"unit", Align::kLeft},
                          {"a"},
                          {"b"},
                          {"b/a"},
                          {"covers", Align::kLeft},
                          {"remarks", Align::kLeft}}};
  for (const EnergyPair& pair : diff.energies) {
    const bool same =
        pair.a->domain == pair.b->domain && pair.a->idle_subtracted == pair.b->idle_subtracted;
    const auto covers = [](const EnergyRow& row) {
      return row.domain + (row.idle_subtracted ? " above idle" : " with idle");
    };
    table.rows.push_back({pair.a->workload, pair.a->unit, shown(*pair.a), shown(*pair.b),
                          ratio_text(pair.ratio()),
                          same ? covers(*pair.a) : covers(*pair.a) + " / " + covers(*pair.b),
                          remarks(pair.a->reasons, pair.b->reasons)});
  }
  return table;
}

Json side_json(const PhaseRow& row) {
  Json json = {{"run_id", row.run_id},
               {"provenance", to_string(row.provenance)},
               {"mixture", row.provenance.mixture},
               {"valid", is_valid(row)},
               {"reasons", row.reasons},
               {"doubts", row.doubts},
               {"notes", row.notes},
               {"samples", row.samples}};
  json.put("median_ns", row.median);
  json.put("ci_low_ns", row.ci_low);
  json.put("ci_high_ns", row.ci_high);
  return json;
}

Json side_json(const EnergyRow& row) {
  Json json = {{"run_id", row.run_id},
               {"provenance", to_string(row.provenance)},
               {"source", row.source},
               {"domain", row.domain},
               {"idle_subtracted", row.idle_subtracted},
               {"valid", is_valid(row)},
               {"reasons", row.reasons},
               {"doubts", row.doubts}};
  json.put("energy_j", row.energy_j);
  return json;
}

Json profile_side_json(const Profile& profile) {
  Json runs = Json::array();
  for (const RunInfo& run : profile.runs) runs.push_back(run.run_id);
  return {{"path", profile.path}, {"platform", profile.platform()}, {"runs", runs}};
}

Json facts_json(const std::vector<FactDifference>& facts) {
  Json json = Json::array();
  for (const auto& difference : facts) {
    Json entry = {{"fact", difference.fact}};
    entry.put("a", difference.a);
    entry.put("b", difference.b);
    json.push_back(std::move(entry));
  }
  return json;
}

}  // namespace

std::optional<double> PhasePair::ratio() const { return ratio_of(*b, *a); }

std::optional<bool> PhasePair::overlap() const {
  if (!is_used(*a) || !is_used(*b) || !a->ci_low || !b->ci_low) return std::nullopt;
  return *a->ci_low <= *b->ci_high && *b->ci_low <= *a->ci_high;
}

std::optional<double> UnitTimePair::ratio() const { return ratio_of(*b, *a); }

std::optional<double> EnergyPair::ratio() const {
  if (!is_used(*a) || !is_used(*b) || !a->energy_j || !b->energy_j || *a->energy_j <= 0) {
    return std::nullopt;
  }
  return *b->energy_j / *a->energy_j;
}

ProfileDiff diff_profiles(const Profile& a, const Profile& b) {
  ProfileDiff diff;
  diff.a = &a;
  diff.b = &b;
  for (const PhaseRow& row : a.phases) {
    const auto* other = b.find(row.workload, row.unit, row.phase, row.state);
    if (other != nullptr) diff.phases.push_back({&row, other});
  }
  for (const PhaseRow& row : a.conditions) {
    const auto* other = b.find_condition(row.workload, row.unit, row.condition);
    if (other != nullptr) diff.conditions.push_back({&row, other});
  }
  for (const UnitTimeRow& row : a.unit_times) {
    const auto other = std::ranges::find_if(b.unit_times, [&row](const UnitTimeRow& each) {
      return each.unit == row.unit && each.phase == row.phase && each.sleep == row.sleep;
    });
    if (other != b.unit_times.end()) diff.unit_times.push_back({&row, &*other});
  }
  for (const EnergyRow& row : a.energies) {
    const auto* other = b.find_energy(row.workload, row.unit);
    if (other != nullptr) diff.energies.push_back({&row, other});
  }
  diff.only_a = cells_only_in(a, b);
  diff.only_b = cells_only_in(b, a);
  if (diff.phases.empty()) {
    throw_bad_input(fmt::format(
        "'{}' (platform {}: {}) and '{}' (platform {}: {}) have no cell in common, so that there "
        "is nothing to compare; choose runs of the same units with --platform",
        a.path, a.platform(), join(diff.only_a, ", "), b.path, b.platform(),
        join(diff.only_b, ", ")));
  }
  diff_facts(diff);
  return diff;
}

Document diff_document(const ProfileDiff& diff) {
  Document document{.title = "pirt diff", .parts = {}};
  Paragraph head{{description("a", *diff.a), description("b", *diff.b)}};
  if (diff.identity.empty()) {
    head.lines.emplace_back("Identity (processor, devices, inputs, build) is the same.");
  }
  if (!diff.information.empty()) {
    std::vector<std::string> names;
    for (const auto& difference : diff.information) names.push_back(difference.fact);
    head.lines.push_back("Other facts that differ: " + join(names, ", "));
  }
  document.parts.emplace_back(std::move(head));
  if (!diff.identity.empty()) document.parts.emplace_back(identity_table(diff));
  document.parts.emplace_back(figure_table(diff));
  if (!diff.unit_times.empty()) document.parts.emplace_back(unit_time_table(diff));
  if (!diff.energies.empty()) document.parts.emplace_back(energy_table(diff));
  return document;
}

Json diff_json(const ProfileDiff& diff) {
  Json json = {{"a", profile_side_json(*diff.a)},
               {"b", profile_side_json(*diff.b)},
               {"same_identity", diff.identity.empty()},
               {"identity", facts_json(diff.identity)},
               {"information", facts_json(diff.information)},
               {"figures", Json::array()},
               {"conditions", Json::array()},
               {"unit_times", Json::array()},
               {"energies", Json::array()},
               {"only_in_a", diff.only_a},
               {"only_in_b", diff.only_b}};
  const auto figure_json = [](const PhasePair& pair) {
    const bool steady = pair.a->condition == Condition::kSteady;
    Json row = {{"workload", pair.a->workload},
                {"unit", pair.a->unit},
                {"phase", to_string(pair.a->phase)},
                {"state", steady ? to_string(pair.a->state) : to_string(pair.a->condition)},
                {"a", side_json(*pair.a)},
                {"b", side_json(*pair.b)}};
    row.put("ratio", pair.ratio());
    row.put("intervals_overlap", pair.overlap());
    return row;
  };
  for (const PhasePair& pair : diff.phases) json["figures"].push_back(figure_json(pair));
  for (const PhasePair& pair : diff.conditions) json["conditions"].push_back(figure_json(pair));
  for (const UnitTimePair& pair : diff.unit_times) {
    Json row = {{"unit", pair.a->unit},
                {"phase", to_string(pair.a->phase)},
                {"sleep_ns", pair.a->sleep.count()}};
    row.put("a_median_ns", pair.a->median);
    row.put("b_median_ns", pair.b->median);
    row.put("ratio", pair.ratio());
    json["unit_times"].push_back(std::move(row));
  }
  for (const EnergyPair& pair : diff.energies) {
    Json row = {{"workload", pair.a->workload},
                {"unit", pair.a->unit},
                {"a", side_json(*pair.a)},
                {"b", side_json(*pair.b)}};
    row.put("ratio", pair.ratio());
    json["energies"].push_back(std::move(row));
  }
  return json;
}

}  // namespace pirt
