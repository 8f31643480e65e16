// Options whose values are no files (those: files.h). Each kind of value is read in one way by all
// commands; what it is not is refused with the option, the value and what it may be.
#pragma once

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <concepts>
#include <cstdint>
#include <functional>
#include <string>

#include "workloads/base/numbers.h"

namespace pirt::cli {

/// What is wrong with a text as a value; empty = nothing.
using Problem = std::function<std::string(const std::string&)>;

[[nodiscard]] std::string nothing_given(const std::string& text);
[[nodiscard]] std::string no_duration(const std::string& text);
[[nodiscard]] std::string no_fraction(const std::string& text);
[[nodiscard]] std::string no_weights(const std::string& text);

template <std::integral Number>
[[nodiscard]] Problem not_within(Number low, Number high) {
  return [low, high](const std::string& text) {
    if (whole_number<Number>(text, low, high).value) return std::string();
    return fmt::format("'{}' is not a whole number between {} and {}, in plain digits", text, low,
                       high);
  };
}
[[nodiscard]] Problem not_within(double low, double high);

/// @param value    A string or number, an optional one, or a vector.
/// @param type     What --help shows: "DURATION", "UNIT,...".
/// @param problem  What each given value has to be without.
template <typename Value>
CLI::Option* add_value(CLI::App& command, const std::string& name, Value& value,
                       const std::string& type, const Problem& problem, const std::string& help) {
  return command.add_option(name, value, help)->type_name(type)->check(problem);
}

/// Any text, but not none.
template <typename Value>
CLI::Option* add_text(CLI::App& command, const std::string& name, Value& value,
                      const std::string& type, const std::string& help) {
  return add_value(command, name, value, type, nothing_given, help);
}

/// Several of them, with commas.
CLI::Option* add_list_of(CLI::App& command, const std::string& name,
                         std::vector<std::string>& values, const std::string& type,
                         const std::string& help);

CLI::Option* add_seed(CLI::App& command, std::uint64_t& seed, const std::string& help);

/// --set, as every command with a platform has it.
CLI::Option* add_settings(CLI::App& command, std::vector<std::string>& settings);

/// --filter, a NameFilter.
CLI::Option* add_filter(CLI::App& command, std::string& filter,
                        const std::string& what = "workloads whose names contain it");

}  // namespace pirt::cli
