#include "reports/full_report.h"

#include <fmt/core.h>

#include <algorithm>
#include <utility>

#include "reports/paper/local_tables.h"
#include "reports/paper/scorecard.h"
#include "reports/paper/table3.h"
#include "reports/profile/condition_report.h"
#include "reports/profile/environment_report.h"
#include "reports/profile/preference.h"
#include "reports/profile/profile_charts.h"
#include "reports/profile/profile_report.h"
#include "reports/profile/roofline_report.h"
#include "reports/profile/setup_report.h"
#include "reports/profile/side_by_side.h"
#include "reports/run/answer.h"
#include "reports/run/comparison_report.h"
#include "reports/run/live_report.h"
#include "reports/run/pareto.h"
#include "reports/run/run_report.h"
#include "scheduler/policies/policy.h"
#include "scheduler/record/keeping_up.h"
#include "workloads/base/error.h"
#include "workloads/base/text/json.h"
#include "workloads/base/text/text.h"

namespace pirt {
namespace {

ModeRuns skipped(const std::vector<std::string>& modes, const std::string& why) {
  ModeRuns none;
  for (const auto& mode : modes) none.skipped.push_back({mode, why});
  return none;
}

/// Those of the paper's four modes that ran.
std::vector<RunRecord> papers_modes(const Machine& machine) {
  std::vector<RunRecord> runs;
  for (const auto& mode : paper_modes()) {
    const auto found = std::ranges::find(machine.modes.runs, mode, &RunRecord::mode);
    if (found != machine.modes.runs.end()) runs.push_back(*found);
  }
  return runs;
}

/// With those that could not run.
ModeRuns paper_modes_of(const Machine& machine) {
  ModeRuns modes{.runs = papers_modes(machine), .skipped = {}};
  for (const auto& each : machine.modes.skipped) {
    const auto shown = paper_modes();
    if (std::ranges::find(shown, each.mode) != shown.end()) modes.skipped.push_back(each);
  }
  return modes;
}

/// Why some of the paper's modes are not shown.
std::vector<std::string> missing_modes(const Machine& machine) {
  return reason_lines(paper_modes_of(machine).skipped);
}

/// Adds the parts of one machine's sections.
class Sections {
 public:
  Sections(Document& document, const Machine& machine, std::string prefix)
      : parts_(document.parts), machine_(machine), prefix_(std::move(prefix)) {}

  void header(const std::vector<std::string>& notes) {
    heading("What was measured, and on what");
    parts_.emplace_back(profile_header(machine_.profile));
    if (!notes.empty()) parts_.emplace_back(Paragraph{notes});
  }
  void time_and_energy() {
    heading("Time and energy");
    add(time_charts(machine_.profile));
    add(energy_charts(machine_.profile));
    parts_.emplace_back(distribution_chart(machine_.profile));
  }
  void set_up() {
    const auto costs = offloading_costs(machine_.profile);
    if (costs.costs.empty()) return;
    heading("Set-up");
    auto offloading = offloading_chart(costs);
    offloading.table.origin = origin_of(machine_.profile);
    parts_.emplace_back(std::move(offloading));
    if (auto crossovers = crossover_chart(costs); !crossovers.marks.empty()) {
      crossovers.table.origin = origin_of(machine_.profile);
      parts_.emplace_back(std::move(crossovers));
    }
  }
  void limits() {
    heading("Limits of the units");
    add(roofline_charts(machine_.profile));
    add(peak_table(rooflines(machine_.profile)));
  }
  void choices(bool with_modes) {
    const bool modes_ran = !machine_.modes.runs.empty() || !machine_.modes.skipped.empty();
    heading(modes_ran ? "Which unit, which mode" : "Which unit");
    add(preference_table(preferences(machine_.profile)));
    const auto modes = papers_modes(machine_);
    if (with_modes && !modes.empty()) {
      for (Table& table : answer_tables(modes)) parts_.emplace_back(std::move(table));
      parts_.emplace_back(modes_table(modes));
    }
    const auto missing = missing_modes(machine_);
    if (!missing.empty()) {
      parts_.emplace_back(Paragraph{{"Modes that are not shown: " + join(missing, "; ")}});
    }
    add(pareto_charts(mode_points(machine_.modes.runs)));
    std::vector<std::string> behind;
    for (const RunRecord& run : machine_.modes.runs) {
      if (keeps_up(run)) continue;
      behind.push_back(fmt::format("{} ({} of {} tasks)", run.mode, run.completed, run.submitted));
    }
    if (!behind.empty()) {
      parts_.emplace_back(Paragraph{{"Modes that do not keep up: " + join(behind, ", ")}});
    }
  }
  void rows(bool with_facts) {
    heading(with_facts ? "Every row, and what was recorded with it" : "Every row");
    add(profile_table(machine_.profile));
    for (auto& table : condition_tables(machine_.profile)) add(std::move(table));
    if (with_facts) add(environment_table(machine_.profile));
  }

