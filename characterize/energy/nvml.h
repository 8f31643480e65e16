// What NVML says of NVIDIA's boards besides their energy, for whoever judges a machine.
#pragma once

#include <map>
#include <optional>
#include <string>
#include <vector>

namespace pirt {

/// Absent is what the board or its driver does not tell.
struct NvmlBoardFacts {
  std::string pci;  ///< As pci_address has it.
  std::optional<double> memory_gb, free_gb;
  std::optional<double> limit_w, default_limit_w;
  std::optional<unsigned> core_mhz, default_core_mhz;  ///< What applications set the clock to.
  std::optional<unsigned> memory_mhz;                  ///< The same of memory.
  std::optional<bool> ecc;
  bool mig = false;
  std::optional<int> others;  ///< Processes with a context on it that are not this one's.
  std::optional<unsigned> link_generation, most_generation;  ///< Of PCIe: now, and at most.
  std::optional<unsigned> link_width, most_width;            ///< Lanes.
};

struct NvmlFacts {
  std::vector<NvmlBoardFacts> boards;
  std::string missing;  ///< Why there are none.
};

[[nodiscard]] NvmlFacts read_nvml();

/// What of a board decides how fast it is and can be set: "power_limit_w", "core_mhz",
/// "memory_mhz", "ecc", as far as its driver tells; empty for another maker's.
[[nodiscard]] std::map<std::string, std::string> board_settings(const std::string& pci);

}  // namespace pirt
