// pirt regress: did anything become slower between two stored profiles?
#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <memory>

#include "cli/commands.h"
#include "cli/output.h"
#include "reports/gate/gate_report.h"
#include "reports/profile_export.h"
#include "workloads/base/error.h"

namespace pirt::cli {
namespace {

struct Options {
  std::vector<std::string> files;
  std::string filter;
  std::string platform;
  std::string mix = "full-robot";
  bool all = false;
  std::optional<std::string> markdown, junit, json;
};

/// Results that take stdout leave no room there for the text.
bool takes_stdout(const Options& options) {
  return options.markdown == "-" || options.junit == "-" || options.json == "-";
}

void check_outputs(const Options& options) {
  int to_stdout = 0;
  for (const auto* target : {&options.markdown, &options.junit, &options.json}) {
    to_stdout += *target == "-" ? 1 : 0;
  }
  if (to_stdout > 1) {
    throw_bad_input("only one of --markdown, --junit and --json can write to stdout; name files");
  }
}

/// By its name, or a platform file.
std::optional<Platform> given_platform(const Options& options) {
  if (options.platform.empty()) return std::nullopt;
  return load_platform(options.platform, {});
}

/// What the mix costs needs the platform's file; profiles of one that is not shipped can be judged
/// without it.
std::optional<Decisions> decide(const Options& options, std::optional<Platform> platform,
                                const Profile& base, const Profile& candidate) {
  if (options.mix == "none") return std::nullopt;
  const Mix mix = load_mix(options.mix);
  const auto shipped = shipped_platforms();
  if (!platform && std::ranges::find(shipped, base.platform()) == shipped.end()) {
    warn("what the mix costs is not shown: platform " + base.platform() +
         " is not a shipped one; give its file with --platform");
    return std::nullopt;
  }
  if (!platform) platform = load_platform(base.platform(), {});
  return compare_decisions(base, candidate, *platform, mix);
}

Profile open_profile(const std::string& path, const std::string& platform,
                     const std::string& filter) {
  auto profile = load_profile(path, platform);
  if (!filter.empty()) keep_workloads(profile, filter);
  read_samples(profile);
  return profile;
}

GateReport compare(const Options& options) {
  const auto& base_path = options.files[0];
  const auto& candidate_path = options.files[1];
  std::error_code missing;  // which loading explains
  if (std::filesystem::equivalent(base_path, candidate_path, missing)) {
    throw_bad_input(fmt::format("'{}' and '{}' are the same file; give a baseline and a candidate",
                                base_path, candidate_path));
  }
  const auto platform = given_platform(options);
  const std::string name = platform ? platform->name : "";
  const Profile base = open_profile(base_path, name, options.filter);
  const Profile candidate = open_profile(candidate_path, name, options.filter);
  GateReport report{.base = base_path,
                    .candidate = candidate_path,
                    .result = {},
                    .decisions = {},
                    .thresholds = {}};
  report.result = judge(diff_profiles(base, candidate), report.thresholds);
  report.decisions = decide(options, platform, base, candidate);
  return report;
}

int regress(const Options& options) {
  if (options.files.size() != 2) {
    throw_bad_input(fmt::format(
        "pirt regress takes two profile databases, BASELINE and CANDIDATE, not {}; see 'pirt "
        "regress --help'",
        options.files.size()));
  }
  check_outputs(options);
  const GateReport report = compare(options);
  const Document document = gate_document(report, options.all);
  if (options.markdown) emit_text(render(document, Format::kMarkdown), options.markdown);
  if (options.junit) emit_text(gate_junit(report), options.junit);
  const std::string text = takes_stdout(options) ? "" : render(document, Format::kText);
  emit(text, gate_json(report), options.json);
  return exit_code_of(report.result);
}

}  // namespace

void add_regress(CLI::App& app, Action& action) {
  auto options = std::make_shared<Options>();
  auto* command = app.add_subcommand(
      "regress", "Compare two profiles and fail if anything became slower: for CI");
  command->add_option("profiles", options->files, "Profile databases: BASELINE CANDIDATE");
  command->add_option("--filter", options->filter,
                      "Regular expression: workloads whose names contain it (default: all)");
  command->add_option("--platform", options->platform,
                      "A name of `pirt list platforms`, or a YAML file (default: that of each "
                      "file's newest run)");
  command
      ->add_option("--mix", options->mix,
                   "Mix whose cost is shown in each mode on both profiles, or none")
      ->capture_default_str();
  command->add_flag("--all", options->all, "Show also the rows that are the same or not judged");
  command->add_option("--markdown", options->markdown,
                      "Write the report as Markdown to FILE, or to stdout for -");
  command->add_option("--junit", options->junit, "Write JUnit XML to FILE, or to stdout for -");
  command->add_option("--json", options->json, "Write JSON to FILE, or to stdout for -");
  command->footer(
      "Exit code 0: nothing became slower; 1: something did; 2: bad input; 3: inconclusive, or not "
      "comparable.\nExample: pirt regress base.db new.db --markdown report.md --junit r.xml");
  command->callback([options, &action] { action = [options] { return regress(*options); }; });
}

}  // namespace pirt::cli
