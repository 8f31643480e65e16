// Which of a backend's devices a platform file means by `device:`, and whether one is it still.
#pragma once

#include <span>
#include <string>
#include <string_view>

#include "workloads/model/backend.h"

namespace pirt {

/// `device:` of the first device with memory of its own.
inline constexpr std::string_view kOwnMemory = "own_memory";

/// Whether @p part occurs in the device's name or platform, in any case.
[[nodiscard]] bool is_named(const DeviceInfo& device, const std::string& part);

struct DeviceChoice {
  std::size_t index = 0;
  std::string remark;  ///< By which other driver the device is there too; empty = by none.
};

/// @param devices  At least one.
/// @param wanted   Empty = the first; kOwnMemory; a number of one or two digits = the place in
/// @p devices, from 0; a PCI id ("0000:01:00.0", "01:00.0"); or part of one device's name or
/// platform, in any case.
/// @throws Error{kEnvironment} naming the devices, where none or several are meant.
[[nodiscard]] DeviceChoice choose_device(std::span<const DeviceInfo> devices,
                                         const std::string& wanted);

/// `1: "NVIDIA H100" (NVIDIA CUDA, 0000:01:00.0)`
[[nodiscard]] std::string numbered(std::span<const DeviceInfo> devices, std::size_t index);

/// What of an open device is not as it was: "driver 'x' in place of 'y'"; empty = it is the same
/// one. Its remark may come and go.
[[nodiscard]] std::string other_device(const DeviceInfo& was, const DeviceInfo& is);

}  // namespace pirt
