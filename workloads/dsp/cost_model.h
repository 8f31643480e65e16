// What a packet costs: from counts to time, with the sources of its constants.
#pragma once

#include "workloads/base/time.h"
#include "workloads/dsp/session.h"

namespace pirt::dsp {

/// One hardware thread of a Hexagon 680. The barrel of four threads that share the core at 2 GHz
/// gives each a slot every 2 ns, so that a packet whose results are ready starts every cycle of the
/// thread.
/// @source L. Codrescu, Architecture of the Hexagon 680 DSP for mobile imaging and computer vision,
/// Hot Chips 27 (2015): 4 threads of 500 MHz, two of them with a context of HVX.
struct CostModel {
  double clock_hz = 500e6;

  /// What no program can be faster than: each packet a cycle.
  [[nodiscard]] Nanos without_stalls(const Cost& cost) const {
    return from_s(static_cast<double>(cost.packets) / clock_hz);
  }
};

}  // namespace pirt::dsp
