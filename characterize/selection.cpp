#include "characterize/selection.h"

#include <fmt/format.h>

#include <algorithm>
#include <regex>
#include <set>

#include "workloads/base/error.h"
#include "workloads/base/text.h"
#include "workloads/catalog.h"

namespace pirt {
namespace {

/// That of the option, and those that the filter names: "fc6@batch8".
std::set<int> wanted_batches(const std::string& filter, std::optional<int> batch) {
  std::set<int> batches;
  if (batch) batches.insert(*batch);
  static const std::regex kNamed("@batch([0-9]{1,3})");
  for (std::sregex_iterator it(filter.begin(), filter.end(), kNamed), end; it != end; ++it) {
    batches.insert(std::stoi((*it)[1]));
  }
  return batches;
}

/// The plain workloads and the variants and batches that are asked for: by name, or in the filter.
std::vector<const Workload*> all_workloads(const std::string& filter,
                                           const std::vector<std::string>& in_variants,
                                           std::optional<int> batch) {
  std::vector<const Workload*> all;
  for (const Workload& workload : catalog()) all.push_back(&workload);
  std::vector<std::string> wanted = in_variants;
  if (filter.find('@') != std::string::npos) {
    for (const Variant& variant : variants()) wanted.emplace_back(variant.name);
  }
  for (const std::string& name : wanted) {
    for (const Workload* workload : workloads_in_variant(name)) {
      if (std::ranges::find(all, workload) == all.end()) all.push_back(workload);
    }
  }
  for (const int size : wanted_batches(filter, batch)) {
    for (const Workload& workload : workloads_in_batch(size)) all.push_back(&workload);
  }
  return all;
}

}  // namespace

std::vector<const Workload*> choose_workloads(const std::string& filter,
                                              const std::vector<std::string>& in_variants,
                                              std::optional<int> batch) {
  std::vector<const Workload*> chosen;
  try {
    const std::regex pattern(filter, std::regex::ECMAScript);
    for (const Workload* workload : all_workloads(filter, in_variants, batch)) {
      if (std::regex_search(workload->name, pattern)) chosen.push_back(workload);
    }
  } catch (const std::regex_error& error) {
    throw_bad_input(
        fmt::format("--filter '{}' is not a regular expression ({}); try a workload's name, or "
                    "'conv[12]|sobel'",
                    filter, error.what()));
  }
  if (chosen.empty()) {
    throw_bad_input(fmt::format("--filter '{}' matches no workload{}; see: pirt list workloads",
                                filter, suggestion(filter, workload_names())));
  }
  return chosen;
}

std::vector<const UnitModel*> choose_units(const Platform& platform,
                                           const std::vector<std::string>& names) {
  std::vector<const UnitModel*> chosen;
  for (const std::string& name : names) {
    const UnitModel& unit = platform.unit(name);
    if (!unit.measured()) {
      throw_bad_input(fmt::format(
          "unit '{}' of platform '{}' has no backend: its times are in the platform file, there is "
          "nothing to measure",
          name, platform.name));
    }
    if (std::ranges::find(chosen, &unit) == chosen.end()) chosen.push_back(&unit);
  }
  if (!names.empty()) return chosen;
  for (const UnitModel& unit : platform.units) {
    if (unit.measured()) chosen.push_back(&unit);
  }
  if (chosen.empty()) {
    throw_bad_input(fmt::format(
        "platform '{}' has no unit to measure (no unit names a backend); try --platform host",
        platform.name));
  }
  return chosen;
}

}  // namespace pirt
