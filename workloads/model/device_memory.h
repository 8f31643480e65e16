// What a kernel is besides, if it has counted what it took of its device's memory.
#pragma once

#include <cstdint>

namespace pirt {

class DeviceMemory {
 public:
  /// All buffers that preparing the kernel made, whatever the driver needs besides.
  [[nodiscard]] virtual std::int64_t device_memory_bytes() const = 0;

 protected:
  ~DeviceMemory() = default;
};

}  // namespace pirt
