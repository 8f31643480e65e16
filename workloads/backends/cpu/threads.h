// The worker pool of oneDNN, which is an OpenMP team. OpenCV has none here: see bands.h.
#pragma once

namespace pirt::cpu {

/// Size of the calling thread's OpenMP team, which oneDNN takes; cheap. Nothing to do where oneDNN
/// has another runtime.
void set_openmp_threads(int threads);

/// Sets that size and makes the team.
void start_openmp_team(int threads);

}  // namespace pirt::cpu
