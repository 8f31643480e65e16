// Did anything become slower between two stored profiles? One verdict a row, corrected for how many
// rows are looked at.
//
// What both were measured under comes first: rows of runs that differ in identity are not
// comparable, and say in what. A row is slower if a one-sided Mann-Whitney test on its raw samples
// says so after Holm's correction over the table, and its median rose by at least `effect` and by
// `noise_factor` times what processes of the same program differ by. Less than that, but more than
// chance, is inconclusive: measure again.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "reports/profile_diff.h"

namespace pirt {

enum class GateVerdict : std::uint8_t {
  kSame,
  kFaster,
  kSlower,
  kFailed,  ///< The candidate crashed, hung or computed something else.
  kInconclusive,
  kNotComparable,  ///< Another identity, another workload size, an invalid row, or missing.
  kNotJudged,      ///< Too few samples for the test; shown, and without influence.
};
[[nodiscard]] std::string_view to_string(GateVerdict verdict);

struct GateThresholds {
  double alpha = 0.05;  ///< Of the whole table, per direction.
  double effect = 0.05;
  double noise_factor = 3;
  std::size_t samples = 9;  ///< A side.
};

struct GateRow {
  std::string workload = {}, unit = {};
  std::string phase = {};  ///< "execute", "prepare cold", "energy".
  GateVerdict verdict = GateVerdict::kSame;
  std::string reason = {};  ///< Why it is not same, faster or slower; else empty.
  std::optional<double> base = {}, candidate = {};  ///< Medians in ns; joules a call of "energy".
  std::optional<double> ratio = {};                 ///< Candidate over base.
  std::optional<double> p = {};                     ///< Adjusted, of the direction that it went.
  std::optional<double> noise = {};                 ///< Relative, between processes of one program.
  std::optional<double> needed = {};                ///< Rise of the median that counts.
};

struct GateResult {
  std::vector<FactDifference> identity;
  std::vector<GateRow> rows;
  [[nodiscard]] std::int64_t count(GateVerdict verdict) const;
};

/// @param diff  Its profiles' samples have been read (read_samples).
[[nodiscard]] GateResult judge(const ProfileDiff& diff, const GateThresholds& thresholds = {});

/// Relative spread of one process's median around those of the others, from the range of the
/// process medians; of both sides together. Absent where neither has two processes.
/// @source Range over d2 estimates a standard deviation: Tippett, Biometrika 17 (1925) 364.
[[nodiscard]] std::optional<double> process_noise(const PhaseRow& base, const PhaseRow& candidate);

}  // namespace pirt
