#include "workloads/backends/opencl/plan/launch_times.h"

#include <algorithm>

namespace pirt::opencl {

void LaunchSum::add(Nanos queued, Nanos start, Nanos end) {
  total_ += std::max(Nanos{0}, start - std::max(queued, previous_end_));
  if (first_start_ == Nanos::min()) first_start_ = start;
  previous_end_ = end;
}

void Launches::count() {
  if (waiting_ == kMostWaiting) finish();
  ++waiting_;
}

void Launches::foreign() {
  count();
  known_ = false;
}

cl::Event* Launches::next() {
  count();
  return stamped_ ? &events_.emplace_back() : nullptr;
}

void Launches::finish() {
  const auto stamp = [](const cl::Event& event, cl_profiling_info which) {
    cl_ulong value = 0;
    event.getProfilingInfo(which, &value);
    return Nanos(static_cast<Nanos::rep>(value));
  };
  queue_.finish();
  for (const cl::Event& event : events_) {
    stamps_.add(stamp(event, CL_PROFILING_COMMAND_QUEUED), stamp(event, CL_PROFILING_COMMAND_START),
                stamp(event, CL_PROFILING_COMMAND_END));
  }
  events_.clear();
  waiting_ = 0;
}

}  // namespace pirt::opencl
