// Several runs of one database as one: what runs of one program differ by is then part of each
// row's interval.
#pragma once

#include "characterize/profile/profile.h"
#include "characterize/profile/store/reader.h"

namespace pirt {

struct Pooled {
  int runs = 1;      ///< That samples come from.
  int left_out = 0;  ///< That could be compared, and are another program's, platform text's or
                     ///< workload file's.
};

/// Reads the samples of all rows, adds those of the same rows in other runs of the file that are of
/// the same program and may be compared with the row's own, takes the median of all of them, and
/// widens the row's interval to what theirs span. The row names them (PhaseRow::pooled_runs).
/// @param profile  Read by @p reader.
Pooled pool_samples(const ProfileReader& reader, Profile& profile);

}  // namespace pirt
