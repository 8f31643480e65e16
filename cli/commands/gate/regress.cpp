// pirt regress: did anything become slower, between two stored profiles or two programs?
#include "cli/commands/gate/regress.h"

#include <fmt/core.h>

#include <algorithm>
#include <filesystem>
#include <memory>

#include "characterize/duet/readers.h"
#include "characterize/profile/identity.h"
#include "characterize/profile/store/reader.h"
#include "cli/commands.h"
#include "cli/options/duration.h"
#include "cli/options/files.h"
#include "cli/options/output.h"
#include "cli/options/profile_platform.h"
#include "cli/options/shipped.h"
#include "cli/options/values.h"
#include "reports/export/profile_export.h"
#include "reports/gate/gate_report.h"
#include "reports/gate/pooling.h"
#include "workloads/base/error.h"
#include "workloads/base/text/json.h"
#include "workloads/base/text/name_filter.h"
#include "workloads/base/text/shell.h"
#include "workloads/catalog/catalog.h"
#include "workloads/model/own_operation.h"
#include "workloads/own/definition.h"

namespace pirt::cli {
namespace {

/// Results that take stdout leave no room there for the text.
bool takes_stdout(const RegressOptions& options) {
  return options.markdown.to_stdout() || options.junit.to_stdout() || options.json.to_stdout();
}

/// By its name, or a platform file.
std::optional<Platform> given_platform(const RegressOptions& options) {
  if (options.platform.empty()) return std::nullopt;
  return load_platform(options.platform, {});
}

/// What the mix costs needs the platform's file; profiles of one that is not shipped can be judged
/// without it.
std::optional<Decisions> decide(const RegressOptions& options, std::optional<Platform> platform,
                                const Profile& base, const Profile& candidate) {
  if (options.mix == "none") return std::nullopt;
  const Mix mix = load_mix(options.mix);
  try {
    if (!platform) platform = platform_of(base);
  } catch (const Error& error) {
    warn(std::string("what the mix costs is not shown: ") + error.what());
    return std::nullopt;
  }
  return compare_decisions(base, candidate, *platform, mix);
}

struct NamedTable {
  Profile profile;
  std::string name;  ///< Its path, and how many runs and programs it is made of.
};

/// Of how many programs, or texts of the platform, the rows are.
std::size_t count_programs(const Profile& profile) {
  std::vector<const RunInfo*> programs;
  for (const PhaseRow& row : profile.phases) {
    const RunInfo* const run = profile.find_run(row.run_id);
    const bool is_known = std::ranges::any_of(programs, [run](const RunInfo* each) {
      return each == run || compare_program(*each, *run).empty();
    });
    if (!is_known) programs.push_back(run);
  }
  return programs.size();
}

NamedTable open_table(const std::string& path, const std::string& platform) {
  const ProfileReader reader(path);
  NamedTable table{.profile = reader.read(platform), .name = path};
  const Pooled pooled = pool_samples(reader, table.profile);
  if (pooled.runs > 1) table.name += fmt::format(" ({} runs)", pooled.runs);
  if (pooled.left_out > 0) {
    table.name += fmt::format(" ({} of another program, platform or workload file left out)",
                              pooled.left_out);
  }
  const std::size_t programs = count_programs(table.profile);
  if (programs > 1) table.name += fmt::format(" (rows of {} programs or platforms)", programs);
  // Also what came to no row of its own: the gate asks what it was to measure.
  for (RunInfo& run : reader.unfinished_runs(table.profile.platform())) {
    const bool is_known = table.profile.find_run(run.run_id) != nullptr;
    if (!is_known) table.profile.runs.push_back(std::move(run));
  }
  return table;
}

/// What is said of a row depends on the others: all were judged. What all rows did together stays.
void keep_workloads(GateReport& report, const NameFilter& wanted) {
  std::erase_if(report.result.rows, [&wanted](const GateRow& row) {
    return row.workload != "all" && !wanted.picks(row.workload);
  });
  if (!report.decisions) return;
  std::erase_if(report.decisions->flips,
                [&wanted](const Flip& flip) { return !wanted.picks(flip.workload); });
}

GateReport compare(const RegressOptions& options) {
  const auto& base_path = options.files[0];
  const auto& candidate_path = options.files[1];
  refuse_same_file(base_path, candidate_path, "; give a baseline and a candidate");
  const auto platform = given_platform(options);
  const std::string name = platform ? platform->name : "";
  const NamedTable base = open_table(base_path, name);
  const NameFilter wanted = workload_filter(base.profile, options.filter);
  const NamedTable candidate = open_table(candidate_path, name);
  GateReport report{.base = base.name,
                    .candidate = candidate.name,
                    .strict = options.strict,
                    .result = judge(diff_profiles(base.profile, candidate.profile)),
                    .decisions = decide(options, platform, base.profile, candidate.profile),
                    .rule = {}};
  if (!options.anchor.empty()) {
    refuse_same_file(options.anchor, candidate_path, "; give an older base as --anchor");
    const NamedTable anchor = open_table(options.anchor, name);
    report.anchor = anchor.name;
    add_anchor(judge(diff_profiles(anchor.profile, candidate.profile)), report.result);
  }
  describe_rule(GateThresholds{}, report);
  keep_workloads(report, wanted);
  return report;
}

int regress_tables(const RegressOptions& options) {
  if (options.files.size() != 2) {
    throw_bad_input(fmt::format(
        "pirt regress takes two profile databases, BASELINE and CANDIDATE, not {}; see 'pirt "
        "regress --help'",
        options.files.size()));
  }
  return emit_report(compare(options), options);
}

/// Whether its numbers are made by its name.
bool is_named_data(const TensorSpec& spec) {
  const std::size_t dims = spec.shape.size();
  const bool may_be_picture = spec.element == Element::kU8 && !spec.varies && spec.ranges.empty();
  return !may_be_picture || !(dims == 2 || (dims == 3 && spec.shape[0] == 3));
}

/// Whether something says what it computes; what is somebody else's is learnt without its code.
bool has_reference(const Workload& workload) {
  const OwnOperation* const operation = own_operation(workload);
  if (operation == nullptr) return workload.reference || workload.step;
  return own::definition_from(parse_json(operation->definition)).verified;
}

/// Where two workloads' calls first differ in what they read or write; empty = nowhere. Of the
/// names of pictures and outputs, each has its own.
std::string different_work(const Workload& candidate, const Workload& baseline) {
  const auto differ = [](std::span<const TensorSpec> ours, std::span<const TensorSpec> theirs,
                         std::string_view what, bool are_inputs) -> std::string {
    if (ours.size() != theirs.size()) {
      return fmt::format("{} and {} {}", ours.size(), theirs.size(), what);
    }
    const auto is_same = [are_inputs](const TensorSpec& a, const TensorSpec& b) {
      const bool may_be_renamed = !are_inputs || !is_named_data(a);
      return a.element == b.element && a.shape == b.shape && (may_be_renamed || a.name == b.name);
    };
    const auto [our, their] = std::ranges::mismatch(ours, theirs, is_same);
    return our == ours.end() ? "" : our->describe() + " and " + their->describe();
  };
  const std::string inputs = differ(candidate.inputs, baseline.inputs, "inputs", true);
  return !inputs.empty() ? inputs : differ(candidate.outputs, baseline.outputs, "outputs", false);
}

/// Two workloads are two commands: fresh processes of this program that sample them.
RegressOptions as_commands(RegressOptions options) {
  const auto equals = options.as.find('=');
  if (equals == std::string::npos || equals == 0 || equals + 1 == options.as.size()) {
    throw_bad_input("--as '" + options.as +
                    "' is not CANDIDATE=BASELINE, two workloads, such as mine.sobel=sobel");
  }
  if (options.units.size() != 1) {
    throw_bad_input("--as compares two workloads on one unit; give it with --units");
  }
  const auto own = options.own.all();
  learn(own);
  const std::string candidate = options.as.substr(0, equals),
                    baseline = options.as.substr(equals + 1);
  const std::string differs = different_work(find_workload(candidate), find_workload(baseline));
  if (!differs.empty()) {
    warn(
        fmt::format("{} and {} do not have the same to do: {}; a size of one's own is named as in "
                    "sobel@640x480",
                    candidate, baseline, differs));
  }
  for (const std::string& name : {candidate, baseline}) {
    if (candidate == baseline || has_reference(find_workload(name))) continue;
    warn(name + " has no reference: whether both compute the same is not compared");
    break;
  }
  const auto sampling = [&](const std::string& workload) {
    std::string command = path_in_shell(std::filesystem::read_symlink("/proc/self/exe").string()) +
                          " sample --workload " + in_shell(workload) + " --unit " +
                          in_shell(options.units.front()) + " --seed " +
                          std::to_string(options.seed) + " --work " + in_shell(options.work);
    for (const std::string& file : own) {
      command += " --workloads " + path_in_shell(file);
    }
    if (!options.platform.empty()) {
      command += " --platform " +
                 (names_a_file(options.platform)
                      ? path_in_shell(std::filesystem::absolute(options.platform).string())
                      : in_shell(options.platform));
    }
    return command;
  };
  options.candidate_command = sampling(candidate);
  options.baseline_command = sampling(baseline);
  return options;
}

int regress(const RegressOptions& options) {
  if (!options.as.empty()) return regress_commands(as_commands(options));
  if (!options.own.files.empty()) {
    throw_bad_input("--workloads brings what --as compares, which is not given");
  }
  if (!options.baseline_command.empty()) return regress_commands(options);
  if (!options.baseline_program.empty()) return regress_programs(options);
  return regress_tables(options);
}

/// What two profiles, two programs and two commands each know nothing of is refused.
void keep_apart(const Command& command, const Option& profiles) {
  const auto option = [&](const char* name) { return command.option(name); };
  for (const char* what : {"program", "command"}) {
    const std::string of(what);
    option(("--baseline-" + of).c_str()).needs(option(("--candidate-" + of).c_str()));
    option(("--candidate-" + of).c_str()).needs(option(("--baseline-" + of).c_str()));
    option(("--baseline-" + of).c_str()).excludes(profiles);
  }
  option("--baseline-program").excludes(option("--baseline-command"));
  for (const auto* name : {"--baseline-command", "--baseline-program", "--filter", "--cold"}) {
    option("--as").excludes(option(name));
  }
  option("--as").excludes(profiles);
  for (const auto* name : {"--setup-command", "--reads", "--warm-up"}) {
    option(name).needs(option("--baseline-command"));
  }
  for (const auto* name : {"--units", "--work", "--cold", "--one-at-a-time"}) {
    option(name).excludes(profiles).excludes(option("--baseline-command"));
  }
  for (const auto* name : {"--filter", "--platform"}) {
    option(name).excludes(option("--baseline-command"));
  }
  for (const auto* name : {"--seed", "--max-time", "--sample-limit", "--ledger"}) {
    option(name).excludes(profiles);
  }
  for (const auto* name : {"--mix", "--anchor"}) option(name).needs(profiles);
}

}  // namespace

int emit_report(const GateReport& report, const RegressOptions& options) {
  const Document document = gate_document(report, options.all);
  if (options.markdown) emit_text(render(document, Format::kMarkdown), options.markdown);
  if (options.junit) emit_text(gate_junit(report), options.junit);
  const std::string text = takes_stdout(options) ? "" : render(document, Format::kText);
  emit(text, gate_json(report), options.json);
  return exit_code_of(report.result, report.strict);
}

Nanos process_limit(const RegressOptions& options) {
  const Nanos third = parse_duration(options.max_time) / 3;
  return std::min(parse_duration(options.sample_limit),
                  std::max<Nanos>(third, std::chrono::seconds(1)));
}

void add_regress(CLI::App& app, Action& action) {
  auto options = std::make_shared<RegressOptions>();
  Command command(
      app, "regress",
      "Compare two profiles, two pirts or any two commands and fail if anything became slower: for "
      "CI");
  const Option profiles =
      add_input(command, "profiles", &options->files, "Profile databases: BASELINE CANDIDATE");
  add_input(command, "--baseline-program", &options->baseline_program,
            "A pirt to compare with: fresh processes of both, in turns");
  add_input(command, "--candidate-program", &options->candidate_program,
            "The pirt that must not be slower");
  add_text(command, "--baseline-command", &options->baseline_command, "COMMAND",
           "Any program to compare with, and its arguments: words as a shell splits them, but no "
           "shell; fresh processes of both, in turns");
  add_text(command, "--candidate-command", &options->candidate_command, "COMMAND",
           "The command that must not be slower");
  add_text(command, "--as", &options->as, "CANDIDATE=BASELINE",
           "Two workloads to compare, on the unit of --units: mine.sobel=sobel");
  add_workloads(command, options->own);
  std::vector<std::string> readers;
  for (const OutputReader& reader : output_readers()) readers.emplace_back(reader.name);
  add_choice(
      command, "--reads", &options->reads, "READER", readers,
      "Commands: what is compared: wall and processor time and peak memory of the process, "
      "or what it prints: JSON of Google Benchmark, lines NAME VALUE UNIT [lower|higher], or "
      "what pirt sample answers")
      .shows_default();
  add_text(command, "--setup-command", &options->setup_command, "COMMAND",
           "Commands: run once before anything");
  add_value(command, "--warm-up", &options->warm_up, "N", not_within(1, 100),
            "Commands: first runs of each that do not count")
      .shows_default();
  add_filter(command, options->filter);
  add_input(command, "--platform", &options->platform,
            "A name of `pirt list platforms`, or a YAML file (default: that of each file's newest "
            "run; host for programs)",
            FileUse::kReadIfFile)
      .offers(offer_platforms());
  add_list_of(command, "--units", options->units, "UNIT",
              "Programs: units to compare on, with commas (default: all)")
      .offers(offer_units());
  add_seed(command, options->seed, "Programs, commands: seed of inputs and of the order");
  add_value(command, "--work", &options->work, "DURATION", no_duration,
            "Programs: how long a process repeats its calls")
      .shows_default();
  command.add_flag("--cold", options->cold,
                   "Programs: set up with empty kernel caches instead of filled ones");
  command.add_flag("--one-at-a-time", options->one_at_a_time,
                   "Programs: never two processes at once (default: units that share no physical "
                   "core are measured side by side)");
  add_value(command, "--max-time", &options->max_time, "DURATION", no_duration,
            "Programs, commands: what is undecided after this is inconclusive; go on with the same "
            "command")
      .shows_default();
  add_value(command, "--sample-limit", &options->sample_limit, "DURATION", no_duration,
            "Programs, commands: a process that takes longer, or a third of --max-time, hangs, and "
            "its cell has failed")
      .shows_default();
  add_continued(command, "--ledger", &options->ledger,
                "File that keeps what was measured, to go on after an interruption (default: "
                "pirt-regress.ledger until the answer is there)");
  add_input(command, "--mix", &options->mix,
            "Profiles: mix whose cost is shown in each mode on both, or none", FileUse::kReadIfFile)
      .offers(offer_mixes())
      .shows_default();
  add_input(command, "--anchor", &options->anchor,
            "Profiles: an older base, such as the last release, to compare with as well: steps too "
            "small to count add up");
  command.add_flag("--strict", options->strict,
                   "Exit with 3 also where nothing was found but rows are undecided");
  command.add_flag("--all", options->all, "Show also the rows that are the same or not judged");
  add_output(command, "--markdown", options->markdown,
             "Write the report as Markdown to a file, or to stdout for -");
  add_output(command, "--junit", options->junit, "Write JUnit XML to a file, or to stdout for -");
  add_json(command, options->json);
  keep_apart(command, profiles);
  command.footer(
      "Exit code 0: nothing became slower; 1: something did, or failed; 2: bad input; 3: "
      "inconclusive, not comparable, or with --strict undecided.\nExample: pirt regress base.db "
      "new.db --markdown report.md --junit r.xml\n"
      "Example: pirt regress --baseline-command 'old/bench' --candidate-command 'new/bench' "
      "--reads "
      "gbench");
  command.runs(action, [options] { return regress(*options); });
}

}  // namespace pirt::cli
