// Starting threads, of which a machine may not give as many as are asked for.
#pragma once

#include <string>
#include <system_error>
#include <thread>
#include <utility>

#include "workloads/base/error.h"

namespace pirt {

/// @throws Error{kEnvironment} if the thread cannot be started; those that run already must then be
/// made to end by the caller, who joins them.
template <typename Body>
[[nodiscard]] std::jthread start_thread(Body&& body) {
  try {
    return std::jthread(std::forward<Body>(body));
  } catch (const std::system_error& error) {
    throw_environment("cannot start a thread: " + error.code().message() +
                      "; raise the limits on processes and memory (ulimit -u, ulimit -v, those of "
                      "the container)");
  }
}

}  // namespace pirt
