#include "cli/options/values.h"

#include <algorithm>
#include <limits>
#include <utility>

#include "cli/options/duration.h"
#include "cli/options/shipped.h"
#include "cli/options/weights.h"
#include "workloads/base/error.h"
#include "workloads/base/text/name_filter.h"
#include "workloads/base/text/text.h"

namespace pirt::cli {
namespace {

/// Of a reader that throws.
template <typename Read>
std::string problem_in(const Read& read) {
  try {
    read();
    return "";
  } catch (const Error& error) {
    return error.what();
  }
}

}  // namespace

std::string nothing_given(const std::string& text) { return text.empty() ? "it is empty" : ""; }

std::string no_duration(const std::string& text) {
  return problem_in([&] { static_cast<void>(parse_duration(text)); });
}

std::string no_fraction(const std::string& text) {
  return problem_in([&] { static_cast<void>(parse_fraction(text)); });
}

std::string no_watts(const std::string& text) {
  return problem_in([&] { static_cast<void>(parse_watts(text)); });
}

std::string no_weights(const std::string& text) {
  return problem_in([&] { static_cast<void>(parse_weights(text)); });
}

Problem not_within(double low, double high) {
  const auto find = [low, high](const std::string& text) {
    if (decimal_number(text, low, high).value) return std::string();
    return fmt::format("'{}' is not a number between {} and {}, in decimal notation", text, low,
                       high);
  };
  return {find, fmt::format("{} to {}", low, high)};
}

Problem not_among(std::vector<std::string> known) {
  return [known = std::move(known)](const std::string& text) {
    if (text.empty() || std::ranges::find(known, text) != known.end()) return nothing_given(text);
    return "'" + text + "' is not one of " + join(known, ", ") + suggestion(text, known);
  };
}

Option add_value(Command& command, const std::string& name, const Target& target,
                 const std::string& type, const Problem& problem, const std::string& help) {
  return command.add(name, target, help).type(type).check(problem);
}

Option add_text(Command& command, const std::string& name, const Target& target,
                const std::string& type, const std::string& help) {
  return add_value(command, name, target, type, nothing_given, help);
}

Option add_choice(Command& command, const std::string& name, const Target& target,
                  const std::string& type, const std::vector<std::string>& known,
                  const std::string& help) {
  return add_value(command, name, target, type, not_among(known), help + ": " + join(known, " | "))
      .offers(known);
}

Option add_list_of(Command& command, const std::string& name, std::vector<std::string>& values,
                   const std::string& type, const std::string& help) {
  return add_text(command, name, &values, type, help).with_commas();
}

Option add_seed(Command& command, std::uint64_t& seed, const std::string& help) {
  const auto problem = not_within(std::uint64_t{0}, std::numeric_limits<std::uint64_t>::max());
  return add_value(command, "--seed", &seed, "INTEGER", problem, help).shows_default();
}

Option add_strict(Command& command, bool& strict) {
  return command.add_flag("--strict", strict,
                          "Do not use figures of the profile that are uncertain (?)");
}

Option add_settings(Command& command, std::vector<std::string>& settings) {
  return add_text(command, "--set", &settings, "UNIT.KEY=VALUE",
                  "Set one value of the platform's units, e.g. cpu.active_w=15 (watts); repeatable")
      .one_at_a_time()
      .offers(offer_units("."));
}

Option add_filter(Command& command, std::string& filter, const std::string& what) {
  return add_value(
             command, "--filter", &filter, "REGEX",
             [](const std::string& text) {
               static_cast<void>(NameFilter(text));  // names the option itself
               return std::string();
             },
             "Regular expression (RE2 syntax: no look-ahead, no back-references): " + what +
                 " (default: all)")
      .offers(offer_workloads());
}

}  // namespace pirt::cli
