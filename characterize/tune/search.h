// Searching the parameters of a device's kernels: which candidates are measured, in which order,
// and when one replaces the default. Knows no process and no device; who measures is given.
//
// Coordinate descent: one parameter after the other, and once more what shares its kernels with one
// that changed afterwards. Candidates are measured in rounds, each with a process for every
// candidate still in the race, in a random order. The fastest is then held against the default in
// fresh rounds, since the best of several measurements looks better than it is.
//
// What gains most at a first look (the candidates at both ends of a range, once each, by one
// workload) comes first, so that a search that is short of time spends it there; what is of all
// kernels takes longest, gains little and comes last. A parameter that was begun and not decided
// when the time was over counts as not reached.
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "workloads/backends/opencl/tuning/tuning.h"
#include "workloads/base/math/random.h"
#include "workloads/base/time.h"

namespace pirt {

/// What one process found of one workload with one choice of parameters.
struct TuneSample {
  enum class Status : std::uint8_t {
    kGood,    ///< Right, and `time` was measured.
    kWrong,   ///< It computed something else than the reference.
    kFailed,  ///< It did not build, crashed, hung.
  };
  Status status = Status::kGood;
  Nanos time{0};            ///< Median of the process; above 0 if good.
  std::string reason = {};  ///< Unless good.
};

/// Verifies and times in a fresh process. Nothing if the user stopped it.
using TuneMeasure = std::function<std::optional<TuneSample>(const opencl::Tuning& tuning,
                                                            const std::string& workload)>;

/// One parameter, and the workloads that it is judged by (the geometric mean of their times).
struct TuneStep {
  const opencl::ParameterInfo* parameter = nullptr;
  std::vector<std::string> workloads;
};

struct TuneRules {
  int rounds = 3;             ///< Of all candidates that are still in the race.
  double out_of_race = 0.25;  ///< Slower than the best by more than this after a round: dropped.
  int confirming_rounds = 8;  ///< Of the best and the default.
  /// A candidate replaces the default if the median of its confirming rounds is faster by at least
  /// this,
  double least_gain = 0.02;
  /// and the median is above no gain at all with this confidence (a bound from order statistics).
  double confidence = 0.95;
};

enum class TuneVerdict : std::uint8_t {
  kReplaced,      ///< The best is faster than the default, confirmed.
  kDefaultBest,   ///< No candidate was faster by least_gain.
  kNotConfirmed,  ///< One was, and was not in fresh rounds.
  kNotMeasured,   ///< The default itself could not be measured; `reason` says why.
};

struct RejectedCandidate {
  int value = 0;
  bool wrong = false;  ///< It computed something else; otherwise it could not be run.
  std::string reason;
  friend bool operator==(const RejectedCandidate&, const RejectedCandidate&) = default;
};

/// How much faster the best is than the default: the default's time over its own, the median over
/// rounds.
struct WorkloadGain {
  std::string workload;
  double speed_up = 1;
};

struct TuneFinding {
  const opencl::ParameterInfo* parameter = nullptr;
  int standard = 0;
  int best = 0;  ///< What is chosen: the default unless kReplaced.
  TuneVerdict verdict = TuneVerdict::kNotMeasured;
  int fastest = 0;      ///< The candidate that was fastest, chosen or not.
  double speed_up = 1;  ///< Of the fastest over the default, all workloads together.
  std::vector<WorkloadGain> gains;
  int rounds = 0;         ///< That speed_up is from: the confirming ones, if there were any.
  int rounds_faster = 0;  ///< How many of them the fastest won.
  double p_value = 1;     ///< Of the sign test over them: so likely by chance, were both equal.
  std::vector<RejectedCandidate> rejected;
  std::string reason;  ///< Of kNotMeasured.
};

struct TuneOutcome {
  opencl::Tuning tuning;
  std::vector<TuneFinding> findings;     ///< One a parameter that was examined, in order.
  std::vector<std::string> not_reached;  ///< Parameters that there was no time to decide.
  bool stopped = false;                  ///< By the user; findings are those that were complete.
};

struct TuneSearch {
  opencl::Tuning start;  ///< Parameters without a step keep their values.
  std::vector<TuneStep> steps;
  TuneMeasure measure;
  TuneRules rules = {};
  std::uint64_t seed = 1;  ///< Of the order in which candidates are measured.
  std::function<bool()> time_up = [] { return false; };  ///< Then nothing more is measured.
  /// Told before each process.
  std::function<void(const TuneStep& step, const std::string& what)> progress =
      [](const TuneStep&, const std::string&) {};
};

[[nodiscard]] TuneOutcome search_tuning(const TuneSearch& search);

}  // namespace pirt
