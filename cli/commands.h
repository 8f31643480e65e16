// The commands of pirt. Each file adds its subcommand and the function that runs it after parsing.
#pragma once

#include "cli/options/command.h"

namespace pirt::cli {

void add_list(CLI::App& app, Action& action);
void add_characterize(CLI::App& app, Action& action);
void add_import(CLI::App& app, Action& action);
void add_tune(CLI::App& app, Action& action);
void add_doctor(CLI::App& app, Action& action);
void add_schedule(CLI::App& app, Action& action);
void add_what_if(CLI::App& app, Action& action);
void add_report(CLI::App& app, Action& action);
void add_regress(CLI::App& app, Action& action);
void add_replay(CLI::App& app, Action& action);
void add_export(CLI::App& app, Action& action);
void add_diff(CLI::App& app, Action& action);
void add_history(CLI::App& app, Action& action);
void add_generate(CLI::App& app, Action& action);
void add_run_robot(CLI::App& app, Action& action);
void add_generate_dag(CLI::App& app, Action& action);
void add_plan(CLI::App& app, Action& action);
void add_describe(CLI::App& app, Action& action);
void add_bundle_adjust(CLI::App& app, Action& action);
void add_generate_bal(CLI::App& app, Action& action);
void add_cloud_worker(CLI::App& app, Action& action);
void add_cloud_admin(CLI::App& app, Action& action);
/// Hidden: what the completion of shells asks for.
void add_complete(CLI::App& app, Action& action);
/// Hidden: what the build makes manual pages with.
void add_manual(CLI::App& app, Action& action);
/// Hidden: the body of the processes that `cloud-worker` starts.
void add_cloud_slot(CLI::App& app, Action& action);
/// Hidden: the body of the processes that `regress` starts, of this and other versions.
void add_sample(CLI::App& app, Action& action);
/// Hidden: the body of the processes that `characterize` starts.
void add_worker(CLI::App& app, Action& action);

}  // namespace pirt::cli
