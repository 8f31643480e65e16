#include "tests/bench/peers/tasks.h"

namespace pirt::bench {

std::vector<TaskPeer> task_peers() { return {}; }

}  // namespace pirt::bench
