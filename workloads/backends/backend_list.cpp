// One that has options adds its entry.
#include "workloads/backends/backend_list.h"

namespace pirt {

std::vector<std::string> backend_names() {
#define PIRT_BACKEND(name) #name,
  return {
#include "workloads/backends/backends.inc"
  };
#undef PIRT_BACKEND
}

std::vector<OptionSpec> options_of(std::string_view backend) {
  if (backend == "dsp") {
    // What the model's constants are where a platform file does not say.
    return {{"clock_mhz", "MHz", "packets a microsecond of one hardware thread", 1, 10'000, 500},
            {"launch_us", "us", "round trip of a call without its kernel", 0, 1e6, 300},
            {"copy_gb_s", "GB/s", "bandwidth of the board's memory, for what is copied", 0.001,
             10'000, 29.86},
            {"miss_gb_s", "GB/s", "what the DSP gets of it while a line is missing in its L2",
             0.001, 10'000, 7.465}};
  }
  if (backend == "fake") {
    return {{"slowdown", "", "all simulated times of calls, times this", 1e-3, 1e3, 1.0}};
  }
  return {};
}

}  // namespace pirt
