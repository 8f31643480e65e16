// How much of each of the vector unit's resources a program has used: from how often each packet
// was executed and a disassembly. What no schedule of the same instructions could be shorter than.
//
// Source of what instructions take: LLVM 14's Hexagon back end (HexagonDepIICHVX.td,
// HexagonDepInstrInfo.td, v60): four pipes, of which two multiply, one shifts and one permutes; all
// four add. One load and one store a packet.
#pragma once

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <map>
#include <memory>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace pirt::bench {

enum Resource { kMultiply, kShift, kPermute, kPipes, kLoad, kStore, kSlots, kResources };

inline constexpr std::array<std::string_view, kResources> kResourceNames = {
    "multiply", "shift", "permute", "ALU", "load", "store", "slots"};
/// Of each in a packet.
inline constexpr std::array<double, kResources> kCapacities = {2, 1, 1, 4, 1, 1, 4};

using Usage = std::array<double, kResources>;

inline bool contains_any(std::string_view text, std::initializer_list<std::string_view> parts) {
  return std::ranges::any_of(parts,
                             [&](auto part) { return text.find(part) != std::string_view::npos; });
}

/// Of one instruction as llvm-objdump writes it: "v5:4.h = vdmpy(v3:2.ub,r5.b)".
inline Usage usage_of(std::string_view text) {
  Usage use{};
  use[kSlots] = 1;
  const auto equals = text.find('=');
  const bool to_pair = text.substr(0, equals).find(':') != std::string_view::npos;
  const double width = to_pair ? 2 : 1;
  if (text.find("vmem") != std::string_view::npos) {
    const bool loads = equals < text.find("vmem");
    use[loads ? kLoad : kStore] = 1;
    if (text.find("vmemu") != std::string_view::npos) use[kPermute] = use[kPipes] = 1;
    return use;
  }
  if (contains_any(text, {"= mem", "=mem"})) {
    use[kLoad] = 1;
  } else if (text.starts_with("mem")) {
    use[kStore] = 1;
  } else if (text.find("mpy") != std::string_view::npos && text.starts_with("v")) {
    use[kMultiply] = contains_any(text, {"vmpye", "vmpyo"}) ? 2 : width;
    use[kPipes] = use[kMultiply];
  } else if (contains_any(text, {"vlut", "vshuff(v", "vdeal("})) {
    // Those of pairs, and look-ups that add to others, shift at the same time.
    const bool both = to_pair || text.find("|= vlut") != std::string_view::npos;
    use[kPermute] = 1;
    use[kShift] = both ? 1 : 0;
    use[kPipes] = both ? 2 : 1;
  } else if (contains_any(text, {"valign", "vlalign", "vror", "vdelta", "vrdelta", "vpack"})) {
    use[kPermute] = use[kPipes] = 1;
  } else if (contains_any(text, {"vasl", "vasr", "vlsr", "vnormamt", "vcl0", "vround"})) {
    use[kShift] = use[kPipes] = 1;
  } else if (contains_any(text, {"= v", "vand", "|= vand"})) {
    use[kPipes] = width;
  }
  return use;
}

/// Instructions of each packet by its address. Empty where llvm-objdump-14 is not installed.
inline std::map<std::uint64_t, std::vector<std::string>> disassemble(
    const std::filesystem::path& program) {
  std::map<std::uint64_t, std::vector<std::string>> packets;
  const auto command = fmt::format(
      "llvm-objdump-14 -d --no-show-raw-insn --mcpu=hexagonv60 --mattr=+hvxv60,+hvx-length128b "
      "'{}' "
      "2>/dev/null",
      program.string());
  const std::unique_ptr<std::FILE, int (*)(std::FILE*)> out(::popen(command.c_str(), "r"),
                                                            ::pclose);
  std::array<char, 1000> buffer;
  std::uint64_t packet = 0;
  while (out && std::fgets(buffer.data(), buffer.size(), out.get()) != nullptr) {
    const std::string line = buffer.data();
    const auto colon = line.find(':');
    const auto tab = line.find('\t');
    if (colon == std::string::npos || tab == std::string::npos || colon > tab) continue;
    if (line.find('{') < tab) packet = std::stoull(line, nullptr, 16);
    std::string text = line.substr(tab + 1);
    text.resize(std::min(text.find(" }"), text.find('\n')));
    packets[packet].push_back(text);
  }
  return packets;
}

/// Of a whole command: @p profile as the plugin has written it.
inline Usage usage_of_command(const std::filesystem::path& profile,
                              const std::map<std::uint64_t, std::vector<std::string>>& packets) {
  Usage all{};
  std::ifstream file(profile);
  std::uint64_t address = 0;
  for (std::uint64_t count = 0; file >> std::hex >> address >> std::dec >> count;) {
    const auto found = packets.find(address);
    if (found == packets.end()) continue;
    for (const std::string& text : found->second) {
      const Usage use = usage_of(text);
      for (std::size_t i = 0; i < kResources; ++i) {
        all[i] += use[i] * static_cast<double>(count);
      }
    }
  }
  return all;
}

/// The resource that needs the most packets, and how many.
inline std::pair<Resource, double> busiest(const Usage& usage) {
  std::size_t most = 0;
  for (std::size_t i = 1; i < kResources; ++i) {
    if (usage[i] / kCapacities[i] > usage[most] / kCapacities[most]) most = i;
  }
  return {static_cast<Resource>(most), usage[most] / kCapacities[most]};
}

}  // namespace pirt::bench
