// What may follow on a command line that is being typed; the scripts of the shells (pirt.bash,
// _pirt, pirt.fish) ask `pirt complete`.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "cli/options/program.h"

namespace pirt::cli {

struct Candidate {
  std::string word;  ///< The whole of it: "--mode=energy", "latency,energy".
  std::string help;
};

struct Completion {
  std::vector<Candidate> candidates = {};
  bool files = false;  ///< The word may be the name of a file, too.
  bool open = false;   ///< The word goes on behind a candidate: "cpu=".
};

/// @param words  What follows the program's name; the last is what is typed, and may be empty.
[[nodiscard]] Completion complete(const CommandDescription& program,
                                  std::span<const std::string> words);

/// A line `WORD<tab>HELP` each, and a last one with what else there is: ":", ":files", ":open".
[[nodiscard]] std::string completion_text(const Completion& completion);

}  // namespace pirt::cli
