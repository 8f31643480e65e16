// Which workloads and units of a platform a command that measures was asked for.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "characterize/platform/platform.h"
#include "workloads/model/workload.h"

namespace pirt {

/// In the catalog's order, then those of others' (catalog/own_list.h), variants last.
/// @param filter       A NameFilter of workload names; empty = those of others', if there are, else
///                     all. One with an '@' is searched in the names of all variants too.
/// @param in_variants  Names of variants() that the workloads whose plain name the filter picks are
///                     chosen in as well.
/// @param batch        Images a call of batches that they are chosen in as well.
/// @param sizes        "1280x720": those picked that are made for sizes, at these as well.
/// @throws Error{kBadInput} if the filter is none, matches no workload, a variant is unknown, or a
/// batch out of range.
[[nodiscard]] std::vector<const Workload*> choose_workloads(
    const std::string& filter, const std::vector<std::string>& in_variants = {},
    std::optional<int> batch = std::nullopt, const std::vector<std::string>& sizes = {});

/// Units with a backend.
/// @param names  Empty = all of the platform, in its order; otherwise in the order given, each
/// once.
/// @throws Error{kBadInput} if a name is unknown or its unit has no backend, or if there are none.
[[nodiscard]] std::vector<const UnitModel*> choose_units(const Platform& platform,
                                                         const std::vector<std::string>& names);

/// Something that will not be measured.
struct Skip {
  std::string unit;
  std::string workload;  ///< Empty = the whole unit.
  std::string reason;    ///< With the remedy where there is one.
};

}  // namespace pirt
