// The FPGA that nobody here owns: streaming cores in Verilog, verilated, whose cycles are counted.
// See README.md.
#pragma once

#include <memory>

#include "workloads/model/backend.h"

namespace pirt {

[[nodiscard]] std::unique_ptr<const Backend> make_fpga_backend();

}  // namespace pirt
