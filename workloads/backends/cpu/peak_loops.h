// The loops that reach for the limits of the host's cores: multiply-adds, 8-bit dot products,
// reading.
//
// Written for x86 extensions chosen at run time, and in the compiler's portable vectors for all
// other processors; oneDNN's matrix products are candidates as well (AMX, SVE, what else it knows).
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string_view>
#include <vector>

#include "workloads/backends/cpu/core_team.h"
#include "workloads/model/peak.h"

namespace pirt::cpu {

/// For loops that every processor has the instructions of.
inline bool always() { return true; }

/// An arithmetic loop on one core.
struct ChainLoop {
  std::string_view name;
  bool (*available)();  ///< Whether this processor has the instructions.
  int values;           ///< Independent chains; starts repeat with peak_math::kStarts.
  /// Moves each of the values on by @p iterations.
  void (*run)(float* values, std::int64_t iterations);
};

/// A loop of 8-bit dot products on one core.
struct DotLoop {
  static constexpr int kRows = 64;  ///< Of data; as many in turn as there are iterations.

  std::string_view name;
  bool (*available)();
  int lanes;    ///< 32-bit sums of one register.
  int weights;  ///< Registers of weights, each with sums of its own.
  /// For each iteration i, weight w and lane l:
  /// sums[w][l] += dot of the 4 bytes data[i % kRows][l] and weights[w][l].
  /// @param data     [kRows][lanes][4], 0 to 127, aligned to 64 bytes; weights [weights][lanes][4],
  ///                 -64 to 63, aligned; sums [weights][lanes], aligned.
  /// @param iterations  Even.
  void (*run)(const std::uint8_t* data, const std::int8_t* weights, std::int32_t* sums,
              std::int64_t iterations);
};

/// A reading loop on one core.
struct ReadLoop {
  static constexpr std::size_t kGrain = 4096;  ///< Bytes; sizes are multiples of it.

  std::string_view name;
  bool (*available)();
  /// The sum of the words modulo 2^32. @param words  Aligned to 64 bytes.
  std::uint32_t (*sum)(const std::uint32_t* words, std::size_t size_bytes);
};

[[nodiscard]] std::span<const ChainLoop> chain_loops();
[[nodiscard]] std::span<const DotLoop> dot_loops();
[[nodiscard]] std::span<const ReadLoop> read_loops();

/// oneDNN's product of two square matrices. @param kind  kF32 or kInt8.
/// @throws dnnl::error if this processor cannot.
[[nodiscard]] std::unique_ptr<PeakLoop> make_matmul_loop(PeakKind kind, int threads);

/// What reading the memory goes through, over all cores of the unit: four times the last caches of
/// the whole machine, so that a pass finds next to nothing of the one before in whatever cache it
/// may lie; beyond 1 GB twice, which is enough where what was not read for longest makes room, and
/// takes seconds to fill. Absent where @p most is less than that.
/// @param caches  All last caches; absent = not known.
[[nodiscard]] std::optional<std::int64_t> memory_read_bytes(std::optional<std::int64_t> caches,
                                                            std::int64_t most);

/// All that this processor can run, on the cores that the calling thread may use now.
[[nodiscard]] PeakLoops make_peak_loops(int threads);

}  // namespace pirt::cpu
