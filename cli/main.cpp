// The pirt binary: runs a command, and turns errors into one message and an exit code. All catching
// is here.
#include <fcntl.h>
#include <unistd.h>

#include <csignal>
#include <cstdio>
#include <exception>
#include <system_error>

#include "cli/commands.h"
#include "cli/version.h"
#include "workloads/base/error.h"
#include "workloads/base/text/printable.h"

namespace pirt::cli {
namespace {

/// In the order in which --help lists them.
constexpr AddCommand* kCommands[] = {
    add_list,           //
    add_characterize,   //
    add_import,         //
    add_tune,           //
    add_doctor,         //
    add_schedule,       //
    add_what_if,        //
    add_report,         //
    add_regress,        //
    add_replay,         //
    add_export,         //
    add_diff,           //
    add_run_robot,      //
    add_generate,       //
    add_generate_dag,   // a kind of it, as the next
    add_generate_bal,   //
    add_plan,           //
    add_describe,       //
    add_bundle_adjust,  //
    add_cloud_worker,   //
    add_cloud_admin,    //
    add_cloud_slot,     //
    add_sample,         //
    add_complete,       //
    add_manual,         //
    add_worker,
};

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
    return pirt::cli::run(pirt::cli::kCommands, pirt::cli::version_text, argc, argv);
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
