#include "cli/options/shipped.h"

#include <filesystem>

#include "characterize/platform/platform.h"
#include "scheduler/mix/mix.h"
#include "scheduler/policies/policy.h"
#include "workloads/backends/backend_list.h"
#include "workloads/base/error.h"
#include "workloads/catalog/catalog.h"

namespace pirt::cli {
namespace {

/// @param names  Asked for only when somebody completes: some read files.
template <typename Names>
Offer offer(Names names) {
  return {.names = [names](const TypedValue&) { return names(); }};
}

std::vector<std::string> units_of(const std::string& platform) {
  // What is typed may be half a name, and a pipe would have no end.
  if (names_a_file(platform) && !std::filesystem::is_regular_file(platform)) return {};
  std::vector<std::string> names;
  try {
    for (const auto& unit : load_platform(platform).units) names.push_back(unit.name);
  } catch (const Error&) {
    return {};  // the command will say it
  }
  return names;
}

}  // namespace

Offer offer_workloads() {
  return offer([] {
    std::vector<std::string> names;
    for (const auto& workload : catalog()) names.push_back(workload.name);
    return names;
  });
}

Offer offer_variants() {
  return offer([] {
    std::vector<std::string> names;
    for (const auto& variant : variants()) names.emplace_back(variant.name);
    return names;
  });
}

Offer offer_backends() { return offer(backend_names); }
Offer offer_platforms() { return offer(shipped_platforms); }
Offer offer_mixes() { return offer(shipped_mixes); }
Offer offer_modes() { return offer(policy_names); }

Offer offer_units(std::string suffix) {
  return {
      .names =
          [](const TypedValue& typed) { return units_of(typed("--platform").value_or("host")); },
      .suffix = std::move(suffix)};
}

}  // namespace pirt::cli
