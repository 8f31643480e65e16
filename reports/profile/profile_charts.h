// What a profile says, as pictures: time and energy of each workload on each unit (the paper's
// Fig. 3 to 6 for this machine), how samples are spread, how near cells come to their roofs.
#pragma once

#include <string>
#include <vector>

#include "characterize/profile/profile.h"
#include "characterize/profile/roofline.h"
#include "reports/document/chart.h"

namespace pirt {

/// Where a profile's figures come from, with the command that measures them again.
[[nodiscard]] std::string origin_of(const Profile& profile);

/// Time a call, a chart a family of workloads that the profile has: vision (Fig. 3), AlexNet (Fig.
/// 5), others.
[[nodiscard]] std::vector<Chart> time_charts(const Profile& profile);

/// Joules a call, likewise (Fig. 4 and 6). A family without any energy has none.
[[nodiscard]] std::vector<Chart> energy_charts(const Profile& profile);

/// At most so many quantiles stand for the samples of a row.
inline constexpr std::size_t kMostQuantiles = 200;

/// How the samples of each cell's calls are spread.
/// @param profile  With samples (ProfileReader::read_samples); rows without any say so.
[[nodiscard]] Chart distribution_chart(const Profile& profile);

/// A roofline a unit with peaks, of the cells whose operations are known; then how near each cell
/// comes to its roof, whatever makes that.
[[nodiscard]] std::vector<Chart> roofline_charts(const Profile& profile);

}  // namespace pirt
