// What a library or a program is linked with, as its file says; no code is loaded for it.
#pragma once

#include <filesystem>
#include <vector>

namespace pirt {

/// The libraries that @p file is linked with, and those that they are linked with in turn, if they
/// lie beside it or in a folder that it names itself (its run path). Those of the system, of
/// LD_LIBRARY_PATH, and what is loaded by name as it runs are not among them. Empty for what is no
/// library or program for this processor's word size.
/// @throws Error{kBadInput} if one of them cannot be read.
[[nodiscard]] std::vector<std::filesystem::path> linked_libraries(
    const std::filesystem::path& file);

}  // namespace pirt
