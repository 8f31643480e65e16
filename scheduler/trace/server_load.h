// What works on the servers of units and links, and what that draws.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <utility>
#include <vector>

#include "characterize/platform/platform.h"
#include "scheduler/trace/run_observer.h"

namespace pirt {

/// Of a unit, or of a link.
struct ServerLoad {
  int servers = 1;
  Discipline discipline = Discipline::kFifo;
  double idle_w = 0;
  double beside_w = 0;  ///< What is drawn beside what the servers do.
  std::deque<std::pair<std::uint32_t, double>> jobs = {};  ///< By arrival, with their watts.

  [[nodiscard]] double power_w() const {
    const bool shared = discipline == Discipline::kProcessorSharing;
    const auto all = static_cast<double>(jobs.size());
    const double rate = shared && all > servers ? servers / all : 1;
    const std::size_t served =
        shared ? jobs.size() : std::min(jobs.size(), static_cast<std::size_t>(servers));
    double sum = idle_w + beside_w;
    for (std::size_t i = 0; i < served; ++i) sum += rate * jobs[i].second;
    return sum;
  }
};

/// Follows the loads of a run.
class LoadObserver : public RunObserver {
 public:
  void arrived(std::size_t servers_index, std::uint32_t job, double power_w) final {
    loads_[servers_index].jobs.emplace_back(job, power_w);
  }
  /// Nothing, if it is not there.
  void departed(std::size_t servers_index, std::uint32_t job) final {
    std::erase_if(loads_[servers_index].jobs,
                  [job](const auto& each) { return each.first == job; });
  }
  /// Nothing, if it is not there.
  void draws(std::size_t servers_index, std::uint32_t job, double power_w) final {
    for (auto& [id, watts] : loads_[servers_index].jobs) {
      if (id == job) watts = power_w;
    }
  }
  void drawing(std::size_t servers_index, double by_w) final {
    loads_[servers_index].beside_w += by_w;
  }

 protected:
  explicit LoadObserver(const Platform& platform) {
    for (const auto& unit : platform.units) {
      loads_.push_back(
          {.servers = unit.servers, .discipline = unit.discipline, .idle_w = unit.standing_w()});
    }
    loads_.resize(loads_.size() + platform.links.size());
  }

  std::vector<ServerLoad> loads_;  ///< Units in order, then links: as RunObserver counts them.
};

}  // namespace pirt
