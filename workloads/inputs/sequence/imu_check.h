// Whether an IMU's samples can be what they are taken for.
#pragma once

#include <string>
#include <vector>

#include "workloads/inputs/sequence/sequence.h"

namespace pirt {

/// Degrees and g, as far as they can be told from a recording; an axis that is stuck. A few samples
/// that no sensor measures are left out with a warning.
/// @param what  For the message: the file, the topic.
/// @throws Error{kBadInput} with the unit that is needed.
void check_imu(const std::string& what, std::vector<ImuSample>& imu,
               std::vector<std::string>& warnings);

}  // namespace pirt
