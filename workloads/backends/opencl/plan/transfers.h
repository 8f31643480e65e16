// Between the host's tensors and the device's, all of a call at once.
#pragma once

#include <cstddef>
#include <span>
#include <string>
#include <vector>

#include "workloads/backends/opencl/plan/plan.h"

namespace pirt::opencl {

/// What the device counted, which is to be allocated and read.
/// @throws Error{kEnvironment} if it is not from 0 to @p most.
[[nodiscard]] std::int64_t checked_count(std::int64_t count, std::int64_t most,
                                         const std::string& of);

/// Commands are queued and waited for once. To and from a device with memory of its own they go by
/// a pinned stage: drivers move rectangles out of other memory row by row (NVIDIA's: 2 ms for 250
/// KB, pinned 32 us). What is pinned itself needs none, and what is large and dense goes the
/// driver's way, which does not copy it twice.
class Transfers {
 public:
  explicit Transfers(const DeviceSession& session);

  /// Host to device, of lists the rows that they have; complete on return.
  /// @param from  Without border.
  void write(std::span<const DeviceTensor> to, std::span<const Tensor> from);

  struct Download {
    std::span<const DeviceTensor> from;  ///< Without border.
    std::span<Tensor> to;
  };
  /// Device to host, of lists the rows that the device says; complete on return.
  /// @throws Error{kEnvironment} as checked_count.
  void read(std::initializer_list<Download> all);

  /// A list that kernels filled, and counted while they did.
  struct Counted {
    cl::Buffer count;  ///< i32, at @p index of it.
    std::size_t index = 0;
    cl::Buffer list;
    std::size_t entry_bytes = 0;
    std::int64_t most = 0;
    std::string_view of = "entries";
  };
  /// Its entries, until the next call of any of these functions; waits for all that is queued.
  /// @throws Error{kEnvironment} as checked_count.
  [[nodiscard]] std::span<const std::byte> read(const Counted& counted);

 private:
  /// Parts of the stage, which is made larger where it has to be; of the heap without one.
  class Parts;
  /// Whether what is, or comes, at @p data goes by the stage.
  [[nodiscard]] bool by_stage(const DeviceTensor& resident, const std::byte* data,
                              std::size_t size_bytes) const;

  DeviceSession session_;
  std::unique_ptr<PinnedMemory> stage_;
  std::vector<std::byte> list_;  ///< Without a stage.
};

}  // namespace pirt::opencl
