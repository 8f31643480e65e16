// What a platform file may say of a unit of backend fpga, with or without the backend.
#pragma once

#include <vector>

#include "workloads/model/backend.h"

namespace pirt {

/// In the order in which fpga_backend.cpp reads them.
[[nodiscard]] inline std::vector<OptionSpec> fpga_options() {
  // What the model's constants are where a platform file does not say: board.h has their sources.
  return {{"clock_mhz", "MHz", "of the cores and of the bridge", 1, 100, 100},
          {"sdram_mhz", "MHz", "of the SDRAM", 1, 143, 143},
          {"bridge_bits", "bits", "data path between host and FPGA; assumed: a transfer a cycle", 8,
           128, 64},
          {"launch_us", "us", "a call without transfers and computation", 0, 1e6, 5},
          {"configuration_mb_s", "MB/s", "at which a bitstream is loaded", 0.001, 10'000, 250},
          {"host_mhz", "MHz", "of the host's cores, for what they do of a call", 1, 10'000, 925}};
}

}  // namespace pirt
