// What the processor at hand has beyond what all of pirt is compiled for.
#pragma once

namespace pirt {

#ifdef __x86_64__
[[nodiscard]] inline bool has_avx2() { return __builtin_cpu_supports("avx2") != 0; }
[[nodiscard]] inline bool has_avx2_and_fma() {
  return has_avx2() && __builtin_cpu_supports("fma") != 0;
}
#else
[[nodiscard]] inline bool has_avx2() { return false; }
[[nodiscard]] inline bool has_avx2_and_fma() { return false; }
#endif

}  // namespace pirt
