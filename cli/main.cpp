// The pirt binary: finds the command, runs it, turns errors into one message and an exit code. All
// catching is here.
#include <fcntl.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <csignal>
#include <cstdio>
#include <exception>
#include <string>
#include <string_view>
#include <system_error>
#include <vector>

#include "cli/commands.h"
#include "cli/files.h"
#include "workloads/base/error.h"
#include "workloads/base/printable.h"
#include "workloads/base/text.h"

namespace pirt::cli {
namespace {

std::vector<std::string> option_names(const CLI::App& app) {
  std::vector<std::string> names;
  for (const auto* option : app.get_options()) {
    for (const auto& name : option->get_lnames()) names.push_back("--" + name);
    for (const auto& name : option->get_snames()) names.push_back("-" + name);
  }
  return names;
}

std::vector<std::string> command_names(const CLI::App& app) {
  std::vector<std::string> names;
  for (const auto* command :
       app.get_subcommands([](const CLI::App* a) { return !a->get_group().empty(); })) {
    names.push_back(command->get_name());
  }
  return names;
}

/// CLI11 leaves what it does not know in remaining(); the nearest known names make a better message
/// than its own.
void reject_unknown(const CLI::App& app, const CLI::App& root) {
  // All that remains of "--" is the mark itself, which is no argument.
  auto unknown = app.remaining();
  if (app.remaining_size() == 0) return;
  if (unknown.size() > app.remaining_size()) unknown.erase(std::ranges::find(unknown, "--"));
  const auto& word = unknown.front();
  const std::string command = &app == &root ? "pirt" : "pirt " + app.get_name();
  if (word.size() > 1 && word.front() == '-') {
    const auto name = word.substr(0, word.find('='));
    throw_bad_input("unknown option '" + name + "'" + suggestion(name, option_names(app)) +
                    "; see '" + command + " --help'");
  }
  if (&app == &root) {
    throw_bad_input("unknown command '" + word + "'" + suggestion(word, command_names(app)));
  }
  throw_bad_input("unexpected argument '" + word + "'; see '" + command + " --help'");
}

int run(int argc, char** argv) {
  CLI::App app{
      "Characterizes robot workloads on every processing unit of a machine and schedules a robot's "
      "mix\n"
      "of them for latency, throughput or energy."};
  app.name("pirt");
  app.set_version_flag("--version", std::string("pirt ") + PIRT_VERSION);
  app.allow_extras();
  Action action;
  add_list(app, action);
  add_characterize(app, action);
  add_tune(app, action);
  add_doctor(app, action);
  add_schedule(app, action);
  add_report(app, action);
  add_regress(app, action);
  add_replay(app, action);
  add_export(app, action);
  add_diff(app, action);
  add_run_robot(app, action);
  add_generate(app, action);
  add_generate_dag(app, action);
  add_sample(app, action);
  add_worker(app, action);
  app.footer(
      "Exit codes: 0 good, 1 a check failed, 2 usage or bad input, 3 inconclusive, 4 not possible "
      "on this "
      "machine.\nFirst steps: pirt characterize --quick --db profile.db && pirt report profile.db");
  for (auto* command : app.get_subcommands({})) command->allow_extras();

  // Nothing but the command can follow.
  if (argc > 1 && std::string_view(argv[1]) == "--") argv[1] = argv[0], ++argv, --argc;
  try {
    app.parse(argc, argv);
  } catch (const CLI::Success& success) {  // --help, --version
    return app.exit(success);
  } catch (const CLI::ParseError& error) {
    for (const auto* command : app.get_subcommands()) reject_unknown(*command, app);
    reject_unknown(app, app);
    throw_bad_input(error.what());
  }
  for (const auto* command : app.get_subcommands()) reject_unknown(*command, app);
  reject_unknown(app, app);
  if (!action) {
    std::fputs(app.help().c_str(), stderr);
    throw_bad_input("no command given (known: " + join(command_names(app), ", ") + ")");
  }
  for (auto* command : app.get_subcommands()) check_files(given_files(*command));
  return action();
}

/// Makes sure that no file is ever opened as one of the standard streams: what is written to those
/// would end up in it. A stream that was closed is open the wrong way round, so that using it fails
/// as before.
bool occupy_standard_streams() {
  for (const int stream : {STDIN_FILENO, STDOUT_FILENO, STDERR_FILENO}) {
    if (::fcntl(stream, F_GETFD) >= 0) continue;
    // The lowest number that is free is the one that open takes.
    if (::open("/dev/null", stream == STDIN_FILENO ? O_WRONLY : O_RDONLY) != stream) return false;
  }
  return true;
}

}  // namespace
}  // namespace pirt::cli

int main(int argc, char** argv) {
  // A limit on the size of files (ulimit -f) is then an error like a full disk, with its message.
  std::signal(SIGXFSZ, SIG_IGN);
  if (!pirt::cli::occupy_standard_streams()) return pirt::kExitEnvironment;
  try {
    return pirt::cli::run(argc, argv);
  } catch (const pirt::Error& error) {
    std::fprintf(stderr, "pirt: %s\n", pirt::printable(error.what()).c_str());
    return pirt::exit_code(error.code());
  } catch (const std::bad_alloc&) {
    std::fputs("pirt: out of memory\n", stderr);
    return pirt::kExitEnvironment;
  } catch (const std::system_error& error) {  // of std::filesystem too, with the path
    std::fprintf(stderr, "pirt: the system refused: %s; check that path, permission and space\n",
                 error.what());
    return pirt::kExitEnvironment;
  } catch (const std::exception& error) {
    std::fprintf(stderr, "pirt: internal error: %s (please report this)\n",
                 pirt::printable(error.what()).c_str());
    return pirt::kExitEnvironment;
  }
}
