// Options that name files. They are made here and nowhere else, so that main knows what a command
// reads and writes and can refuse, before it runs, to let one file overwrite another.
#pragma once

#include <cstdint>
#include <filesystem>
#include <initializer_list>
#include <string>
#include <vector>

#include "cli/options/command.h"
#include "cli/options/output.h"

namespace pirt::cli {

struct NamedFile {
  std::string option;  ///< As messages name it: "--db".
  std::filesystem::path path;
  FileUse use = FileUse::kRead;
};

/// Empty names are refused, and what is read from `-` is standard input; of what is written also
/// those that begin with '-', which is an option without its value more likely than a file.
Option add_input(Command& command, const std::string& name, const Target& target,
                 const std::string& help, FileUse use = FileUse::kRead);
Option add_continued(Command& command, const std::string& name, const Target& target,
                     const std::string& help);
Option add_output(Command& command, const std::string& name, Output& output,
                  const std::string& help, StdoutUse stdout_use = StdoutUse::kAllowed);
/// --json, as every command has it.
void add_json(Command& command, Output& output);

/// The files that @p command was given.
[[nodiscard]] std::vector<NamedFile> given_files(const CLI::App& command);
/// Those of @p outputs that were asked for.
[[nodiscard]] std::vector<NamedFile> written_files(std::initializer_list<const Output*> outputs);

/// @throws Error{kBadInput} if something that is written is also read, or written a second time,
/// under whatever name (links included, and names of files that do not exist yet); if two results
/// go to standard output; or if a file cannot be written. What is continued may be read as well,
/// and devices and pipes may be named any number of times.
void check_files(std::vector<NamedFile> files);

}  // namespace pirt::cli
