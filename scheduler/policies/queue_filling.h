// What Algorithms 2 and 3 share: the first queue, in a fixed order, that is shorter than its
// weight.
#pragma once

#include <memory>
#include <span>
#include <string_view>

#include "scheduler/policies/policy.h"

namespace pirt {

/// @param order      Roles in the order in which queues are filled.
/// @param otherwise  Role that the printed `else` names.
[[nodiscard]] std::unique_ptr<Policy> make_queue_filling_policy(const PolicySetup& setup,
                                                                std::span<const Role> order,
                                                                Role otherwise);

}  // namespace pirt
