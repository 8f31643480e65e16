// The worker pools of the two libraries of the cpu backend.
#pragma once

namespace pirt::cpu {

/// Sets the size of OpenCV's pool (one a process) and of the calling thread's OpenMP team, and
/// starts both.
void start_workers(int threads);

/// Size of the calling thread's OpenMP team, which oneDNN takes; cheap. Nothing to do where oneDNN
/// has another runtime.
void set_openmp_threads(int threads);

}  // namespace pirt::cpu
