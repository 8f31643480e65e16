// What recordings are compressed with.
#pragma once

#include <cstddef>
#include <filesystem>
#include <functional>
#include <string>
#include <string_view>

namespace pirt {

/// @param name  "none", "bz2", "lz4" or "zstd".
/// @param file  For the message.
/// @throws Error{kBadInput} if it is none of them; Error{kEnvironment} if pirt was built without
/// it.
void check_compression(std::string_view name, const std::string& file);

/// Gives the bytes that follow, fewer than asked for only at their end.
using ReadPacked = std::function<std::string(std::size_t most)>;

/// What is packed is read piece by piece, so that it is never there as a whole.
/// @param size  Of what comes out.
/// @throws Error{kBadInput} if the bytes are damaged.
[[nodiscard]] std::string unpack(std::string_view name, const ReadPacked& packed, std::size_t size,
                                 const std::string& file);

/// The best of those that pirt was built with.
[[nodiscard]] std::string_view best_compression();
/// The other way round. @throws Error as check_compression.
[[nodiscard]] std::string pack(std::string_view name, std::string_view bytes,
                               const std::string& file);

/// Whether a message begins as what zstd packs.
[[nodiscard]] bool is_packed(std::string_view message);
/// One message that was packed with zstd.
/// @throws Error{kBadInput} if it is damaged or larger than a chunk may be.
[[nodiscard]] std::string unpack_message(std::string message, const std::string& file);
/// A whole file that was packed with zstd.
/// @throws Error{kBadInput} if it is damaged; Error{kEnvironment} if there is no room for it.
void unpack_file(const std::filesystem::path& packed, const std::filesystem::path& plain);

}  // namespace pirt
