// What a thread does that waits awake.
#pragma once

#include <thread>

namespace pirt {

/// Tells the core that nothing is to be done yet, which saves energy and lets its other thread run.
inline void pause_core() {
#if defined(__x86_64__) || defined(__i386__)
  __builtin_ia32_pause();
#elif defined(__aarch64__) || defined(__arm__)
  asm volatile("yield");
#else
  std::this_thread::yield();
#endif
}

}  // namespace pirt
