// Where programs are that are called by their names, and what files a command names.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <span>
#include <string>
#include <vector>

namespace pirt {

/// As a shell finds it: by its path, if @p word has a slash, else in the folders of PATH.
/// @return Absolute; absent if there is no such file that may be run.
[[nodiscard]] std::optional<std::filesystem::path> try_find_program(const std::string& word);

/// A larger file that a command names, a recording say, is told apart by its size.
inline constexpr std::uintmax_t kMostHashedBytes = std::uintmax_t{256} << 20;

/// A file that a command names.
struct CommandFile {
  std::string name;  ///< In the command's words, behind the folder that it changes to.
  std::filesystem::path file;
  bool is_program = false;  ///< It may be run.
};
/// The files that @p words name and that may be read, in their order: by themselves ("x.yaml"),
/// behind a '=' or within a script (sh -c '...') that does not write them (">x.log"), also in the
/// folders that it changes to (cd DIR, env -C DIR); programs also by PATH.
/// @param folder  That the command runs in; empty = this process'.
[[nodiscard]] std::vector<CommandFile> files_named_by(std::span<const std::string> words,
                                                      const std::filesystem::path& folder = {});

}  // namespace pirt
