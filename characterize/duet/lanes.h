// Which cells of a comparison are measured side by side: those of units that have no core in
// common.
#pragma once

#include <cstddef>
#include <filesystem>
#include <vector>

#include "characterize/duet/sample.h"

namespace pirt {

/// Indices of cells whose processes run one at a time.
using DuetLane = std::vector<std::size_t>;
/// The lanes of a round run side by side, the rounds one after another.
using DuetRounds = std::vector<std::vector<DuetLane>>;

/// All cells in one lane.
[[nodiscard]] DuetRounds one_at_a_time(std::size_t cells);

/// A lane for each group of units that share a physical core with each other and with no unit of
/// another lane; afterwards, by itself, what may run on any core.
/// @param root  "/", or the folder of a recorded machine.
/// @throws Error{kBadInput} if @p platform has not the unit of a cell.
[[nodiscard]] DuetRounds side_by_side(const Platform& platform, const std::vector<DuetCell>& cells,
                                      const std::filesystem::path& root = "/");

}  // namespace pirt
