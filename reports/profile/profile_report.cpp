#include "reports/profile/profile_report.h"

#include <fmt/core.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <iterator>
#include <map>
#include <set>
#include <string_view>
#include <utility>

#include "characterize/profile/identity.h"
#include "characterize/profile/roofline.h"
#include "reports/document/figures.h"
#include "reports/profile/condition_report.h"
#include "reports/profile/environment_report.h"
#include "reports/profile/roofline_report.h"
#include "reports/profile/shown_row.h"
#include "workloads/base/text/json.h"
#include "workloads/base/text/text.h"
#include "workloads/catalog/catalog.h"

namespace pirt {
namespace {

/// Images a call.
int batch_of(const std::string& workload) {
  const Workload* found = try_find_workload(workload);
  return found == nullptr ? 1 : found->batch;
}

/// A call's share for each image of its batch; "-" where it has one image.
std::string image_cell(const PhaseRow* row) {
  if (row == nullptr || batch_of(row->workload) == 1) return "-";
  if (!row->median) return median_cell(row);
  return shown_figure(*row, figure_ms(*row->median / batch_of(row->workload)), row->provenance);
}

/// Puts the time per image beside that per call, where some workload has a batch.
void add_image_column(const Profile& profile, Table& table) {
  constexpr std::ptrdiff_t kBehindCall = 3;
  const auto names = profile.workloads();
  if (std::ranges::none_of(names, [](const auto& name) { return batch_of(name) > 1; })) return;
  table.columns.insert(table.columns.begin() + kBehindCall, {"call/image"});
  for (auto& row : table.rows) {
    row.insert(row.begin() + kBehindCall,
               image_cell(profile.find(row[0], row[1], Phase::kCall, State::kSteady)));
  }
  table.footnotes.push_back("call/image: the call's time over the images of its batch.");
}

/// Puts what a call needs of memory before the remarks, where that is known of some.
void add_memory_column(const Profile& profile, Table& table) {
  const auto known = [](const PhaseRow& row) {
    return row.host_memory_bytes || row.device_memory_bytes;
  };
  if (std::ranges::none_of(profile.phases, known)) return;
  table.columns.insert(table.columns.end() - 1, {"MB"});
  for (auto& row : table.rows) {
    const auto* call = profile.find(row[0], row[1], Phase::kCall, State::kSteady);
    std::vector<std::string> parts;
    if (call != nullptr) {
      for (const auto& bytes : {call->host_memory_bytes, call->device_memory_bytes}) {
        if (bytes) parts.push_back(figure(static_cast<double>(*bytes) / 1e6));
      }
    }
    row.insert(row.end() - 1, parts.empty() ? "-" : join(parts, " / "));
  }
  table.footnotes.emplace_back(
      "MB: memory that preparing and calling take on the host, / of the device's buffers.");
}

std::string spread(const PhaseRow* row) {
  if (row == nullptr || !is_used(*row) || !row->median || !row->ci_low || !row->ci_high) return "-";
  if (row->median->count() <= 0) return "-";
  if (is_doubted(*row)) {
    return figure_ms(row->ci_low) + " to " + figure_ms(row->ci_high);
  }
  const double half = static_cast<double>((*row->ci_high - *row->ci_low).count()) / 2;
  return fmt::format("{:.1f}%", 100 * half / static_cast<double>(row->median->count()));
}

std::string energy_cell(const EnergyRow* row) {
  if (row == nullptr) return "-";
  const bool is_model = row->provenance != Provenance::kMeasured;
  if (!row->energy_j) return is_model ? "-" : "invalid";
  return shown_mj(*row);
}

struct Word {
  std::string_view name, meaning;
};

/// Of the reasons and notes that characterize/profile/store/schema.sql lists.
constexpr std::array kWords = std::to_array<Word>(
    {{"imprecise", "the interval of the median is more than 20 % either way"},
     {"unstable", "the first half of the samples differs from the second"},
     {"throttled", "the processor was throttled meanwhile"},
     {"few_samples", "fewer samples or processes than asked for"},
     {"input_resized", "the picture was scaled to the workload's size"},
     {"input_cropped", "its edges were cut to keep its proportions"},
     {"precision_not_reached", "the interval of the median is wider than was asked for"},
     {"contended", "other processes took processor time meanwhile"},
     {"bimodal", "the samples have two centres, or the processes"},
     {"no_kernel_cache", "nothing is compiled that could be cached: cold and warm are alike"},
     {kDeterministic, "the figure repeats exactly: one sample is all there is"},
     {"shared_core", "another unit owns one of its cores too"}});

/// What is said of a cell, with the phases that it is said of, in order of first appearance.
using Remarks = std::vector<std::pair<std::string, std::vector<Phase>>>;

/// "contended: 31 % of its time was taken".
std::string uncertain_text(const PhaseRow& row, const std::string& doubt) {
  if (doubt != "contended" || !row.taken || row.phase != Phase::kCall) return doubt;
  return fmt::format("{}: others had its cores for {:.0f} % of its time", doubt, 100 * *row.taken);
}

Remarks remarks_of(const Profile& profile, const std::string& workload, const std::string& unit) {
  Remarks remarks;
  const auto add = [&](const std::string& text, Phase phase) {
    auto found = std::ranges::find(remarks, text, &Remarks::value_type::first);
    if (found == remarks.end()) found = remarks.insert(remarks.end(), {text, {}});
    if (std::ranges::find(found->second, phase) == found->second.end()) {
      found->second.push_back(phase);
    }
  };
  for (const auto& row : profile.phases) {
    if (row.workload != workload || row.unit != unit) continue;
    for (const auto& reason : row.reasons) {
      add(row.unknown().empty() ? "INVALID: " + reason : reason, row.phase);
    }
    for (const auto& doubt : row.doubts) add(uncertain_text(row, doubt), row.phase);
    if (row.bound) {
      add(fmt::format("{} at least {} ms", to_string(row.phase), figure_ms(row.bound)), row.phase);
    }
    for (const auto& note : row.notes) add(note, row.phase);
  }
  const auto* energy = profile.find_energy(workload, unit);
  if (energy != nullptr && energy->provenance == Provenance::kMeasured) {
    for (const auto& reason : energy->reasons) {
      remarks.push_back({"INVALID energy: " + reason, {Phase::kCall}});
    }
    for (const auto& doubt : energy->doubts) {
      remarks.push_back({"uncertain energy: " + doubt, {Phase::kCall}});
    }
  }
  return remarks;
}

bool concerns_call(const std::vector<Phase>& phases) {
  return std::ranges::find(phases, Phase::kCall) != phases.end();
}

/// The phases are named where the call as a whole is not concerned.
std::string remark_text(const std::string& text, const std::vector<Phase>& phases) {
  if (concerns_call(phases)) return text;
  std::vector<std::string> names;
  for (const Phase phase : phases) names.emplace_back(to_string(phase));
  return text + " (" + join(names, ", ") + ")";
}

/// Notes that every workload of a unit has, said once instead of in every row, with their phases.
/// Those that concern the calls of some workloads are said of all phases but the call: the rows
/// whose call is concerned say so themselves.
using CommonNotes = std::map<std::string, std::vector<Phase>>;

CommonNotes common_notes(const Profile& profile, const std::string& unit) {
  struct Found {
    int workloads = 0;
    int calls = 0;
    std::vector<Phase> phases;       ///< In all workloads,
    std::vector<Phase> beside_call;  ///< and in those whose call is not concerned.
  };
  std::map<std::string, Found> notes;
  int workloads = 0;
  const auto add = [](std::vector<Phase>& to, const std::vector<Phase>& phases) {
    for (const Phase phase : phases) {
      if (std::ranges::find(to, phase) == to.end()) to.push_back(phase);
    }
  };
  for (const auto& workload : profile.workloads()) {
    const Remarks remarks = remarks_of(profile, workload, unit);
    if (remarks.empty() && profile.find(workload, unit, Phase::kCall) == nullptr) continue;
    ++workloads;
    for (const auto& [text, phases] : remarks) {
      if (text.starts_with("INVALID")) continue;
      Found& found = notes[text];
      ++found.workloads;
      found.calls += concerns_call(phases) ? 1 : 0;
      add(found.phases, phases);
      if (!concerns_call(phases)) add(found.beside_call, phases);
    }
  }
  CommonNotes common;
  for (auto& [text, found] : notes) {
    if (found.workloads != workloads) continue;
    common[text] = found.calls == workloads ? found.phases : found.beside_call;
  }
  return common;
}

std::string remarks_text(const Remarks& remarks, const CommonNotes& common) {
  std::vector<std::string> parts;
  for (const auto& [text, phases] : remarks) {
    const auto said = common.find(text);
    const bool is_said =
        said != common.end() && (concerns_call(said->second) || !concerns_call(phases));
    if (!is_said) parts.push_back(remark_text(text, phases));
  }
  return join(parts, "; ");
}

/// What the words that occur mean.
std::vector<std::string> glossary(const Profile& profile) {
  std::vector<std::string> lines;
  for (const Word& word : kWords) {
    const auto has = [&](const PhaseRow& row) {
      return std::ranges::find(row.notes, word.name) != row.notes.end() ||
             std::ranges::find(row.doubts, word.name) != row.doubts.end();
    };
    if (std::ranges::any_of(profile.phases, has)) {
      lines.push_back(fmt::format("{}: {}.", word.name, word.meaning));
    }
  }
  return lines;
}

Json phase_json(const PhaseRow& row) {
  Json json = {{"run_id", row.run_id},
               {"platform", row.platform},
               {"workload", row.workload},
               {"unit", row.unit},
               {"backend", row.backend},
               {"phase", to_string(row.phase)},
               {"state", row.condition == Condition::kSteady ? to_string(row.state)
                                                             : to_string(row.condition)},
               {"provenance", to_string(row.provenance)},
               {"valid", is_valid(row)},
               {"reasons", row.reasons},
               {"doubts", row.doubts},
               {"notes", row.notes},
               {"samples", row.samples},
               {"bytes", row.bytes},
               {"processes", row.processes},
               {"mixture", row.provenance.mixture}};
  if (const int batch = batch_of(row.workload); batch > 1) json["batch"] = batch;
  json.put("median_ns", row.median);
  json.put("mad_ns", row.mad);
  json.put("p95_ns", row.p95);
  json.put("p99_ns", row.p99);
  json.put("ci_low_ns", row.ci_low);
  json.put("ci_high_ns", row.ci_high);
  json.put("ops", row.ops);
  json.put("bound_ns", row.bound);
  json.put("cpu_ns", row.cpu);
  json.put("taken", row.taken);
  json.put("host_memory_bytes", row.host_memory_bytes);
  json.put("device_memory_bytes", row.device_memory_bytes);
  return json;
}

Json energy_json(const EnergyRow& row) {
  Json json = {{"run_id", row.run_id},
               {"workload", row.workload},
               {"unit", row.unit},
               {"provenance", to_string(row.provenance)},
               {"source", row.source},
               {"valid", is_valid(row)},
               {"reasons", row.reasons},
               {"doubts", row.doubts},
               {"domain", row.domain},
               {"idle_subtracted", row.idle_subtracted},
               {"mixture", row.provenance.mixture}};
  json.put("energy_j", row.energy_j);
  json.put("ci_low_j", row.ci_low_j);
  json.put("ci_high_j", row.ci_high_j);
  return json;
}

Json run_json(const RunInfo& run) {
  Json units = Json::array();
  for (const auto& unit : run.units) {
    units.push_back({{"unit", unit.unit},
                     {"backend", unit.backend},
                     {"device", unit.device},
                     {"device_is_cpu", unit.device_is_cpu},
                     {"cores", unit.cores}});
  }
  return {
      {"run_id", run.run_id},         {"started", run.started}, {"finished", run.finished},
      {"platform", run.platform},     {"seed", run.seed},       {"environment", run.environment},
      {"identity", identity_of(run)}, {"units", units}};
}

std::string core_text(const std::vector<int>& cores) {
  if (cores.empty()) return "";
  return fmt::format(", core{} {}", cores.size() == 1 ? "" : "s", fmt::join(cores, " "));
}

}  // namespace

Paragraph profile_header(const Profile& profile) {
  Paragraph paragraph;
  const auto& run = profile.runs.front();
  const auto fact = [&](const char* key) {
    const auto it = run.environment.find(key);
    return it == run.environment.end() ? std::string("unknown") : it->second;
  };
  paragraph.lines.push_back(fmt::format("Platform {}, run {} of {}{}; seed {}", run.platform,
                                        run.run_id, run.started,
                                        run.finished.empty() ? " (did not end)" : "", run.seed));
  paragraph.lines.push_back(fmt::format("Machine: {}, kernel {}, governor {}", fact("cpu_model"),
                                        fact("kernel"), fact("governor")));
  for (const auto& unit : run.units) {
    const bool disguised = unit.device_is_cpu && unit.backend == "opencl";
    paragraph.lines.push_back(fmt::format(
        "Unit {}: backend {} on {}{}{}", unit.unit, unit.backend, unit.device,
        core_text(unit.cores), disguised ? "; computes on the host's own cores, not a GPU" : ""));
  }
  return paragraph;
}

namespace {

std::string in_short(const Profile& profile, std::size_t rows) {
  std::map<std::string, int> fastest;
  for (const Preference& each : preferences(profile)) ++fastest[each.by_time.preferable()];
  std::vector<std::string> counts;
  for (const auto& [unit, count] : fastest) {
    counts.push_back(unit == "-" ? fmt::format("none {}", count)
                                 : fmt::format("{} {}", unit, count));
  }
  const auto calls = [&profile](bool (*is)(const PhaseRow&)) {
    return std::ranges::count_if(profile.phases, [is](const PhaseRow& row) {
      return row.phase == Phase::kCall && row.state == State::kSteady && is(row);
    });
  };
  return fmt::format(
      "In short: {} rows of {} workloads, {} uncertain, {} not valid; fastest at so many: {}.",
      rows, profile.workloads().size(), calls(is_doubted<PhaseRow>),
      calls([](const PhaseRow& row) { return !is_used(row); }), join(counts, ", "));
}

}  // namespace

Table profile_table(const Profile& profile) {
  Table table{.title = "Profile (medians, ms)",
              .columns = {{"workload", Align::kLeft},
                          {"unit", Align::kLeft},
                          {"call"},
                          {"+/-"},
                          {"upload"},
                          {"launch"},
                          {"execute"},
                          {"download"},
                          {"prepare cold"},
                          {"warm"},
                          {"energy mJ"},
                          {"roofline"},
                          {"samples"},
                          {"remarks", Align::kLeft}}};
  const Rooflines roofs = rooflines(profile);
  std::map<std::string, CommonNotes> common;
  for (const auto& unit : profile.units()) common[unit] = common_notes(profile, unit);
  for (const auto& workload : profile.workloads()) {
    for (const auto& unit : profile.units()) {
      const auto phase = [&](Phase p, State state = State::kSteady) {
        return profile.find(workload, unit, p, state);
      };
      const auto* call = phase(Phase::kCall);
      const auto* cold = phase(Phase::kPrepare, State::kCold);
      if (call == nullptr && cold == nullptr) continue;
      table.rows.push_back({workload, unit, median_cell(call), spread(call),
                            median_cell(phase(Phase::kUpload)), median_cell(phase(Phase::kLaunch)),
                            median_cell(phase(Phase::kExecute)),
                            median_cell(phase(Phase::kDownload)), median_cell(cold),
                            median_cell(phase(Phase::kPrepare, State::kWarm)),
                            energy_cell(profile.find_energy(workload, unit)),
                            roofline_cell(roofs.find(workload, unit)),
                            call == nullptr ? "0" : fmt::format("{}", call->samples),
                            remarks_text(remarks_of(profile, workload, unit), common[unit])});
    }
  }
  table.footnotes = {
      "call = upload + launch + execute + download of one call; +/-: half the 95 % confidence "
      "interval of its "
      "median, or, of an uncertain figure, all of it; - a phase that the unit does not have.",
      std::string(provenance_legend())};
  for (auto& line : roofline_footnotes(roofs)) table.footnotes.push_back(std::move(line));
  for (const auto& [unit, notes] : common) {
    if (notes.empty()) continue;
    std::vector<std::string> list;
    for (const auto& [text, phases] : notes) list.push_back(remark_text(text, phases));
    table.footnotes.push_back(fmt::format("All rows of {}: {}", unit, join(list, ", ")));
  }
  for (auto& line : glossary(profile)) table.footnotes.push_back(std::move(line));
  std::set<std::string> sources;
  for (const auto& energy : profile.energies) {
    sources.insert(fmt::format("{} ({}; idle {}): {}", energy.unit, energy.domain,
                               energy.idle_subtracted ? "subtracted" : "included", energy.source));
  }
  for (const auto& source : sources) table.footnotes.push_back("Energy of " + source);
  add_image_column(profile, table);
  add_memory_column(profile, table);
  table.footnotes.push_back(in_short(profile, table.rows.size()));
  return table;
}

Table preference_table(const std::vector<Preference>& preferences, bool with_paper) {
  Table table{.title = "Preferable unit for each workload (the paper's Table III for this machine)",
              .columns = {{"workload", Align::kLeft},
                          {"by time", Align::kLeft},
                          {"ms"},
                          {"next takes"},
                          {"by energy", Align::kLeft},
                          {"mJ"}}};
  if (with_paper) {
    table.columns.push_back({"paper: time", Align::kLeft});
    table.columns.push_back({"paper: energy", Align::kLeft});
  }
  for (const auto& p : preferences) {
    const auto best = [](const Ranking& ranking, double scale) {
      if (ranking.units.empty()) return std::string("-");
      const RankedUnit& first = ranking.units[0];
      return marked(figure(first.value * scale), first.provenance) + first.doubt;
    };
    const auto advantage = p.by_time.advantage();
    auto& row = table.rows.emplace_back();
    row = {p.workload,
           p.by_time.preferable(),
           best(p.by_time, 1),
           advantage ? figure(*advantage) + "x" : "-",
           p.by_energy.preferable(),
           best(p.by_energy, 1e3)};
    if (!with_paper) continue;
    for (const auto& paper : {p.paper_time, p.paper_energy}) {
      row.push_back(paper ? marked(*paper, Provenance::kPublished) : "-");
    }
  }
  table.footnotes = {
      std::string(
          "By phase call, transfers included; a = b where the confidence intervals overlap. "
          "next takes: by time.") +
          (with_paper ? " The paper's units are those of its three boards." : ""),
      std::string(provenance_legend())};
  return table;
}

Json ranking_json(const Ranking& ranking, const char* value_key) {
  Json units = Json::array();
  for (const auto& unit : ranking.units) {
    units.push_back(
        {{"unit", unit.unit}, {value_key, unit.value}, {"provenance", to_string(unit.provenance)}});
  }
  Json json = {{"preferable", ranking.preferable()}, {"units", units}};
  json.put("advantage", ranking.advantage());
  return json;
}

Json preference_json(const std::vector<Preference>& preferences) {
  Json json = Json::array();
  for (const auto& p : preferences) {
    json.push_back({{"workload", p.workload},
                    {"by_time", ranking_json(p.by_time, "call_ms")},
                    {"by_energy", ranking_json(p.by_energy, "energy_j")}});
  }
  return json;
}

Json profile_json(const Profile& profile, const std::vector<Preference>& preferences) {
  Json json = {{"runs", Json::array()},
               {"profile_summary", Json::array()},
               {"condition_summary", Json::array()},
               {"unit_time_summary", unit_time_json(profile)},
               {"energy_summary", Json::array()},
               {"preferable", preference_json(preferences)},
               {"roofline", roofline_json(rooflines(profile))}};
  for (const auto& run : profile.runs) json["runs"].push_back(run_json(run));
  for (const auto& row : profile.phases) json["profile_summary"].push_back(phase_json(row));
  for (const auto& row : profile.conditions) json["condition_summary"].push_back(phase_json(row));
  for (const auto& row : profile.energies) json["energy_summary"].push_back(energy_json(row));
  return json;
}

}  // namespace pirt
