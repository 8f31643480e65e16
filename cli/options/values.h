// Options whose values are no files (those: files.h). Each kind of value is read in one way by all
// commands; what it is not is refused with the option, the value and what it may be.
#pragma once

#include <fmt/core.h>

#include <concepts>
#include <cstdint>
#include <limits>
#include <string>
#include <vector>

#include "cli/options/command.h"
#include "workloads/base/text/numbers.h"

namespace pirt::cli {

[[nodiscard]] std::string nothing_given(const std::string& text);
[[nodiscard]] std::string no_duration(const std::string& text);
[[nodiscard]] std::string no_fraction(const std::string& text);
[[nodiscard]] std::string no_watts(const std::string& text);
[[nodiscard]] std::string no_weights(const std::string& text);

template <std::integral Number>
[[nodiscard]] Problem not_within(Number low, Number high) {
  const auto find = [low, high](const std::string& text) {
    if (whole_number<Number>(text, low, high).value) return std::string();
    return fmt::format("'{}' is not a whole number between {} and {}, in plain digits", text, low,
                       high);
  };
  // What the type holds is no range that a reader wants to know.
  return {find,
          high == std::numeric_limits<Number>::max() ? "" : fmt::format("{} to {}", low, high)};
}
[[nodiscard]] Problem not_within(double low, double high);

/// The nearest of them is suggested.
[[nodiscard]] Problem not_among(std::vector<std::string> known);

/// @param type     What --help shows: "DURATION", "UNIT,...".
/// @param problem  What each given value has to be without.
Option add_value(Command& command, const std::string& name, const Target& target,
                 const std::string& type, const Problem& problem, const std::string& help);

/// Any text, but not none.
Option add_text(Command& command, const std::string& name, const Target& target,
                const std::string& type, const std::string& help);

/// One of a few words, which --help lists.
Option add_choice(Command& command, const std::string& name, const Target& target,
                  const std::string& type, const std::vector<std::string>& known,
                  const std::string& help);

/// Several of them, with commas.
Option add_list_of(Command& command, const std::string& name, std::vector<std::string>& values,
                   const std::string& type, const std::string& help);

Option add_seed(Command& command, std::uint64_t& seed, const std::string& help);

/// --strict, as every command that uses a profile has it.
Option add_strict(Command& command, bool& strict);

/// --set, as every command with a platform has it.
Option add_settings(Command& command, std::vector<std::string>& settings);

/// --filter, a NameFilter.
Option add_filter(Command& command, std::string& filter,
                  const std::string& what = "workloads whose names contain it");

}  // namespace pirt::cli
