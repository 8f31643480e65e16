// The DSP that nobody here owns: Hexagon code with HVX under qemu-hexagon, whose time is counted in
// packets. See README.md.
#pragma once

#include <memory>

#include "workloads/model/backend.h"

namespace pirt {

[[nodiscard]] std::unique_ptr<const Backend> make_dsp_backend();

}  // namespace pirt
