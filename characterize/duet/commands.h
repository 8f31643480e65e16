// Any two commands compared: words of a program and its arguments, run in turns.
#pragma once

#include <atomic>
#include <filesystem>
#include <string>
#include <vector>

#include "characterize/duet/duet.h"
#include "characterize/duet/readers.h"

namespace pirt {

struct DuetCommands {
  std::vector<std::string> baseline, candidate;  ///< Words; a program without / is found in PATH.
  std::vector<std::string> setup;                ///< Run once before anything; may be empty.
  const OutputReader* reader = nullptr;
  int warm_up = 1;                         ///< First runs of each that do not count, at least 1.
  Nanos limit = std::chrono::seconds(60);  ///< Of one process.
  const std::atomic<bool>* stop = nullptr;
};

/// The file that a command's first word runs.
/// @throws Error{kBadInput} if there is none that can be run.
[[nodiscard]] std::filesystem::path find_program(const std::string& word);

/// Runs the setup command, whatever it takes. @throws Error{kEnvironment} if it fails.
void run_setup(const DuetCommands& commands);

/// One process for each sample; its working folder, environment and cores are ours. What is decided
/// is not asked for again where the reader can say so.
/// @param comparison  Of one cell; outlives the result.
[[nodiscard]] TakeSample command_samples(const DuetCommands& commands,
                                         const DuetComparison& comparison);

/// What a ledger of it is about: the commands' words, their programs with the libraries beside
/// them, the reader, the machine.
[[nodiscard]] Ledger::Event ledger_key(const DuetCommands& commands, std::uint64_t seed);
/// Of a comparison that a ledger goes on with: whether the files that the words name besides are
/// those of the first processes. What those wrote may be anything.
/// @throws Error{kBadInput} naming the first that is another one, or gone.
void refuse_changed_files(const DuetCommands& commands, const DuetComparison& comparison,
                          const std::filesystem::path& ledger);

/// "12 blocks of 4 runs of 1.1 s: about 1 min; confirming 2 min more", of first runs that took
/// @p run_s.
[[nodiscard]] std::string duration_text(double run_s);

}  // namespace pirt
