#include "characterize/profile/identity.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <optional>
#include <set>
#include <utility>

#include "characterize/machine/environment_keys.h"
#include "workloads/base/text/text.h"

namespace pirt {
namespace {

bool has_unit(const RunInfo& run, const std::string& unit) {
  return std::ranges::find(run.units, unit, &UnitRecord::unit) != run.units.end();
}

std::optional<std::string> find_value(const std::map<std::string, std::string>& identity,
                                      const std::string& field) {
  const auto it = identity.find(field);
  return it == identity.end() ? std::nullopt : std::optional(it->second);
}

}  // namespace

std::map<std::string, std::string> identity_of(const RunInfo& run) {
  std::map<std::string, std::string> identity;
  for (const auto& [key, value] : run.environment) {
    if (without_unknown(key) != key) continue;
    // A key of another version of pirt is what that version took it for.
    const bool listed = find_environment_key(key) != nullptr;
    if (listed ? fact_kind(key) == FactKind::kIdentity : run.identity.contains(key)) {
      identity[key] = value;
    }
  }
  identity["platform"] = run.platform;
  identity["seed"] = std::to_string(run.seed);
  for (const UnitRecord& unit : run.units) {
    const std::string prefix = "unit." + unit.unit + ".";
    identity[prefix + "backend"] = unit.backend;
    identity[prefix + "device"] = unit.device;
    if (!unit.cores.empty()) {
      identity[prefix + "cores"] = fmt::format("{}", fmt::join(unit.cores, ","));
    } else if (const auto usable = find_value(run.environment, "cores_usable");
               usable && unit.device_is_cpu) {
      identity[prefix + "cores"] = *usable;
    }
    // Runs of versions that could not tune do not say so.
    if (unit.backend == "opencl") identity.try_emplace(prefix + "tuning", "default");
  }
  return identity;
}

std::vector<IdentityDifference> compare_identity(const RunInfo& a, const RunInfo& b) {
  const auto of_a = identity_of(a);
  const auto of_b = identity_of(b);
  std::set<std::string> fields;
  for (const auto* identity : {&of_a, &of_b}) {
    for (const auto& [field, value] : *identity) fields.insert(field);
  }
  std::vector<IdentityDifference> differences;
  for (const std::string& field : fields) {
    const std::string unit = unit_of_key(field);
    if (!unit.empty() && !(has_unit(a, unit) && has_unit(b, unit))) continue;
    const auto in_a = find_value(of_a, field);
    const auto in_b = find_value(of_b, field);
    if (in_a == in_b) continue;
    const auto* key = find_environment_key(field);
    differences.push_back({field, unit, in_a, in_b,
                           key == nullptr
                               ? "the version of pirt that recorded it takes it for identity"
                               : std::string(key->why)});
  }
  std::ranges::stable_sort(differences, {}, [](const IdentityDifference& difference) {
    const auto* key = find_environment_key(difference.field);
    return key == nullptr ? environment_keys().size()
                          : static_cast<std::size_t>(key - environment_keys().data());
  });
  return differences;
}

std::vector<IdentityDifference> compare_identity(const RunInfo& a, const RunInfo& b,
                                                 std::string_view unit) {
  auto differences = compare_identity(a, b);
  std::erase_if(differences, [unit](const IdentityDifference& each) {
    return !each.unit.empty() && each.unit != unit;
  });
  return differences;
}

std::vector<IdentityDifference> compare_program(const RunInfo& a, const RunInfo& b) {
  constexpr const char* kProgram = "it is another program";
  constexpr std::array<std::pair<const char*, const char*>, 4> kFacts = {
      {{"pirt_version", kProgram},
       {"git_commit", kProgram},
       {"program_hash", kProgram},
       {"platform_hash", "its platform was changed"}}};
  std::vector<IdentityDifference> differences;
  for (const auto& [field, why] : kFacts) {
    const auto in_a = find_value(a.environment, field);
    const auto in_b = find_value(b.environment, field);
    if (in_a != in_b) differences.push_back({field, "", in_a, in_b, why});
  }
  return differences;
}

std::string describe(const IdentityDifference& difference) {
  constexpr const char* kNotKnown = "not known";
  return fmt::format("{}: {} against {}", difference.field, difference.a.value_or(kNotKnown),
                     difference.b.value_or(kNotKnown));
}

std::string describe(const std::vector<IdentityDifference>& differences) {
  std::vector<std::string> parts;
  for (const auto& each : differences) parts.push_back(describe(each));
  return join(parts, "; ");
}

}  // namespace pirt
