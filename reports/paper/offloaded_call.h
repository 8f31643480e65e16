// One offloaded call, part by part, on every unit of a platform that has figures of it: those of
// the profile, and those that the platform file gives. Beside it what the paper's Fig. 7 says.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "characterize/platform/platform.h"
#include "characterize/profile/profile.h"
#include "reports/document/table.h"
#include "workloads/base/text/json.h"

namespace pirt {

/// Packets of a convolution of the catalog's size by workloads/dsp/program/scalar.
/// @source tests/bench/dsp
inline constexpr std::int64_t kScalarConvolutionPackets = 10'538'159;

struct TimeFigure {
  Nanos time{0};
  Origin from = {};
};

struct OffloadedCall {
  std::string unit;
  Role role = Role::kOther;
  std::string backend;               ///< Empty = the platform file's figures.
  std::optional<TimeFigure> once;    ///< Device and kernel, warm: before the first call.
  std::optional<TimeFigure> set_up;  ///< Of each call, what another unit does for it.
  std::optional<TimeFigure> launch, copies, execute;
  std::optional<Nanos> bound;  ///< The least that the execution can take, where it is known.
  TimeFigure call;             ///< All but `once`.

  /// What of the call is not its execution: 0 to 1.
  [[nodiscard]] double overhead() const;
};

/// Units in the platform's order. A measured unit has its medians of valid rows; of a modelled one,
/// stages on itself execute, those on other units set up, and delays copy.
[[nodiscard]] std::vector<OffloadedCall> offloaded_calls(const Profile& profile,
                                                         const Platform& platform,
                                                         std::string_view workload);

/// The convolution's, with what the paper says of each unit, and whether that is so here.
[[nodiscard]] Table offloaded_convolution_table(const std::vector<OffloadedCall>& calls);
/// The paper's figure of its DSP (Table V) at a convolution between what vector code, scalar code
/// and the peak of Table II take.
struct PaperDsp {
  TimeFigure vectors, vectors_without_stalls, scalar_without_stalls, fitted, peak;

  /// What follows, in a sentence or two.
  [[nodiscard]] std::string conclusion() const;
};
/// Of the convolution's calls; absent without a unit of backend `dsp`.
[[nodiscard]] std::optional<PaperDsp> paper_dsp(const std::vector<OffloadedCall>& calls);
[[nodiscard]] Table paper_dsp_table(const PaperDsp& dsp);

/// All that a report says of the convolution's calls: none if there are none.
[[nodiscard]] std::vector<Table> offloaded_convolution_tables(
    const std::vector<OffloadedCall>& calls);
/// Keys "convolution" and, if it is known, "paper_dsp".
[[nodiscard]] Json offloaded_convolution_json(const std::vector<OffloadedCall>& calls);

}  // namespace pirt
