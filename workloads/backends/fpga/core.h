// A streaming core, cycle by cycle: what it sees on its ports and what it shows there. The cores
// are cores/*.v, verilated.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <string_view>

namespace pirt::fpga {

/// What a core's ports are driven with until the next edge of its clock.
struct Driven {
  bool in_valid = false;
  std::uint64_t in_data = 0;
  bool out_ready = false;
};

/// What it answers: an element is taken where in_valid and in_ready are set at the edge, and given
/// where out_valid and out_ready are.
struct Shown {
  bool in_ready = false;
  bool out_valid = false;
  std::uint64_t out_data = 0;
};

/// One core. Used by one thread at a time.
class Core {
 public:
  virtual ~Core() = default;
  /// Resets it for pictures of @p width x @p height, and sets its parameters, if it has any.
  virtual void start(int width, int height, std::span<const std::uint8_t> parameters) = 0;
  /// What it shows while it is driven so; before the edge.
  virtual Shown show(const Driven& driven) = 0;
  /// The edge.
  virtual void clock() = 0;
};

/// What is known of a core without its RTL.
struct CoreType {
  std::string_view name;  ///< Of its file and module.
  std::unique_ptr<Core> (*make)();
  int max_width;  ///< Of a picture: its line buffers'.
  int min_width, min_height;
};

/// @throws std::logic_error if there is none of that name.
[[nodiscard]] const CoreType& find_core(std::string_view name);
/// All of them.
[[nodiscard]] std::span<const CoreType> cores();

}  // namespace pirt::fpga
