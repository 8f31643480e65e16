// The DE1-SoC around the cores: from counts to time, with the sources of its constants.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>

#include "workloads/backends/fpga/sdram.h"
#include "workloads/backends/fpga/simulation.h"
#include "workloads/base/time.h"

namespace pirt::fpga {

struct Board {
  /// Of the cores and of the bridge: half of a period for logic by the timing model that Yosys has
  /// of the device, half for wires (README.md); 100 MHz is the most that is taken without a board.
  double clock_hz = 100e6;

  SdramTiming sdram = {};

  /// HPS-to-FPGA bridge: bits of its data path. A transfer a cycle of the cores' clock is an
  /// assumption, the most that the bus can do.
  /// @source Intel, Cyclone V Hard Processor System Technical Reference Manual, "HPS-FPGA bridges":
  /// AXI, 32, 64 or 128 bits.
  int bridge_bits = 64;

  /// From the call to the first cycle of the core and from its last one back: writing a core's
  /// registers and reading its state over the lightweight bridge, by polling. An assumption.
  double launch_us = 5;

  /// Bits of a configuration of the 5CSEMA5, not compressed, and the rate of its 16 bits at 125
  /// MHz.
  /// @source Intel, Cyclone V Device Datasheet (CV-51002), "Configuration files" and "Minimum
  /// configuration time estimation": 56 057 632 bits, 28 ms.
  std::int64_t configuration_bits = 56'057'632;
  double configuration_bits_per_s = 16 * 125e6;

  /// Of the host's cores, Table II of the Pi-RT paper. What they do for a call (host_cycles) is
  /// modelled, never measured here.
  double host_hz = 925e6;

  [[nodiscard]] Nanos cycles(std::int64_t count) const {
    return from_s(static_cast<double>(count) / clock_hz);
  }
  [[nodiscard]] std::int64_t core_hz() const { return static_cast<std::int64_t>(clock_hz); }
  [[nodiscard]] Nanos launch() const { return from_s(launch_us * 1e-6); }
  [[nodiscard]] Nanos configuration() const {
    return from_s(static_cast<double>(configuration_bits) / configuration_bits_per_s);
  }
  /// Over the bridge and into or out of the SDRAM, whichever is slower.
  [[nodiscard]] Nanos transfer(std::size_t size_bytes, bool into_memory) const {
    const double bridge = 8.0 * static_cast<double>(size_bytes) / bridge_bits / clock_hz;
    return from_s(std::max(bridge, transfer_s(size_bytes, into_memory, sdram)));
  }
  [[nodiscard]] Nanos host(double host_cycles) const { return from_s(host_cycles / host_hz); }
};

}  // namespace pirt::fpga
