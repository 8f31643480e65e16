// pirt characterize: measures every workload on every unit of a platform, into a profile database.
#include <fmt/core.h>

#include <algorithm>
#include <cstdio>
#include <memory>
#include <string_view>

#include "characterize/campaign/campaign.h"
#include "characterize/doctor/doctor.h"
#include "characterize/energy/nvml.h"
#include "characterize/profile/store/reader.h"
#include "characterize/worker/scratch.h"
#include "cli/commands.h"
#include "cli/commands/measure/campaign_text.h"
#include "cli/commands/measure/fit_energy.h"
#include "cli/commands/measure/unit_times.h"
#include "cli/long_run.h"
#include "cli/options/duration.h"
#include "cli/options/files.h"
#include "cli/options/output.h"
#include "cli/options/own.h"
#include "cli/options/shipped.h"
#include "cli/options/sysfs.h"
#include "cli/options/values.h"
#include "reports/document/document.h"
#include "reports/profile/condition_report.h"
#include "reports/profile/profile_report.h"
#include "scheduler/mix/mix.h"
#include "workloads/base/error.h"
#include "workloads/base/text/json.h"
#include "workloads/base/text/shell.h"
#include "workloads/base/text/text.h"
#include "workloads/base/time.h"
#include "workloads/catalog/catalog.h"
#include "workloads/inputs/sequence/recorded.h"
#include "workloads/own/definition.h"

