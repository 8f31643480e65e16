// What a device is besides, if it computes elsewhere, over a way that may be lost and come back.
#pragma once

#include <cstdint>
#include <optional>

#include "workloads/base/time.h"

namespace pirt {

class Kernel;

/// What was measured of the way there while it was used.
struct LinkEstimate {
  std::optional<Nanos> round_trip;
  std::optional<double> bytes_per_s;  ///< From here; absent until something large was sent.
  std::int64_t late_replies = 0;      ///< To calls that nobody waited for any more: dropped.
};

/// A device whose kernels may be prepared, and used, by several threads at a time; each kernel by
/// one.
class Remote {
 public:
  /// Whether a call that is made now gets there and is computed. Any thread may ask.
  [[nodiscard]] virtual bool is_reachable() const = 0;
  /// Nobody wants the call any more that the kernel is bound for: it ends soon, as it would have or
  /// with an Error{kEnvironment}. Any thread, while the kernel is bound.
  virtual void withdraw(Kernel& kernel) = 0;
  /// Nobody takes the result of the call that the kernel is bound for once @p time_left is over.
  virtual void expires_in(Kernel& kernel, Nanos time_left) = 0;
  /// For how long a call waits for the way there, or back, before it ends with an error.
  [[nodiscard]] virtual Nanos patience() const = 0;
  /// Any thread.
  [[nodiscard]] virtual LinkEstimate link() const = 0;
  /// Another number whenever those there may serve other workloads than before. Any thread.
  [[nodiscard]] virtual std::uint64_t heard() const = 0;

 protected:
  ~Remote() = default;
};

}  // namespace pirt
