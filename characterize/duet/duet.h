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
  std::string error;     ///< Empty with a sample, and if stopped.
  bool stopped = false;  ///< By the user.
};
/// May be asked for samples of different units at the same time.
using TakeSample = std::function<SampleOutcome(Side side, const DuetCell& cell, SampleKind kind)>;

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

/// What a ledger of a comparison is about: the programs' contents, the platform, cells, seed and
/// work.
/// @throws Error{kBadInput} if a program cannot be read.
[[nodiscard]] Ledger::Event ledger_key(const DuetPrograms& programs,
                                       const std::vector<DuetCell>& cells);

enum class DuetEnd : std::uint8_t { kDecided, kStopped, kOutOfTime };

struct DuetLimits {
  std::optional<Nanos> time;  ///< After which no block is begun.
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
