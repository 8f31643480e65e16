// The samples of several runs of one database as those of one: what differs between runs is then
// part of what is tested, and set-up, of which a run has few samples, has enough of them.
#pragma once

#include "characterize/profile/profile.h"
#include "characterize/profile/store/reader.h"

namespace pirt {

/// Reads the samples of all rows, adds those of the same rows in other runs of the file that may be
/// compared with the row's own, and takes the medians of all of them.
/// @param profile  Read by @p reader.
/// @return  Runs that samples come from.
int pool_samples(const ProfileReader& reader, Profile& profile);

}  // namespace pirt
