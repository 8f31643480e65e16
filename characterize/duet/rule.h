// When to stop comparing two programs, and what to say then: a sequential rule over blocks of
// interleaved runs.
//
// Pure: no clock, no process. A block is one ABBA or BAAB of fresh processes; its value is the mean
// log ratio of candidate to baseline, so that 0.10 is about 10 % slower.
#pragma once

#include <cstdint>
#include <string_view>
#include <vector>

namespace pirt {

enum class DuetVerdict : std::uint8_t {
  kUndecided,     ///< More blocks are wanted.
  kNotSlower,     ///< No slowdown worth an alarm.
  kSlower,        ///< Suspected, and confirmed on fresh blocks.
  kInconclusive,  ///< Neither can be said within the blocks that there are.
  kRefused,       ///< The baseline differs from itself: the machine is too unquiet to judge.
};
[[nodiscard]] std::string_view to_string(DuetVerdict verdict);

/// Of calls. Fixed before the figures of the self-test were taken with them. Effects are log
/// ratios.
///
/// @source Simulated with drift, stolen time and spikes: an interleaved sequential rule of these
/// looks raises no false alarm in 1000 trials and finds 96.7 % (32 blocks) to 100 % (90) of 10 %
/// slowdowns, where a single run with a threshold of 10 % has 13.8 % false alarms and finds half.
/// Confirmations and canaries: simulated with blocks of a shared machine in a noisy hour (half of
/// them off by more than 6 %), where 97 to 99 of 100 slowdowns of 10 % are found.
struct DuetThresholds {
  std::vector<std::size_t> looks = {8, 12, 20, 32, 56, 90};
  std::size_t first_suspicion = 12;  ///< Blocks; an earlier look can only clear.
  std::size_t first_futility = 20;   ///< Blocks.
  std::vector<std::size_t> confirmations = {20, 40, 60};
  double suspicious_bound = 0.02;   ///< Suspected: the 99.5 % lower bound is above it,
  double suspicious_median = 0.04;  ///< and the median above this.
  double futile_median = 0.02;      ///< Below it there is nothing to find.
  double bound_confidence = 0.995;
  double alpha = 0.05;  ///< Of all series of the table together, for a confirmation.
  /// At the end an upper bound above it leaves the question open, as does a suspicious median.
  double open_bound = 0.10;
  /// Of the baseline against itself: refused if the median is farther from 0 than this, and a
  /// two-sided sign test says that it is not their spread alone, for which eight are enough. To be
  /// cleared needs none, since either order comes as often.
  double canary_median = 0.02;
  double canary_alpha = 0.01;
};

/// Of device_init and prepare, which a process does once: each block is as noisy as a single call,
/// and what matters is 20 % and not 10 %, so that effects are twice those of calls. Futility is
/// found earlier, so that set-up does not keep the gate busy long after calls are decided.
[[nodiscard]] DuetThresholds setup_thresholds();

/// One series: a phase of a cell. Blocks are added as they are measured; the verdict changes at
/// looks only.
class DuetRule {
 public:
  explicit DuetRule(DuetThresholds thresholds = {});

  /// Ignored once there is a verdict.
  /// @param table  How many series are decided together, at least 1: among more of them a
  ///               confirmation must be surer, and may take more blocks.
  void add_block(double log_ratio, std::size_t table = 1);
  /// Nothing more will be known of the series: inconclusive, unless there is a verdict.
  void give_up();
  /// A block of the baseline against itself; ignored once there is a verdict.
  void add_canary(double log_ratio);

  [[nodiscard]] DuetVerdict verdict() const { return verdict_; }
  /// Blocks after a suspicion are fresh: those that raised it do not count as its confirmation.
  [[nodiscard]] bool confirming() const { return confirming_; }
  [[nodiscard]] const std::vector<double>& blocks() const { return blocks_; }
  [[nodiscard]] const std::vector<double>& confirmation() const { return confirmation_; }
  [[nodiscard]] const std::vector<double>& canaries() const { return canaries_; }

  /// Median log ratio of the fresh blocks if there are any, else of all. Needs at least one block.
  [[nodiscard]] double effect() const;
  /// Sign test of the confirmation: what Holm's correction over a table of series takes. 1 where
  /// nothing was confirmed.
  [[nodiscard]] double p_value() const;

 private:
  void look();
  void look_again(std::size_t table);
  void clear(const std::vector<double>& blocks, std::size_t last);
  void conclude(DuetVerdict verdict);

  DuetThresholds thresholds_;
  std::vector<double> blocks_, confirmation_, canaries_;
  bool confirming_ = false;
  DuetVerdict verdict_ = DuetVerdict::kUndecided;
};

}  // namespace pirt
