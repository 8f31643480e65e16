// Two profiles side by side: what differs in what makes them comparable, then figure beside figure.
//
// No verdict: whether a difference is a regression needs more than two intervals (`pirt regress`).
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "characterize/profile/profile.h"
#include "reports/document/document.h"
#include "workloads/base/text/json.h"

namespace pirt {

/// A fact that the two profiles do not have in common; absent = it has none of that name.
struct FactDifference {
  std::string fact;
  std::optional<std::string> a, b;
};

/// A row that both have.
struct PhasePair {
  const PhaseRow* a = nullptr;
  const PhaseRow* b = nullptr;

  /// Median of b over that of a; absent unless both are valid and a's is above 0.
  [[nodiscard]] std::optional<double> ratio() const;
  /// Whether the 95 % intervals of the medians meet; absent unless both are valid and have one.
  [[nodiscard]] std::optional<bool> overlap() const;
};

struct UnitTimePair {
  const UnitTimeRow* a = nullptr;
  const UnitTimeRow* b = nullptr;

  [[nodiscard]] std::optional<double> ratio() const;
};

struct EnergyPair {
  const EnergyRow* a = nullptr;
  const EnergyRow* b = nullptr;

  [[nodiscard]] std::optional<double> ratio() const;
};

struct ProfileDiff {
  const Profile* a = nullptr;  ///< Both outlive this.
  const Profile* b = nullptr;
  /// What compare_identity() finds between any run of a and any of b, of the units in common.
  /// Several runs that disagree within one profile show as "x / y".
  std::vector<FactDifference> identity;
  std::vector<FactDifference> information;  ///< All other facts.
  std::vector<PhasePair> phases;            ///< In the order of a.
  std::vector<PhasePair> conditions;        ///< Of all but steady.
  std::vector<UnitTimePair> unit_times;
  std::vector<EnergyPair> energies;
  std::vector<std::string> only_a, only_b;  ///< "workload on unit" of cells that the other lacks.
};

/// @throws Error{kBadInput} if they have no cell (workload on unit) in common.
[[nodiscard]] ProfileDiff diff_profiles(const Profile& a, const Profile& b);

/// Identity first, then the figures, then what only one of them has.
[[nodiscard]] Document diff_document(const ProfileDiff& diff);
[[nodiscard]] Json diff_json(const ProfileDiff& diff);

}  // namespace pirt
