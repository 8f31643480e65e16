// Which of the host's cores a thread runs on.
#pragma once

#include <sched.h>
#include <sys/types.h>

#include <cstddef>
#include <span>
#include <string>
#include <vector>

namespace pirt {

/// Binds the calling thread (threads that it starts inherit this) to @p cores; leaves it alone if
/// they are empty.
/// @return  Number of cores that the thread may use now.
/// @throws  Error{kEnvironment} naming @p unit if a core does not exist or may not be used; the
/// affinity is then as before.
int bind_to_cores(std::span<const int> cores, const std::string& unit);

/// The cores that a thread may use, in order; empty if the system does not say.
/// @param thread  Its number; 0 = the calling one.
/// @param ask     Another function in tests.
[[nodiscard]] std::vector<int> cores_of_thread(pid_t thread,
                                               int (*ask)(pid_t, std::size_t,
                                                          cpu_set_t*) = ::sched_getaffinity);

/// The same of the calling thread.
/// @throws Error{kEnvironment} if the system does not say.
[[nodiscard]] std::vector<int> current_cores();

/// When it goes, the thread that made it may use the cores again that it could.
class CoresRestored {
 public:
  CoresRestored() : before_(current_cores()) {}
  ~CoresRestored() {
    try {
      bind_to_cores(before_, "");
    } catch (...) {  // Those cores are gone: it keeps what it has.
    }
  }
  CoresRestored(const CoresRestored&) = delete;
  CoresRestored& operator=(const CoresRestored&) = delete;

 private:
  std::vector<int> before_;
};

}  // namespace pirt
