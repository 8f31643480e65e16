// pirt characterize: measures every workload on every unit of a platform, into a profile database.
#include <fmt/format.h>

#include <atomic>
#include <csignal>
#include <memory>

#include "characterize/campaign.h"
#include "cli/commands.h"
#include "cli/duration.h"
#include "cli/output.h"
#include "reports/document.h"
#include "reports/figures.h"
#include "reports/profile_report.h"
#include "workloads/base/error.h"
#include "workloads/base/text.h"

namespace pirt::cli {
namespace {

struct Options {
  std::string database;
  std::string platform = "host";
  std::vector<std::string> settings;
  std::vector<std::string> units;
  std::string filter;
  std::optional<std::string> images;
  std::string precision = "2%";
  std::uint64_t seed = 1;
  bool quick = false;
  bool dry_run = false;
  std::optional<std::string> json;
};

std::atomic<bool> stop_requested = false;

/// The first Ctrl-C ends the run after what is stored; the second one ends the process at once.
extern "C" void request_stop(int signal) {
  stop_requested = true;
  std::signal(signal, SIG_DFL);
}

std::string minutes(Nanos value) {
  const auto seconds = value.count() / 1'000'000'000;
  return fmt::format("{}:{:02}", seconds / 60, seconds % 60);
}

/// One line on stderr that is written over; silent if stderr is no terminal.
class ProgressLine {
 public:
  explicit ProgressLine(bool shown) : shown_(shown) {}
  ~ProgressLine() { clear(); }
  ProgressLine(const ProgressLine&) = delete;
  ProgressLine& operator=(const ProgressLine&) = delete;

  void show(const Progress& progress) const {
    if (!shown_) return;
    fmt::print(stderr, "\r[{}/{}] {} on {}: {}; {} gone, about {} left\x1b[K", progress.cell,
               progress.cells, progress.workload, progress.unit, progress.step,
               minutes(progress.elapsed), minutes(progress.estimated_left));
    std::fflush(stderr);
  }
  void clear() const {
    if (shown_) fmt::print(stderr, "\r\x1b[K");
  }

