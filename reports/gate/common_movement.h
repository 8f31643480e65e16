// What the machine does to many rows at once between two runs, so that it is not taken for what a
// program does to one.
//
// A slow clock moves all rows of a unit alike. Others on the machine, who take memory bandwidth and
// last-level cache, move some rows far and others not at all. Which ones, the samples say: a
// process does not change its program, so that what a row wanders by while one runs, the machine
// does. Rows that wander more than their unit's others are moved in proportion to that, by a factor
// which all of them together tell.
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "reports/gate/between_runs.h"
#include "reports/profile/profile_diff.h"

namespace pirt {

/// What a row is expected to change by without a change of its program.
struct ExpectedMovement {
  double shift = 0;  ///< Logarithm of candidate over base.
  double sd = 0;     ///< Of the shift.
  Drift drift = Drift::kWhole;
};

/// Rows that moved together.
struct JointMovement {
  enum class Rows : std::uint8_t {
    kRunning,
    kSetup,
    kUnsteady,  ///< Those that wander more than their unit's others.
  };
  std::vector<std::string> units;
  Rows rows = Rows::kRunning;
  double shift = 0;  ///< Logarithm of candidate over base, of a typical row.
  double noise = 0;  ///< Relative standard deviation of that between runs of one program.
};

[[nodiscard]] std::string_view to_string(JointMovement::Rows rows);

/// Rows that a machine moves alike: a unit's set-up, and its others.
struct Family {
  std::string unit;
  bool setup = false;
  auto operator<=>(const Family&) const = default;
};
[[nodiscard]] Family family_of(const PhasePair& pair);

class CommonMovement {
 public:
  using Pairs = std::vector<const PhasePair*>;

  /// @param base       Says which units share the host's memory.
  /// @param pairs      Those that can be compared; their samples have been read.
  /// @param workloads  So many at least tell what all of them moved by.
  CommonMovement(const Profile& base, const Pairs& pairs, std::size_t workloads);

  /// @param pair  One of those that this was made of.
  [[nodiscard]] ExpectedMovement expected(const PhasePair& pair) const;
  [[nodiscard]] const std::vector<JointMovement>& all() const { return all_; }

 private:
  [[nodiscard]] double shift_of(const PhasePair& pair) const;
  void find_shifts(const Pairs& pairs, std::size_t workloads);
  void find_wanders(const Pairs& pairs);
  void find_factors(const Profile& base, const Pairs& pairs, std::size_t workloads);

  std::map<Family, double> shifts_;
  struct Wander {
    double mean = 0;    ///< Of both runs.
    double excess = 0;  ///< By how much the mean is above that of the unit's typical row.
  };
  std::map<const PhaseRow*, Wander> wanders_;  ///< Of base rows.
  /// Movement over excess, by unit and workload: of all rows but the workload's own.
  std::map<std::pair<std::string, std::string>, double> factors_;
  std::vector<JointMovement> all_;
};

}  // namespace pirt
