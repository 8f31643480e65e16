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

 private:
  Nanos total_{0};
  Nanos previous_end_ = Nanos::min();
};

/// Collects the events of one execute() and folds their stamps into a LaunchSum, keeping few of
/// them alive.
class LaunchTimes {
 public:
  /// @param has_clock  Whether their stamps tell the time (DeviceSession::has_clock).
  explicit LaunchTimes(bool has_clock) : has_clock_(has_clock) {}

  /// @param event  Of the command enqueued last. Once 256 are alive it waits for the older half,
  /// while the
  ///               younger half keeps the device busy.
  void add(cl::Event event);
  /// The sum over all commands added, where there is a clock. Waits for the last one.
  [[nodiscard]] std::optional<Nanos> finish();

 private:
  static constexpr std::size_t kMaxLive = 256;
  void fold(std::size_t count);

  bool has_clock_;
  std::vector<cl::Event> live_;
  LaunchSum sum_;
};

}  // namespace pirt::opencl
