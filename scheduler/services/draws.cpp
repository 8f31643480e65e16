#include "scheduler/services/draws.h"

#include <algorithm>

namespace pirt {

bool draws_times(const Platform& platform, const Mix& mix) {
  const auto is_drawn = [](const Stage& stage) {
    return stage.time.kind != Distribution::Kind::kConstant;
  };
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
