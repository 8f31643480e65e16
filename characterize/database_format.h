// The versions of the profile database's format: their schemas and what their checksums cover.
// Private to characterize/.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <string_view>

#include "characterize/sqlite.h"

namespace pirt {

inline constexpr std::int64_t kDatabaseApplicationId = 0x50495254;  ///< "PIRT", as in schema.sql.
inline constexpr std::int64_t kDatabaseVersion = 2;
inline constexpr std::int64_t kOldestDatabaseVersion = 1;  ///< The oldest that is migrated.

struct DatabaseFormat {
  std::int64_t version = 0;  ///< user_version.
  std::string_view schema;   ///< Definitions, which a file has byte for byte.
  /// Each with one parameter, the run's or the cell's number; in an order of its own.
  std::span<const std::string_view> run_queries, cell_queries;
};

/// @param version  kOldestDatabaseVersion to kDatabaseVersion.
[[nodiscard]] const DatabaseFormat& database_format(std::int64_t version = kDatabaseVersion);

/// Hash of everything that a run (environment, units and peaks included) or a cell (measurements,
/// samples, energy) holds, apart from the checksum itself.
[[nodiscard]] std::int64_t run_checksum(const sqlite::Connection& connection, std::int64_t run_id,
                                        const DatabaseFormat& format = database_format());
[[nodiscard]] std::int64_t cell_checksum(const sqlite::Connection& connection, std::int64_t cell_id,
                                         const DatabaseFormat& format = database_format());

/// Compares structure (integrity_check), definitions and references with the format's.
/// @throws Error{kBadInput}: damaged, saying what.
void check_structure(const sqlite::Connection& connection,
                     const DatabaseFormat& format = database_format());

/// check_structure, and the checksums of every run and every cell. Also of runs that are not shown:
/// damage in a newer one (its platform's name, say) would silently show the figures of an older.
/// @throws Error{kBadInput}: damaged, saying what.
void verify_all(const sqlite::Connection& connection,
                const DatabaseFormat& format = database_format());

}  // namespace pirt
