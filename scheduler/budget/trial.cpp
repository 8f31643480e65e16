#include "scheduler/budget/trial.h"

#include <algorithm>
#include <utility>

#include "scheduler/dispatcher/dispatcher.h"
#include "scheduler/record/keeping_up.h"
#include "scheduler/record/summary.h"
#include "scheduler/virtual/virtual_time.h"
#include "workloads/base/math/random.h"

namespace pirt {
namespace {

/// Tasks a second of pipelines with a rate.
double task_rate(const Mix& mix) {
  double rate = 0;
  for (const Pipeline& pipeline : mix.pipelines) {
    rate += pipeline.rate_hz.value_or(0) * static_cast<double>(pipeline.tasks.size());
  }
  return rate;
}

}  // namespace

Trial::Trial(const ModeSetup& setup, double tasks, bool slices)
    : setup_(setup),
      mix_(setup.scenario.mix),
      joules_known_(without_joules(setup.scenario, setup.policy_setup.budget) == nullptr) {
  const Scenario& run = setup.scenario;
  for (Pipeline& pipeline : mix_.pipelines) {
    if (!pipeline.frames) continue;
    const auto most = static_cast<std::int64_t>(tasks / static_cast<double>(pipeline.tasks.size()));
    pipeline.frames =
        std::clamp<std::int64_t>(*pipeline.frames, 1, std::max<std::int64_t>(1, most));
  }
  scenario_.emplace(Scenario{.platform = run.platform,
                             .mix = mix_,
                             .services = run.services,
                             .classes = run.classes,
                             .in_flight = run.in_flight,
                             .duration = run.duration,
                             .seed = derive_seed(run.seed, "trial"),
                             .slices = run.slices});
  if (!slices) scenario_->keep_calls_whole();
  if (mix_.open_loop()) {
    scenario_->duration = std::min(run.duration, from_s(std::min(tasks / task_rate(mix_), 60.0)));
  }
}

TrialResult Trial::run(const BudgetChoice& choice) {
  PolicySetup policy = setup_.policy_setup;
  policy.budget = choice.plan;
  return run(setup_.mode.policy.make(policy), choice.in_flight);
}

TrialResult Trial::run(std::unique_ptr<Policy> policy, std::vector<int> in_flight) {
  scenario_->in_flight = std::move(in_flight);
  Dispatcher dispatcher(setup_.slots, std::move(policy));
  const Tally tally = VirtualTime(*scenario_, dispatcher).run();
  const RunRecord record = summarize(*scenario_, nullptr, {}, tally);
  tasks_run_ += record.submitted;
  TrialResult result{.rate_per_ms = record.throughput_per_ms.value_or(0),
                     .latency_ms = record.mean_latency_ms.value_or(0)};
  if (joules_known_ && record.energy_j && record.completed > 0) {
    result.energy_mj = *record.energy_j * 1e3 / static_cast<double>(record.completed);
  }
  result.misses += record.stalled;
  result.late = record.stalled + real_time_losses(record);
  for (const PipelineResult& pipeline : record.pipelines) {
    if (!pipeline.deadline_ms) continue;
    result.misses += *pipeline.deadline_misses + pipeline.dropped;
  }
  return result;
}

}  // namespace pirt
