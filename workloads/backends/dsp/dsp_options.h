// What a platform file may say of a unit of backend dsp, with or without the backend.
#pragma once

#include <vector>

#include "workloads/model/backend.h"

namespace pirt {

/// In the order in which dsp_backend.cpp reads them.
[[nodiscard]] inline std::vector<OptionSpec> dsp_options() {
  // What the model's constants are where a platform file does not say.
  return {{"clock_mhz", "MHz", "packets a microsecond of one hardware thread", 1, 10'000, 500},
          {"launch_us", "us", "round trip of a call without its kernel", 0, 1e6, 300},
          {"copy_gb_s", "GB/s", "bandwidth of the board's memory, for what is copied", 0.001,
           10'000, 29.86},
          {"miss_gb_s", "GB/s", "what the DSP gets of it while a line is missing in its L2", 0.001,
           10'000, 7.465}};
}

}  // namespace pirt
