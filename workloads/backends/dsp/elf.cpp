#include "workloads/backends/dsp/elf.h"

#include <elf.h>
#include <fmt/core.h>

#include <cstring>
#include <fstream>
#include <string>

#include "workloads/base/error.h"

namespace pirt::dsp {
namespace {

constexpr int kHexagon = 164;  // EM_HEXAGON; elf.h of glibc 2.36 calls it EM_QDSP6

std::string fault_of(const Elf32_Ehdr& header, bool complete) {
  if (!complete || std::memcmp(header.e_ident, ELFMAG, SELFMAG) != 0) return "is no ELF file";
  if (header.e_machine != kHexagon) {
    return fmt::format("is for another machine (ELF machine {}, not {})", header.e_machine,
                       kHexagon);
  }
  if (header.e_ident[EI_CLASS] != ELFCLASS32 || header.e_type != ET_EXEC) {
    return "is no executable for a 32-bit machine";
  }
  return "";
}

}  // namespace

void check_hexagon_elf(const std::filesystem::path& path) {
  std::ifstream file(path, std::ios::binary);
  Elf32_Ehdr header{};
  file.read(reinterpret_cast<char*>(&header), sizeof(header));
  const std::string fault = fault_of(header, file.gcount() == sizeof(header));
  if (!fault.empty()) {
    throw_environment(
        fmt::format("the Hexagon program '{}' {}; build pirt again", path.string(), fault));
  }
}

}  // namespace pirt::dsp
