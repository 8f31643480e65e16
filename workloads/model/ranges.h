// What the values of an input may be, for whoever takes one that others have made.
#pragma once

#include <string>

#include "workloads/model/tensor.h"

namespace pirt {

/// As out_of_range(tensor), by the ranges that a workload says: a tensor's own spec is the same but
/// for those, which whoever made it need not know.
[[nodiscard]] std::string out_of_range(const Tensor& tensor, const TensorSpec& spec);

}  // namespace pirt
