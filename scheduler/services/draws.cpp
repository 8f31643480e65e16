#include "scheduler/services/draws.h"

#include <algorithm>

namespace pirt {

bool draws_times(const Platform& platform, const Mix& mix) {
  const auto varies = [](const Distribution& time) {
    return time.kind != Distribution::Kind::kConstant;
  };
  const auto is_drawn = [&](const Stage& stage) { return varies(stage.time); };
  if (std::ranges::any_of(platform.links,
                          [&](const auto& link) { return varies(link.second.latency); })) {
    return true;
  }
  for (const Pipeline& pipeline : mix.pipelines) {
    if (pipeline.jitter > Nanos::zero()) return true;
    for (const MixTask& task : pipeline.tasks) {
      const auto model = platform.workloads.find(task.workload);
      if (model == platform.workloads.end()) continue;
      for (const auto& [unit, stages] : model->second.stages) {
        if (std::ranges::any_of(stages, is_drawn)) return true;
      }
    }
  }
  return false;
}

}  // namespace pirt
