// Graphics cards: what their drivers say of them, and boards that OpenCL does not reach.
#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <cstdlib>

#include "characterize/doctor/doctor_checks.h"
#include "characterize/machine/system_files.h"
#include "workloads/base/text/text.h"

namespace pirt::doctor {
namespace {

constexpr const char* kCapabilities = "NVIDIA_DRIVER_CAPABILITIES=compute,utility";
constexpr double kLowered = 0.99;  // of the default power limit; above it is rounding

/// PCIe: generation and lanes, now and at most.
struct PciLink {
  std::optional<unsigned> generation, most_generation, width, most_width;
};

/// Of "16.0 GT/s PCIe", as the kernel has it.
std::optional<unsigned> generation_of(const std::string& speed) {
  constexpr std::array kGigatransfers = {2.5, 5.0, 8.0, 16.0, 32.0, 64.0};
  const double found = std::atof(speed.c_str());
  const auto at = std::ranges::find(kGigatransfers, found);
  if (at == kGigatransfers.end()) return std::nullopt;
  return static_cast<unsigned>(at - kGigatransfers.begin()) + 1;
}

std::optional<unsigned> lanes_of(const std::filesystem::path& file) {
  const auto lanes = read_number(file);  // 255 where the kernel does not know
  if (!lanes || *lanes < 1 || *lanes > 32) return std::nullopt;
  return static_cast<unsigned>(*lanes);
}

std::filesystem::path pci_folder(const DoctorInput& input) {
  return input.root / "sys/bus/pci/devices";
}

/// As the kernel has it, in whose place the board's driver answers where it is not there.
PciLink link_of(const DoctorInput& input, const std::string& pci, const NvmlBoardFacts* board) {
  const auto folder = pci_folder(input) / pci;
  PciLink link{generation_of(text_or_empty(folder / "current_link_speed")),
               generation_of(text_or_empty(folder / "max_link_speed")),
               lanes_of(folder / "current_link_width"), lanes_of(folder / "max_link_width")};
  if (board == nullptr) return link;
  if (!link.generation) link.generation = board->link_generation;
  if (!link.most_generation) link.most_generation = board->most_generation;
  if (!link.width) link.width = board->link_width;
  if (!link.most_width) link.most_width = board->most_width;
  return link;
}

/// The generation falls at rest, and rises with the first transfer.
std::string link_text(const PciLink& link) {
  if (!link.generation || !link.width) return "link not known";
  const auto now = fmt::format("PCIe {}.0 x{}", *link.generation, *link.width);
  if (!link.most_generation || !link.most_width) return now;
  return now + fmt::format(" (at most {}.0 x{})", *link.most_generation, *link.most_width);
}

const NvmlBoardFacts* board_of(const DoctorInput& input, const DeviceInfo& device) {
  if (!input.nvml || device.pci.empty()) return nullptr;
  const auto found = std::ranges::find(input.nvml->boards, device.pci, &NvmlBoardFacts::pci);
  return found == input.nvml->boards.end() ? nullptr : &*found;
}

/// Contexts on a board compute in turns of one length.
std::string share_text(const DeviceInfo& device, const NvmlBoardFacts& board) {
  if (board.mig) return fmt::format("a MIG instance of {} compute units", device.compute_units);
  if (!board.others) return "a context's share of its time not known";
  if (*board.others == 0) return "all of its time for one context";
  return fmt::format("1/{} of its time for a context", *board.others + 1);
}

std::string gpu_text(const DeviceInfo& device, const PciLink& link, const NvmlBoardFacts* board) {
  std::vector<std::string> parts = {fmt::format("{} ({})", device.name, device.version),
                                    device.pci.empty() ? "PCI id not known" : device.pci,
                                    link_text(link)};
  if (board == nullptr) return join(parts, ", ");
  if (board->memory_gb) parts.push_back(fmt::format("{:.1f} GB", *board->memory_gb));
  if (board->free_gb) parts.push_back(fmt::format("{:.1f} GB free", *board->free_gb));
  if (board->limit_w) parts.push_back(fmt::format("at most {:.0f} W", *board->limit_w));
  if (board->ecc) parts.emplace_back(*board->ecc ? "ECC on" : "ECC off");
  parts.push_back(share_text(device, *board));
  return join(parts, ", ");
}

void judge_board(const NvmlBoardFacts& board, const std::string& check, Findings& findings) {
  const auto add = [&](Level level, std::string found, std::string why, std::string remedy) {
    findings.push_back({check, level, std::move(found), std::move(why), std::move(remedy)});
  };
  if (const int others = board.others.value_or(0); others > 0) {
    add(Level::kSpoils,
        fmt::format("{} other process{} on it", others, others == 1 ? " computes" : "es compute"),
        "contexts take turns, so that calls wait for those of others", "end them; see: nvidia-smi");
  }
  if (board.mig) {
    add(Level::kNote, "MIG is on", "figures are an instance's, and the energy is the whole board's",
        fmt::format("sudo nvidia-smi -i {} -mig 0", board.pci));
  }
  if (board.limit_w && board.default_limit_w &&
      *board.limit_w < kLowered * *board.default_limit_w) {
    add(Level::kNote,
        fmt::format("at most {:.0f} W, {:.0f} W by default", *board.limit_w,
                    *board.default_limit_w),
        "kernels that reach the limit run slower",
        fmt::format("sudo nvidia-smi -i {} -pl {:.0f}", board.pci, *board.default_limit_w));
  }
  if (board.core_mhz && board.default_core_mhz && *board.core_mhz < *board.default_core_mhz) {
    add(Level::kNote,
        fmt::format("its clock is set to {} MHz, {} MHz by default", *board.core_mhz,
                    *board.default_core_mhz),
        "everything on it runs slower", fmt::format("sudo nvidia-smi -i {} -rac", board.pci));
  }
}

bool is_nvidia(const DeviceInfo& device) {
  return (device.name + device.platform).find("NVIDIA") != std::string::npos;
}

bool has_nvidia_board(const DoctorInput& input) {
  const auto is_board = [](const std::filesystem::path& folder) {
    return text_or_empty(folder / "vendor") == "0x10de" &&
           text_or_empty(folder / "class").starts_with("0x03");  // a display controller
  };
  return std::ranges::any_of(folder_entries(pci_folder(input)), is_board) ||
         // There with any board; a container may have another than the first.
         std::filesystem::exists(input.root / "dev/nvidiactl") ||
         std::filesystem::exists(input.root / "proc/driver/nvidia");
}

/// What is missing between a board of NVIDIA's and this program; mostly in containers.
void judge_nvidia_driver(const DoctorInput& input, Findings& findings) {
  if (std::ranges::none_of(*input.devices, is_nvidia)) {
    const bool named = std::filesystem::exists(input.root / "etc/OpenCL/vendors/nvidia.icd");
    const std::string remedy =
        named ? fmt::format(
                    "install the driver's libnvidia-opencl.so.1, or start the container "
                    "with {}",
                    kCapabilities)
              : fmt::format(
                    "mkdir -p /etc/OpenCL/vendors && echo libnvidia-opencl.so.1 > "
                    "/etc/OpenCL/vendors/nvidia.icd (a container is started with {} besides)",
                    kCapabilities);
    findings.push_back({"gpu driver", Level::kNote,
                        named
                            ? "a board of NVIDIA's without an OpenCL device"
                            : "a board of NVIDIA's, and no nvidia.icd that names its OpenCL driver",
                        "the board will have no figures", remedy});
  }
  if (input.nvml && input.nvml->boards.empty()) {
    findings.push_back({"gpu driver", Level::kNote, "NVML: " + input.nvml->missing,
                        "the board's energy, memory and limits are not known",
                        fmt::format("install the driver's libnvidia-ml.so.1, or start the "
                                    "container with {}; after an update of the driver, reboot",
                                    kCapabilities)});
  }
}

}  // namespace

Findings gpus(const DoctorInput& input) {
  const bool nvidia = has_nvidia_board(input);
  if (!input.devices) {
    if (!nvidia) return {};
    return {unknown("gpu", "a board of NVIDIA's, not asked: this is a recorded machine")};
  }
  Findings findings;
  for (std::size_t i = 0; i < input.devices->size(); ++i) {
    const DeviceInfo& device = (*input.devices)[i];
    if (!device.own_memory) continue;
    const std::string check = fmt::format("gpu {}", i);
    const NvmlBoardFacts* const board = board_of(input, device);
    const PciLink link = link_of(input, device.pci, board);
    findings.push_back(good(check, gpu_text(device, link, board)));
    if (board != nullptr) judge_board(*board, check, findings);
    if (link.width && link.most_width && *link.width < *link.most_width) {
      findings.push_back({check, Level::kNote,
                          fmt::format("x{} of x{} lanes", *link.width, *link.most_width),
                          "transfers take longer than the board's own link allows",
                          fmt::format("another slot; see: sudo lspci -vvs {}", device.pci)});
    }
  }
  if (nvidia) judge_nvidia_driver(input, findings);
  if (findings.empty()) findings.push_back(good("gpu", "none with memory of its own"));
  return findings;
}

}  // namespace pirt::doctor
