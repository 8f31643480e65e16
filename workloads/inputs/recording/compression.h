// What chunks of a bag are compressed with.
#pragma once

#include <cstddef>
#include <string>
#include <string_view>

namespace pirt {

/// @param name  "none", "bz2" or "lz4".
/// @param file  For the message.
/// @throws Error{kBadInput} if it is none of them; Error{kEnvironment} if pirt was built without
/// it.
void check_compression(std::string_view name, const std::string& file);

/// @param size  Of what comes out.
/// @throws Error{kBadInput} if the bytes are damaged.
[[nodiscard]] std::string unpack(std::string_view name, const std::string& packed, std::size_t size,
                                 const std::string& file);

}  // namespace pirt
