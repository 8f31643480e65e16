#include "workloads/backends/cpu/threads.h"

#include <dlfcn.h>

#include "workloads/backends/cpu/onednn.h"

namespace pirt::cpu {

void set_openmp_threads(int threads) {
  // oneDNN's build decides which OpenMP runtime is loaded (libgomp in Debian's); linking one here
  // might bring in a second.
  using SetThreads = void (*)(int);
  static const auto set = reinterpret_cast<SetThreads>(dlsym(RTLD_DEFAULT, "omp_set_num_threads"));
  if (set != nullptr) set(threads);
}

/// Any primitive that is large enough for a parallel region makes the OpenMP team. Where oneDNN may
/// make none (no executable memory), what needs it says so, and the rest of the unit computes.
void start_openmp_team(int threads) try {
  set_openmp_threads(threads);
  const dnnl::engine engine(dnnl::engine::kind::cpu, 0);
  dnnl::stream stream(engine);
  const dnnl::memory::desc desc({dnnl::memory::dim{16'384} * threads}, dnnl::memory::data_type::f32,
                                dnnl::memory::format_tag::a);
  const dnnl::memory values(desc, engine);
  const auto relu = describe_relu(engine, desc);
  dnnl::eltwise_forward(relu).execute(stream, {{DNNL_ARG_SRC, values}, {DNNL_ARG_DST, values}});
  stream.wait();
} catch (const dnnl::error&) {
  return;
}

}  // namespace pirt::cpu