namespace pirt::cli {
namespace {

struct CharacterizeFlags {
  std::string database;
  std::string platform = "host";
  std::string mix = "full-robot";
  std::vector<std::string> settings;
  std::vector<std::string> units;
  OwnFiles own;
  std::string filter;
  std::vector<std::string> variants;
  std::vector<std::string> sizes;
  std::optional<int> batch;
  std::optional<std::string> images, topics;
  std::string precision = "2%";
  std::optional<std::string> max_time;
  std::uint64_t seed = 1;
  bool quick = false;
  bool interference = false;
  bool resume = false;
  bool dry_run = false;
  bool strict = false;
  FitOptions fit;
  Output json;
};

/// Where there is no progress line: a log that says what is safe.
void acknowledge(const CellName& cell) {
  if (stderr_is_terminal()) return;
  // Not fmt::print, which throws where nobody listens.
  std::fprintf(stderr, "stored: %s on %s\n", cell.workload.c_str(), cell.unit.c_str());
}

/// Each workload of the mix once that can be measured, with all who may serve some task of it.
std::vector<NeededWorkload> needed_by(const Mix& mix) {
  std::vector<NeededWorkload> needed;
  for (const Pipeline& pipeline : mix.pipelines) {
    for (const MixTask& task : pipeline.tasks) {
      if (!task.service.empty()) continue;
      const auto known = std::ranges::find(needed, task.workload, &NeededWorkload::workload);
      if (known == needed.end()) {
        needed.push_back({task.workload, task.eligible});
      } else if (task.eligible.empty()) {
        known->served_by.clear();
      } else if (!known->served_by.empty()) {
        known->served_by.insert(known->served_by.end(), task.eligible.begin(), task.eligible.end());
      }
    }
  }
  return needed;
}

CampaignOptions campaign_options(const CharacterizeFlags& options) {
  if (options.resume) {
    CampaignOptions campaign = resume_options(options.database);
    if (options.max_time) {
      campaign.max_time = parse_duration(*options.max_time);
      campaign.precision_time.reset();
    }
    learn(campaign.own);
    return campaign;
  }
  CampaignOptions campaign;
  campaign.own = options.own.all(options.mix);
  learn(campaign.own);
  campaign.mix = options.mix;
  campaign.first = needed_by(load_mix(options.mix));
  campaign.database = options.database;
  campaign.platform_argument = names_a_file(options.platform)
                                   ? std::filesystem::absolute(options.platform).string()
                                   : options.platform;
  campaign.settings = options.settings;
  campaign.platform = load_platform(options.platform, parse_overrides(options.settings));
  campaign.units = options.units;
  campaign.filter = options.filter;
  campaign.variants = options.variants;
  campaign.sizes = options.sizes;
  campaign.batch = options.batch;
  if (options.images) campaign.images = *options.images;
  if (options.topics) {
    const SequenceTopics topics = parse_topics(*options.topics);
    if (!topics.left || topics.right || topics.imu || topics.truth) {
      throw_bad_input("--topics of --images is left=TOPIC: the one whose pictures are taken");
    }
    campaign.images_topic = *topics.left;
  }
  campaign.seed = options.seed;
  campaign.precision = parse_fraction(options.precision);
  if (options.max_time) campaign.max_time = parse_duration(*options.max_time);
  campaign.quick = options.quick;
  campaign.interference = options.interference;
  campaign.command = command_of(campaign);
  return campaign;
}

/// The run keeps the time that it was begun with, which a raised one is not.
std::string resume_hint(const CharacterizeFlags& options) {
  const bool raised = options.resume && options.max_time;
  return fmt::format("go on with: pirt characterize --resume{} --db {}",
                     raised ? " --max-time " + in_shell(*options.max_time) : "",
                     path_in_shell(options.database));
}

CampaignSummary measure(const CampaignOptions& campaign, const CampaignPlan& plan,
                        const CharacterizeFlags& options) {
  const ProgressLine line;
  const auto warn_below = [&line](const std::string& message) {
    line.clear();
    warn(message);
  };
  bool begun = false;
  const ProgressSink sink{
      .progress = [&](const Progress& progress) { line.show(progress_text(progress)); },
      .warning = warn_below,
      .stored = [](const CellName& cell) { acknowledge(cell); },
      .begun = [&begun](std::int64_t) { begun = true; },
      .waiting = warn_below};
  try {
    return run_campaign(campaign, plan, sink);
  } catch (const Error& error) {
    // Whoever ends it while it waits for another program still has a run to go on with.
    if (error.code() != ErrorCode::kEnvironment || !begun || !campaign.stop->load()) throw;
    throw_environment(fmt::format("{}; {}", error.what(), resume_hint(options)));
  }
}

/// Said before the time is spent: what `pirt doctor` calls spoiling makes rows uncertain.
void warn_of_what_spoils(const CampaignPlan& plan, const CampaignOptions& campaign,
                         const DoctorSnapshot& before) {
  const auto on_this_clock = std::ranges::count(plan.provenances, Provenance::kMeasured);
  if (on_this_clock == 0) return;
  DoctorInput input;
  input.cores = usable_cores();
  input.before = before;
  input.build = build_environment();
  input.units.emplace();
  for (const UnitRecord& unit : plan.units) {
    input.units->push_back({unit.unit, unit.device, "", unit.cores});
  }
  input.devices = plan.devices;
  if (std::ranges::any_of(plan.devices, &DeviceInfo::own_memory)) input.nvml = read_nvml();
  const auto folder = std::filesystem::absolute(campaign.database).parent_path();
  for (const auto& each : {scratch_base(), folder}) input.disks.push_back(free_space(each));
  input.readable = [](const std::filesystem::path&) { return true; };  // Meters are chosen.
  constexpr int kPart = 10;  // Of the time, which is for what is measured.
  const Nanos duration = std::min<Nanos>(std::chrono::seconds(1), plan.max_time / kPart);
  for (const Finding& each : look_before_measuring(std::move(input), duration)) {
    warn(fmt::format("{}: {}, and rows that this disturbs will be uncertain; {}", each.found,
                     each.why, each.remedy));
  }
}

/// The files of a run that is gone on with stand in its database and not on the command line.
void check_resumed_files(const CharacterizeFlags& options, const CampaignOptions& campaign) {
  auto files = written_files({&options.json, &options.fit.file});
  if (names_a_file(campaign.platform_argument)) {
    files.push_back({"the run's platform", campaign.platform_argument, FileUse::kRead});
  }
  if (campaign.images) {
    files.push_back({"the run's images", *campaign.images, FileUse::kReadPictures});
  }
  check_files(std::move(files));
}

int characterize(const CharacterizeFlags& options) {
  if (options.database.empty() && (!options.dry_run || options.resume)) {
    throw_bad_input("--db is required (or --dry-run to see what would be measured)");
  }
  auto campaign = campaign_options(options);
  if (options.resume) check_resumed_files(options, campaign);
  campaign.sysfs = sysfs_root();
  campaign.stop = stop_on_signal();
  campaign.unit_times = unit_time_parts;
  const auto before = read_doctor_snapshot(usable_cores());
  auto plan = plan_campaign(campaign);
  check_fit(options.fit, plan);
  if (options.dry_run) {
    auto json = plan_json(plan);
    json["schema_version"] = 1;
    emit(plan_text(plan, campaign), json, options.json);
    return 0;
  }
  warn_of_skipped(plan, "measured", "--dry-run");
  for (const auto& remark : plan.remarks) warn(remark);
  warn_of_what_spoils(plan, campaign, before);
  const auto summary = measure(campaign, plan, options);
  const bool has_rows = campaign.resumed && !campaign.resumed->done.empty();
  if (summary.cells + summary.cells_begun == 0 && !has_rows) {
    throw_environment(
        summary.interrupted
            ? fmt::format("interrupted before a cell had rows to show; {}", resume_hint(options))
            : out_of_time_text(summary, plan, options.database));
  }
  // This run alone: others may write to the same database meanwhile.
  const auto load = [&] {
    return load_profile(options.database, campaign.platform.name, {summary.run_id, summary.run_id});
  };
  const auto profile = load();
  Document document{.title = "pirt characterize",
                    .parts = {profile_header(profile), profile_table(profile)}};
  for (auto& table : condition_tables(profile)) document.parts.emplace_back(std::move(table));
  Paragraph closing{{summary_text(summary, plan, campaign),
                     out_of_time_text(summary, plan, options.database),
                     precision_text(summary, plan, campaign), doubted_text(profile, campaign),
                     clock_text(profile.runs.front())}};
  std::erase(closing.lines, "");
  document.parts.emplace_back(std::move(closing));
  auto json = profile_json(profile, preferences(profile));
  json["schema_version"] = 1;
  json["summary"] = summary_json(summary);
  json["skipped"] = plan_json(plan)["skipped"];
  const bool fits = options.fit.file && !summary.interrupted;
  FitOutcome fit;
  if (fits) {
    fit = fit_run(options.fit, campaign, profile);
    for (auto& table : fit.tables) document.parts.emplace_back(std::move(table));
    json["energy_fit"] = fit.json;
  }
  emit(render(document, Format::kText), json, options.json);
  if (summary.interrupted) {
    throw_environment(fmt::format("interrupted; {} cells are complete and {} were begun; {}",
                                  summary.cells, summary.cells_begun, resume_hint(options)));
  }
  // Set-ups are timed also where no call is right.
  const auto no_call = [&profile](bool (*is)(const PhaseRow&)) {
    return std::ranges::none_of(
        profile.phases, [is](const PhaseRow& row) { return !is_setup(row.phase) && is(row); });
  };
  if (no_call(is_used<PhaseRow>)) {
    throw_environment(nothing_text(profile));
  }
  if (options.strict && no_call(is_valid<PhaseRow>)) {
    warn("no row of a call is free of doubt, which --strict asks for");
    return kExitInconclusive;
  }
  if (fits && !fit.complete) {
    warn("not every unit's energy model could be fitted; the tables say why");
    return kExitInconclusive;
  }
  return 0;
}

}  // namespace

void add_characterize(CLI::App& app, Action& action) {
  auto options = std::make_shared<CharacterizeFlags>();
  Command command(app, "characterize",
                  "Measure every workload on every unit of a platform, into a profile database");
  add_continued(command, "--db", &options->database,
                "Profile database; made if missing, added to otherwise");
  add_input(command, "--platform", &options->platform,
            "A name of `pirt list platforms`, or a YAML file", FileUse::kReadIfFile)
      .offers(offer_platforms())
      .shows_default();
  add_settings(command, options->settings);
  add_input(command, "--mix", &options->mix,
            "What this mix's tasks need is measured first: a name of `pirt list mixes`, or a YAML "
            "file",
            FileUse::kReadIfFile)
      .offers(offer_mixes())
      .shows_default();
  add_list_of(command, "--units", options->units, "UNIT",
              "Units to measure, with commas (default: all)")
      .offers(offer_units());
  add_workloads(command, options->own);
  add_filter(command, options->filter);
  add_list_of(command, "--variants", options->variants, "VARIANT",
              "Measure these variants of workloads as well, with commas: see `pirt list "
              "workloads` (default: those that --filter names, as in 'sobel@map')")
      .offers(offer_variants());
  add_list_of(command, "--sizes", options->sizes, "WIDTHxHEIGHT",
              "Measure workloads on pictures in these sizes as well, with commas, in rows such as "
              "sobel@1280x720 (default: those that --filter names)")
      .check({[](const std::string& text) {
        return own::size_from(text) ? std::string() : "'" + text + "' is no size, such as 1280x720";
      }});
  add_value(command, "--batch", &options->batch, "INTEGER",
            not_within(kSmallestBatch, kLargestBatch),
            "Measure AlexNet's layers and the chain with this many images a call as well, "
            "in rows such as fc6@batch8 (default: those that --filter names)");
  add_input(command, "--images", &options->images,
            "PNG or JPEG file, a folder of them, or a recording of ROS, as input (default: "
            "generated from the seed)",
            FileUse::kReadPictures);
  add_text(command, "--topics", &options->topics, "left=TOPIC",
           "Of a recording, the topic whose pictures are taken (default: the first that has some)")
      .needs(command.option("--images"));
  add_value(command, "--precision", &options->precision, "FRACTION", no_fraction,
            "Sample until the 95 % interval of each median of call and execute, over processes, is "
            "within +/- this, or the time is up; a fraction or a percentage")
      .shows_default();
  add_value(
      command, "--max-time", &options->max_time, "DURATION", no_duration,
      "Total time after which nothing begins to be measured, e.g. 5min; with --resume, that "
      "of the whole run (default: 15 s a cell, or 3min if that is more; 3min with --quick, and up "
      "to 6 more where meters are read)");
  command.add_flag("--strict", options->strict,
                   "Exit code 3 if every row of calls that was measured is uncertain (?)");
  add_seed(command, options->seed, "Seed of inputs, weights and the order of measuring");
  command.add_flag(
      "--quick", options->quick,
      "4 processes a cell, 2 of them with cold set-ups, instead of 10 and 5, and less sampling");
  command.add_flag("--interference", options->interference,
                   "Measure calls beside a busy unit of the same memory, and after all caches were "
                   "emptied, as well, which a run without --quick does anyway");
  command.add_flag("--dry-run", options->dry_run,
                   "Show the cells and the estimated time; measure nothing");
  add_output(command, "--fit-energy", options->fit.file,
             "Fit the energy model of each unit with a meter to this run, print it with its "
             "residuals, and write the platform with it to a file that ends in .yaml, for "
             "--platform",
             StdoutUse::kRefused);
  add_text(command, "--fit-parameters", &options->fit.parameters, "PARAMETER,...",
           "What to fit, with commas: active_w (W), op_pj, byte_pj (pJ), call_j (J) (default: as "
           "many as the cells can tell apart)")
      .needs(command.option("--fit-energy"));
  const Option resume = command.add_flag(
      "--resume", options->resume,
      "Go on with the newest run of --db that did not end, with the options it was started with");
  for (const auto* name : {"--platform", "--set", "--mix", "--units", "--workloads", "--filter",
                           "--variants", "--sizes", "--batch", "--images", "--topics",
                           "--precision", "--seed", "--quick", "--interference"}) {
    resume.excludes(command.option(name));
  }
  add_json(command, options->json);
  command.footer("Example: pirt characterize --quick --filter 'sobel|fc8' --db profile.db");
  command.runs(action, [options] { return characterize(*options); });
}

}  // namespace pirt::cli
