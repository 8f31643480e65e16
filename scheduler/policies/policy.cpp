// The table of policies: a new one adds its line here.
#include "scheduler/policies/policy.h"

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
    {"cpu-only", "Baseline: every task to the CPU, whatever else the platform has",
     WeightRule::kNone, make_cpu_only_policy, "cpu"},
    {"met",
     "Baseline, minimum execution time: the fastest unit for the workload, whatever its load",
     WeightRule::kNone, make_met_policy},
    {"olb", "Baseline, opportunistic load balancing: the next idle unit, whatever its speed",
     WeightRule::kNone, make_olb_policy},
    {"ect", "Baseline, earliest completion time: the unit that is expected to end the task first",
     WeightRule::kNone, make_ect_policy},
    {"edf", "Earliest deadline first, each task on the unit that is expected to end it first",
     WeightRule::kNone, make_edf_policy},
    {"qilin",
     "Qilin's static split: each workload's frames over the units in proportion to their rates",
     WeightRule::kNone, make_qilin_policy},
    {"etf", "Static plan, earliest time first: of ready tasks the one that can start first",
     WeightRule::kNone, make_planned_policy, "", plan_etf},
    {"heft", "Static plan, heterogeneous earliest finish time: by upward rank, with insertion",
     WeightRule::kNone, make_planned_policy, "", plan_heft},
    {"cpop", "Static plan, critical path on a processor: the longest path stays on one unit",
     WeightRule::kNone, make_planned_policy, "", plan_cpop},
    {"peft", "Static plan, predict earliest finish time: looks ahead by an optimistic cost table",
     WeightRule::kNone, make_planned_policy, "", plan_peft},
    {"shortest", "Static plan: the shortest of those of heft, cpop, peft and etf",
     WeightRule::kNone, make_planned_policy, "", plan_shortest},
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
  const auto is_basic = [](const PolicyInfo& info) {
    return !info.has_basic() && info.planner == nullptr;
  };
  if (is_basic(policy)) return policy;
  std::vector<std::string> basic;
  for (const auto& info : policies()) {
    if (is_basic(info)) basic.emplace_back(info.name);
  }
  throw_bad_input(std::string(name) + " is not a basic scheduler; those are " + join(basic, ", "));
}

}  // namespace pirt
