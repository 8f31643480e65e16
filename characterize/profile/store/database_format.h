// The format of the profile database: its schema and what its checksums cover. Private to
// characterize/.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "characterize/profile/records.h"
#include "characterize/profile/store/sqlite.h"

namespace pirt {

/// The fact of a run that VisitRecord::spent is kept as: seconds.
inline constexpr std::string_view kSpent = "run.spent_s";

inline constexpr std::int64_t kDatabaseApplicationId = 0x50495254;  ///< "PIRT", as in schema.sql.
inline constexpr std::int64_t kDatabaseVersion = 7;                 ///< user_version.
inline constexpr std::int64_t kOldestVersion = 3;                   ///< What upgrade() takes.

/// Definitions, which a file has byte for byte.
[[nodiscard]] std::string_view database_schema();

/// Hash of everything that a run (environment, units, peaks, and which cells and visits it has) or
/// a cell (measurements, samples, energy) holds, apart from the checksum itself.
[[nodiscard]] std::int64_t run_checksum(const sqlite::Connection& connection, std::int64_t run_id);
[[nodiscard]] std::int64_t cell_checksum(const sqlite::Connection& connection,
                                         std::int64_t cell_id);

[[nodiscard]] std::int64_t visit_checksum(std::int64_t run_id, const CellName& cell,
                                          const VisitRecord& visit);

/// Reasons and notes as the database has them: separated by "; ". A semicolon inside an entry
/// becomes a comma.
[[nodiscard]] std::string join_words(const std::vector<std::string>& words);
[[nodiscard]] std::vector<std::string> split_words(const std::string& text);

/// Checks structure (integrity_check), definitions, references and the checksums of every run and
/// every cell. Also of runs that are not shown: damage in a newer one (its platform's name, say)
/// would silently show the figures of an older.
/// @throws Error{kBadInput}: damaged, saying what.
void verify_all(const sqlite::Connection& connection);

/// The file's user_version.
[[nodiscard]] std::int64_t version_of(const sqlite::Connection& connection);

/// Makes a database of an older version, which verify_all has passed, one of today's, in one
/// transaction: of version 6 and before, doubts stand among its reasons, and what is memory of a
/// call, processor time and interval of joules is not known; of version 5, its only times of units
/// are hand-overs; of version 4, it has none, and no other conditions than steady; of version 3
/// besides, no figure is a mixture, and none has a bound. Nothing to do where another program did
/// it meanwhile.
void upgrade(sqlite::Connection& connection);

}  // namespace pirt
