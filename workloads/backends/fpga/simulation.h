// One call of a streaming core: alone, and between the streams of the board's memory, cycle by
// cycle.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "workloads/backends/fpga/core.h"
#include "workloads/backends/fpga/sdram.h"

namespace pirt::fpga {

/// A buffer of the board's memory that a core reads or writes in order.
struct Lane {
  std::span<std::byte> memory;
  int bytes = 1;  ///< Of an element.
};

/// What a core is to do. Elements of several lanes lie side by side on its port, the first one
/// lowest.
struct Task {
  int width = 0, height = 0;  ///< Of a core for pictures.
  std::span<const std::uint8_t> parameters;
  std::vector<Lane> in, out;
};

/// From the first element in to the last out, with elements always there (zeros: no core takes
/// longer for others) and always taken.
/// @throws Error{kEnvironment} if the core stops: never for a core that is right.
[[nodiscard]] std::int64_t cycles_alone(Core& core, const Task& task);

/// Computes @p task in the memory's buffers: from the first cycle of the memory to the last byte in
/// it.
/// @param core_hz  The core's clock.
/// @return cycles of the core's clock, those in which it waited for the memory included.
/// @throws as cycles_alone.
[[nodiscard]] std::int64_t cycles_with_memory(Core& core, const Task& task, std::int64_t core_hz,
                                              const SdramTiming& timing);

/// What moving @p size_bytes into or out of the SDRAM takes at least, in seconds: by the same
/// model, with nothing else going on.
[[nodiscard]] double transfer_s(std::size_t size_bytes, bool into_memory,
                                const SdramTiming& timing);

}  // namespace pirt::fpga
