// An order in which everything comes after what it depends on, or why there is none.
#pragma once

#include <cstddef>
#include <string>
#include <vector>

namespace pirt {

struct DependencyOrder {
  std::vector<std::size_t>
      order;  ///< All positions, or those that are in no cycle and behind none.
  /// A loop in the direction of the data, its first position again at the end; empty if there is
  /// none.
  std::vector<std::size_t> cycle;
};

/// Kahn's algorithm, each time the first that is ready.
/// @param predecessors  By position: the positions that it comes after; one may stand there twice.
[[nodiscard]] DependencyOrder dependency_order(
    const std::vector<std::vector<std::size_t>>& predecessors);

/// "the tasks wait for each other: a -> b -> a"
[[nodiscard]] std::string cycle_text(const std::vector<std::size_t>& cycle,
                                     const std::vector<std::string>& names);

}  // namespace pirt
