// How a device's place on the PCI bus is written, whichever driver tells it.
#pragma once

#include <fmt/core.h>

#include <string>

namespace pirt {

/// "0000:01:00.0", as the kernel and lspci -D have it.
[[nodiscard]] inline std::string pci_address(unsigned domain, unsigned bus, unsigned device,
                                             unsigned function) {
  return fmt::format("{:04x}:{:02x}:{:02x}.{:x}", domain, bus, device, function);
}

}  // namespace pirt
