#include "scheduler/policies/policy.h"

#include <algorithm>

#include "scheduler/policies/policies.h"
#include "workloads/base/error.h"
#include "workloads/base/text/text.h"

namespace pirt {
namespace {

std::vector<PolicyInfo> all_policies() {
  std::vector<PolicyInfo> all = {
#define PIRT_POLICY(name) policy::name,
#include "scheduler/policies/policies.inc"
#undef PIRT_POLICY
  };
  for (const PlannerInfo* planner : planners()) all.push_back(planned_policy(*planner));
  return all;
}

bool is_basic(const PolicyInfo& info) {
  return !info.has_basic() && info.planner == nullptr && !info.budgets;
}

/// @param is  bool(const PolicyInfo&).
template <typename Is>
std::vector<std::string> names_where(const Is& is) {
  std::vector<std::string> names;
  for (const PolicyInfo& policy : policies()) {
    if (is(policy)) names.emplace_back(policy.name);
  }
  return names;
}

}  // namespace

std::span<const PolicyInfo> policies() {
  static const std::vector<PolicyInfo> all = all_policies();
  return all;
}

std::vector<std::string> policy_names() {
  return names_where([](const PolicyInfo&) { return true; });
}

std::vector<std::string> runtime_policy_names() {
  return names_where([](const PolicyInfo& policy) { return policy.planner == nullptr; });
}

const PolicyInfo& find_policy(std::string_view name) {
  const auto all = policies();
  const auto it = std::ranges::find(all, name, &PolicyInfo::name);
  if (it != all.end()) return *it;
  throw_bad_input("unknown mode '" + std::string(name) + "'" + suggestion(name, policy_names()));
}

std::vector<std::string> find_policies(std::string_view names) {
  std::vector<std::string> found;
  for (const auto& name : split(names, ',')) {
    static_cast<void>(find_policy(name));
    if (std::ranges::find(found, name) == found.end()) found.push_back(name);
  }
  return found;
}

Mode find_mode(std::string_view name, std::string_view basic) {
  const PolicyInfo& policy = find_policy(name);
  const PolicyInfo& fallback = find_basic_policy(basic);
  return {policy, policy.has_basic() ? &fallback : nullptr};
}

const PolicyInfo& find_basic_policy(std::string_view name) {
  const PolicyInfo& policy = find_policy(name);
  if (is_basic(policy)) return policy;
  throw_bad_input(std::string(name) + " is not a basic scheduler; those are " +
                  join(names_where(is_basic), ", "));
}

}  // namespace pirt
