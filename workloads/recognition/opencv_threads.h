// OpenCV has one count of threads for the whole process, which networks and kernels want otherwise.
// Nothing else in pirt sets it.
#pragma once

namespace pirt::recognition {

/// OpenCV computes on so many threads while one is there. Those of one thread are there side by
/// side, one of more alone: another one waits for it.
class OpencvThreads {
 public:
  /// @param count  0 = as many as it has.
  explicit OpencvThreads(int count);
  ~OpencvThreads();
  OpencvThreads(const OpencvThreads&) = delete;
  OpencvThreads& operator=(const OpencvThreads&) = delete;

 private:
  int count_;
};

/// OpenCV computes on the thread that calls it from now on: for kernels that are split over threads
/// of their own. Waits for nobody: what an OpencvThreads has stays as long as that is there.
void compute_on_calling_thread();

}  // namespace pirt::recognition
