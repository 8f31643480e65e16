// The file behind a profile database: creating it, telling it from what it is not, finding damage.
// Private to characterize/.
#pragma once

#include <array>
#include <cstdint>
#include <filesystem>

#include "characterize/profile/store/sqlite.h"

namespace pirt {

/// What SQLite calls the files that it keeps beside a database, behind the database's name.
inline constexpr std::array kSideFiles = {"-journal", "-wal", "-shm"};

/// Opens an existing profile database after checking what it is, its version, its structure
/// (integrity_check), its schema and all its checksums. A journal left by a killed writer is rolled
/// back; apart from that nothing is written, except that a file of the version before, opened for
/// writing, becomes one of today's. Of one that is only read, what is given is a copy in memory.
/// @throws Error{kBadInput}: missing, a folder, empty, no SQLite database, another application's,
/// of another version, in WAL mode, damaged.
/// @throws Error{kEnvironment}: busy, unreadable disk.
[[nodiscard]] sqlite::Connection open_database(const std::filesystem::path& path,
                                               sqlite::Connection::Mode mode,
                                               const FileWait& waiting = {});

/// Makes an empty profile database where no file is: built beside it and then linked to its name,
/// so that no half-made one is ever seen. A journal that a killed writer left of a file that was
/// removed since goes first.
/// @throws Error as open_database.
void create_database(const std::filesystem::path& path);

}  // namespace pirt
