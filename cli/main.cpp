// The pirt binary: runs a command, and turns errors into one message and an exit code. All catching
// is here.
#include <csignal>
#include <cstdio>
#include <exception>
#include <string>
#include <system_error>
#include <vector>

#include "cli/commands.h"
#include "cli/options/process_start.h"
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
    add_history,        //
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

int run_guarded(const std::vector<std::string>& undone, int argc, char** argv) {
  try {
    return run(kCommands, version_text, undone, argc, argv);
  } catch (const Error& error) {
    std::fprintf(stderr, "pirt: %s\n", printable(error.what()).c_str());
    return exit_code(error.code());
  } catch (const std::bad_alloc&) {
    std::fputs("pirt: out of memory\n", stderr);
    return kExitEnvironment;
  } catch (const std::system_error& error) {  // of std::filesystem too, with the path
    std::fprintf(stderr, "pirt: the system refused: %s; check that path, permission and space\n",
                 error.what());
    return kExitEnvironment;
  } catch (const std::exception& error) {
    std::fprintf(stderr, "pirt: internal error: %s (please report this)\n",
                 printable(error.what()).c_str());
    return kExitEnvironment;
  }
}

}  // namespace
}  // namespace pirt::cli

int main(int argc, char** argv) {
  const auto undone = pirt::cli::settle_process();
  // A limit on the size of files (ulimit -f) is then an error like a full disk, with its message.
  std::signal(SIGXFSZ, SIG_IGN);
  return pirt::cli::run_with_room([&] { return pirt::cli::run_guarded(undone, argc, argv); });
}
