// How a thread that serves a run begins, whoever makes the run, and who must not wait for tasks,
// since they wait for him.
#pragma once

#include <span>
#include <string>
#include <utility>

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

/// While one of these is there, its thread must not wait for tasks: it would wait for itself.
class MustNotWait {
 public:
  MustNotWait() : before_(std::exchange(here_, true)) {}
  ~MustNotWait() { here_ = before_; }
  MustNotWait(const MustNotWait&) = delete;
  MustNotWait& operator=(const MustNotWait&) = delete;

  [[nodiscard]] static bool here() { return here_; }
  /// @throws std::logic_error if the calling thread must not.
  static void check(const char* what);

 private:
  static thread_local bool here_;
  bool before_;
};

}  // namespace pirt::runtime
