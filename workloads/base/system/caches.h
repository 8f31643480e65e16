// The sizes of the host's caches: what a probe of bandwidth has to fit into, or to exceed.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <span>

namespace pirt {

/// Of a line of the host's caches.
inline constexpr std::size_t kLineWords = 64 / sizeof(std::uint64_t);

/// Absent where the machine does not say.
struct CacheSizes {
  std::optional<std::int64_t> l2_bytes;    ///< Level 2 of one core.
  std::optional<std::int64_t> last_bytes;  ///< The largest level that a core reaches.
};

/// All caches of the last level of the machine's processors together: of each core the largest
/// level that it reaches, those that several cores share once. Absent where the machine does not
/// say.
/// @param root  As for read_cache_sizes.
[[nodiscard]] std::optional<std::int64_t> all_last_cache_bytes(
    const std::filesystem::path& root = "/");

/// What @p cores have for themselves: the caches of the largest level which no other core shares
/// with them, together; where there is none, their part of the smallest level behind the first.
/// Absent where the machine does not say.
/// @param cores  At least one.
/// @param root   As for read_cache_sizes.
[[nodiscard]] std::optional<std::int64_t> own_cache_bytes(std::span<const int> cores,
                                                          const std::filesystem::path& root = "/");

/// All caches of the largest level that @p cores reach, those that others share with them, too.
/// Absent where the machine does not say.
/// @param cores  At least one.
/// @param root   As for read_cache_sizes.
[[nodiscard]] std::optional<std::int64_t> reached_cache_bytes(
    std::span<const int> cores, const std::filesystem::path& root = "/");

/// Data and unified caches of @p core.
/// @param root  Where /sys is found; another folder in tests. Where it has no caches and is "/",
/// the C library is asked (which knows them by CPUID).
[[nodiscard]] CacheSizes read_cache_sizes(int core = 0, const std::filesystem::path& root = "/");

}  // namespace pirt
