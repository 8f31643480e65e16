// Making a program slower on purpose, to see whether a gate notices: extra work in proportion,
// never a sleep.
#pragma once

#include <cstdint>
#include <memory>
#include <string>

#include "workloads/base/time.h"
#include "workloads/model/backend.h"

namespace pirt {

/// What a step takes as a multiple of what it would take; 1 = nothing is injected.
struct Injection {
  double execute = 1;
  double prepare = 1;
  double scheduler = 1;
  [[nodiscard]] bool any() const { return execute > 1 || prepare > 1 || scheduler > 1; }
};

/// "execute=1.1" or "prepare=1.2,scheduler=1.1". @throws Error{kBadInput} if it is not of that
/// form, or a factor is not within [1, 100].
[[nodiscard]] Injection parse_injection(const std::string& text);
/// What parse_injection reads; "" if nothing is injected.
[[nodiscard]] std::string to_string(const Injection& injection);

/// A loop that keeps one core busy: a chain of integer operations that no compiler shortens.
class ExtraWork {
 public:
  /// Times the loop: about 2 ms.
  explicit ExtraWork(const Clock& clock);
  /// Steps that take @p time when nothing disturbs.
  [[nodiscard]] std::int64_t steps_for(Nanos time) const;
  static void run(std::int64_t steps);

 private:
  double steps_per_ns_ = 1;
};

/// @p kernel with the same steps of extra work after each execution, which are those that @p factor
/// takes of the shortest of five executions now.
/// @param kernel  Prepared and bound.
[[nodiscard]] std::unique_ptr<Kernel> slowed(std::unique_ptr<Kernel> kernel, double factor,
                                             const Clock& clock);

}  // namespace pirt
