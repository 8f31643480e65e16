// pirt worker: the process that `characterize` starts for whatever touches a device. Not for users.
#include "characterize/worker/worker.h"

#include <iostream>

#include "cli/commands.h"

namespace pirt::cli {

void add_worker(CLI::App& app, Action& action) {
  auto* command = app.add_subcommand("worker", "Does one job from standard input");
  command->group("");  // not in the help
  command->callback([&action] { action = [] { return run_worker(std::cin, std::cout); }; });
}

}  // namespace pirt::cli
