// What works on the servers of a unit or a link, and what it draws.
#pragma once

#include <algorithm>
#include <cstdint>
#include <deque>
#include <utility>
#include <vector>

#include "characterize/platform/platform.h"

namespace pirt {

struct ServerLoad {
  int servers = 1;
  Discipline discipline = Discipline::kFifo;
  double idle_w = 0;
  double beside_w = 0;  ///< What is drawn beside what the servers do.
  std::deque<std::pair<std::uint32_t, double>> jobs = {};  ///< By arrival, with their watts.

  void arrived(std::uint32_t job, double power_w) { jobs.emplace_back(job, power_w); }
  /// Nothing, if it is not there.
  void departed(std::uint32_t job) {
    std::erase_if(jobs, [job](const auto& each) { return each.first == job; });
  }
  [[nodiscard]] double power_w() const;
};

/// Units in order, then links: as RunObserver counts them.
[[nodiscard]] std::vector<ServerLoad> server_loads(const Platform& platform);

}  // namespace pirt
