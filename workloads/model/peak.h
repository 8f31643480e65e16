// The limits of a unit and the loops that try to reach them: peak arithmetic and bandwidth, the two
// sides of a roofline.
//
// A loop here computes something that is checked, as fast as its author knows how; the best of
// several is the measured limit. Who measures calls run() and reads the clock.
#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "workloads/model/workload.h"

namespace pirt {

enum class PeakKind : std::uint8_t {
  kF32,          ///< Single-precision operations a second; a multiply-add counts 2.
  kInt8,         ///< Operations of 8-bit dot products with 32-bit sums; a multiply-add counts 2.
  kBandwidthL2,  ///< Bytes a second read from data that stay in caches of level 2.
  kBandwidthMemory,  ///< Bytes a second read from data that no cache holds.
};
inline constexpr std::array kAllPeakKinds = {PeakKind::kF32, PeakKind::kInt8,
                                             PeakKind::kBandwidthL2, PeakKind::kBandwidthMemory};

/// "f32", "int8", "bandwidth_l2", "bandwidth_memory": as in the profile database.
[[nodiscard]] std::string_view to_string(PeakKind kind);
[[nodiscard]] std::optional<PeakKind> peak_kind_from_string(std::string_view text);

/// One way to reach for one limit, ready to run. Used by one thread at a time; its device outlives
/// it.
class PeakLoop {
 public:
  virtual ~PeakLoop() = default;
  [[nodiscard]] virtual PeakKind kind() const = 0;
  /// What distinguishes it: "avx2 fma, 10 accumulators".
  [[nodiscard]] virtual std::string variant() const = 0;
  /// Operations or bytes of one run(1).
  [[nodiscard]] virtual double work() const = 0;
  /// Does the work @p repeats times on all of the unit's cores and waits for the end.
  /// @throws Error{kEnvironment} if the device fails.
  virtual void run(int repeats) = 0;
  /// Whether what the last run() left is exactly what its work leaves.
  [[nodiscard]] virtual Verdict verify() const = 0;
};

/// The loops of one device.
struct PeakLoops {
  std::vector<std::unique_ptr<PeakLoop>> loops;
  std::map<PeakKind, std::string> unavailable;  ///< Why a kind has none; one clause.
};

}  // namespace pirt
