// How much memory this process has at most between two moments: the kernel's high-water mark of
// what is resident, which is set back first.
#pragma once

#include <cstdint>
#include <optional>

namespace pirt {

class ResidentMemory {
 public:
  /// Begins; whoever has memory already keeps it.
  ResidentMemory();

  /// Of what is resident, the highest since it began less what there was then; absent where the
  /// kernel does not tell (/proc/self/clear_refs and status).
  [[nodiscard]] std::optional<std::int64_t> added_bytes() const;
  /// The same of what is resident now, which may have become less.
  [[nodiscard]] std::int64_t kept_bytes() const;

 private:
  std::optional<std::int64_t> before_bytes_;
};

}  // namespace pirt
