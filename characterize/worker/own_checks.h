// What somebody else's workload says of itself, held against what it does before it is measured.
#pragma once

#include <span>
#include <string>
#include <vector>

#include "workloads/model/player.h"
#include "workloads/model/workload.h"

namespace pirt {

/// @param frames  As it made them. pirt's own need no look.
/// @throws Error{kBadInput} for a value out of the ranges that it says, which a unit that runs live
/// refuses.
void check_inputs(const Workload& workload, std::span<const Data> frames);

/// Plays the sequence; where calls on the host's cores have other slices than it says, which
/// schedules in virtual time believe, a line of that is added to @p notes.
/// @param player  After Player::scribble.
void note_slices(const Workload& workload, Player& player, std::vector<std::string>& notes);

}  // namespace pirt
