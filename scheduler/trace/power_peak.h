// The most that a run draws in any second: what a cap of power speaks of. What units draw idle they
// draw before it and after it, too.
#pragma once

#include <deque>
#include <vector>

#include "scheduler/trace/run_observer.h"
#include "scheduler/trace/server_load.h"

namespace pirt {

class PowerPeak final : public RunObserver {
 public:
  explicit PowerPeak(const Platform& platform);

  void arrived(std::size_t servers_index, std::uint32_t job, double power_w) override {
    loads_[servers_index].arrived(job, power_w);
  }
  void departed(std::size_t servers_index, std::uint32_t job) override {
    loads_[servers_index].departed(job);
  }
  void drawing(std::size_t servers_index, double by_w) override {
    loads_[servers_index].beside_w += by_w;
  }
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

  std::vector<ServerLoad> loads_;
  std::deque<Change> changes_;  ///< The last one, and those of a second before it.
  double idle_w_ = 0;
  double highest_w_ = 0;
};

}  // namespace pirt
