// Robust statistics of timing samples: median, MAD, percentiles, the interval of the median,
// bimodality.
//
// All on integer nanoseconds, on all samples: nothing is dropped as an outlier, since a spike that
// happens is part of what a robot meets. Deliberately no normal theory: timing samples are skewed.
// A mean is only for what adds up, joules.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "workloads/base/time.h"

namespace pirt {

struct Interval {
  Nanos low{0};
  Nanos high{0};
  friend bool operator==(const Interval&, const Interval&) = default;
};

/// Ranks (1-based, in sorted order) of the two samples that enclose the median.
struct Ranks {
  std::size_t low = 0;
  std::size_t high = 0;
  friend bool operator==(const Ranks&, const Ranks&) = default;
};

/// The narrowest symmetric pair of order statistics that covers the median with at least 95 %
/// probability, whatever the distribution: 1 - 2*P(Binomial(n, 1/2) < low) >= 0.95. Absent below 6
/// samples, where no pair reaches 95 %.
/// @source Conover, Practical Nonparametric Statistics, 3rd ed., section 3.2.
[[nodiscard]] std::optional<Ranks> median_interval_ranks(std::size_t n);

/// Middle sample; for an even number the mean of the middle two, rounded towards the smaller. Needs
/// at least one sample.
[[nodiscard]] Nanos median(std::span<const Nanos> samples);

/// Percentile by nearest rank: the smallest sample such that at least @p percent of all are not
/// above it. Needs at least one sample.
/// @param percent  1 to 100.
[[nodiscard]] Nanos percentile(std::span<const Nanos> samples, int percent);

/// Median of the process medians. Needs at least one sample.
/// @param processes  Which process took each sample; empty = one took all.
[[nodiscard]] Nanos median(std::span<const Nanos> samples, std::span<const std::int32_t> processes);

/// Mean of the process means: what a call takes in the long run, where a process counts once
/// however many samples it took. Needs at least one sample.
/// @param processes  As for median.
[[nodiscard]] Nanos mean(std::span<const Nanos> samples, std::span<const std::int32_t> processes);

/// 95 % interval of the median; absent below 6 samples.
[[nodiscard]] std::optional<Interval> median_interval(std::span<const Nanos> samples);

/// The median of each process's samples, in order of process number.
/// @param processes  Which process took each sample; as many as there are samples.
[[nodiscard]] std::vector<Nanos> process_medians(std::span<const Nanos> samples,
                                                 std::span<const std::int32_t> processes);

/// 95 % interval of the median of the medians that processes have: what another run with other
/// processes would find. Samples of one process share its memory layout and the machine's mood, so
/// that an interval over samples is too narrow by what lies between processes (Kalibera and Jones,
/// Rigorous Benchmarking in Reasonable Time, ISMM 2013: the highest level of repetition decides).
/// Deliberately no cluster bootstrap: with few clusters it covers too little (Cameron, Gelbach and
/// Miller, Bootstrap-Based Improvements for Inference with Clustered Errors, 2008).
///
/// - From 6 processes on: order statistics of the process medians, whatever their distribution, so
///   that a few disturbed processes do not widen it. @source Hettmansperger and Sheather,
///   Confidence intervals based on interpolated order statistics, Statistics & Probability Letters
///   4 (1986) 75. They are interpolated to 97 %, since a cell ends as soon as its interval is
///   narrow enough, which favours those that are narrow by chance: what remains of it then is 95 %
///   (below).
/// - 3 to 5: no pair of order statistics reaches 95 %; Student's t of the process medians (Kalibera
///   and Jones), widened where needed to hold their median. No cell ends here for its precision.
/// - Below 3: absent.
///
/// It never begins below the smallest of them: a call that no process has seen is no answer,
/// whatever normal theory says. With 3 to 5 that costs coverage, since all of so few are above the
/// median by chance in 1 of 8 to 1 of 32 cases.
///
/// A machine's clock and memory drift, so that processes that follow each other are alike, and n of
/// them say less than n independent ones would. From 8 processes on the interval is therefore wider
/// by dependence_factor.
///
/// Simulated coverage, 20000 runs each: tests/characterize/campaign/coverage_test.cpp.
/// @param medians  One of each process, in order of time.
[[nodiscard]] std::optional<Interval> interval_over_processes(std::span<const Nanos> medians);

/// How much wider the interval of the median of these must be for values that follow each other are
/// alike: sqrt((1 + r) / (1 - r)), with r the lag-1 autocorrelation of their ranks, corrected for
/// its bias, at least 0 and at most 0.6 (a factor of 2; what drifts more than that is not
/// stationary and noted as `unstable`). 1 below 8 values.
/// @param values  In order of time.
/// @source Bayley and Hammersley, The "effective" number of independent observations in an
/// autocorrelated time series, Suppl. J. Royal Statist. Soc. 8 (1946) 184; the bias, -(1 + 4 r) /
/// n: Marriott and Pope, Bias in the estimation of autocorrelations, Biometrika 41 (1954) 390.
[[nodiscard]] double dependence_factor(std::span<const Nanos> values);

/// Half of @p interval relative to @p middle; absent without an interval or for a middle of 0.
[[nodiscard]] std::optional<double> relative_half_width(const std::optional<Interval>& interval,
                                                        Nanos middle);

/// Whether the samples form two groups that are clearly apart: the two-means split (least squares,
/// exact in one dimension) has both groups at 15 % of the samples or more, means at least 5 % of
/// the median apart, and Ashman's D above kBimodalD. False below 20 samples.
/// @source D: Ashman, Bird, Zepf, Detecting bimodality in astronomical datasets, AJ 108 (1994)
/// 2348. They call D > 2 a clean separation
///         of two *fitted* normals; splitting the samples themselves cuts the tails and inflates D,
///         hence the higher limit.
[[nodiscard]] bool is_bimodal(std::span<const Nanos> samples);

/// The same of the medians of processes, which are few: two in each group at least, whose means are
/// 20 % of the median apart or more (what tells units apart, see is_unstable in validity.h). A
/// process that takes few samples, since they are long, counts as much here as one that takes many.
/// False below 4.
[[nodiscard]] bool processes_are_bimodal(std::span<const Nanos> medians);

/// Simulated, 20000 sets each from uniform, normal, exponential and log-normal (sigma 0.5)
/// distributions: with 20 samples at most 0.96 % of the sets exceed it (exponential; uniform 0.16
/// %), with 50 and 300 samples none did.
inline constexpr double kBimodalD = 7.0;

struct Statistics {
  std::int64_t samples = 0;
  Nanos median{0};
  Nanos mad{0};  ///< Median of the absolute deviations from the median; not scaled to a standard
                 ///< deviation.
  Nanos p95{0};
  Nanos p99{0};
  std::optional<Interval> interval;  ///< 95 % interval of the median; see summarize.
  bool bimodal = false;              ///< Samples, or the medians of processes.
  std::int64_t processes = 1;
};

/// Of samples that one process took; the interval is that of median_interval. Needs at least one
/// sample.
[[nodiscard]] Statistics summarize(std::span<const Nanos> samples);

/// The median is the median of the process medians, so that a process counts once however many
/// samples it took, and the interval that of interval_over_processes; all else is of all samples.
/// Samples of a single process have the interval of median_interval, which says nothing of what
/// another process would find. Needs at least one sample.
/// @param processes  Which process took each sample; as many as there are samples.
[[nodiscard]] Statistics summarize(std::span<const Nanos> samples,
                                   std::span<const std::int32_t> processes);

}  // namespace pirt
