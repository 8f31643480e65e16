// The samples of several runs of one database as those of one: what differs between runs is then
// part of what is tested, and set-up, of which a run has few samples, has enough of them.
#pragma once

#include "characterize/profile/profile.h"
#include "characterize/profile/store/reader.h"

namespace pirt {

struct Pooled {
  int runs = 1;      ///< That samples come from.
  int left_out = 0;  ///< That could be compared, and are another program's or platform text's.
};

/// Reads the samples of all rows, adds those of the same rows in other runs of the file that are of
/// the same program and may be compared with the row's own, and takes the medians of all of them.
/// @param profile  Read by @p reader.
Pooled pool_samples(const ProfileReader& reader, Profile& profile);

}  // namespace pirt
