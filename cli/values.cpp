#include "cli/values.h"

#include <limits>

#include "cli/duration.h"
#include "cli/weights.h"
#include "workloads/base/error.h"
#include "workloads/base/name_filter.h"

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

std::string no_weights(const std::string& text) {
  return problem_in([&] { static_cast<void>(parse_weights(text)); });
}

Problem not_within(double low, double high) {
  return [low, high](const std::string& text) {
    if (decimal_number(text, low, high).value) return std::string();
    return fmt::format("'{}' is not a number between {} and {}, in decimal notation", text, low,
                       high);
  };
}

CLI::Option* add_list_of(CLI::App& command, const std::string& name,
                         std::vector<std::string>& values, const std::string& type,
                         const std::string& help) {
  return add_text(command, name, values, type, help)->delimiter(',')->allow_extra_args(false);
}

CLI::Option* add_seed(CLI::App& command, std::uint64_t& seed, const std::string& help) {
  const auto problem = not_within(std::uint64_t{0}, std::numeric_limits<std::uint64_t>::max());
  return add_value(command, "--seed", seed, "INTEGER", problem, help)->capture_default_str();
}

CLI::Option* add_settings(CLI::App& command, std::vector<std::string>& settings) {
  return add_text(command, "--set", settings, "UNIT.KEY=VALUE",
                  "Set one value of the platform's units, e.g. cpu.active_w=15 (watts); repeatable")
      ->allow_extra_args(false);
}

CLI::Option* add_filter(CLI::App& command, std::string& filter, const std::string& what) {
  return command
      .add_option("--filter", filter,
                  "Regular expression (RE2 syntax: no look-ahead, no back-references): " + what +
                      " (default: all)")
      ->type_name("REGEX")
      ->check([](const std::string& text) {
        static_cast<void>(NameFilter(text));  // names the option itself
        return std::string();
      });
}

}  // namespace pirt::cli
