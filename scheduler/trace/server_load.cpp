#include "scheduler/trace/server_load.h"

namespace pirt {

double ServerLoad::power_w() const {
  const bool shared = discipline == Discipline::kProcessorSharing;
  const auto all = static_cast<double>(jobs.size());
  const double rate = shared && all > servers ? servers / all : 1;
  const std::size_t served =
      shared ? jobs.size() : std::min(jobs.size(), static_cast<std::size_t>(servers));
  double sum = idle_w + beside_w;
  for (std::size_t i = 0; i < served; ++i) sum += rate * jobs[i].second;
  return sum;
}

std::vector<ServerLoad> server_loads(const Platform& platform) {
  std::vector<ServerLoad> loads;
  for (const auto& unit : platform.units) {
    loads.push_back(
        {.servers = unit.servers, .discipline = unit.discipline, .idle_w = unit.standing_w()});
  }
  loads.resize(loads.size() + platform.links.size());
  return loads;
}

}  // namespace pirt
