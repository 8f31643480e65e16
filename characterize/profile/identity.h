// Whether two runs may be compared: the part of what is recorded that has to match.
#pragma once

#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "characterize/profile/profile.h"

namespace pirt {

/// The run's facts of kind identity (environment_keys.h), with its platform, seed and units as
/// "platform", "seed", "unit.<unit>.device". What is not known is not in it.
[[nodiscard]] std::map<std::string, std::string> identity_of(const RunInfo& run);

/// A field of the identity that two runs do not share.
struct IdentityDifference {
  std::string field;                ///< "governor", "unit.cpu.version".
  std::string unit;                 ///< The unit whose rows it concerns; empty = all rows.
  std::optional<std::string> a, b;  ///< The values; absent where a run does not know.
  std::string why;                  ///< Why it has to match.
};

/// The fields that differ, in the order of environment_keys(); empty = the runs may be compared.
/// What neither run knows is no difference; what one of them does not know is one. A unit that only
/// one of them measured is none: its rows have nothing that they could be compared with.
[[nodiscard]] std::vector<IdentityDifference> compare_identity(const RunInfo& a, const RunInfo& b);
/// Those that concern rows of @p unit.
[[nodiscard]] std::vector<IdentityDifference> compare_identity(const RunInfo& a, const RunInfo& b,
                                                               std::string_view unit);

/// Beside that: in what the runs are of two programs, or of two texts of their platform. Figures of
/// these are compared, and never put together.
[[nodiscard]] std::vector<IdentityDifference> compare_program(const RunInfo& a, const RunInfo& b);

/// "governor: powersave against performance", for messages.
[[nodiscard]] std::string describe(const IdentityDifference& difference);
/// All of them; empty if there is none.
[[nodiscard]] std::string describe(const std::vector<IdentityDifference>& differences);

/// Why two figures of a cell are not of the same work; empty if they are. Of rows, and of what has
/// their `ops`, `bytes` and `provenance`.
template <typename Row>
[[nodiscard]] std::string compare_work(const Row& a, const Row& b) {
  if (a.ops != b.ops || a.bytes != b.bytes) return "the workload is of another size";
  if (a.provenance == b.provenance) return "";
  return "times are " + std::string(to_string(a.provenance)) + " and " +
         std::string(to_string(b.provenance));
}

}  // namespace pirt
