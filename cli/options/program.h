// What the program offers: the table that --help is printed from, for the manual and completion.
#pragma once

#include <string>
#include <vector>

#include "cli/options/command.h"

namespace pirt::cli {

struct OptionDescription {
  std::vector<std::string> names;  ///< "-o", "--output"; of a positional argument, its name.
  bool positional = false;
  bool required = false;
  bool repeatable = false;
  int least_values = 0;  ///< That follow it; 0 with a type = a value that may be left out.
  int most_values = 0;
  std::string type;  ///< "DURATION"; empty = a flag.
  std::string help;
  std::string standard;  ///< The value without it, where --help shows that.
  std::vector<std::string> needs, excludes;
  OptionFacts facts;
};

/// The program, a command, or a kind of a command; what is hidden from --help is not in it.
struct CommandDescription {
  std::string name;  ///< "pirt generate dag"
  std::string help;
  std::string footer;
  std::vector<OptionDescription> options;
  std::vector<CommandDescription> kinds;

  /// "dag"
  [[nodiscard]] std::string last_name() const { return name.substr(name.rfind(' ') + 1); }
};
[[nodiscard]] CommandDescription describe(const CLI::App& app);

}  // namespace pirt::cli
