// The most that a run draws in any second: what a cap of power speaks of.
//
// As in a trace, joules that a call costs as a whole have no place in time and are left out.
#pragma once

#include <deque>
#include <vector>

#include "scheduler/trace/run_observer.h"
#include "scheduler/trace/server_load.h"

namespace pirt {

class PowerPeak final : public RunObserver {
 public:
  /// @param next  Hears of everything, too; null = nobody.
  PowerPeak(const Platform& platform, RunObserver* next)
      : loads_(server_loads(platform)), next_(next) {}

  void submitting(TaskId task, std::size_t pipeline, std::size_t position,
                  std::uint64_t firing) override;
  void arrived(std::size_t servers_index, std::uint32_t job, double power_w) override;
  void left(std::size_t servers_index, std::uint32_t job) override;
  void preparing(TaskId task, Nanos now, Nanos takes) override;
  void settled(Nanos now, std::span<const int> waiting) override;

  /// Joules of the fullest second so far, which is a mean power in watts.
  [[nodiscard]] double highest_w() const { return highest_w_; }

 private:
  /// From then on this power is drawn, until the next.
  struct Change {
    Nanos at{0};
    double power_w = 0;
    double before_j = 0;  ///< Joules of the run until then.
  };
  [[nodiscard]] double joules_until(Nanos time) const;
  void consider(Nanos end);

  std::vector<ServerLoad> loads_;
  RunObserver* next_;
  std::deque<Change> changes_;  ///< The last one, and those of a second before it.
  double highest_w_ = 0;
};

}  // namespace pirt
