// The policies' factories, one file each in this folder. Shipped ones are named in ../policy.cpp.
#pragma once

#include <memory>

#include "scheduler/policies/policy.h"

namespace pirt {

[[nodiscard]] std::unique_ptr<Policy> make_latency_policy(const PolicySetup& setup);
[[nodiscard]] std::unique_ptr<Policy> make_throughput_policy(const PolicySetup& setup);
[[nodiscard]] std::unique_ptr<Policy> make_energy_policy(const PolicySetup& setup);
[[nodiscard]] std::unique_ptr<Policy> make_advanced_policy(const PolicySetup& setup);
[[nodiscard]] std::unique_ptr<Policy> make_cpu_only_policy(const PolicySetup& setup);
[[nodiscard]] std::unique_ptr<Policy> make_met_policy(const PolicySetup& setup);
[[nodiscard]] std::unique_ptr<Policy> make_olb_policy(const PolicySetup& setup);
[[nodiscard]] std::unique_ptr<Policy> make_ect_policy(const PolicySetup& setup);
[[nodiscard]] std::unique_ptr<Policy> make_edf_policy(const PolicySetup& setup);
[[nodiscard]] std::unique_ptr<Policy> make_qilin_policy(const PolicySetup& setup);
/// Of all modes with a planner.
[[nodiscard]] std::unique_ptr<Policy> make_planned_policy(const PolicySetup& setup);

}  // namespace pirt
