// The paper's Table III, rebuilt: which unit each vision workload prefers, over the units of
// several profiles: what was measured and counted as it is, and beside it at the size of the
// paper's boards.
//
// At the boards' size, a CPU or GPU of Table II takes
//
//   execute x max(operations / P, bytes / B) / max(operations / p, bytes / b)
//
// where execute is what the unit took that computed it here, p and b are its measured f32 peak and
// memory bandwidth, and P and B are the board's: it is as near to its roofline as ours to its own.
// That is a model. DSP and FPGA are counted at the boards' clocks already and stay as they are.
// Nobody knows a board's launches and copies, so that execution alone is compared, as the paper's
// Fig. 3 does. Energy is as it is, since no figure of a board's power under these workloads is
// known.
#pragma once

#include <optional>
#include <span>
#include <string>
#include <vector>

#include "characterize/profile/profile.h"
#include "reports/document/table.h"
#include "reports/profile/preference.h"
#include "workloads/base/text/json.h"

namespace pirt {

/// One of the six vision workloads.
struct Table3Row {
  std::string workload;
  Ranking here;                        ///< Phase `call`, ms, of the profiles' units.
  Ranking energy;                      ///< J a call, of those that have a figure.
  std::vector<std::string> no_energy;  ///< Of the units in `here`, those without: in no count.
  Ranking boards;  ///< Phase `execute`, ms, by the paper's names: CPU, mGPU, GPU, DSP, FPGA.
  std::string paper_time, paper_energy;
  /// Why `boards` prefers another unit than the paper: what its unit takes, and what that is made
  /// of. Empty if both agree.
  std::string difference;
};

struct Table3 {
  std::vector<Table3Row> rows;       ///< In the paper's order; those that some profile has.
  std::vector<std::string> sources;  ///< What each unit is: device, backend, profile.
};

/// @param profiles  Of any machines; of two with a unit of the same kind the first counts for the
/// boards.
[[nodiscard]] Table3 table3(std::span<const Profile* const> profiles);

/// Preferable units beside the paper's, and the figures that they follow from.
[[nodiscard]] std::vector<Table> table3_tables(const Table3& table);
[[nodiscard]] Json table3_json(const Table3& table);

}  // namespace pirt
