// Who must not wait for tasks, since they wait for him.
#pragma once

#include <utility>

namespace pirt::runtime {

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
