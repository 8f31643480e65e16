// What the cores of backend fpga compute beyond the workloads' own definitions, to the last bit:
// their number formats in plain integers.
#pragma once

#include <array>
#include <bit>
#include <cmath>
#include <cstdint>

namespace pirt::test {

/// The 27 leading bits of a number below 2^60 and the zeros before them, of 60.
struct Front {
  std::int64_t bits = 0;
  int zeros = 0;
};

inline Front front_of(std::int64_t value) {
  if (value == 0) return {};
  const int zeros = std::countl_zero(static_cast<std::uint64_t>(value)) - 4;
  return {value << zeros >> 33, zeros};
}

/// 2 * numerator / det as the core has it: f32 of a quotient of 27 bits by 27, whose first 24 are
/// kept.
inline std::uint32_t flow_quotient(std::int64_t numerator, std::int64_t det) {
  if (numerator == 0 || det == 0) return 0;
  const Front a = front_of(std::abs(numerator)), b = front_of(det);
  const std::int64_t quotient = (a.bits << 24) / b.bits;  // in [2^23, 2^25)
  const bool whole = quotient >> 24 != 0;
  const int exponent = 127 + 1 + b.zeros - a.zeros - (whole ? 0 : 1);
  const std::int64_t fraction = (whole ? quotient >> 1 : quotient) & 0x7fffff;
  return static_cast<std::uint32_t>((numerator < 0 ? std::int64_t{1} << 31 : 0) |
                                    std::int64_t{exponent} << 23 | fraction);
}

/// Of the window's sums xx, xy, yy, xt, yt: v in the high half, u in the low.
inline std::uint64_t flow_of(const std::array<std::int64_t, 5>& s) {
  const auto& [xx, xy, yy, xt, yt] = s;
  const std::int64_t det = xx * yy - xy * xy;
  const std::uint64_t u = flow_quotient(xy * yt - yy * xt, det);
  const std::uint64_t v = flow_quotient(xy * xt - xx * yt, det);
  return v << 32 | u;
}

/// Twice the smaller eigenvalue in 1/64: the root cut off after 6 bits.
inline std::uint64_t score_of(std::int64_t xx, std::int64_t xy, std::int64_t yy) {
  const std::int64_t square = ((xx - yy) * (xx - yy) + 4 * xy * xy) << 12;  // below 2^61
  auto root = static_cast<std::int64_t>(std::sqrt(static_cast<double>(square)));
  while (root * root > square) --root;
  while ((root + 1) * (root + 1) <= square) ++root;
  return static_cast<std::uint64_t>(((xx + yy) << 6) - root);
}

}  // namespace pirt::test
