// Measuring what a comparison of two programs asks for, through fresh processes of both.
#pragma once

#include <atomic>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>

#include "characterize/duet/comparison.h"
#include "characterize/duet/lanes.h"
#include "characterize/duet/ledger.h"

namespace pirt {

/// What one process came to: its sample, or why there is none.
struct SampleOutcome {
  std::optional<Sample> sample;
  std::string error;         ///< Empty with a sample, and if stopped or out of time.
  bool stopped = false;      ///< By the user.
  bool out_of_time = false;  ///< It took longer than it might.
  bool timed_out = false;    ///< The error is that it took longer than a process may.
};
/// May be asked for samples of different units at the same time.
/// @param most  What it may take; whatever takes longer is ended, and is no failure of its own.
using TakeSample =
    std::function<SampleOutcome(Side side, const DuetCell& cell, SampleKind kind, Nanos most)>;

struct OutputReader;
struct ProcessRequest;
inline constexpr std::size_t kLastWords = 300;  ///< Characters of stderr that a reason quotes.
inline constexpr std::size_t kMostOutput = std::size_t{64} << 20;  ///< Bytes.
/// One process to its end, and what @p reader makes of it: an exit code that is not 0, a signal, a
/// time limit, more than kMostOutput and an output that is none of its kind are errors.
/// @param most  As of TakeSample; request.limit is the process' own.
[[nodiscard]] SampleOutcome run_sample(ProcessRequest request, const OutputReader& reader,
                                       Nanos most);

struct DuetPrograms {
  std::filesystem::path baseline, candidate;
  Platform platform;              ///< Whose units are compared.
  std::string platform_argument;  ///< What the programs are told: a name, or an absolute path.
  std::uint64_t seed = 1;
  Nanos work = std::chrono::milliseconds(50);
  bool cold = false;                       ///< Set-up with empty kernel caches.
  Nanos limit = std::chrono::seconds(60);  ///< Of one process.
  Injection injection;                     ///< Into the candidate's samples of `injected`.
  DuetCell injected;
  const std::atomic<bool>* stop = nullptr;
};

/// Runs `PROGRAM sample ...` for each sample. Kernel caches are each side's own, in a folder that
/// is gone with the function.
[[nodiscard]] TakeSample program_samples(const DuetPrograms& programs);

/// Hash of a file, for a ledger; of one above 256 MB its size and when it was written. A file that
/// was not touched since is read once.
/// @throws Error{kBadInput} if it cannot be read.
[[nodiscard]] std::string content_key(const std::filesystem::path& file);
/// A program and what was built with it: libraries and a DSP's code (.elf) in its folder, or that
/// of the program that it is a link to, and pirt's own in the library folders that belong to it.
[[nodiscard]] Ledger::Event built_key(const std::filesystem::path& program);
/// The machine of a ledger: its processor, cores that may be used, and kernel.
[[nodiscard]] std::string machine_key();

/// What a ledger of a comparison is about: the contents of the programs and of libraries beside
/// them, the platform's name and text, the machine, cells, seed and work.
/// @throws Error{kBadInput} if a program cannot be read.
[[nodiscard]] Ledger::Event ledger_key(const DuetPrograms& programs,
                                       const std::vector<DuetCell>& cells);

enum class DuetEnd : std::uint8_t { kDecided, kStopped, kOutOfTime };

struct DuetLimits {
  /// What would last longer, by the cell's longest process so far, is not begun; what does is
  /// ended.
  std::optional<Nanos> time;
  const std::atomic<bool>* stop = nullptr;
};

/// Measures until all is decided; each step is in @p ledger before its lane's next begins.
/// @param rounds   Of indices of the comparison's cells.
/// @param on_step  Called before each step, never at the same time; may be empty.
/// @throws Error{kEnvironment} if the ledger cannot be written.
DuetEnd run_duet(DuetComparison& comparison, Ledger& ledger, const TakeSample& take,
                 const DuetRounds& rounds, const DuetLimits& limits,
                 const std::function<void(const DuetStep&)>& on_step = {});

}  // namespace pirt