 private:
  void heading(const std::string& text) { parts_.emplace_back(Heading{prefix_ + text}); }
  /// A table of the profile's figures.
  void add(Table table) {
    table.origin = origin_of(machine_.profile);
    parts_.emplace_back(std::move(table));
  }
  void add(std::vector<Chart> charts) {
    for (auto& chart : charts) parts_.emplace_back(std::move(chart));
  }

  std::vector<Part>& parts_;
  const Machine& machine_;
  std::string prefix_;
};

void add_side_by_side(Document& document, const std::vector<Profile>& profiles) {
  document.parts.emplace_back(Heading{"Side by side"});
  document.parts.emplace_back(identities_table(profiles));
  document.parts.emplace_back(side_by_side_chart(profiles));
  document.parts.emplace_back(best_units_table(profiles));
}

ModeRuns modes_without_machine(const ReportInputs& inputs) {
  return inputs.runs.empty() ? inputs.modelled : ModeRuns{.runs = inputs.runs, .skipped = {}};
}

/// What the answer is about: the runs that are given, if any.
ModeRuns answered_modes(const ReportInputs& inputs) {
  if (inputs.runs.empty()) return paper_modes_of(inputs.machines.front());
  ModeRuns modes{.runs = inputs.runs, .skipped = {}};
  // What virtual time says of a live run is no other mode.
  std::erase_if(modes.runs,
                [&](const RunRecord& run) { return run.time != inputs.runs.front().time; });
  return modes;
}

/// What the modes make of a mix where nothing was measured.
void add_modelled(const ReportInputs& inputs, Document& document) {
  const ModeRuns modes = modes_without_machine(inputs);
  for (Part& part : comparison_document(modes, inputs.mix).parts) {
    document.parts.push_back(std::move(part));
  }
  for (Chart& chart : pareto_charts(mode_points(modes.runs))) {
    document.parts.emplace_back(std::move(chart));
  }
  if (inputs.runs.empty() && !modes.runs.empty()) {
    document.parts.emplace_back(modes_table(modes.runs));
  }
}

std::vector<const Profile*> profiles_of(const ReportInputs& inputs) {
  std::vector<const Profile*> profiles;
  for (const Machine& machine : inputs.machines) profiles.push_back(&machine.profile);
  return profiles;
}

Table3 table3_of(const Machine& machine, const std::vector<Profile>& others) {
  std::vector<const Profile*> profiles = {&machine.profile};
  for (const Profile& other : others) profiles.push_back(&other);
  return table3(profiles);
}

Evidence evidence_of(const Machine* machine, const Mix& mix, const PaperRuns& paper) {
  Evidence evidence{.cells = &paper.cells, .section5 = &paper.section5};
  if (machine == nullptr) return evidence;
  evidence.profile = &machine->profile;
  evidence.platform = machine->platform ? &*machine->platform : nullptr;
  evidence.mix = &mix;
  evidence.modes = &machine->modes;
  if (!machine->table5.runs.empty()) evidence.table5 = &machine->table5;
  return evidence;
}

}  // namespace

ModeRuns runs_of(const Profile& profile, const std::optional<Platform>& platform, const Mix& mix,
                 const std::vector<std::string>& modes, const std::string& why, bool strict) {
  if (!platform) return skipped(modes, why);
  ScheduleOptions options;
  options.strict = strict;
  try {
    return run_modes(*platform, &profile, mix, modes, options);
  } catch (const Error& error) {
    return skipped(modes, error.what());
  }
}

Machine machine_of(Profile profile, std::optional<Platform> platform, const Mix& mix,
                   const std::string& why, bool strict) {
  Machine machine{
      .profile = std::move(profile), .platform = std::move(platform), .modes = {}, .table5 = {}};
  machine.modes = runs_of(machine.profile, machine.platform, mix, policy_names(), why, strict);
  return machine;
}

ModeRuns table5_of(const Machine& machine, bool strict) {
  return runs_of(machine.profile, machine.platform, load_mix("convolution-1000"),
                 {"throughput", "latency", "energy"}, "", strict);
}

std::vector<std::string> mismatches(const ReportInputs& inputs) {
  std::vector<std::string> notes;
  const auto is_of = [&](const std::string& platform) {
    return std::ranges::any_of(inputs.machines, [&](const Machine& machine) {
      return machine.profile.platform() == platform;
    });
  };
  if (inputs.machines.empty()) return notes;
  for (const RunRecord& run : inputs.runs) {
    if (is_of(run.platform)) continue;
    notes.push_back(
        fmt::format("NOT COMPARABLE: the run of mode {} is of platform {}, the "
                    "database of {}",
                    run.mode, run.platform, inputs.machines.front().profile.platform()));
  }
  for (const Timeline& timeline : inputs.timelines) {
    if (is_of(timeline.platform)) continue;
    notes.push_back(fmt::format(
        "NOT COMPARABLE: the trace {} is of platform {}, the database of {}", timeline.source,
        timeline.platform, inputs.machines.front().profile.platform()));
  }
  return notes;
}

Document full_report(const ReportInputs& inputs) {
  const bool several = inputs.machines.size() > 1;
  std::vector<Profile> profiles;
  if (several) {
    for (const Machine& machine : inputs.machines) profiles.push_back(machine.profile);
  }
  const auto names = names_of(profiles);
  Document document{.title = "pirt report", .parts = {}};
  if (several) add_side_by_side(document, profiles);
  if (inputs.machines.size() == 1) {
    const ModeRuns modes = answered_modes(inputs);
    if (!(modes.runs.empty() && modes.skipped.empty())) {
      document.parts.emplace_back(Paragraph{answer_of(modes).lines()});
    }
  }
  if (inputs.machines.empty()) add_modelled(inputs, document);
  std::vector<Sections> sections;
  for (std::size_t i = 0; i < inputs.machines.size(); ++i) {
    sections.emplace_back(document, inputs.machines[i], several ? names[i] + ": " : "");
    sections.back().header(i == 0 ? mismatches(inputs) : std::vector<std::string>{});
    sections.back().choices(inputs.runs.empty());
    sections.back().time_and_energy();
    sections.back().set_up();
    sections.back().limits();
  }
  if (!inputs.runs.empty() || !inputs.timelines.empty()) {
    document.parts.emplace_back(Heading{"What ran where and when"});
  }
  if (!inputs.runs.empty()) document.parts.emplace_back(modes_table(inputs.runs));
  for (const Timeline& timeline : inputs.timelines) {
    document.parts.emplace_back(timeline_chart(timeline));
  }
  for (Part& part : live_parts(inputs.runs, profiles_of(inputs))) {
    document.parts.push_back(std::move(part));
  }
  for (Sections& each : sections) each.rows(inputs.facts);
  return document;
}

Json full_report_json(const ReportInputs& inputs) {
  Json json;
  if (inputs.machines.empty()) {
    json = comparison_json(modes_without_machine(inputs));
    Json runs = json["runs"];
    json.erase("runs");
    json["modes"] = std::move(runs);
    return json;
  }
  for (const Machine& machine : inputs.machines) {
    Json one = profile_json(machine.profile, preferences(machine.profile));
    one["setup"] = setup_json(offloading_costs(machine.profile));
    one["pareto"] = pareto_json(mode_points(machine.modes.runs));
    if (&machine == &inputs.machines.front()) {
      json = std::move(one);
    } else {
      json["others"].push_back(std::move(one));
    }
  }
  const Machine& first = inputs.machines.front();
  json["modes"] = Json::array();
  for (const auto& run : inputs.runs.empty() ? papers_modes(first) : inputs.runs) {
    json["modes"].push_back(to_json(run));
  }
  const auto missing = missing_modes(first);
  if (inputs.runs.empty() && !missing.empty()) json["modes_missing"] = join(missing, "; ");
  auto live = live_json(inputs.runs, profiles_of(inputs));
  if (!live.empty()) json["live"] = std::move(live);
  return json;
}

Document brief_document(const Profile& profile, const ModeRuns& modes, const Mix& mix) {
  Document document{.title = "pirt report compare", .parts = {}};
  document.parts = comparison_document(modes, mix, false).parts;
  document.parts.emplace_back(preference_table(preferences(profile)));
  document.parts.emplace_back(profile_header(profile));
  return document;
}

Json brief_json(const Profile& profile, const ModeRuns& modes) {
  Json json = comparison_json(modes);
  json["preferable"] = preference_json(preferences(profile));
  return json;
}

Document paper_document(const Machine* machine, const std::vector<Profile>& others, const Mix& mix,
                        const PaperRuns& paper) {
  Document document{.title = "pirt report paper", .parts = {}};
  if (machine != nullptr) document.parts.emplace_back(profile_header(machine->profile));
  document.parts.emplace_back(scorecard_table(scorecard(evidence_of(machine, mix, paper))));
  document.parts.emplace_back(contradictions_table());
  document.parts.emplace_back(paper_table(paper.cells));
  document.parts.emplace_back(section5_table(paper.section5));
  if (machine == nullptr) return document;
  for (Table& table : table3_tables(table3_of(*machine, others))) {
    document.parts.emplace_back(std::move(table));
  }
  document.parts.emplace_back(preference_table(preferences(machine->profile), true));
  const auto platform = machine->platform ? &*machine->platform : nullptr;
  document.parts.emplace_back(cloud_table(inferences(machine->profile, platform)));
  if (!machine->table5.runs.empty()) {
    document.parts.emplace_back(scheduling_table(machine->table5.runs));
  }
  return document;
}

Json paper_document_json(const Machine* machine, const std::vector<Profile>& others, const Mix& mix,
                         const PaperRuns& paper) {
  Json json = paper_json(paper.cells);
  if (machine != nullptr) json["table3"] = table3_json(table3_of(*machine, others));
  json["section5"] = section5_json(paper.section5);
  json["scorecard"] = scorecard_json(scorecard(evidence_of(machine, mix, paper)));
  return json;
}

}  // namespace pirt
