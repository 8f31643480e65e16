// pirt regress with two programs: is the candidate slower than the baseline, here and now?
#include <fmt/core.h>
#include <unistd.h>

#include <algorithm>
#include <filesystem>
#include <memory>

#include "characterize/campaign/campaign.h"
#include "characterize/worker/process.h"
#include "cli/commands/gate/regress.h"
#include "cli/long_run.h"
#include "cli/options/duration.h"
#include "cli/options/files.h"
#include "cli/options/output.h"
#include "reports/document/document.h"
#include "reports/gate/duet_gate.h"
#include "workloads/base/error.h"
#include "workloads/base/text/json.h"
#include "workloads/base/text/name_filter.h"
#include "workloads/base/text/text.h"
#include "workloads/catalog/specs.h"

namespace pirt::cli {
namespace {

constexpr const char* kDefaultLedger = "pirt-regress.ledger";

/// A program that answers `sample`.
/// @throws Error{kBadInput} if it does not.
std::filesystem::path checked_program(const std::string& name, const char* option) {
  std::error_code error;
  auto path = std::filesystem::canonical(name, error);
  if (error || std::filesystem::is_directory(path) || ::access(path.c_str(), X_OK) != 0) {
    throw_bad_input(fmt::format("{} '{}' is no program that can be run; give the path of a pirt",
                                option, name));
  }
  ProcessRequest request;
  request.program = path;
  request.arguments = {"sample", "--help"};
  request.limit = std::chrono::seconds(10);
  std::string why;
  try {
    const auto answer = run_process(request);
    const bool known = answer.end == ProcessResult::End::kExited && answer.code == 0 &&
                       answer.output.find("--workload") != std::string::npos;
    if (known) return path;
    why = how_it_ended(answer, request.limit);
  } catch (const Error& cannot_start) {
    why = cannot_start.what();
  }
  throw_bad_input(fmt::format(
      "{} '{}' does not know `pirt sample` ({}): it is no pirt, or one from before programs could "
      "be compared",
      option, name, why));
}

std::string platform_argument(const RegressOptions& options) {
  const std::string name = options.platform.empty() ? "host" : options.platform;
  return names_a_file(name) ? std::filesystem::absolute(name).string() : name;
}

DuetPrograms programs_of(const RegressOptions& options) {
  DuetPrograms programs;
  programs.platform_argument = platform_argument(options);
  programs.platform = load_platform(programs.platform_argument);
  programs.seed = options.seed;
  programs.work = parse_duration(options.work);
  programs.cold = options.cold;
  programs.limit = process_limit(options);
  programs.stop = stop_on_signal();
  return programs;
}

/// Those of a characterization with the same filter, and the scheduler.
std::vector<DuetCell> chosen_cells(const RegressOptions& options, const DuetPrograms& programs) {
  std::vector<DuetCell> cells;
  const std::string scheduler(kSchedulerCell);
  const NameFilter filter(options.filter);
  // By itself the scheduler is no workload that a campaign would find.
  const bool is_alone = filter.picks(scheduler) && options.filter.find('@') == std::string::npos &&
                        std::ranges::none_of(workload_names(), [&filter](const std::string& name) {
                          return filter.picks(name);
                        });
  if (!is_alone) {
    CampaignOptions campaign;
    campaign.platform_argument = programs.platform_argument;
    campaign.platform = programs.platform;
    campaign.units = options.units;
    campaign.filter = options.filter;
    campaign.stop = programs.stop;
    const auto plan = plan_campaign(campaign);
    for (const auto& cell : plan.cells) cells.push_back({cell.workload->name, cell.unit});
    warn_of_skipped(plan, "compared", "pirt list backends");
  }
  if (options.units.empty() && filter.picks(scheduler)) cells.push_back({scheduler, ""});
  if (cells.empty()) throw_bad_input("the scheduler is on no unit: leave --units out");
  return cells;
}

std::string step_text(const DuetComparison& comparison, const DuetStep& step) {
  const DuetCellState& state = comparison.cells()[step.cell];
  const char* what = step.kind == DuetStep::Kind::kCheck    ? "verifying"
                     : step.kind == DuetStep::Kind::kCanary ? "canary"
                                                            : "block";
  return fmt::format("[{} of {} decided] {}: {} {}", comparison.decided(),
                     comparison.cells().size(), to_string(state.cell), what,
                     step.kind == DuetStep::Kind::kBlock ? std::to_string(state.blocks + 1) : "");
}

}  // namespace

int finish_comparison(const RegressOptions& options, const LiveComparison& live,
                      const std::string& baseline, const std::string& candidate) {
  if (!options.ledger) {  // main knows one that is named
    auto files = written_files({&options.markdown, &options.junit, &options.json});
    files.push_back({"the ledger", kDefaultLedger, FileUse::kContinued});
    check_files(std::move(files));
  }
  DuetComparison& comparison = live.comparison;
  Ledger ledger(options.ledger.value_or(kDefaultLedger), live.key,
                [&](const Ledger::Event& event) { comparison.apply(event); });
  if (live.on_ledger) live.on_ledger(ledger);
  if (const auto there = comparison.processes(); there > 0) {
    warn(fmt::format("going on with {}: {} processes are there", ledger.path().string(), there));
  }
  DuetEnd end = DuetEnd::kDecided;
  {
    const ProgressLine line;
    end = run_duet(comparison, ledger, live.take, live.rounds,
                   {.time = parse_duration(options.max_time), .stop = live.stop},
                   [&](const DuetStep& step) {
                     if (live.on_step) live.on_step(step);
                     line.show(step_text(comparison, step));
                   });
  }
  GateReport report{.base = baseline,
                    .candidate = candidate,
                    .strict = options.strict,
                    .result = judge_duet(comparison, end),
                    .decisions = std::nullopt,
                    .rule = {}};
  describe_rule(report);
  if (!options.baseline_program.empty()) {
    report.decisions = Decisions{.mix = "", .flips = find_flips(report.result), .modes = {}};
  }
  const int code = emit_report(report, options);
  if (end == DuetEnd::kStopped) {
    throw_environment(fmt::format(
        "interrupted; {} of {} cells are decided and {} processes are kept in '{}': go on with the "
        "same command",
        comparison.decided(), comparison.cells().size(), comparison.processes(),
        ledger.path().string()));
  }
  if (end == DuetEnd::kOutOfTime) {
    warn(fmt::format("{} of {} cells are decided; the same command goes on with '{}'",
                     comparison.decided(), comparison.cells().size(), ledger.path().string()));
  } else if (!options.ledger) {
    std::filesystem::remove(ledger.path());
  }
  return code;
}

int regress_programs(const RegressOptions& options) {
  DuetPrograms programs = programs_of(options);
  programs.baseline = checked_program(options.baseline_program, "--baseline-program");
  programs.candidate = checked_program(options.candidate_program, "--candidate-program");
  const auto cells = chosen_cells(options, programs);
  DuetComparison comparison(cells, options.seed, programs.limit);
  return finish_comparison(
      options,
      {.comparison = comparison,
       .key = ledger_key(programs, cells),
       .take = program_samples(programs),
       .rounds = options.one_at_a_time ? one_at_a_time(cells.size())
                                       : side_by_side(programs.platform, cells),
       .stop = programs.stop},
      options.baseline_program, options.candidate_program);
}

}  // namespace pirt::cli
