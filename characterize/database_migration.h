// Bringing a profile database of an older version to the present one. Private to characterize/.
//
// A migration is a file of SQL, migrations/vN_to_vM.sql, which fills the new tables from the old
// ones; the schema of each old version stays beside it. Versions are passed through one by one.
#pragma once

#include <cstdint>

#include "characterize/sqlite.h"

namespace pirt {

[[nodiscard]] std::int64_t stored_version(const sqlite::Connection& connection);

/// A copy in memory of the database behind @p source, migrated; the file is not touched.
/// @throws Error{kBadInput} if the old content is damaged: it never gets new checksums then.
[[nodiscard]] sqlite::Connection migrated_copy(sqlite::Connection& source);

/// Migrates the file itself in one transaction, after a copy of it was made beside it: FILE.v1.bak
/// (FILE.v1.bak2 and so on where that name is taken by something else). Does nothing if another
/// program has done it meanwhile.
/// @throws Error{kBadInput} if the old content is damaged, or the copy cannot be made;
/// Error{kEnvironment}: busy, no space. The file is as it was then.
void migrate_file(sqlite::Connection& connection, Nanos busy_wait);

}  // namespace pirt
