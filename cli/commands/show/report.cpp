// pirt report: what profile databases hold, what the modes make of it, and what the paper says.
#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <filesystem>
#include <fstream>
#include <memory>
#include <utility>

#include "characterize/profile/store/reader.h"
#include "characterize/worker/scratch.h"
#include "cli/commands.h"
#include "cli/options/files.h"
#include "cli/options/output.h"
#include "cli/options/own.h"
#include "cli/options/profile_platform.h"
#include "cli/options/shipped.h"
#include "cli/options/values.h"
#include "reports/document/document.h"
#include "reports/full_report.h"
#include "reports/paper/cloud_offload.h"
#include "reports/paper/offloaded_call.h"
#include "reports/profile/profile_report.h"
#include "reports/profile/setup_report.h"
#include "reports/run/comparison_report.h"
#include "reports/run/run_report.h"
#include "reports/run/timeline.h"
#include "scheduler/policies/policy.h"
#include "scheduler/schedule.h"
#include "scheduler/services/eligibility.h"
#include "workloads/base/error.h"
#include "workloads/base/text/json.h"
#include "workloads/base/text/shell.h"
#include "workloads/base/text/text.h"
#include "workloads/own/definition.h"

namespace pirt::cli {
namespace {

struct ReportFlags {
  std::vector<std::string> files;
  std::string format = "text";
  Output output;
  std::optional<std::string> platform;
  std::vector<std::string> settings;
  std::string mix = "full-robot";
  OwnFiles own;
  bool paper = false, setup = false, offload = false, brief = false;  ///< What they were once.
  bool strict = false;
  Output json;
};

/// Of one that the kind of report knows.
Format parse_format(const std::string& name) {
  if (name == "text") return Format::kText;
  return name == "md" ? Format::kMarkdown : Format::kHtml;
}

/// What is asked for, where and as what.
/// @param make_json  Called only if that is asked for: of a large profile it has every sample.
template <typename MakeJson>
void write(const ReportFlags& options, const Document& document, const MakeJson& make_json) {
  const Format format = parse_format(options.format);
  Json json;
  if (options.json) {
    json = make_json();
    json["schema_version"] = 1;
  }
  const std::size_t columns = options.output || options.json.to_stdout() ? 0 : stdout_columns();
  const std::string text = render(document, format, columns);
  if (options.output) emit_text(text, options.output);
  emit(options.output ? "" : text, json, options.json);
}

/// The files of the command line by what is in them.
struct Files {
  std::vector<std::string> databases, runs, traces;
};

/// Pipes cannot be looked into beforehand: the first file is then a database, others are run
/// records.
Files sort_files(const std::vector<std::string>& files) {
  Files sorted;
  for (const auto& file : files) {
    std::array<char, 4096> begin{};
    std::error_code missing;
    const auto status = std::filesystem::status(file, missing);
    if (std::filesystem::is_regular_file(status)) {
      std::ifstream(file, std::ios::binary).read(begin.data(), begin.size());
    }
    std::string_view text(begin.data(), begin.size());
    if (text.starts_with("\xef\xbb\xbf")) text.remove_prefix(3);  // the mark that readers skip
    text.remove_prefix(std::min(text.find_first_not_of(" \t\r\n"), text.size()));
    // Opening it explains what is not there: a database, unless it is called as records are.
    const bool missed = !std::filesystem::exists(status) && !file.ends_with(".json");
    if (text.starts_with("SQLite format 3") || missed ||
        (&file == &files.front() && !text.starts_with('[') && !text.starts_with('{'))) {
      sorted.databases.push_back(file);
    } else if (text.starts_with('[') || text.find("\"traceEvents\"") != std::string_view::npos) {
      sorted.traces.push_back(file);
    } else {
      sorted.runs.push_back(file);
    }
  }
  return sorted;
}

/// What the files have and what was measured of them have to agree.
Profile held_against(const ReportFlags& options, Profile profile) {
  Platform platform;  // As it is called: one that a file describes need not be here.
  platform.name = options.platform.value_or(profile.platform());
  const auto files = options.own.all(options.mix);
  hold_against(profile, files);
  for (const std::string& file : files) {
    auto missing = known_of(file);
    for (const std::string& row : profile.workloads()) missing.erase(own::plain_name(row));
    if (missing.empty()) continue;
    const std::vector names(missing.begin(), missing.end());
    warn(fmt::format("{} has no rows of {}, which {} has; measure them: {}", profile.path,
                     join(names, ", "), file, measure_command(platform, "", names, profile.path)));
  }
  return profile;
}

Profile open_profile(const ReportFlags& options, const std::string& file, bool samples) {
  const ProfileReader reader(file);
  auto profile =
      options.platform ? reader.read(load_platform(*options.platform).name) : reader.read();
  profile.path = file;
  if (samples) reader.read_samples(profile);
  return held_against(options, std::move(profile));
}

/// For the boards beside the machine, each of its newest run: --platform and --set are the
/// machine's, whose database comes first.
ReportFlags of_others(ReportFlags options) {
  options.platform.reset();
  options.settings.clear();
  return options;
}

/// Of all @p files.
std::vector<Profile> open_profiles(const ReportFlags& options,
                                   const std::vector<std::string>& files, bool samples) {
  std::vector<Profile> profiles;
  for (const auto& file : files) {
    profiles.push_back(
        open_profile(profiles.empty() ? options : of_others(options), file, samples));
  }
  return profiles;
}

/// The platform that is given, or the profile's.
/// @throws Error{kBadInput} if that is none that is shipped.
Platform platform_for(const ReportFlags& options, const Profile& profile) {
  const auto overrides = parse_overrides(options.settings);
  return options.platform ? load_platform(*options.platform, overrides)
                          : platform_of(profile, overrides);
}

/// Where no platform is read that they could change.
void reject_settings(const ReportFlags& options) {
  if (options.settings.empty()) return;
  throw_bad_input("--set '" + options.settings.front() +
                  "' changes nothing here: no platform is read; leave it out");
}

/// Where no database is read, either.
void reject_platform(const ReportFlags& options) {
  reject_settings(options);
  if (!options.platform) return;
  throw_bad_input("--platform '" + *options.platform +
                  "' changes nothing here: no profile database is read; leave it out");
}

/// The platform of a profile, or why it is not known.
struct FoundPlatform {
  std::optional<Platform> platform;
  std::string why_not;
};
/// @throws Error{kBadInput} if the command line asks for one that cannot be.
FoundPlatform find_platform(const ReportFlags& options, const Profile& profile) {
  try {
    return {platform_for(options, profile), ""};
  } catch (const Error& error) {
    if (options.platform || !options.settings.empty()) throw;
    return {std::nullopt, error.what()};
  }
}

/// With all modes in virtual time; a profile of a platform that is not known goes without.
Machine read_machine(const ReportFlags& options, Profile profile, const Mix& mix) {
  auto found = find_platform(options, profile);
  return machine_of(std::move(profile), std::move(found.platform), mix, found.why_not,
                    options.strict);
}

/// Modes on a platform that its file describes.
ModeRuns modelled_runs(const ReportFlags& options, const Mix& mix,
                       const std::vector<std::string>& modes) {
  return run_modes(load_platform(options.platform.value(), parse_overrides(options.settings)),
                   nullptr, mix, modes, {});
}

/// Makes @p schedule what @p run was made by, as flags_of has it.
void take_settings(const RunRecord& run, const Mix& mix, ScheduleOptions& schedule) {
  if (run.basic) schedule.basic = *run.basic;
  schedule.in_flight = run.in_flight;
  if (run.objective && find_policy(run.mode).budgets) {
    schedule.objective = find_objective(*run.objective);
    if (!mix.fires_once()) {
      schedule.min_rate_per_ms = run.min_rate_per_ms;
      schedule.power_cap_w = run.power_cap_w;
    }
  }
  if (run.overflow == "literal") schedule.overflow = Overflow::kLiteral;
  schedule.slices = run.slices;
  if (run.draw) schedule.draw = find_draw(*run.draw);
}

/// What was given beside the database, as flags of pirt schedule in any folder.
std::string given_flags(const ReportFlags& options) {
  const auto place = [](const std::string& file) {
    return path_in_shell(std::filesystem::absolute(file).string());
  };
  const auto name = [&place](const std::string& shipped_or_file) {
    return names_a_file(shipped_or_file) ? place(shipped_or_file) : in_shell(shipped_or_file);
  };
  std::string flags;
  if (options.platform) flags += " --platform " + name(*options.platform);
  for (const std::string& setting : options.settings) flags += " --set " + in_shell(setting);
  flags += " --mix " + name(options.mix);
  for (const std::string& file : options.own.files) flags += " --workloads " + place(file);
  if (options.strict) flags += " --strict";
  return flags;
}

/// What the first seconds of virtual time look like, where no trace was given: of the given run, if
/// it was made from what is here, else of the paper's whole scheduler.
std::optional<Timeline> make_timeline(const Machine& machine, const Mix& mix,
                                      const std::vector<RunRecord>& runs,
                                      const ReportFlags& options) {
  if (!machine.platform) return std::nullopt;
  ScheduleOptions schedule;
  schedule.mode = "advanced";
  schedule.strict = options.strict;
  if (!runs.empty()) {
    const RunRecord& run = runs.front();
    const std::string hash = platform_hash(*machine.platform);
    const std::vector<std::string> besides(options.strict ? 1 : 0, "--strict");
    const bool same = run.platform == machine.profile.platform() && run.mix == mix.name &&
                      run.platform_hash.value_or(hash) == hash &&
                      (run.besides == besides || !run.platform_hash) &&
                      run.weights_from.value_or("") != "given";
    if (!same) return std::nullopt;
    schedule.mode = run.mode;
    schedule.seed = run.seed;
  }
  if (mix.open_loop()) schedule.duration = std::chrono::seconds(2);
  const ScratchFolder scratch;
  schedule.trace = (scratch.path() / "trace.json").string();
  try {
    if (!runs.empty()) take_settings(runs.front(), mix, schedule);
    static_cast<void>(run_virtual(*machine.platform, &machine.profile, mix, schedule));
  } catch (const Error&) {
    return std::nullopt;  // the report says already why the mode cannot run
  }
  auto timeline = load_timeline(*schedule.trace);
  timeline.source = fmt::format(
      "virtual time; the whole of it: pirt schedule --mode {} --profile {}{} --seed {}{} --trace "
      "trace.json",
      schedule.mode, path_in_shell(std::filesystem::absolute(machine.profile.path).string()),
      given_flags(options), schedule.seed, runs.empty() ? "" : flags_of(runs.front()));
  return timeline;
}

/// The one database of a document that has no place for more.
const std::string& only_file(const ReportFlags& options, const char* kind) {
  if (options.files.size() > 1) {
    throw_bad_input(
        fmt::format("pirt report {} takes one profile database, and no run records, "
                    "not '{}'",
                    kind, options.files[1]));
  }
  return options.files.front();
}

int report_all(const ReportFlags& options) {
  const Files files = sort_files(options.files);
  if (files.databases.empty() && files.runs.empty() && !options.platform) {
    throw_bad_input(
        "traces alone make no report; add the profile database or the run's record (pirt schedule "
        "--json), or --platform of a modelled board");
  }
  if (files.databases.empty() && !files.runs.empty()) reject_platform(options);
  ReportInputs inputs;
  for (const auto& file : files.runs) inputs.runs.push_back(load_run_record(file));
  for (const auto& file : files.traces) inputs.timelines.push_back(load_timeline(file));
  std::vector<Profile> profiles = open_profiles(options, files.databases, true);
  inputs.mix = load_mix(options.mix);  // Profiles say what workloads of their own they have.
  for (Profile& profile : profiles) {
    const bool of_first =
        inputs.machines.empty() || profile.platform() == inputs.machines.front().profile.platform();
    inputs.machines.push_back(
        read_machine(of_first ? options : of_others(options), std::move(profile), inputs.mix));
  }
  if (inputs.machines.empty() && inputs.runs.empty()) {
    inputs.modelled = modelled_runs(options, inputs.mix, policy_names());
  }
  for (const RunRecord& run : inputs.runs) {
    if (auto planned = planned_timeline(run)) inputs.timelines.push_back(std::move(*planned));
  }
  // A page has room for them.
  const Format format = parse_format(options.format);
  inputs.facts = format != Format::kText;
  if (inputs.timelines.empty() && format == Format::kHtml && !inputs.machines.empty()) {
    if (auto made = make_timeline(inputs.machines.front(), inputs.mix, inputs.runs, options)) {
      inputs.timelines.push_back(std::move(*made));
    }
  }
  warn_all(mismatches(inputs));
  write(options, full_report(inputs), [&] { return full_report_json(inputs); });
  return 0;
}

int report_profile(const ReportFlags& options) {
  reject_settings(options);
  ReportInputs inputs;
  for (Profile& profile : open_profiles(options, options.files, true)) {
    inputs.machines.push_back(
        {.profile = std::move(profile), .platform = std::nullopt, .modes = {}, .table5 = {}});
  }
  Document document = full_report(inputs);
  document.title = "pirt report profile";
  write(options, document, [&] { return full_report_json(inputs); });
  return 0;
}

int report_setup(const ReportFlags& options) {
  const auto profile = open_profile(options, only_file(options, "setup"), false);
  const auto found = find_platform(options, profile);
  std::vector<OffloadedCall> calls;
  if (found.platform) {
    calls = offloaded_calls(profile, *found.platform, "convolution");
  } else {
    warn(found.why_not);
  }
  const auto costs = offloading_costs(profile);
  Document document{.title = "pirt report setup", .parts = {profile_header(profile)}};
  document.parts.emplace_back(offloading_chart(costs));
  if (auto crossovers = crossover_table(costs); !crossovers.rows.empty()) {
    document.parts.emplace_back(std::move(crossovers));
  }
  for (auto& table : offloaded_convolution_tables(calls)) {
    document.parts.emplace_back(std::move(table));
  }
  write(options, document, [&] {
    Json json = setup_json(costs);
    json.update(offloaded_convolution_json(calls));
    return json;
  });
  return 0;
}

int report_offload(const ReportFlags& options) {
  const auto profile = open_profile(options, only_file(options, "offload"), false);
  const Platform platform = platform_for(options, profile);
  const OffloadChoices choices = offload_choices(profile, platform);
  write(options,
        {.title = "pirt report offload",
         .parts = {profile_header(profile), offload_table(choices, platform)}},
        [&] { return offload_json(choices); });
  return 0;
}

int report_compare(const ReportFlags& options) {
  if (options.files.empty()) {
    const auto mix = load_mix(options.mix);
    const auto modes = modelled_runs(options, mix, paper_modes());
    auto document = comparison_document(modes, mix, false);
    document.title = "pirt report compare";
    write(options, document, [&] { return comparison_json(modes); });
    return 0;
  }
  const auto profile = open_profile(options, only_file(options, "compare"), false);
  const auto found = find_platform(options, profile);
  const auto mix = load_mix(options.mix);
  const auto modes =
      runs_of(profile, found.platform, mix, paper_modes(), found.why_not, options.strict);
  write(options, brief_document(profile, modes, mix), [&] { return brief_json(profile, modes); });
  return 0;
}

/// @return kExitCheckFailed if a cell of Table V is farther off than its limit.
int report_paper(const ReportFlags& options) {
  const Files files = sort_files(options.files);
  if (!files.runs.empty() || !files.traces.empty()) {
    throw_bad_input("pirt report paper takes profile databases, not '" +
                    (files.runs.empty() ? files.traces : files.runs).front() + "'");
  }
  if (files.databases.empty()) reject_platform(options);
  std::vector<Profile> others = open_profiles(options, files.databases, false);
  const auto mix = load_mix(options.mix);
  std::optional<Machine> machine;
  if (!others.empty()) {
    machine = read_machine(options, std::move(others.front()), mix);
    machine->table5 = table5_of(*machine, options.strict);
    others.erase(others.begin());
  }
  const auto paper = run_paper();
  const Machine* evidence = machine ? &*machine : nullptr;
  write(options, paper_document(evidence, others, mix, paper),
        [&] { return paper_document_json(evidence, others, mix, paper); });
  return std::ranges::all_of(paper.cells, &PaperCell::holds) ? 0 : kExitCheckFailed;
}

/// A document that can be asked for: `pirt report NAME`.
struct Kind {
  const char* name;
  const char* description;
  const char* files;    ///< What the help says of them.
  const char* formats;  ///< "FORMAT|FORMAT"; the first is the default.
  const char* example;
  bool runs_modes;  ///< On --mix.
  int (*write)(const ReportFlags& options);
};
constexpr const char* kOneDatabase = "The profile database";
constexpr const char* kEverything =
    "The profile database; then more of them, to be shown side by side, run records of pirt "
    "schedule --json (default: the modes are simulated now), and traces of its --trace. Run "
    "records "
    "alone, or nothing beside --platform of a modelled board, will do";
constexpr Kind kText = {
    "text",       "Show all that is known: which unit, which mode, and what that follows from",
    kEverything,  "text|md",
    "profile.db", true,
    report_all};
constexpr Kind kPage = {
    "page",
    "Write the same as one page of HTML, with charts and a timeline; it needs no "
    "network",
    kEverything,
    "html",
    "profile.db -o report.html",
    true,
    report_all};
constexpr Kind kCompare = {
    "compare",
    "Show the preferable unit of each workload and the paper's four modes, on a screen",
    kOneDatabase,
    "text|md|html",
    "profile.db",
    true,
    report_compare};
constexpr Kind kProfile = {"profile",
                           "Show what was measured, without running any mode",
                           "The profile database; then more of them, to be shown side by side",
                           "text|md|html",
                           "profile.db",
                           false,
                           report_profile};
constexpr Kind kSetup = {
    "setup",
    "Show offloading time by phase, cold and warm (ms), from how many calls on "
    "one unit beats another, and a convolution beside the paper's Fig. 7",
    kOneDatabase,
    "text|md|html",
    "profile.db",
    false,
    report_setup};
constexpr Kind kOffload = {
    "offload",
    "Show each workload here or in the cloud, in time and in the robot's energy, and from which "
    "bandwidth on; the paper's Table IV",
    kOneDatabase,
    "text|md|html",
    "profile.db",
    false,
    report_offload};
constexpr Kind kPaper = {
    "paper",
    "Show the Pi-RT paper's claims, one by one: confirmed, refuted or not testable here; with a "
    "profile database also those about units",
    "A profile database; then those of other boards (dsp.db fpga.db), for Table III over all of "
    "their units",
    "text|md|html",
    "profile.db",
    true,
    report_paper};

int report(const ReportFlags& options, const Kind& kind) {
  const auto formats = split(kind.formats, '|');
  if (std::ranges::find(formats, options.format) == formats.end()) {
    const char* instead = "";
    if (options.format == "html") instead = "; pirt report page writes a page";
    if (options.format == "json") instead = "; that is --json FILE, or --json - for stdout";
    throw_bad_input(fmt::format("pirt report {} knows --format {}, not '{}'{}", kind.name,
                                join(formats, " and "), options.format, instead));
  }
  const bool of_modes = kind.write == report_all || kind.write == report_compare;
  if (options.files.empty() && kind.write != report_paper && !(of_modes && options.platform)) {
    throw_bad_input("no profile database given; `pirt characterize --db FILE` makes one" +
                    std::string(of_modes ? ", or give --platform of a modelled board" : ""));
  }
  learn(options.own.all(options.mix));
  return kind.write(options);
}

/// Flags that say what is a word now.
int report_as_before(const ReportFlags& options) {
  struct Old {
    bool given;
    const char* flag;
    const Kind& kind;
  };
  const Old old[] = {{options.paper, "--paper", kPaper},
                     {options.brief, "--brief", kCompare},
                     {options.offload, "--offload", kOffload},
                     {options.setup, "--setup", kSetup},
                     {options.format == "html", "--format html", kPage}};
  const auto* const found = std::ranges::find_if(old, &Old::given);
  if (found == std::end(old)) return report(options, kText);
  warn(fmt::format("'pirt report {}' is 'pirt report {}' now; the next release knows that only",
                   found->flag, found->kind.name));
  return report(options, found->kind);
}

void add_common(Command& command, const std::shared_ptr<ReportFlags>& options, const char* files,
                const std::vector<std::string>& formats, bool runs_modes) {
  add_input(command, "files", &options->files, files);
  options->format = formats.front();
  if (formats.size() > 1) {
    add_text(command, "--format", &options->format, "FORMAT", join(formats, " | "))
        .offers(formats)
        .shows_default();
  }
  add_output(command, "-o,--output", options->output, "Write to a file instead of stdout");
  add_input(command, "--platform", &options->platform,
            "Show the runs of this platform (default: that of the newest run, as of each further "
            "database)",
            FileUse::kReadIfFile)
      .offers(offer_platforms());
  add_settings(command, options->settings);
  if (runs_modes) {
    add_input(command, "--mix", &options->mix,
              "Mix of the simulated modes: a name of `pirt list mixes`, or a YAML file",
              FileUse::kReadIfFile)
        .offers(offer_mixes())
        .shows_default();
    add_strict(command, options->strict);
  }
  add_workloads(command, options->own);
  add_json(command, options->json);
}

}  // namespace

void add_report(CLI::App& app, Action& action) {
  auto options = std::make_shared<ReportFlags>();
  Command command(
      app, "report",
      "Show the preferable unit of each workload, the modes side by side, and the profiles that "
      "they follow from: without a further word as text");
  add_common(command, options, kText.files, {"text", "md", "html"}, true);
  command.add_flag("--brief", options->brief, "Is pirt report compare now");
  command.add_flag("--paper", options->paper, "Is pirt report paper now");
  command.add_flag("--setup", options->setup, "Is pirt report setup now");
  command.add_flag("--offload", options->offload, "Is pirt report offload now");
  command.option("--brief").excludes(command.option("--paper"));
  for (const auto* name : {"--paper", "--brief", "--mix"})
    command.option("--setup").excludes(command.option(name));
  for (const auto* name : {"--paper", "--brief", "--mix", "--setup"})
    command.option("--offload").excludes(command.option(name));
  command.footer("Example: pirt report page profile.db -o report.html");
  command.runs(action, [options] { return report_as_before(*options); });

  for (const Kind& kind : {kText, kPage, kCompare, kProfile, kSetup, kOffload, kPaper}) {
    auto own = std::make_shared<ReportFlags>();
    Command one(app, fmt::format("report {}", kind.name), kind.description);
    add_common(one, own, kind.files, split(kind.formats, '|'), kind.runs_modes);
    one.footer(fmt::format("Example: pirt report {} {}", kind.name, kind.example));
    one.runs(action, [own, kind] { return report(*own, kind); });
  }
}

}  // namespace pirt::cli
