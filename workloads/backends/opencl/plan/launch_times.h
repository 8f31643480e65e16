// How long commands waited between submission and start, from the device's own stamps.
#pragma once

#include <optional>
#include <vector>

#include "workloads/backends/opencl/device/api.h"
#include "workloads/base/time.h"

namespace pirt::opencl {

/// Sums max(0, START_i - max(QUEUED_i, END_{i-1})) over the commands of an in-order queue: the time
/// in which the device could have begun a command and had not. Waiting for the command before is
/// not launching.
class LaunchSum {
 public:
  /// @param queued, start, end  Stamps of the next command, on the device's clock.
  void add(Nanos queued, Nanos start, Nanos end);
  [[nodiscard]] Nanos total() const { return total_; }
  /// From the first one's start to the last one's end.
  [[nodiscard]] Nanos span() const { return previous_end_ - first_start_; }

 private:
  Nanos total_{0};
  Nanos first_start_ = Nanos::min();
  Nanos previous_end_ = Nanos::min();
};

/// The commands of one execution: waits for them, with or without their stamps. These have a price
/// (NVIDIA's driver takes 8 us more for a command whose event is asked for, which is as much as the
/// command), so that calls go without.
class Launches {
 public:
  /// @param stamped  Whether stamps() are wanted.
  Launches(const cl::CommandQueue& queue, bool stamped) : queue_(queue), stamped_(stamped) {}
  /// Waits for what a failure has left under way: it may read what the caller has.
  ~Launches() {
    if (waiting_ > 0) clFinish(queue_());
  }
  Launches(const Launches&) = delete;
  Launches& operator=(const Launches&) = delete;

  /// For the next command: where its event goes, null = nowhere. Waits now and then, so that no
  /// driver has to hold thousands of commands.
  [[nodiscard]] cl::Event* next();
  /// For commands of somebody else's, which follow: what they wait for is not known.
  void foreign();
  /// Waits for all.
  void finish();
  /// Of all that finish() waited for; absent with foreign commands among them.
  [[nodiscard]] std::optional<LaunchSum> stamps() const {
    return known_ ? std::optional(stamps_) : std::nullopt;
  }

 private:
  static constexpr std::size_t kMostWaiting = 256;

  void count();

  const cl::CommandQueue& queue_;
  bool stamped_;
  bool known_ = true;
  std::size_t waiting_ = 0;
  std::vector<cl::Event> events_;
  LaunchSum stamps_;
};

}  // namespace pirt::opencl
