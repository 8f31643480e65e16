#include "scheduler/virtual/virtual_time.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <functional>
#include <stdexcept>
#include <utility>

#include "scheduler/services/transfers.h"
#include "workloads/base/random.h"

namespace pirt {

/// One thing after the other that a started task goes through.
struct VirtualTime::Step {
  static constexpr std::uint32_t kDelay = UINT32_MAX;
  std::uint32_t servers = kDelay;  ///< Position in servers_, or a pure delay.
  Distribution time;               ///< Before the scale.
  Nanos scaled{0};                 ///< Of a constant.
  double scale = 1;
  double energy_scale = 0;  ///< Of its time before the scale, what draws the unit's active_w.
  bool for_data = false;    ///< A delay until the data of the predecessors is there.
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
  bool has_edges = false;    ///< Some task's plan has edges.
  std::int64_t to_fire = 0;  ///< Of a closed loop: at the begin, or in refires_ or starving_.
};

struct VirtualTime::Firing {
  FiringId id = 0;
  std::uint32_t pipeline = 0;
  std::uint32_t tasks_left = 0;  ///< 0: over.
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
  Nanos takes{0};    ///< Server time of its step,
  Nanos powered{0};  ///< and the part of it that draws the unit's active_w.
};

struct VirtualTime::Timer {
  Moment moment;
  bool fires = false;       ///< A pipeline; otherwise the end of a job's delay.
  std::uint32_t index = 0;  ///< Of the pipeline or the job.
  friend auto operator<=>(const Timer&, const Timer&) = default;
};

namespace {

/// What the dispatcher refuses here would be this driver's mistake.
void must(bool taken) {
  if (!taken) throw std::logic_error("the dispatcher refused an input of virtual time");
}

bool takes_time(const GraphEdge& edge) {
  const auto any = [](const std::vector<Nanos>& times) {
    return std::ranges::any_of(times, [](Nanos time) { return time > Nanos::zero(); });
  };
  return edge.delay > Nanos::zero() || any(edge.leave) || any(edge.enter);
}

}  // namespace

VirtualTime::~VirtualTime() = default;

VirtualTime::VirtualTime(const Scenario& scenario, Dispatcher& dispatcher, RunObserver* observer)
    : scenario_(scenario), observer_(observer), dispatcher_(dispatcher) {
  for (const auto& unit : scenario.platform.units)
    servers_.push_back(make_servers(unit.servers, unit.discipline));
  for (std::size_t i = 0; i < scenario.platform.links.size(); ++i) {
    servers_.push_back(make_servers(1, Discipline::kFifo));
  }
  plan_tasks();
  if (scenario.mix.open_loop()) end_ = scenario.duration;
  tally_.units.resize(scenario.platform.units.size());
  tally_.pipelines.resize(scenario.mix.pipelines.size());
  tally_.calls.assign(scenario.services.workloads.size(),
                      std::vector<std::int64_t>(scenario.platform.units.size(), 0));
}

void VirtualTime::plan_tasks() {
  for (std::uint32_t p = 0; p < scenario_.mix.pipelines.size(); ++p) {
    const Pipeline& pipeline = scenario_.mix.pipelines[p];
    PipelineState state;
    state.pipeline = &pipeline;
    state.first_plan = static_cast<std::uint32_t>(plans_.size());
    state.seed = derive_seed(scenario_.seed, pipeline.name);
    for (std::size_t t = 0; t < pipeline.tasks.size(); ++t) {
      const TaskClass& kind = scenario_.classes[p][t];
      TaskPlan plan{
          .workload = kind.workload, .image_input = kind.image_input, .edges = {}, .steps = {}};
      auto edges = edges_into(scenario_.platform, pipeline, t);
      if (std::ranges::any_of(edges, takes_time)) plan.edges = std::move(edges);
      state.has_edges = state.has_edges || !plan.edges.empty();
      for (UnitId unit = 0; unit < scenario_.platform.units.size(); ++unit) {
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
  const Service& service = *scenario_.services.find(plan.workload, unit);
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
                     .energy_scale = service.energy_scale(stage)});
  }
  if (moves_data) add_transfer(steps, unit, bytes.out);
  return steps;
}

/// The link is busy while it sends (bytes * 8 / mbit_s); the latency that follows is a delay,
/// during which it may send again.
void VirtualTime::add_transfer(std::vector<Step>& steps, UnitId unit,
                               std::int64_t size_bytes) const {
  const auto& name = scenario_.platform.units[unit].link;
  if (name.empty()) return;
  const auto link = scenario_.platform.links.find(name);
  const auto position = std::distance(scenario_.platform.links.begin(), link);
  const Nanos sending = sending_time(link->second, size_bytes);
  steps.push_back({.servers = static_cast<std::uint32_t>(scenario_.platform.units.size()) +
                              static_cast<std::uint32_t>(position),
                   .time = {.low = sending, .high = sending},
                   .scaled = sending});
  steps.push_back({.time = link->second.latency, .scaled = link->second.latency.mean()});
}

Tally VirtualTime::run() {
  begin();
  while (advance()) settle();
  if (!at_end_) close_books(scenario_.mix.open_loop() ? end_ : tally_.last_completion);
  at_end_->last_completion = tally_.last_completion;
  at_end_->stalled = dispatcher_.counts().queued();
  return *std::move(at_end_);
}

/// What has been counted by now is what the run returns.
void VirtualTime::close_books(Nanos end) {
  Tally tally = tally_;
  tally.end = end;
  tally.tasks = dispatcher_.counts();
  count_served(tally);
  count_unfinished(tally, end);
  for (std::size_t w = 0; w < tally.calls.size(); ++w) {
    for (UnitId unit = 0; unit < tally.units.size(); ++unit) {
      const Service* service = scenario_.services.find(static_cast<WorkloadId>(w), unit);
      if (service == nullptr) continue;
      tally.units[unit].extra_j += static_cast<double>(tally.calls[w][unit]) * service->fixed_j();
    }
  }
  at_end_ = std::move(tally);
}

/// The served part of what is at the servers: steps are charged as they leave.
void VirtualTime::count_served(Tally& tally) const {
  for (const auto& servers : servers_) {
    for (const auto& [index, left] : servers->left(tally.end)) {
      const Job& job = jobs_[index];
      const Nanos served = job.takes - left;
      if (served <= Nanos::zero()) continue;
      const double part = to_s(served) / to_s(job.takes);
      charge(tally, job, step_of(job), served, scaled(job.powered, part));
    }
  }
}

void VirtualTime::count_unfinished(Tally& tally, Nanos end) const {
  for (const Firing& firing : firings_) {
    if (firing.tasks_left == 0) continue;
    PipelineTally& pipeline = tally.pipelines[firing.pipeline];
    ++pipeline.unfinished;
    const auto& deadline = pipelines_[firing.pipeline].pipeline->deadline;
    if (deadline && end - firing.fired_at > *deadline) ++pipeline.deadline_misses;
  }
}

void VirtualTime::charge(Tally& tally, const Job& job, const Step& step, Nanos served,
                         Nanos powered) const {
  if (step.servers < tally.units.size()) {
    tally.units[step.servers].busy += served;
    tally.units[step.servers].powered += powered;
  } else {
    tally.units[job.unit].transferring += served;
  }
}

const VirtualTime::Step& VirtualTime::step_of(const Job& job) const {
  return plans_[job.plan].steps[job.unit][job.step];
}

void VirtualTime::begin() {
  for (std::uint32_t p = 0; p < pipelines_.size(); ++p) {
    const Pipeline& pipeline = *pipelines_[p].pipeline;
    if (pipeline.rate_hz) {
      schedule_firing(p);
    } else {
      pipelines_[p].to_fire = std::min<std::int64_t>(*pipeline.frames, scenario_.in_flight[p]);
      for (std::int64_t i = 0; i < pipelines_[p].to_fire; ++i) add_timer(Nanos::zero(), true, p);
    }
  }
}

/// The next thing that happens. False if nothing is left to.
bool VirtualTime::advance() {
  static constexpr Moment kNever;
  const Moment* soonest = timers_.empty() ? &kNever : &timers_.front().moment;
  Servers* servers = nullptr;
  for (const auto& each : servers_) {
    if (*soonest <= each->next()) continue;
    soonest = &each->next();
    servers = each.get();
  }
  // At equal times completions come first: a task may start at its last moment.
  const Nanos wake = dispatcher_.next_wake();
  const bool wakes = wake < soonest->time;
  if (!wakes && soonest->time == Nanos::max()) return false;
  const Nanos time = std::max(now_, wakes ? wake : soonest->time);
  if (time > end_ && !at_end_) close_books(end_);
  now_ = time;
  if (wakes) {
    dispatcher_.wake(now_, starts_);
    return true;
  }
  if (servers != nullptr) {
    const JobIndex index = servers->complete_next();
    Job& job = jobs_[index];
    const Step& step = step_of(job);
    charge(tally_, job, step, job.takes, job.powered);
    if (observer_ != nullptr) observer_->left(step.servers, index);
    ++job.step;
    proceed(index);
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
  const double at_ns = number * 1e9 / *pipelines_[pipeline].pipeline->rate_hz;
  // Compared before it is rounded, so that it fits.
  if (at_ns >= static_cast<double>(end_.count())) return;
  const Nanos at(std::llround(at_ns));
  if (at < end_) add_timer(at, true, pipeline);
}

void VirtualTime::fire(std::uint32_t p) {
  PipelineState& state = pipelines_[p];
  const Pipeline& pipeline = *state.pipeline;
  PipelineTally& tally = tally_.pipelines[p];
  const auto number = static_cast<std::uint64_t>(tally.fired++);
  if (pipeline.rate_hz) schedule_firing(p);
  if (pipeline.frames) --state.to_fire;
  if (!finds_buffer(state)) {
    ++tally.dropped;
    tally_.refused_tasks += static_cast<std::int64_t>(pipeline.tasks.size());
    if (pipeline.frames) fire_anew(p);
    return;
  }
  if (state.image_tasks > 0) ++buffers_used_;
  if (free_firings_.empty()) {
    free_firings_.push_back(static_cast<FiringIndex>(firings_.size()));
    firings_.emplace_back();
  }
  const FiringIndex firing = free_firings_.back();
  free_firings_.pop_back();
  firings_[firing] = {.id = firing_number_++,
                      .pipeline = p,
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
  after_.clear();
  tasks_.clear();
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
    for (const std::size_t each : pipeline.tasks[t].after) after_.push_back(ids_[each]);
    Task& task = tasks_.emplace_back();
    task.id = id;
    task.kind = scenario_.classes[p][t];
    if (pipeline.deadline) task.deadline = now_ + *pipeline.deadline;
    if (pipeline.expires) task.expires_at = now_ + *pipeline.expires;
    if (observer_ != nullptr) {
      observer_->submitting(id, p, t, firings_[firing].number);
    }
  }
  // Now that after_ does not move any more.
  std::size_t begin = 0;
  for (std::uint32_t t = 0; t < pipeline.tasks.size(); ++t) {
    const std::size_t count = pipeline.tasks[t].after.size();
    tasks_[t].after = std::span(after_).subspan(begin, count);
    begin += count;
  }
  must(dispatcher_.submit(firings_[firing].id, tasks_, now_, starts_));
}

/// Carries out what the dispatcher said, and what follows at the same moment.
void VirtualTime::settle() {
  apply_starts();
  fire_again();
  if (observer_ != nullptr) observer_->settled(now_);
}

/// Closed loops: those whose firing has ended, then those that were short of a buffer, in the order
/// in which they were.
void VirtualTime::fire_again() {
  if (now_ >= end_) {
    refires_.clear();
    starving_.clear();
  }
  const auto fires = [this](std::uint32_t pipeline) {
    fire(pipeline);
    apply_starts();
  };
  for (std::size_t i = 0; i < refires_.size(); ++i) {
    const std::uint32_t pipeline = refires_[i];
    if (finds_buffer(pipelines_[pipeline])) {
      fires(pipeline);
    } else {
      starving_.push_back(pipeline);
    }
  }
  refires_.clear();
  while (!starving_.empty() && finds_buffer(pipelines_[starving_.front()])) {
    const std::uint32_t pipeline = starving_.front();
    starving_.pop_front();
    fires(pipeline);
  }
}

void VirtualTime::apply_starts() {
  // A step ends through an event only, even one that takes no time, so that starts_ does not grow
  // here.
  for (const Start& start : starts_.started) {
    const auto job = static_cast<JobIndex>(start.task);
    assert(jobs_[job].id == start.task);
    jobs_[job].unit = start.unit;
    jobs_[job].dispatched_at = start.dispatched_at;
    begin_step(job, step_of(jobs_[job]));
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
    const auto sending = [&](UnitId end, Nanos from) {
      const Link* link = link_of(scenario_.platform, end);
      const Nanos takes = sending_time(*link, *edge_bytes(job, i));
      tally_.units[end].transferring += before_end(from, takes);
    };
    const bool leaves = !edge.leave.empty() && edge.leave[unit] > Nanos::zero();
    if (leaves) sending(unit, at);
    if (!edge.enter.empty() && edge.enter[job.unit] > Nanos::zero()) {
      sending(job.unit, leaves ? at + edge.leave[unit] : at);
    }
  }
  return arrival;
}

/// The part of a time that counts.
Nanos VirtualTime::before_end(Nanos start, Nanos length) const {
  return std::clamp(end_ - start, Nanos::zero(), length);
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
  jobs_[job].takes = takes;
  jobs_[job].powered = step.energy_scale == 1 ? unscaled : scaled(unscaled, step.energy_scale);
  if (observer_ != nullptr) {
    observer_->arrived(step.servers, job, power_w(jobs_[job], step));
  }
  servers_[step.servers]->arrive(job, takes, sequence_++, now_);
}

/// While a server works on the step. A scaled stage draws less for longer: its energy stays.
double VirtualTime::power_w(const Job& job, const Step& step) const {
  if (step.servers < tally_.units.size()) {
    return scenario_.platform.units[step.servers].active_w * step.energy_scale / step.scale;
  }
  return scenario_.platform.links.at(scenario_.platform.units[job.unit].link).active_w;
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
  must(dispatcher_.complete(done.unit, done.id, Outcome::kCompleted, now_, starts_));
  const Nanos latency = now_ - done.dispatched_at;
  ++tally_.calls[plans_[done.plan].workload][done.unit];
  ++tally_.units[done.unit].completed;
  tally_.units[done.unit].latency.add(latency);
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
  if (plans_[jobs_[job].plan].image_input && --firing.images_left == 0) --buffers_used_;
  free_jobs_.push_back(job);
  if (--firing.tasks_left == 0) end_firing(index);
}

void VirtualTime::end_firing(FiringIndex index) {
  const Firing& firing = firings_[index];
  const Pipeline& pipeline = *pipelines_[firing.pipeline].pipeline;
  PipelineTally& tally = tally_.pipelines[firing.pipeline];
  if (firing.complete) {
    const Nanos latency = now_ - firing.fired_at;
    ++tally.completed;
    tally.latency.add(latency);
    if (pipeline.deadline && latency > *pipeline.deadline) ++tally.deadline_misses;
  } else {
    ++tally.dropped;
  }
  must(dispatcher_.release(firing.id, now_));
  free_firings_.push_back(index);
  if (pipeline.frames) fire_anew(firing.pipeline);
}

/// A closed loop's place in flight is free: it fires once more, when what happens now is settled,
/// if a frame is left.
void VirtualTime::fire_anew(std::uint32_t p) {
  PipelineState& state = pipelines_[p];
  if (tally_.pipelines[p].fired + state.to_fire >= *state.pipeline->frames) return;
  ++state.to_fire;
  refires_.push_back(p);
}

/// Whether a firing of the pipeline has, or needs no, image buffer.
bool VirtualTime::finds_buffer(const PipelineState& state) const {
  return state.image_tasks == 0 || !scenario_.mix.image_buffers ||
         buffers_used_ < *scenario_.mix.image_buffers;
}

}  // namespace pirt
