// What a process has from before main: what its launcher left, which is a wish as far as it can be
// one (taskset, nice, nohup, ulimit), and what libraries changed when they were loaded, which is
// undone. The kernel's state is read before the first constructor of any library runs, so that the
// two can be told apart.
#pragma once

#include <functional>
#include <ostream>
#include <string>
#include <string_view>
#include <vector>

namespace pirt::cli {

/// Makes the process what its launcher wished: to be called first in main. Nobody wishes blocked
/// signals, a SIGCHLD that is ignored, or files that their owner cannot read.
/// @return What was undone, or could not be, a sentence each; empty if nothing was to do.
[[nodiscard]] std::vector<std::string> settle_process();

/// Runs @p body on a stack of the usual size, also under a smaller limit, and its threads on such
/// ones also without a limit, with the descriptors that the hard limit allows, and so that running
/// out of processor time (ulimit -t) is a signal that can be told from others.
/// @return What it returns. It does not throw.
[[nodiscard]] int run_with_room(const std::function<int()>& body);

/// Where results go: what the process was given as standard output. Descriptor 1 leads to standard
/// error from before main on, since libraries write there what they have to say.
[[nodiscard]] int results_descriptor();

/// @throws Error{kEnvironment} if it cannot be written.
void write_results(std::string_view text);

/// The same as a stream, for what is written bit by bit.
[[nodiscard]] std::ostream& results_stream();

}  // namespace pirt::cli
