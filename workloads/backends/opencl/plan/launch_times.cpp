#include "workloads/backends/opencl/plan/launch_times.h"

#include <algorithm>

namespace pirt::opencl {

void LaunchSum::add(Nanos queued, Nanos start, Nanos end) {
  total_ += std::max(Nanos{0}, start - std::max(queued, previous_end_));
  previous_end_ = end;
}

void LaunchTimes::add(cl::Event event) {
  live_.push_back(std::move(event));
  if (live_.size() == kMaxLive) fold(kMaxLive / 2);
}

std::optional<Nanos> LaunchTimes::finish() {
  if (!live_.empty()) fold(live_.size());
  return has_clock_ ? std::optional(sum_.total()) : std::nullopt;
}

void LaunchTimes::fold(std::size_t count) {
  const auto stamp = [](const cl::Event& event, cl_profiling_info which) {
    cl_ulong value = 0;
    event.getProfilingInfo(which, &value);
    return Nanos(static_cast<Nanos::rep>(value));
  };
  // The queue is in order: the last one's end is everybody's. wait() flushes the queue as well.
  live_[count - 1].wait();
  for (std::size_t i = 0; has_clock_ && i < count; ++i) {
    sum_.add(stamp(live_[i], CL_PROFILING_COMMAND_QUEUED),
             stamp(live_[i], CL_PROFILING_COMMAND_START),
             stamp(live_[i], CL_PROFILING_COMMAND_END));
  }
  live_.erase(live_.begin(), live_.begin() + static_cast<std::ptrdiff_t>(count));
}

}  // namespace pirt::opencl