 private:
  bool shown_;
};

CampaignOptions campaign_options(const Options& options) {
  const auto overrides = parse_overrides(options.settings);
  CampaignOptions campaign;
  campaign.database = options.database;
  campaign.platform = load_platform(options.platform, overrides);
  campaign.units = options.units;
  campaign.filter = options.filter;
  if (options.images) campaign.images = *options.images;
  campaign.seed = options.seed;
  campaign.precision = parse_fraction(options.precision);
  campaign.quick = options.quick;
  campaign.stop = &stop_requested;
  return campaign;
}

nlohmann::ordered_json plan_json(const CampaignPlan& plan) {
  auto cells = nlohmann::ordered_json::array();
  for (const auto& cell : plan.cells) {
    cells.push_back({{"workload", cell.workload->name}, {"unit", cell.unit}});
  }
  auto skipped = nlohmann::ordered_json::array();
  for (const auto& skip : plan.skipped) {
    nlohmann::ordered_json entry = {{"unit", skip.unit}, {"reason", skip.reason}};
    if (!skip.workload.empty()) entry["workload"] = skip.workload;
    skipped.push_back(std::move(entry));
  }
  return {{"cells", cells}, {"skipped", skipped}, {"estimate_s", to_s(plan.estimate)}};
}

std::string plan_text(const CampaignPlan& plan) {
  Table table{.title = fmt::format("{} cells in the order of measuring, about {} min",
                                   plan.cells.size(), minutes(plan.estimate)),
              .columns = {{"workload", Align::kLeft}, {"unit", Align::kLeft}}};
  for (const auto& cell : plan.cells) table.rows.push_back({cell.workload->name, cell.unit});
  for (const auto& skip : plan.skipped) {
    table.footnotes.push_back(fmt::format("Not measured: {}{}: {}", skip.unit,
                                          skip.workload.empty() ? "" : ", " + skip.workload,
                                          skip.reason));
  }
  return render({.parts = {table}}, Format::kText);
}

void warn_of_skipped(const CampaignPlan& plan) {
  for (const auto& skip : plan.skipped) {
    const auto what =
        skip.workload.empty() ? "unit " + skip.unit : skip.workload + " on unit " + skip.unit;
    warn(what + " is not measured: " + skip.reason);
  }
}

int characterize(const Options& options) {
  if (options.database.empty() && !options.dry_run) {
    throw_bad_input("--db is required (or --dry-run to see what would be measured)");
  }
  const auto campaign = campaign_options(options);
  const auto plan = plan_campaign(campaign);
  if (options.dry_run) {
    auto json = plan_json(plan);
    json["schema_version"] = 1;
    emit(plan_text(plan), json, options.json);
    return 0;
  }
  warn_of_skipped(plan);

  std::signal(SIGINT, request_stop);
  std::signal(SIGTERM, request_stop);
  CampaignSummary summary;
  {
    const ProgressLine line(stderr_is_terminal());
    summary = run_campaign(campaign, plan,
                           {.progress = [&](const Progress& progress) { line.show(progress); },
                            .warning =
                                [&](const std::string& message) {
                                  line.clear();
                                  warn(message);
                                }});
  }
  if (summary.interrupted && summary.cells == 0) {
    throw_environment("interrupted before the first cell was done");
  }
  const auto profile = load_profile(options.database, campaign.platform.name);
  Document document{.title = "pirt characterize",
                    .parts = {profile_header(profile), profile_table(profile)}};
  document.parts.emplace_back(
      Paragraph{{fmt::format("{} of {} cells in {} min, {} valid and {} invalid rows, in {}",
                             summary.cells, plan.cells.size(), minutes(summary.elapsed),
                             summary.rows_valid, summary.rows_invalid, options.database)}});
  auto json = profile_json(profile, preferences(profile));
  json["schema_version"] = 1;
  json["summary"] = {{"run_id", summary.run_id},           {"cells", summary.cells},
                     {"rows_valid", summary.rows_valid},   {"rows_invalid", summary.rows_invalid},
                     {"interrupted", summary.interrupted}, {"elapsed_s", to_s(summary.elapsed)}};
  json["skipped"] = plan_json(plan)["skipped"];
  emit(render(document, Format::kText), json, options.json);
  if (summary.interrupted) {
    throw_environment(fmt::format("interrupted; the {} cells that were done are in {}",
                                  summary.cells, options.database));
  }
  if (summary.rows_valid == 0) {
    throw_environment("no valid row was measured; see the remarks for the reasons");
  }
  return 0;
}

}  // namespace

void add_characterize(CLI::App& app, Action& action) {
  auto options = std::make_shared<Options>();
  auto* command = app.add_subcommand(
      "characterize",
      "Measure every workload on every unit of a platform, into a profile database");
  command->add_option("--db", options->database,
                      "Profile database; made if missing, added to otherwise");
  command
      ->add_option("--platform", options->platform,
                   "A name of `pirt list platforms`, or a YAML file")
      ->capture_default_str();
  command
      ->add_option(
          "--set", options->settings,
          "Set one value of the platform's units, e.g. cpu.active_w=15 (watts); repeatable")
      ->allow_extra_args(false);
  command->add_option("--units", options->units, "Units to measure, with commas (default: all)")
      ->delimiter(',')
      ->allow_extra_args(false);
  command->add_option("--filter", options->filter,
                      "Regular expression: workloads whose names contain it (default: all)");
  command->add_option(
      "--images", options->images,
      "PNG or JPEG file, or a folder of them, as input (default: generated from the seed)");
  command
      ->add_option(
          "--precision", options->precision,
          "Sample until the 95 % interval of a median is within +/- this, or the time is up")
      ->capture_default_str();
  command->add_option("--seed", options->seed, "Seed of inputs, weights and the order of measuring")
      ->capture_default_str();
  command->add_flag("--quick", options->quick,
                    "Fewer set-ups and at most 0.8 s (else 5 s) of samples a cell");
  command->add_flag("--dry-run", options->dry_run,
                    "Show the cells and the estimated time; measure nothing");
  command->add_option("--json", options->json, "Write JSON to FILE, or to stdout for -");
  command->footer("Example: pirt characterize --quick --filter 'sobel|fc8' --db profile.db");
  command->callback([options, &action] { action = [options] { return characterize(*options); }; });
}

}  // namespace pirt::cli
