// How a thread that serves a run begins, whoever makes the run.
#pragma once

#include <span>
#include <string>

#include "workloads/base/error.h"
#include "workloads/base/system/affinity.h"
#include "workloads/base/system/thread.h"

namespace pirt::runtime {

/// Of the calling thread: who started it may be bound to a core, and of a real-time class.
/// @param cores  That it may use; empty = those that it has, as where one of them is gone.
inline void begin_thread(const std::string& name, std::span<const int> cores) {
  name_thread(name);
  take_class_of_process();
  try {
    bind_to_cores(cores, name);
  } catch (const Error&) {  // It keeps what it has.
  }
}

}  // namespace pirt::runtime
