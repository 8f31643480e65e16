// Computes in a process of its own: a kernel that crashes, or takes too long, takes a try, and not
// the worker.
#pragma once

#include <memory>
#include <span>
#include <string>
#include <vector>

#include "workloads/backends/nats/service/computer.h"

namespace pirt::cloud {

/// Where the process finds its end of the line.
inline constexpr int kSlotDescriptor = 3;

struct SlotProgram {
  std::string program;
  std::vector<std::string> arguments = {};
  Nanos call_limit = std::chrono::seconds(60);  ///< With preparing; then the process is killed.
  /// The same for a call that is computed as the worker ends.
  Nanos end_limit = std::chrono::seconds(5);
};

/// Starts the program when it is first needed, and again once it is gone, which is an error of that
/// call. Whatever it holds ends with it.
[[nodiscard]] std::unique_ptr<Computer> make_process_computer(SlotProgram program);

/// The body of that process: computes what comes until the line ends.
/// @param admission  Judges a call once more: the process trusts nobody either.
/// @return  Whether it ended where a call ends.
bool serve_computer(Computer& computer, const Admission& admission, int line = kSlotDescriptor);

}  // namespace pirt::cloud
