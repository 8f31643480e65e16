// The paper's Tables IV and V for the machine of a profile.
#pragma once

#include <optional>
#include <span>

#include "characterize/platform/platform.h"
#include "characterize/profile/profile.h"
#include "reports/document/table.h"
#include "scheduler/record/run_record.h"

namespace pirt {

/// One way to infer an image: a unit of the machine, or the cloud of its platform.
struct Inference {
  std::string where;
  std::optional<double> energy_j = std::nullopt;
  std::optional<double> low_s = std::nullopt, high_s = std::nullopt;  ///< Equal for units.
  Origin energy_provenance = Provenance::kMeasured, time_provenance = Provenance::kMeasured;
};

/// AlexNet on each unit with a valid row, then on each unit of role cloud that serves it.
/// @param platform  Null = no cloud is known.
[[nodiscard]] std::vector<Inference> inferences(const Profile& profile, const Platform* platform);

/// Table IV: inference locally against the cloud, with the paper's rows below.
[[nodiscard]] Table cloud_table(const std::vector<Inference>& here);

/// Table V: the modes on frames of a convolution in a closed loop, each above the paper's row.
[[nodiscard]] Table scheduling_table(std::span<const RunRecord> runs);

}  // namespace pirt
