// pirt regress with two commands: is what the second one measures slower, here and now?
#include <cstdio>

#include "characterize/duet/commands.h"
#include "cli/commands/gate/regress.h"
#include "cli/long_run.h"
#include "workloads/base/error.h"
#include "workloads/base/text/json.h"
#include "workloads/base/text/shell.h"
#include "workloads/own/own.h"

namespace pirt::cli {
namespace {

DuetCommands commands_of(const RegressOptions& options) {
  DuetCommands commands;
  commands.baseline = shell_words(options.baseline_command);
  commands.candidate = shell_words(options.candidate_command);
  if (!options.setup_command.empty()) commands.setup = shell_words(options.setup_command);
  commands.reader = options.as.empty() ? &find_reader(options.reads) : &workload_reader();
  commands.warm_up = options.warm_up;
  commands.limit = process_limit(options);
  commands.stop = stop_on_signal();
  return commands;
}

/// Once the first runs of both have told how long one takes.
void say_how_long(const DuetComparison& comparison, const DuetStep& step,
                  const std::string& max_time) {
  const DuetCellState& state = comparison.cells()[step.cell];
  if (step.kind != DuetStep::Kind::kBlock || state.blocks > 0) return;
  const double run_s = (state.checks[0]->wall_s + state.checks[1]->wall_s) / 2;
  std::fprintf(stderr, "%s; at most --max-time %s\n", duration_text(run_s).c_str(),
               max_time.c_str());
}

}  // namespace

int regress_commands(const RegressOptions& options) {
  const DuetCommands commands = commands_of(options);
  const DuetCell cell = options.as.empty() ? DuetCell{std::string(kCommandCell), ""}
                                           : DuetCell{options.as, options.units.front()};
  DuetComparison comparison({cell}, options.seed, commands.limit);
  run_setup(commands);  // Which may build them.
  auto key = ledger_key(commands, options.seed);
  Json digests = Json::array();
  for (const std::string& file : options.own.all()) digests.push_back(own::digest_of(file));
  key["own"] = digests;
  return finish_comparison(
      options,
      {.comparison = comparison,
       .key = key,
       .take = command_samples(commands, comparison),
       .rounds = one_at_a_time(1),
       .stop = commands.stop,
       .on_step = [&](const DuetStep& step) { say_how_long(comparison, step, options.max_time); },
       .on_ledger =
           [&](const Ledger& ledger) {
             refuse_changed_files(commands, comparison, ledger.path());
           }},
      options.baseline_command, options.candidate_command);
}

}  // namespace pirt::cli
