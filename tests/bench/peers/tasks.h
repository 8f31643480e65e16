// Peers of the runtime: an empty task after the other, on two threads.
#pragma once

#include <functional>
#include <string>
#include <vector>

namespace pirt::bench {

struct TaskPeer {
  std::string name;
  /// Seconds for so many tasks with a callback each, from the first submission until all have
  /// ended; as a chain each comes after the one before. The runtime is started already.
  std::function<double(int tasks, bool chain)> run;
};

/// Those that were found as this was built. StarPU: started here, one for the whole process.
[[nodiscard]] std::vector<TaskPeer> task_peers();

}  // namespace pirt::bench
