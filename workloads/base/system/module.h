// Modules: shared libraries of pirt that are loaded when first needed, since what they link brings
// a hundred others, and each start of a process would pay 0.1 s for them.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace pirt {

/// Where modules and what else pirt installs for itself may be, best first: seen from the program,
/// where it was built, where its libraries are installed.
[[nodiscard]] std::vector<std::filesystem::path> module_folders();

/// The files of all modules that there are, in order of their names.
[[nodiscard]] std::vector<std::filesystem::path> modules();

/// A function that a module exports, with C linkage. Modules stay loaded.
/// @param module  Its file: "libpirt_pictures.so".
/// @param remedy  For the message: "which reads pictures; leave out --images".
/// @throws Error{kEnvironment} if it is not beside the program or where it was built.
[[nodiscard]] void* module_symbol(const char* module, const char* symbol,
                                  const std::string& remedy);

}  // namespace pirt
