// Where programs are that are called by their names.
#pragma once

#include <filesystem>
#include <optional>
#include <string>

namespace pirt {

/// As a shell finds it: by its path, if @p word has a slash, else in the folders of PATH.
/// @return Absolute; absent if there is no such file that may be run.
[[nodiscard]] std::optional<std::filesystem::path> try_find_program(const std::string& word);

}  // namespace pirt
