// The one place that says of each recorded fact whether it belongs to a run's identity (it must
// match for the figures of two runs to be compared) or is information, and why.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <string_view>

namespace pirt {

enum class FactKind : std::uint8_t { kIdentity, kInformation };

/// "identity", "information": as in the profile database.
[[nodiscard]] std::string_view to_string(FactKind kind);

struct EnvironmentKey {
  std::string_view key;  ///< "governor"; a '*' stands for a name: "unit.*.version".
  FactKind kind;
  std::string_view why;  ///< Why it is of that kind; one clause.
};

/// All facts that a run may record, identity first.
[[nodiscard]] std::span<const EnvironmentKey> environment_keys();

/// Null if no run of this version records @p key. "governor_unknown" is the entry of governor.
[[nodiscard]] const EnvironmentKey* find_environment_key(std::string_view key);

/// Of a key that this version does not know: information, since nothing is known to depend on it.
[[nodiscard]] FactKind fact_kind(std::string_view key);

/// What "<key>_unknown" is about; nothing else is changed.
[[nodiscard]] std::string_view without_unknown(std::string_view key);

/// The unit of "unit.<unit>.<fact>"; empty for other keys.
[[nodiscard]] std::string unit_of_key(std::string_view key);

}  // namespace pirt
