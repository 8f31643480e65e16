// pirt report: what a profile database holds and what the four modes make of it.
#include <algorithm>
#include <memory>
#include <utility>

#include "characterize/profile/store/reader.h"
#include "cli/commands.h"
#include "cli/files.h"
#include "cli/output.h"
#include "cli/profile_platform.h"
#include "cli/values.h"
#include "reports/document.h"
#include "reports/environment_report.h"
#include "reports/paper_report.h"
#include "reports/profile_report.h"
#include "reports/roofline_report.h"
#include "reports/run_report.h"
#include "reports/setup_report.h"
#include "scheduler/schedule.h"
#include "workloads/base/error.h"
#include "workloads/base/json_value.h"
#include "workloads/base/text.h"

namespace pirt::cli {
namespace {

struct Options {
  std::vector<std::string> files;
  std::string format = "text";
  Output output;
  std::optional<std::string> platform;
  std::vector<std::string> settings;
  std::string mix = "full-robot";
  bool paper = false;
  bool setup = false;
  Output json;
};

/// Absent = JSON.
std::optional<Format> parse_format(const std::string& name) {
  if (name == "text") return Format::kText;
  if (name == "md") return Format::kMarkdown;
  if (name == "html") return Format::kHtml;
  if (name == "json") return std::nullopt;
  const std::vector<std::string> known = {"text", "md", "html", "json"};
  throw_bad_input("unknown --format '" + name + "'" + suggestion(name, known));
}

/// The paper's four modes in virtual time. A profile that lacks some of the mix's workloads still
/// makes a report.
ModeRuns simulate_modes(const Options& options, const Profile& profile, const Mix& mix) {
  try {
    const auto overrides = parse_overrides(options.settings);
    const auto platform = options.platform ? load_platform(*options.platform, overrides)
                                           : platform_of(profile, overrides);
    return run_modes(platform, &profile, mix, paper_modes(), {});
  } catch (const Error& error) {
    ModeRuns none;
    for (const auto& mode : paper_modes()) none.skipped.push_back({mode, error.what()});
    return none;
  }
}

ModeRuns collect_modes(const Options& options, const Profile& profile) {
  const auto mix = load_mix(options.mix);
  if (options.files.size() == 1) return simulate_modes(options, profile, mix);
  ModeRuns modes;
  for (std::size_t i = 1; i < options.files.size(); ++i) {
    modes.runs.push_back(load_run_record(options.files[i]));
  }
  return modes;
}

Profile open_profile(const Options& options) {
  if (!options.platform) return load_profile(options.files.front());
  return load_profile(options.files.front(), load_platform(*options.platform).name);
}

/// What is asked for, where and as what.
void write(const Options& options, const Document& document, Json json) {
  const auto format = parse_format(options.format);
  json["schema_version"] = 1;
  const std::string text = format ? render(document, *format) : json_text(json, 2) + "\n";
  if (options.output) {
    emit_text(text, options.output);
    if (options.json) emit("", json, options.json);
  } else {
    emit(text, json, options.json);
  }
}

int report_profile(const Options& options) {
  const auto profile = open_profile(options);
  const auto modes = collect_modes(options, profile);
  const auto preferable = preferences(profile);

  Document document{.title = "pirt report",
                    .parts = {profile_header(profile), profile_table(profile),
                              peak_table(rooflines(profile)), preference_table(preferable)}};
  if (!modes.runs.empty()) document.parts.emplace_back(modes_table(modes.runs));
  const auto missing = reason_lines(modes.skipped);
  if (!missing.empty()) {
    document.parts.emplace_back(Paragraph{{"Modes that are not shown: " + join(missing, "; ")}});
  }
  document.parts.emplace_back(environment_table(profile));
  auto json = profile_json(profile, preferable);
  json["modes"] = Json::array();
  for (const auto& record : modes.runs) json["modes"].push_back(to_json(record));
  if (!missing.empty()) json["modes_missing"] = join(missing, "; ");
  write(options, document, std::move(json));
  return 0;
}

int report_setup(const Options& options) {
  if (options.files.size() > 1) {
    throw_bad_input("--setup takes one profile database and no run records");
  }
  const auto profile = open_profile(options);
  const auto costs = offloading_costs(profile);
  Document document{.title = "pirt report --setup", .parts = {profile_header(profile)}};
  document.parts.emplace_back(offloading_table(costs));
  document.parts.emplace_back(crossover_table(costs));
  write(options, document, setup_json(costs));
  return 0;
}

/// @return kExitCheckFailed if a cell is farther off than its limit.
int report_paper(const Options& options) {
  if (!options.files.empty())
    throw_bad_input("--paper takes no files: it shows the paper's own table");
  const auto cells = paper_cells();
  write(options, {.title = "pirt report --paper", .parts = {paper_table(cells)}},
        paper_json(cells));
  return std::ranges::all_of(cells, &PaperCell::holds) ? 0 : kExitCheckFailed;
}

int report(const Options& options) {
  static_cast<void>(parse_format(options.format));  // before anything is computed
  if (options.paper && options.setup) throw_bad_input("give either --paper or --setup");
  if (options.paper) return report_paper(options);
  if (options.files.empty()) {
    throw_bad_input("no profile database given; `pirt characterize --db FILE` makes one");
  }
  return options.setup ? report_setup(options) : report_profile(options);
}

}  // namespace

void add_report(CLI::App& app, Action& action) {
  auto options = std::make_shared<Options>();
  Command command(
      app, "report",
      "Show a profile, the preferable unit of each workload, and the four modes side by side");
  add_input(command, "files", &options->files,
            "The profile database, then run records of pirt schedule --json (default: the four "
            "modes are simulated now)");
  add_text(command, "--format", &options->format, "FORMAT", "text | md | html | json")
      .shows_default();
  add_output(command, "-o,--output", options->output, "Write to a file instead of stdout");
  add_input(command, "--platform", &options->platform,
            "Show the runs of this platform (default: that of the newest run)",
            FileUse::kReadIfFile);
  add_settings(command, options->settings);
  add_input(command, "--mix", &options->mix,
            "Mix of the simulated modes: a name of `pirt list mixes`, or a YAML file",
            FileUse::kReadIfFile)
      .shows_default();
  command.add_flag("--paper", options->paper,
                   "Instead of a profile: Table V of the Pi-RT paper beside virtual time");
  command.add_flag("--setup", options->setup,
                   "Instead of the profile: offloading time by phase, cold and warm (ms), and from "
                   "how many calls on one unit beats another");
  add_json(command, options->json);
  command.footer("Example: pirt report profile.db --format html -o report.html");
  command.runs(action, [options] { return report(*options); });
}

}  // namespace pirt::cli
