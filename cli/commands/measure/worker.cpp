// pirt worker: the process that `characterize` starts for whatever touches a device. Not for users.
#include "characterize/worker/worker.h"

#include <iostream>

#include "cli/commands.h"
#include "cli/options/process_start.h"

namespace pirt::cli {

void add_worker(CLI::App& app, Action& action) {
  Command command(app, "worker", "Does one job from standard input");
  command.hide();  // not in the help
  command.runs(action, [] { return run_worker(std::cin, results_stream()); });
}

}  // namespace pirt::cli
