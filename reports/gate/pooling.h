// Several runs of one database as one: what runs of one program differ by is then part of each
// row's interval.
#pragma once

#include <cstdint>

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
/// widens the row's interval to what theirs span.
/// @param profile  Read by @p reader.
Pooled pool_samples(const ProfileReader& reader, Profile& profile);

/// Process numbers of one run are below this; a pooled row has further ones.
inline constexpr std::int32_t kProcessesARun = 10'000;
/// Whether samples of several runs are in @p row.
[[nodiscard]] bool is_pooled(const PhaseRow& row);

}  // namespace pirt
