#include "characterize/platform/selection.h"

#include <fmt/core.h>

#include <algorithm>
#include <iterator>
#include <set>
#include <string_view>

#include "workloads/base/error.h"
#include "workloads/base/text/name_filter.h"
#include "workloads/base/text/numbers.h"
#include "workloads/base/text/text.h"
#include "workloads/catalog/catalog.h"
#include "workloads/catalog/own_list.h"
#include "workloads/model/own_operation.h"
#include "workloads/own/definition.h"

namespace pirt {
namespace {

/// 8 of "fc6@batch8", 8 and 16 of "@(batch8|batch16)".
std::set<int> named_batches(const std::string& filter) {
  std::set<int> batches;
  constexpr std::string_view kWord = "batch";
  for (auto at = filter.find(kWord); at != std::string::npos; at = filter.find(kWord, at + 1)) {
    const auto begin = at + kWord.size();
    const auto end = std::min(filter.find_first_not_of("0123456789", begin), begin + 3);
    const auto size = whole_number<int>(filter.substr(begin, end - begin), 0, 999);
    if (size.value) batches.insert(*size.value);
  }
  return batches;
}

/// Variants and batches that an option asks for: what is wanted of the workloads that the filter
/// picks.
std::vector<const Workload*> asked_for(const std::vector<std::string>& in_variants,
                                       std::optional<int> batch) {
  std::vector<const Workload*> all;
  for (const std::string& name : in_variants) {
    for (const Workload* workload : workloads_in_variant(name)) all.push_back(workload);
  }
  if (batch) {
    for (const Workload& workload : workloads_in_batch(*batch)) all.push_back(&workload);
  }
  return all;
}

/// "1280x720" of "sobel@1280x720", and "640x480" too of "@(1280x720|640x480)".
std::vector<std::string> named_sizes(const std::string& filter) {
  std::vector<std::string> sizes;
  const auto is_of_size = [](char c) { return (c >= '0' && c <= '9') || c == 'x'; };
  for (auto at = std::find(filter.begin(), filter.end(), '@'); at != filter.end();) {
    at = std::find_if(at, filter.end(), is_of_size);
    const auto end = std::find_if_not(at, filter.end(), is_of_size);
    const std::string size(at, end);
    // A name may have one too: mine.conv3x3.
    const bool begins = std::string_view("@(|:").find(*std::prev(at)) != std::string_view::npos;
    if (begins && own::size_from(size)) sizes.push_back(size);
    at = end;
  }
  return sizes;
}

/// Those that are made for sizes, at these.
std::vector<const Workload*> at_sizes(const std::vector<std::string>& sizes) {
  std::vector<const Workload*> all;
  const auto add = [&](const Workload& plain) {
    if (!plain.at_size) return;
    for (const std::string& size : sizes) all.push_back(&find_workload(plain.name + "@" + size));
  };
  for (const Workload& workload : catalog()) add(workload);
  for (const Workload* workload : own_workloads()) add(*workload);
  return all;
}

/// Variants, batches and sizes that the filter itself may name.
std::vector<const Workload*> nameable(const std::string& filter) {
  if (filter.find('@') == std::string::npos) return {};
  std::vector<std::string> names;
  for (const Variant& variant : variants()) names.emplace_back(variant.name);
  auto all = asked_for(names, std::nullopt);
  for (const int size : named_batches(filter)) {
    for (const Workload& workload : workloads_in_batch(size)) all.push_back(&workload);
  }
  for (const Workload* workload : at_sizes(named_sizes(filter))) all.push_back(workload);
  return all;
}

}  // namespace

std::vector<const Workload*> choose_workloads(const std::string& filter,
                                              const std::vector<std::string>& in_variants,
                                              std::optional<int> batch,
                                              const std::vector<std::string>& sizes) {
  std::vector<const Workload*> chosen;
  const auto choose = [&](const Workload* workload) {
    if (std::ranges::find(chosen, workload) == chosen.end()) chosen.push_back(workload);
  };
  const NameFilter wanted(filter);
  const auto own = own_workloads();
  // Who brings some and names none wants those.
  const bool own_alone = filter.empty() && !own.empty();
  for (const Workload& workload : catalog()) {
    if (!own_alone && wanted.picks(workload.name)) choose(&workload);
  }
  for (const Workload* workload : own) {
    if (wanted.picks(workload->name)) choose(workload);
  }
  auto others = asked_for(in_variants, batch);
  for (const Workload* workload : at_sizes(sizes)) {
    if (!own_alone || own_operation(*workload) != nullptr) others.push_back(workload);
  }
  for (const Workload* workload : others) {
    const std::string plain = workload->name.substr(0, workload->name.find('@'));
    if (wanted.picks(workload->name) || wanted.picks(plain)) choose(workload);
  }
  for (const Workload* workload : nameable(filter)) {
    if (wanted.picks(workload->name)) choose(workload);
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
