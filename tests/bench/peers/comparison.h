// What the scheduler's benchmark compares with a peer, where the peer is installed.
#pragma once

namespace pirt::bench {

/// Prints virtual time beside SimGrid S4U: tasks a second, interleaved, and completion times of the
/// same decisions.
/// @return  Whether the completion times agree; true with a line that says so where SimGrid is not
/// installed.
[[nodiscard]] bool compare_with_simgrid();

}  // namespace pirt::bench
