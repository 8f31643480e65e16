// Workloads that are somebody else's: of a module (a shared library, <pirt/module.h>) or a workload
// file (YAML, README.md here).
#pragma once

#include <filesystem>
#include <map>
#include <set>
#include <string>
#include <vector>

#include "workloads/own/definition.h"

namespace pirt::own {

/// Loads a module, whose code runs in this process from then on, or reads a workload file, whose
/// sources and networks are read and whose programs are started where they are used. Modules stay
/// loaded.
/// @param file  A module is what begins as a shared library does.
/// @throws Error{kBadInput} naming the file and what is wrong with it; Error{kEnvironment} if a
/// library cannot be loaded.
[[nodiscard]] std::vector<Definition> load(const std::filesystem::path& file);

/// Of what the file holds, the files that a workload file names (of a command's above
/// kMostHashedBytes their size), and the libraries that modules and programs among them are linked
/// with (linked_libraries): 16 digits.
/// @throws Error{kBadInput} if one of them cannot be read.
[[nodiscard]] std::string digest_of(const std::filesystem::path& file);

/// What is read several times has to be one, or missing, which whoever opens it says.
/// @throws Error{kBadInput}
void check_is_file(const std::filesystem::path& path);

/// Of several files: none takes the place of what another one has.
class NamesOfFiles {
 public:
  /// @throws Error{kBadInput} if an earlier file has one of the names.
  void add(const std::string& file, const std::set<std::string>& names);

 private:
  std::map<std::string, std::string> files_;  ///< By name.
};

/// What to say of a file that is another one than was measured.
/// @param workloads  Whose rows are uncertain for that, as text.
[[nodiscard]] std::string not_as_measured(const std::string& file, const std::string& workloads);

// Of the two kinds, each in its file.
[[nodiscard]] std::vector<Definition> load_module(const std::filesystem::path& file);
[[nodiscard]] std::vector<Definition> read_workload_file(const std::filesystem::path& file,
                                                         const std::string& text);
struct NamedFile {
  std::filesystem::path file;
  bool is_of_command = false;
};
/// The files that the workload file names; of a program's command as files_named_by() has them, but
/// for what PATH finds and what it `writes`.
[[nodiscard]] std::vector<NamedFile> named_files(const std::filesystem::path& file,
                                                 const std::string& text);

}  // namespace pirt::own
