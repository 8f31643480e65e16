#include "workloads/model/device_choice.h"

#include <fmt/core.h>

#include <algorithm>
#include <cctype>
#include <functional>
#include <vector>

#include "workloads/base/error.h"
#include "workloads/base/text/text.h"

namespace pirt {
namespace {

using Devices = std::span<const DeviceInfo>;

std::string in_lower_case(std::string text) {
  std::ranges::transform(text, text.begin(),
                         [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return text;
}

bool is_device_number(const std::string& text) {
  return !text.empty() && text.size() <= 2 &&
         std::ranges::all_of(text, [](unsigned char c) { return std::isdigit(c) != 0; });
}

bool is_pci_id(const std::string& text) {
  return text.find(':') != std::string::npos && text.find('.') != std::string::npos &&
         text.find_first_not_of("0123456789abcdef:.") == std::string::npos;
}

/// Short ids leave the domain out, those of NVIDIA's tools have it with eight digits.
bool is_at(const DeviceInfo& device, const std::string& pci) {
  if (device.pci.empty()) return false;
  return device.pci == pci || device.pci.ends_with(":" + pci) || pci.ends_with(device.pci);
}

/// One device by two drivers. Of the host's cores there is one; where a driver does not say the
/// place, the name tells.
bool is_same_device(const DeviceInfo& a, const DeviceInfo& b) {
  if (a.platform == b.platform || a.is_cpu != b.is_cpu) return false;
  if (!a.pci.empty() && !b.pci.empty()) return a.pci == b.pci;
  return a.is_cpu || a.name == b.name;
}

std::vector<std::size_t> where(Devices devices,
                               const std::function<bool(const DeviceInfo&)>& matches) {
  std::vector<std::size_t> found;
  for (std::size_t i = 0; i < devices.size(); ++i) {
    if (matches(devices[i])) found.push_back(i);
  }
  return found;
}

std::string all_numbered(Devices devices, const std::vector<std::size_t>& which) {
  std::vector<std::string> parts;
  for (const std::size_t i : which) parts.push_back(numbered(devices, i));
  return join(parts, ", ");
}

[[noreturn]] void throw_no_device(Devices devices, const std::string& what) {
  const auto all = where(devices, [](const DeviceInfo&) { return true; });
  throw_environment(fmt::format("no device {}; there are: {}", what, all_numbered(devices, all)));
}

/// The first, whose other drivers are worth a remark.
DeviceChoice first_of(Devices devices, std::size_t first) {
  const auto others = where(
      devices, [&](const DeviceInfo& device) { return is_same_device(device, devices[first]); });
  if (others.empty()) return {first, ""};
  return {first, fmt::format("\"{}\" of {} is there by another driver too, {}; device: {} takes it",
                             devices[first].name, devices[first].platform,
                             all_numbered(devices, others), others.front())};
}

}  // namespace

bool is_named(const DeviceInfo& device, const std::string& part) {
  const std::string wanted = in_lower_case(part);
  return in_lower_case(device.name).find(wanted) != std::string::npos ||
         in_lower_case(device.platform).find(wanted) != std::string::npos;
}

std::string numbered(std::span<const DeviceInfo> devices, std::size_t index) {
  const DeviceInfo& device = devices[index];
  return fmt::format("{}: \"{}\" ({}{}{})", index, device.name, device.platform,
                     device.pci.empty() ? "" : ", ", device.pci);
}

DeviceChoice choose_device(std::span<const DeviceInfo> devices, const std::string& wanted) {
  if (wanted.empty()) return first_of(devices, 0);
  if (wanted == kOwnMemory) {
    const auto own = std::ranges::find(devices, true, &DeviceInfo::own_memory);
    if (own == devices.end()) throw_no_device(devices, "has memory of its own, as a GPU's card");
    return first_of(devices, static_cast<std::size_t>(own - devices.begin()));
  }
  if (is_device_number(wanted)) {
    const auto index = static_cast<std::size_t>(std::stoul(wanted));
    if (index >= devices.size()) throw_no_device(devices, "has number " + wanted);
    return {index, ""};
  }
  const std::string part = in_lower_case(wanted);
  const bool by_place = is_pci_id(part);
  const auto found = where(devices, [&](const DeviceInfo& each) {
    return by_place ? is_at(each, part) : is_named(each, part);
  });
  if (found.empty()) throw_no_device(devices, "matches \"" + wanted + "\"");
  const bool one_place = by_place && std::ranges::all_of(found, [&](std::size_t i) {
                           return devices[i].pci == devices[found.front()].pci;
                         });
  if (one_place) return first_of(devices, found.front());
  if (found.size() == 1) return {found.front(), ""};
  throw_environment(fmt::format(
      "{} devices match \"{}\": {}; choose one by its number (device: {}) or its PCI id",
      found.size(), wanted, all_numbered(devices, found), found.front()));
}

std::string other_device(const DeviceInfo& was, const DeviceInfo& is) {
  std::vector<std::string> changed;
  const auto compare = [&](std::string_view what, std::string DeviceInfo::*of) {
    if (is.*of == was.*of) return;
    changed.push_back(fmt::format("{} '{}' in place of '{}'", what, is.*of, was.*of));
  };
  compare("device", &DeviceInfo::name);
  compare("driver", &DeviceInfo::platform);
  compare("version", &DeviceInfo::version);
  compare("tuning", &DeviceInfo::tuning);
  compare("PCI id", &DeviceInfo::pci);
  return join(changed, ", ");
}

}  // namespace pirt
