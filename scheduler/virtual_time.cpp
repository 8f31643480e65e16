#include "scheduler/virtual_time.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <functional>
#include <utility>

#include "scheduler/transfers.h"
#include "workloads/base/random.h"

namespace pirt {

/// One thing after the other that a started task goes through.
struct VirtualTime::Step {
  static constexpr std::uint32_t kDelay = UINT32_MAX;
  std::uint32_t servers = kDelay;  ///< Position in servers_, or a pure delay.
  Distribution time;               ///< Before the scale.
  Nanos scaled{0};                 ///< Of a constant.
  double scale = 1;
  bool powered = false;   ///< Its server time draws the unit's active_w.
  bool for_data = false;  ///< A delay until the data of the predecessors is there.
};

struct VirtualTime::TaskPlan {
  WorkloadId workload = 0;
  bool image_input = false;
  std::vector<GraphEdge> edges;          ///< From its predecessors; empty if none takes time.
  std::vector<std::vector<Step>> steps;  ///< By unit.
};

struct VirtualTime::PipelineState {
  const Pipeline* pipeline = nullptr;
  std::uint32_t first_plan = 0;
  std::uint32_t image_tasks = 0;
  std::uint64_t seed = 0;
  bool has_edges = false;  ///< Some task's plan has edges.
  int in_flight = 0;       ///< Firings; of closed loops.
  int refires = 0;         ///< Of it in refires_.
  bool starving = false;   ///< A closed loop with nothing in flight that waits for a buffer.
};

struct VirtualTime::Firing {
  std::uint32_t pipeline = 0;
  std::uint32_t tasks_left = 0;
  std::uint32_t images_left = 0;
  bool complete = true;
  std::uint64_t number = 0;
  Nanos fired_at{0};
  /// Where and when each task of the pipeline completed; empty unless the pipeline has edges.
  std::vector<std::pair<UnitId, Nanos>> finished = {};
};

struct VirtualTime::Job {
  TaskId id = 0;
  FiringIndex firing = 0;
  std::uint32_t plan = 0;
  UnitId unit = 0;
  std::uint32_t step = 0;
  Nanos dispatched_at{0};
};

struct VirtualTime::Timer {
  Moment moment;
  bool fires = false;       ///< A pipeline; otherwise the end of a job's delay.
  std::uint32_t index = 0;  ///< Of the pipeline or the job.
  friend auto operator<=>(const Timer&, const Timer&) = default;
};

namespace {

bool takes_time(const GraphEdge& edge) {
  const auto any = [](const std::vector<Nanos>& times) {
    return std::ranges::any_of(times, [](Nanos time) { return time > Nanos::zero(); });
  };
  return edge.delay > Nanos::zero() || any(edge.leave) || any(edge.enter);
}

}  // namespace

VirtualTime::~VirtualTime() = default;

VirtualTime::VirtualTime(const VirtualSetup& setup, Dispatcher& dispatcher)
    : setup_(setup), dispatcher_(dispatcher) {
  for (const auto& unit : setup.platform.units)
    servers_.push_back(make_servers(unit.servers, unit.discipline));
  for (std::size_t i = 0; i < setup.platform.links.size(); ++i) {
    servers_.push_back(make_servers(1, Discipline::kFifo));
  }
  plan_tasks();
  tally_.units.resize(setup.platform.units.size());
  tally_.pipelines.resize(setup.mix.pipelines.size());
  tally_.calls.assign(setup.services.workloads.size(),
                      std::vector<std::int64_t>(setup.platform.units.size(), 0));
}

void VirtualTime::plan_tasks() {
  for (std::uint32_t p = 0; p < setup_.mix.pipelines.size(); ++p) {
    const Pipeline& pipeline = setup_.mix.pipelines[p];
    PipelineState state;
    state.pipeline = &pipeline;
    state.first_plan = static_cast<std::uint32_t>(plans_.size());
    state.seed = derive_seed(setup_.seed, pipeline.name);
    for (std::size_t t = 0; t < pipeline.tasks.size(); ++t) {
      const TaskClass& kind = setup_.classes[p][t];
      TaskPlan plan{
          .workload = kind.workload, .image_input = kind.image_input, .edges = {}, .steps = {}};
      auto edges = edges_into(setup_.platform, pipeline, t);
      if (std::ranges::any_of(edges, takes_time)) plan.edges = std::move(edges);
      state.has_edges = state.has_edges || !plan.edges.empty();
      for (UnitId unit = 0; unit < setup_.platform.units.size(); ++unit) {
        plan.steps.push_back(contains(kind.eligible, unit)
                                 ? plan_steps(pipeline.tasks[t], plan, unit)
                                 : std::vector<Step>{});
      }
      plans_.push_back(std::move(plan));
      state.image_tasks += kind.image_input ? 1 : 0;
    }
    pipelines_.push_back(state);
  }
}

/// A call on a linked unit is: inputs over the link, the stages, outputs back. They travel at each
/// call, wherever the predecessor ran.
std::vector<VirtualTime::Step> VirtualTime::plan_steps(const MixTask& task, const TaskPlan& plan,
                                                       UnitId unit) const {
  const Service& service = *setup_.services.find(plan.workload, unit);
  const bool moves_data = task.service.empty();
  const CallBytes bytes = call_bytes(task);
  std::vector<Step> steps;
  if (!plan.edges.empty()) steps.push_back({.time = {}, .for_data = true});
  if (moves_data) add_transfer(steps, unit, bytes.in);
  for (const auto& stage : service.stages) {
    steps.push_back({.servers = stage.on.value_or(Step::kDelay),
                     .time = stage.time,
                     .scaled = stage.mean(),
                     .scale = stage.scale,
                     .powered = !service.metered_j});
  }
  if (moves_data) add_transfer(steps, unit, bytes.out);
  return steps;
}

/// The link is busy while it sends (bytes * 8 / mbit_s); the latency that follows is a delay,
/// during which it may send again.
void VirtualTime::add_transfer(std::vector<Step>& steps, UnitId unit,
                               std::int64_t size_bytes) const {
  const auto& name = setup_.platform.units[unit].link;
  if (name.empty()) return;
  const auto link = setup_.platform.links.find(name);
  const auto position = std::distance(setup_.platform.links.begin(), link);
  const Nanos sending = sending_time(link->second, size_bytes);
  steps.push_back({.servers = static_cast<std::uint32_t>(setup_.platform.units.size()) +
                              static_cast<std::uint32_t>(position),
                   .time = {.low = sending, .high = sending},
                   .scaled = sending});
  steps.push_back({.time = link->second.latency, .scaled = link->second.latency.mean()});
}

Tally VirtualTime::run() {
  begin();
  while (advance()) settle();
  for (std::size_t w = 0; w < tally_.calls.size(); ++w) {
    for (UnitId unit = 0; unit < tally_.units.size(); ++unit) {
      const Service* service = setup_.services.find(static_cast<WorkloadId>(w), unit);
      if (service == nullptr) continue;
      tally_.units[unit].extra_j += static_cast<double>(tally_.calls[w][unit]) *
                                    service->metered_j.value_or(service->extra_j);
    }
  }
  return std::move(tally_);
}

void VirtualTime::begin() {
  for (std::uint32_t p = 0; p < pipelines_.size(); ++p) {
    const Pipeline& pipeline = *pipelines_[p].pipeline;
    if (pipeline.rate_hz) {
      schedule_firing(p);
    } else {
      const auto first = std::min<std::int64_t>(*pipeline.frames, setup_.in_flight[p]);
      for (std::int64_t i = 0; i < first; ++i) add_timer(Nanos::zero(), true, p);
    }
  }
}

/// The next thing that happens. False if nothing is left to.
bool VirtualTime::advance() {
  const Moment* soonest = timers_.empty() ? nullptr : &timers_.front().moment;
  Servers* servers = nullptr;
  for (const auto& each : servers_) {
    if (each->next().time == Nanos::max() || (soonest != nullptr && *soonest < each->next()))
      continue;
    soonest = &each->next();
    servers = each.get();
  }
  // At equal times completions come first: a task may start at its last moment.
  const auto wake = dispatcher_.next_wake();
  if (wake && (soonest == nullptr || *wake < soonest->time)) {
    now_ = std::max(now_, *wake);
    dispatcher_.wake(now_, starts_);
    return true;
  }
  if (soonest == nullptr) return false;
  now_ = soonest->time;
  if (servers != nullptr) {
    const JobIndex job = servers->complete_next();
    const Step& step = plans_[jobs_[job].plan].steps[jobs_[job].unit][jobs_[job].step];
    if (setup_.observer != nullptr) setup_.observer->left(step.servers, job);
    ++jobs_[job].step;
    proceed(job);
    return true;
  }
  std::ranges::pop_heap(timers_, std::greater{});
  const Timer timer = timers_.back();
  timers_.pop_back();
  if (timer.fires) {
    fire(timer.index);
  } else {
    ++jobs_[timer.index].step;
    proceed(timer.index);
  }
  return true;
}

void VirtualTime::add_timer(Nanos at, bool fires, std::uint32_t index) {
  timers_.push_back({{at, sequence_++}, fires, index});
  std::ranges::push_heap(timers_, std::greater{});
}

void VirtualTime::schedule_firing(std::uint32_t pipeline) {
  // From the number of the firing, not from the last one, so that rounding does not add up.
  const auto number = static_cast<double>(tally_.pipelines[pipeline].fired);
  const Nanos at(std::llround(number * 1e9 / *pipelines_[pipeline].pipeline->rate_hz));
  if (at < setup_.duration) add_timer(at, true, pipeline);
}

void VirtualTime::fire(std::uint32_t p) {
  PipelineState& state = pipelines_[p];
  const Pipeline& pipeline = *state.pipeline;
  PipelineTally& tally = tally_.pipelines[p];
  const auto number = static_cast<std::uint64_t>(tally.fired++);
  if (pipeline.rate_hz) schedule_firing(p);
  if (state.image_tasks > 0) {
    if (setup_.mix.image_buffers && buffers_used_ >= *setup_.mix.image_buffers) {
      ++tally.dropped;
      tally_.refused_tasks += static_cast<std::int64_t>(pipeline.tasks.size());
      // A closed loop goes on at its next completion; without any under way, when a buffer is free
      // again.
      state.starving = pipeline.frames && state.in_flight == 0 && tally.fired < *pipeline.frames;
      return;
    }
    ++buffers_used_;
  }
  ++state.in_flight;
  if (free_firings_.empty()) {
    free_firings_.push_back(static_cast<FiringIndex>(firings_.size()));
    firings_.emplace_back();
  }
  const FiringIndex firing = free_firings_.back();
  free_firings_.pop_back();
  firings_[firing] = {.pipeline = p,
                      .tasks_left = static_cast<std::uint32_t>(pipeline.tasks.size()),
                      .images_left = state.image_tasks,
                      .number = number,
                      .fired_at = now_};
  if (state.has_edges) firings_[firing].finished.resize(pipeline.tasks.size());
  submit_tasks(p, firing);
}

void VirtualTime::submit_tasks(std::uint32_t p, FiringIndex firing) {
  const PipelineState& state = pipelines_[p];
  const Pipeline& pipeline = *state.pipeline;
  ids_.clear();
  for (std::uint32_t t = 0; t < pipeline.tasks.size(); ++t) {
    if (free_jobs_.empty()) {
      free_jobs_.push_back(static_cast<JobIndex>(jobs_.size()));
      jobs_.emplace_back();
    }
    const JobIndex job = free_jobs_.back();
    free_jobs_.pop_back();
    // The place in jobs_ below, a running number above: unique among live tasks, and found again
    // without a search.
    const TaskId id = TaskId{task_number_++} << 32 | job;
    jobs_[job] = {.id = id, .firing = firing, .plan = state.first_plan + t};
    ids_.push_back(id);
    after_.clear();
    for (const std::size_t each : pipeline.tasks[t].after) after_.push_back(ids_[each]);
    Task task{
        .id = id, .kind = setup_.classes[p][t], .deadline = {}, .expires_at = {}, .after = after_};
    if (pipeline.deadline) task.deadline = now_ + *pipeline.deadline;
    if (pipeline.expires) task.expires_at = now_ + *pipeline.expires;
    if (setup_.observer != nullptr) {
      setup_.observer->submitting(id, p, t, firings_[firing].number);
    }
    dispatcher_.submit(task, now_, starts_);
  }
}

/// Carries out what the dispatcher said, and what follows at the same moment.
void VirtualTime::settle() {
  apply_starts();
  for (std::size_t i = 0; i < refires_.size(); ++i) {
    --pipelines_[refires_[i]].refires;
    fire(refires_[i]);
    apply_starts();
  }
  refires_.clear();
  if (setup_.observer != nullptr) setup_.observer->settled(now_);
}

void VirtualTime::apply_starts() {
  // proceed() may complete a task that has no steps' time left only through an event, so that
  // starts_ does not grow here.
  for (const Start& start : starts_.started) {
    const auto job = static_cast<JobIndex>(start.task);
    assert(jobs_[job].id == start.task);
    jobs_[job].unit = start.unit;
    jobs_[job].dispatched_at = start.dispatched_at;
    ++tally_.calls[plans_[jobs_[job].plan].workload][start.unit];
    const auto& steps = plans_[jobs_[job].plan].steps[start.unit];
    begin_step(job, steps.front());
  }
  for (const Ended& ended : starts_.ended) end_task(static_cast<JobIndex>(ended.task), false);
  starts_.clear();
}

/// To the job's current step, or to its end.
void VirtualTime::proceed(JobIndex job) {
  const auto& steps = plans_[jobs_[job].plan].steps[jobs_[job].unit];
  if (jobs_[job].step < steps.size()) {
    begin_step(job, steps[jobs_[job].step]);
  } else {
    complete(job);
  }
}

/// Data sets out to the unit when its predecessor completes; other transfers do not hold it up.
Nanos VirtualTime::data_arrival(const Job& job) {
  const TaskPlan& plan = plans_[job.plan];
  const auto& finished = firings_[job.firing].finished;
  Nanos arrival = now_;
  for (std::size_t i = 0; i < plan.edges.size(); ++i) {
    const GraphEdge& edge = plan.edges[i];
    const auto [unit, at] = finished[edge.from];
    arrival = std::max(arrival, at + edge.transfer(unit, job.unit));
    if (unit == job.unit) continue;
    const auto sending = [&](UnitId end) {
      const Link* link = link_of(setup_.platform, end);
      tally_.units[end].transferring += sending_time(*link, *edge_bytes(job, i));
    };
    if (!edge.leave.empty() && edge.leave[unit] > Nanos::zero()) sending(unit);
    if (!edge.enter.empty() && edge.enter[job.unit] > Nanos::zero()) sending(job.unit);
  }
  return arrival;
}

const std::optional<std::int64_t>& VirtualTime::edge_bytes(const Job& job, std::size_t edge) const {
  const PipelineState& state = pipelines_[firings_[job.firing].pipeline];
  return state.pipeline->tasks[job.plan - state.first_plan].edges[edge].bytes;
}

void VirtualTime::begin_step(JobIndex job, const Step& step) {
  if (step.for_data) {
    add_timer(data_arrival(jobs_[job]), false, job);
    return;
  }
  const bool constant = step.time.kind == Distribution::Kind::kConstant;
  const Nanos unscaled = constant ? step.time.low : draw(jobs_[job], step);
  const Nanos takes = constant ? step.scaled : scaled(unscaled, step.scale);
  if (step.servers == Step::kDelay) {
    add_timer(now_ + takes, false, job);
    return;
  }
  if (step.servers < tally_.units.size()) {
    tally_.units[step.servers].busy += takes;
    if (step.powered) tally_.units[step.servers].powered += unscaled;
  } else {
    tally_.units[jobs_[job].unit].transferring += takes;
  }
  if (setup_.observer != nullptr) {
    setup_.observer->arrived(step.servers, job, power_w(jobs_[job], step));
  }
  servers_[step.servers]->arrive(job, takes, sequence_++, now_);
}

/// While a server works on the step. A scaled stage draws less for longer: its energy stays.
double VirtualTime::power_w(const Job& job, const Step& step) const {
  if (step.servers < tally_.units.size()) {
    return step.powered ? setup_.platform.units[step.servers].active_w / step.scale : 0;
  }
  return setup_.platform.links.at(setup_.platform.units[job.unit].link).active_w;
}

/// A pure function of seed, pipeline, firing, task and step, so that two policies meet the same
/// luck.
Nanos VirtualTime::draw(const Job& job, const Step& step) const {
  const Firing& firing = firings_[job.firing];
  const PipelineState& state = pipelines_[firing.pipeline];
  const std::uint64_t task = job.plan - state.first_plan;
  const std::uint64_t stream = hash_u64(hash_u64(state.seed, firing.number), task);
  return step.time.draw(hash_u64(stream, job.step));
}

void VirtualTime::complete(JobIndex job) {
  const Job done = jobs_[job];
  dispatcher_.complete(done.unit, done.id, Outcome::kCompleted, now_, starts_);
  const Nanos latency = now_ - done.dispatched_at;
  ++tally_.units[done.unit].completed;
  tally_.units[done.unit].latency.add(latency);
  tally_.latency.add(latency);
  tally_.last_completion = now_;
  Firing& firing = firings_[done.firing];
  if (!firing.finished.empty()) {
    firing.finished[done.plan - pipelines_[firing.pipeline].first_plan] = {done.unit, now_};
  }
  end_task(job, true);
}

void VirtualTime::end_task(JobIndex job, bool completed) {
  const FiringIndex index = jobs_[job].firing;
  Firing& firing = firings_[index];
  firing.complete = firing.complete && completed;
  if (plans_[jobs_[job].plan].image_input && --firing.images_left == 0) release_buffer();
  free_jobs_.push_back(job);
  if (--firing.tasks_left == 0) end_firing(index);
}

void VirtualTime::end_firing(FiringIndex index) {
  const Firing& firing = firings_[index];
  PipelineState& state = pipelines_[firing.pipeline];
  PipelineTally& tally = tally_.pipelines[firing.pipeline];
  if (firing.complete) {
    const Nanos latency = now_ - firing.fired_at;
    ++tally.completed;
    tally.latency.add(latency);
    tally.last_completion = now_;
    if (state.pipeline->deadline && latency > *state.pipeline->deadline) ++tally.deadline_misses;
  } else {
    ++tally.dropped;
  }
  --state.in_flight;
  free_firings_.push_back(index);
  if (state.pipeline->frames && tally.fired + state.refires < *state.pipeline->frames)
    refire(firing.pipeline);
}

/// The pipeline fires once more at this moment, when what happens now is settled.
void VirtualTime::refire(std::uint32_t pipeline) {
  ++pipelines_[pipeline].refires;
  refires_.push_back(pipeline);
}

void VirtualTime::release_buffer() {
  --buffers_used_;
  for (std::uint32_t p = 0; p < pipelines_.size(); ++p) {
    if (std::exchange(pipelines_[p].starving, false)) refire(p);
  }
}

}  // namespace pirt
