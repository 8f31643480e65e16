// pirt tune: searches the parameters of the OpenCL kernels on this machine's devices, and keeps
// what is faster.
#include "characterize/tune/tune.h"

#include <fmt/chrono.h>
#include <fmt/core.h>

#include <ctime>
#include <exception>
#include <memory>

#include "cli/commands.h"
#include "cli/long_run.h"
#include "cli/options/duration.h"
#include "cli/options/files.h"
#include "cli/options/output.h"
#include "cli/options/shipped.h"
#include "cli/options/values.h"
#include "reports/tools/tune_report.h"
#include "workloads/backends/opencl/tuning/tuning_file.h"
#include "workloads/base/error.h"
#include "workloads/base/text/json.h"
#include "workloads/base/time.h"

namespace pirt::cli {
namespace {

struct TuneFlags {
  std::string platform = "host";
  std::vector<std::string> units;
  std::string filter;
  std::string max_time = "15min";
  std::uint64_t seed = 1;
  std::optional<std::string> output;
  Output json;
  bool dry_run = false;
};

std::filesystem::path output_of(const TuneFlags& options) {
  if (options.output) return *options.output;
  const auto path = opencl::tuning_path();
  if (!path) {
    throw_bad_input(
        "there is no place for the tuned parameters: PIRT_TUNING is none, or there is no home "
        "folder; give one with --output FILE");
  }
  return *path;
}

void warn_of_rejected(const TunedUnit& tuned) {
  for (const TuneFinding& finding : tuned.outcome.findings) {
    for (const RejectedCandidate& rejected : finding.rejected) {
      if (!rejected.wrong) continue;
      warn(fmt::format("{}={} computes something else on {} and is not used: {}",
                       finding.parameter->name, rejected.value, tuned.unit, rejected.reason));
    }
  }
}

bool measured_anything(const TunedUnit& tuned) {
  return std::ranges::any_of(tuned.outcome.findings, [](const TuneFinding& finding) {
    return finding.verdict != TuneVerdict::kNotMeasured;
  });
}

int show_plan(const TunePlan& plan, const TuneOptions& tune, const TuneFlags& options) {
  Document document{.title = "pirt tune", .parts = {}};
  Json json = {{"schema_version", 1}, {"output", tune.output.string()}, {"units", nullptr}};
  json["units"] = Json::array();
  for (const TuneUnit& unit : plan.units) {
    Table table = tune_plan_table(unit);
    const auto processes = expected_processes(unit, {});
    table.footnotes.push_back(fmt::format(
        "About {} processes of half a second, and more where something is faster; would be stored "
        "in {}",
        processes, tune.output.string()));
    document.parts.emplace_back(std::move(table));
    json["units"].push_back(tune_plan_json(unit));
    json["units"].back()["processes"] = processes;
  }
  emit(render(document, Format::kText), json, options.json);
  return 0;
}

struct Searched {
  std::vector<TunedUnit> units;
  std::exception_ptr not_stored;  ///< Why one could not be; null otherwise.
};

/// Searches all units; each is stored as soon as it is done.
Searched search(const TunePlan& plan, const TuneOptions& tune) {
  const MachineClock clock;
  const Nanos end = clock.now() + tune.max_time;
  const ProgressLine line;
  Searched searched;
  auto& all = searched.units;
  for (const TuneUnit& unit : plan.units) {
    all.push_back(tune_unit(
        tune, unit,
        [&](const std::string& what) { line.show(fmt::format("{}: {}", unit.unit->name, what)); },
        [&] { return clock.now() >= end; }));
    line.clear();
    warn_of_rejected(all.back());
    try {
      if (measured_anything(all.back())) {
        store_tuning(tune, all.back(), fmt::format("{:%FT%TZ}", fmt::gmtime(std::time(nullptr))));
      }
    } catch (const Error&) {
      searched.not_stored = std::current_exception();
    }
    if (all.back().outcome.stopped) break;
  }
  return searched;
}

int tune(const TuneFlags& options) {
  TuneOptions tune;
  tune.platform = load_platform(options.platform);
  tune.units = options.units;
  tune.filter = options.filter;
  tune.max_time = parse_duration(options.max_time);
  tune.seed = options.seed;
  tune.output = output_of(options);
  tune.stop = stop_on_signal();
  const TunePlan plan = plan_tuning(tune);
  for (const Skip& skip : plan.skipped) warn(skip.unit + " is not tuned: " + skip.reason);
  if (options.dry_run) return show_plan(plan, tune, options);

  check_output(tune.output);
  const auto [tuned, not_stored] = search(plan, tune);
  Document document{.title = "pirt tune", .parts = {}};
  Json json = {{"schema_version", 1}, {"output", tune.output.string()}};
  json["units"] = Json::array();
  for (const TunedUnit& unit : tuned) {
    document.parts.emplace_back(tune_table(unit));
    json["units"].push_back(tune_json(unit));
  }
  const bool any = std::ranges::any_of(tuned, measured_anything);
  if (any && !not_stored) {
    document.parts.emplace_back(Paragraph{{fmt::format(
        "Stored in {}; used from now on by every command, for exactly this device and driver "
        "(PIRT_TUNING=none turns it off).",
        tune.output.string())}});
  }
  emit(render(document, Format::kText), json, options.json);
  if (not_stored) std::rethrow_exception(not_stored);
  if (tuned.back().outcome.stopped) {
    throw_environment(any ? "interrupted; the parameters above are stored"
                          : "interrupted; nothing was stored");
  }
  if (!any)
    throw_environment(
        "nothing could be measured; see the reasons above, or give it more --max-time");
  return 0;
}

}  // namespace

void add_tune(CLI::App& app, Action& action) {
  auto options = std::make_shared<TuneFlags>();
  Command command(
      app, "tune",
      "Search the parameters of the OpenCL kernels on this machine, and keep what is faster");
  add_input(command, "--platform", &options->platform,
            "Whose units are tuned: a name of `pirt list platforms`, or a YAML file",
            FileUse::kReadIfFile)
      .offers(offer_platforms())
      .shows_default();
  add_list_of(command, "--units", options->units, "UNIT",
              "Units to tune, with commas (default: all with backend opencl)")
      .offers(offer_units());
  add_filter(command, options->filter,
             "only parameters of workloads whose names contain it, judged by those");
  add_value(command, "--max-time", &options->max_time, "DURATION", no_duration,
            "Time after which nothing more is measured; what gains most comes first")
      .shows_default();
  add_seed(command, options->seed, "Seed of inputs, weights and the order of measuring");
  command.add_flag("--dry-run", options->dry_run,
                   "Show the parameters and candidates; measure nothing");
  add_continued(command, "--output", &options->output,
                "File of tuned parameters (default: the one that is used: PIRT_TUNING, or "
                "pirt/opencl-tuning.json in $XDG_CONFIG_HOME or ~/.config)");
  add_json(command, options->json);
  command.footer(
      "A candidate has to compute what the reference computes, and replaces the default if it is "
      "faster by 2 % and\nmore than chance in fresh rounds. What is stored holds for exactly this "
      "device and driver version.\n"
      "Example: pirt tune --platform host-opencl --filter 'conv|fc'");
  command.runs(action, [options] { return tune(*options); });
}

}  // namespace pirt::cli
