// Parts of reading a profile database that several files need. Private to characterize/.
#pragma once

#include <cstdint>
#include <vector>

#include "characterize/database.h"
#include "characterize/profile.h"
#include "characterize/sqlite.h"

namespace pirt {

/// One run with its facts and units. @throws Error{kBadInput} if it is missing.
[[nodiscard]] RunInfo read_run(const sqlite::Connection& connection, std::int64_t run_id);

/// As load_samples.
[[nodiscard]] std::vector<RowSamples> read_run_samples(const sqlite::Connection& connection,
                                                       std::int64_t run_id);

}  // namespace pirt
