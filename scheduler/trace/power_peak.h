// The most that a run draws in any second: what a cap of power speaks of. What units draw idle they
// draw before it and after it, too.
#pragma once

#include <deque>

#include "scheduler/trace/server_load.h"

namespace pirt {

class PowerPeak final : public LoadObserver {
 public:
  explicit PowerPeak(const Platform& platform);

  void settled(Nanos now, std::span<const int> waiting) override;

  /// Joules of the fullest second so far, which is a mean power in watts.
  [[nodiscard]] double highest_w() const { return idle_w_ + highest_w_; }

 private:
  /// From then on this power is drawn, until the next.
  struct Change {
    Nanos at{0};
    double power_w = 0;   ///< Above what is drawn idle.
    double before_j = 0;  ///< Joules of the run until then, likewise.
  };
  [[nodiscard]] double joules_until(Nanos time) const;
  void consider(Nanos end);

  std::deque<Change> changes_;  ///< The last one, and those of a second before it.
  double idle_w_ = 0;
  double highest_w_ = 0;
};

}  // namespace pirt
