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

/// pirt's own, then those of others.
std::vector<const Workload*> plain_ones() {
  std::vector<const Workload*> all;
  for (const Workload& workload : catalog()) all.push_back(&workload);
  for (const Workload* workload : own_workloads()) all.push_back(workload);
  return all;
}

/// Variants, batches and sizes that the filter itself names; of what has a size a variant only
/// where the filter says both. Nothing else is made: not each workload has each size.
std::vector<const Workload*> named(const std::string& filter, const NameFilter& wanted) {
  if (filter.find('@') == std::string::npos) return {};
  std::vector<std::string> ways, sizes = {""};
  for (const Variant& variant : variants()) ways.emplace_back(variant.name);
  for (const int batch : named_batches(filter)) {
    static_cast<void>(workloads_in_batch(batch));  // Refuses those that are none.
    ways.push_back("batch" + std::to_string(batch));
  }
  ways.emplace_back();
  for (const std::string& size : named_sizes(filter)) sizes.push_back("@" + size);
  std::vector<const Workload*> all;
  for (const std::string& way : ways) {
    for (const std::string& size : sizes) {
      if (!size.empty() && filter.find(way) == std::string::npos) continue;
      for (const Workload* plain : plain_ones()) {
        const std::string name = plain->name + size + (way.empty() ? "" : "@" + way);
        const Workload* const found = wanted.picks(name) ? try_find_workload(name) : nullptr;
        if (found != nullptr) all.push_back(found);
      }
    }
  }
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
  // Who brings some and names none wants those.
  const bool own_alone = filter.empty() && !own_workloads().empty();
  const auto is_wanted = [&](const Workload& plain, const std::string& name) {
    if (own_alone && own_operation(plain) == nullptr) return false;
    return wanted.picks(name) || wanted.picks(plain.name);
  };
  for (const Workload* workload : plain_ones()) {
    if (is_wanted(*workload, workload->name)) choose(workload);
  }
  for (const Workload* workload : asked_for(in_variants, batch)) {
    const std::string plain = own::plain_name(workload->name);
    if (wanted.picks(workload->name) || wanted.picks(plain)) choose(workload);
  }
  for (const Workload* workload : plain_ones()) {
    if (!workload->at_size) continue;
    for (const std::string& size : sizes) {
      const std::string name = workload->name + "@" + size;
      if (is_wanted(*workload, name)) choose(&find_workload(name));
    }
  }
  for (const Workload* workload : named(filter, wanted)) choose(workload);
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
