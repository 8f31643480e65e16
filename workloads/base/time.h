// Time in pirt: int64 nanoseconds everywhere, floating point only when printing.
#pragma once

#include <chrono>
#include <cmath>
#include <cstdint>

namespace pirt {

using Nanos = std::chrono::duration<std::int64_t, std::nano>;

[[nodiscard]] constexpr double to_ms(Nanos t) { return static_cast<double>(t.count()) / 1e6; }
[[nodiscard]] constexpr double to_us(Nanos t) { return static_cast<double>(t.count()) / 1e3; }
[[nodiscard]] constexpr double to_s(Nanos t) { return static_cast<double>(t.count()) / 1e9; }
[[nodiscard]] inline Nanos from_ms(double ms) { return Nanos(std::llround(ms * 1e6)); }
[[nodiscard]] inline Nanos from_s(double s) { return Nanos(std::llround(s * 1e9)); }

/// @p time and then @p more, at most Nanos::max().
[[nodiscard]] constexpr Nanos later_by(Nanos time, Nanos more) {
  return more > Nanos::zero() && time > Nanos::max() - more ? Nanos::max() : time + more;
}

/// @p time times @p factor, to the nearest nanosecond.
[[nodiscard]] inline Nanos scaled(Nanos time, double factor) {
  return Nanos(std::llround(factor * static_cast<double>(time.count())));
}

/// A source of time. Measuring code reads one; a device that simulates its own time provides one.
class Clock {
 public:
  virtual ~Clock() = default;
  [[nodiscard]] virtual Nanos now() const = 0;
};

/// The machine's monotonic clock.
class MachineClock : public Clock {
 public:
  [[nodiscard]] Nanos now() const override {
    return std::chrono::steady_clock::now().time_since_epoch();
  }
};

}  // namespace pirt
