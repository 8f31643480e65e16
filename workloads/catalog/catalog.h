// All workloads, in the order that tables show them: Table I first, then the pools, then the chain.
#pragma once

#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "workloads/catalog/specs.h"
#include "workloads/model/workload.h"

namespace pirt {

[[nodiscard]] std::span<const Workload> catalog();

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

/// How many images a call of a batch may have.
inline constexpr int kSmallestBatch = 2;
inline constexpr int kLargestBatch = 256;
/// The layers and the chain of AlexNet for @p batch images a call, as "fc6@batch8", in the
/// catalog's order. @throws Error{kBadInput} if there is no such batch.
[[nodiscard]] std::span<const Workload> workloads_in_batch(int batch);

/// Of the catalog, a variant or a batch; null if there is none of that name.
[[nodiscard]] const Workload* try_find_workload(std::string_view name);
/// @throws Error{kBadInput} with the nearest names.
[[nodiscard]] const Workload& find_workload(std::string_view name);

}  // namespace pirt
