// Whether an IMU's samples can be what they are taken for.
#pragma once

#include <string>
#include <vector>

#include "workloads/inputs/sequence/sequence.h"

namespace pirt {

/// Degrees and g, as far as they can be told from a recording.
/// @param what  For the message: the file, the topic.
/// @throws Error{kBadInput} with the unit that is needed.
void check_imu(const std::string& what, const std::vector<ImuSample>& imu);

}  // namespace pirt
