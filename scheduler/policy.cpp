// The table of policies: a new one adds its line here.
#include "scheduler/policy.h"

#include <algorithm>

#include "scheduler/policies/policies.h"
#include "workloads/base/error.h"
#include "workloads/base/text.h"

namespace pirt {
namespace {

constexpr PolicyInfo kPolicies[] = {
    {"latency", "Algorithm 1: deals tasks out to GPU, DSP and CPU in turn, by weight",
     WeightRule::kShare, make_latency_policy},
    {"throughput", "Algorithm 2: keeps the GPU's queue full, then the CPU's, then the DSP's",
     WeightRule::kFastQueue, make_throughput_policy},
    {"energy", "Algorithm 3: fills the DSP's queue first, then the GPU's, then the CPU's",
     WeightRule::kQueue, make_energy_policy},
    {"advanced",
     "Algorithm 4: non-real-time tasks to the cloud, image tasks first on any unit, the rest by "
     "--basic",
     WeightRule::kOfBasic, make_advanced_policy},
};

}  // namespace

std::span<const PolicyInfo> policies() { return kPolicies; }

std::vector<std::string> policy_names() {
  std::vector<std::string> names;
  for (const auto& policy : policies()) names.emplace_back(policy.name);
  return names;
}

const PolicyInfo& find_policy(std::string_view name) {
  const auto all = policies();
  const auto it = std::ranges::find(all, name, &PolicyInfo::name);
  if (it != all.end()) return *it;
  throw_bad_input("unknown mode '" + std::string(name) + "'" + suggestion(name, policy_names()));
}

const PolicyInfo& find_basic_policy(std::string_view name) {
  const PolicyInfo& policy = find_policy(name);
  if (!policy.has_basic()) return policy;
  std::vector<std::string> basic;
  for (const auto& info : policies()) {
    if (!info.has_basic()) basic.emplace_back(info.name);
  }
  throw_bad_input(std::string(name) + " is not a basic scheduler; those are " + join(basic, ", "));
}

}  // namespace pirt
