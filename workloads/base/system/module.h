// Modules: shared libraries of pirt that are loaded when first needed, since what they link brings
// a hundred others, and each start of a process would pay 0.1 s for them.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace pirt {

/// Where modules and what else pirt installs for itself may be, best first: beside the library or
/// the program that this code is in, so that a copied build folder has its own; where that is
/// installed, and the library folder above; of a program that lies where it was built, that build;
/// of one that was built with installed libraries, where they are; where libraries were to be
/// installed.
[[nodiscard]] std::vector<std::filesystem::path> module_folders();
/// The same if this code is in @p file; empty if that is not known.
[[nodiscard]] std::vector<std::filesystem::path> module_folders(const std::filesystem::path& file);

/// What @p program, which this process runs, computes with: itself, the library that this code is
/// in, if that is another file, and all modules that there are.
[[nodiscard]] std::vector<std::filesystem::path> program_files(
    const std::filesystem::path& program);

/// A function that a module exports, with C linkage. Modules stay loaded.
/// @param module  Its file: "libpirt_pictures.so".
/// @param remedy  For the message: "which reads pictures; leave out --images".
/// @throws Error{kEnvironment} if it is in none of module_folders().
[[nodiscard]] void* module_symbol(const char* module, const char* symbol,
                                  const std::string& remedy);

}  // namespace pirt
