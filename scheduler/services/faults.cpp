#include "scheduler/services/faults.h"

#include "workloads/base/math/random.h"

namespace pirt {

Outcome Faults::outcome(std::uint64_t stream, std::uint64_t firing, std::uint64_t task,
                        std::uint32_t tries) const {
  const std::uint64_t call =
      hash_u64(hash_u64(hash_u64(hash_u64(seed, stream), firing), task), tries);
  const double draw = static_cast<double>(call >> 11U) * 0x1p-53;
  if (draw < failing) return Outcome::kFailed;
  return draw < failing + returning ? Outcome::kReturned : Outcome::kCompleted;
}

}  // namespace pirt
