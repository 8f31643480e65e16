// What a packet costs: from counts to time, with the sources of its constants.
#pragma once

#include "workloads/backends/dsp/session.h"
#include "workloads/base/time.h"

namespace pirt::dsp {

/// One hardware thread of a Hexagon 680.
struct CostModel {
  /// Four threads of 500 MHz share the core, so that the results of a packet are ready when the
  /// thread's next one is due: a packet a cycle, at best.
  /// @source J. Hruska, Qualcomm's new Hexagon 680 DSP: fast, efficient, shipping with Snapdragon
  /// 820, ExtremeTech, 25 August 2015, after Qualcomm's talk at Hot Chips 27.
  double clock_hz = 500e6;

  /// What the DSP gets of the memory while it fetches ahead (l2fetch), which a line that is not in
  /// the L2 waits for: an assumption, a quarter of the board's. The L2 of 512 KiB and 8 ways in
  /// protocol.h is one, too: no source was found that gives the 680's.
  double memory_bytes_per_s = 29.86e9 / 4;

  /// Of the board's memory: 2 channels x 4 bytes x 3.73e9 transfers a second.
  /// @source PhoneDB, Snapdragon 820 APQ8096: LPDDR4, 1866 MHz, 2 channels of 32 bits, 29.86 GB/s;
  /// the Pi-RT paper's Table II has the same memory and clock.
  double board_bytes_per_s = 29.86e9;

  /// From the call to the kernel's begin and back, cache maintenance included.
  /// @source Qualcomm, Hexagon SDK, "System optimizations", "IPC performance considerations":
  /// without a coherent cache "a minimum of a few hundred microseconds"; read as three hundred.
  double round_trip_us = 300;

  /// What is copied is read and written: both go over the board's memory. Published.
  [[nodiscard]] Nanos copy(std::size_t size_bytes) const {
    return from_s(2 * static_cast<double>(size_bytes) / board_bytes_per_s);
  }
  /// Published.
  [[nodiscard]] Nanos launch() const { return from_s(round_trip_us * 1e-6); }

  /// No stalls: what no program can be faster than. Counted.
  [[nodiscard]] Nanos without_stalls(const Cost& cost) const {
    return from_s(static_cast<double>(cost.packets) / clock_hz);
  }
  /// Of a session that models the memory: each line waits, and nothing overlaps. Modelled.
  [[nodiscard]] Nanos with_memory(const Cost& cost) const {
    const double missed_bytes = static_cast<double>(cost.misses) * PIRT_DSP_LINE;
    return without_stalls(cost) + from_s(missed_bytes / memory_bytes_per_s);
  }
};

}  // namespace pirt::dsp
