// All workloads, in the order that tables show them: Table I first, then the pools, then the chain.
#pragma once

#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "workloads/workload.h"

namespace pirt {

[[nodiscard]] std::span<const Workload> catalog();
[[nodiscard]] std::vector<std::string> workload_names();

/// Another way to compute some of the workloads, with rows of its own: "sobel@map".
struct Variant {
  std::string_view name;
  std::string_view description;
  /// The workload computed that way; nothing if it has no such variant. Name and variant are set by
  /// the catalog.
  std::optional<Workload> (*make)(const Workload& plain);
};
[[nodiscard]] std::span<const Variant> variants();
/// All workloads in variant @p name, in the catalog's order. @throws Error{kBadInput} with the
/// nearest names.
[[nodiscard]] std::vector<const Workload*> workloads_in_variant(std::string_view name);

/// Of the catalog or a variant; null if there is none of that name.
[[nodiscard]] const Workload* try_find_workload(std::string_view name);
/// @throws Error{kBadInput} with the nearest names.
[[nodiscard]] const Workload& find_workload(std::string_view name);

}  // namespace pirt
