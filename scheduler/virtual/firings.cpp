#include "scheduler/virtual/firings.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <utility>

#include "workloads/base/math/random.h"

namespace pirt {

Firings::Firings(const Scenario& scenario, bool keep_made)
    : scenario_(scenario),
      keep_made_(keep_made),
      pipelines_(scenario.mix.pipelines.size()),
      tallies_(scenario.mix.pipelines.size()) {
  if (scenario.mix.open_loop()) end_ = scenario.duration;
  for (std::uint32_t p = 0; p < scenario.mix.pipelines.size(); ++p) plan(p);
}

void Firings::plan(std::uint32_t p) {
  PipelineState& state = pipelines_[p];
  const Pipeline& pipeline = scenario_.mix.pipelines[p];
  const std::size_t tasks = pipeline.tasks.size();
  state.pipeline = &pipeline;
  state.jitter_seed = derive_seed(scenario_.seed, "jitter of " + pipeline.name);
  state.moves_data = keep_made_;
  const auto moves = [this](const MixEdge& edge) {
    return edge.transfer > Nanos::zero() || (edge.bytes && !scenario_.platform.links.empty());
  };
  std::vector<SeriesId> series_of(tasks, 0);  // Of those that are read later.
  for (std::size_t t = 0; t < tasks; ++t) {
    const MixTask& task = pipeline.tasks[t];
    state.image_tasks += task.image_input ? 1 : 0;
    const bool by_port = !task.inputs.empty() && !scenario_.platform.links.empty();
    state.moves_data = state.moves_data || by_port || std::ranges::any_of(task.edges, moves);
    if (!task.read_later) continue;
    state.series.push_back({.task = t, .image = task.image_input});
    series_of[t] = series_count_++;
  }
  state.after.resize(tasks);
  state.reads.resize(tasks);
  state.leads.resize(tasks);
  // What is real-time, or has no deadline, is never taken back.
  if (pipeline.deadline && !pipeline.real_time) state.leads = recall_leads(scenario_, p);
  for (std::size_t t = 0; t < tasks; ++t) {
    const MixTask& definition = pipeline.tasks[t];
    Task& task = state.tasks.emplace_back();
    task.kind = scenario_.classes[p][t];
    std::ranges::transform(definition.after, std::back_inserter(state.after[t]),
                           [](std::size_t each) { return static_cast<std::uint32_t>(each); });
    task.after_own = state.after[t];
    if (definition.state) task.state = static_cast<StateId>(*definition.state);
    if (definition.read_later) task.series = series_of[t];
    auto& reads = state.reads[t];
    for (const PortInput& port : definition.inputs) {
      if (!port.earlier || std::ranges::find(reads, series_of[port.task]) != reads.end()) continue;
      reads.push_back(series_of[port.task]);
    }
    task.reads = reads;
  }
  if (pipeline.frames) {
    state.to_fire = std::min<std::int64_t>(*pipeline.frames, scenario_.in_flight[p]);
  }
}

std::optional<Nanos> Firings::due(std::uint32_t p) const {
  const Pipeline& pipeline = *pipelines_[p].pipeline;
  if (!pipeline.rate_hz) return std::nullopt;
  const std::int64_t number = tallies_[p].fired;
  const double at_ns = nominal_ns(*pipeline.rate_hz, number);
  // Compared before it is rounded, so that it fits.
  if (at_ns >= static_cast<double>(end_.count())) return std::nullopt;
  Nanos at = Nanos(std::llround(at_ns)) + pipeline.offset;
  if (pipeline.jitter > Nanos::zero()) {
    const auto drawn = hash_u64(pipelines_[p].jitter_seed, static_cast<std::uint64_t>(number));
    at += scaled(pipeline.jitter, static_cast<double>(drawn >> 11U) * 0x1p-53);
  }
  return at < end_ ? std::optional(at) : std::nullopt;
}

std::uint32_t Firings::take_loop(Nanos now) {
  if (now >= end_) {
    refires_.clear();
    starving_.clear();
  }
  const auto take = [](std::deque<std::uint32_t>& from) {
    const std::uint32_t first = from.front();
    from.pop_front();
    return first;
  };
  while (!refires_.empty()) {
    const std::uint32_t pipeline = take(refires_);
    if (finds_buffer(pipelines_[pipeline])) return pipeline;
    starving_.push_back(pipeline);
  }
  if (starving_.empty() || !finds_buffer(pipelines_[starving_.front()])) return kNoLoop;
  return take(starving_);
}

std::optional<std::span<const Task>> Firings::fire(std::uint32_t p, Nanos now) {
  PipelineState& state = pipelines_[p];
  const Pipeline& pipeline = *state.pipeline;
  ++tallies_[p].fired;
  const bool has_buffer = finds_buffer(state);
  if (pipeline.frames) --state.to_fire;
  if (!state.series.empty()) state.over.push_back(!has_buffer);
  if (!has_buffer) {
    advance(state);
    ++tallies_[p].dropped;
    refused_tasks_ += static_cast<std::int64_t>(pipeline.tasks.size());
    if (pipeline.frames) fire_anew(p);
    return std::nullopt;
  }
  if (state.image_tasks > 0) ++buffers_used_;
  for (std::size_t t = 0; t < state.tasks.size(); ++t) {
    Task& task = state.tasks[t];
    if (pipeline.deadline) task.deadline = now + *pipeline.deadline;
    if (state.leads[t]) task.recall = state.leads[t]->recall(*task.deadline);
    if (pipeline.expires) task.expires_at = now + *pipeline.expires;
  }
  return state.tasks;
}

void Firings::submitted(std::uint32_t p, FiringId id, std::span<const TaskId> tasks, Nanos now) {
  const PipelineState& state = pipelines_[p];
  const std::uint32_t slot = slot_of(id);
  if (slot >= firings_.size()) firings_.resize(slot + std::size_t{1});
  Firing& firing = firings_[slot];
  firing.id = id;
  firing.pipeline = p;
  firing.tasks_remaining = static_cast<std::uint32_t>(tasks.size());
  firing.images_remaining = state.image_tasks;
  firing.complete = firing.only_no_predecessor = true;
  firing.number = static_cast<std::uint64_t>(tallies_[p].fired - 1);
  firing.fired_at = now;
  if (state.moves_data) firing.made.resize(tasks.size());
  for (std::uint32_t t = 0; t < tasks.size(); ++t) {
    const JobIndex job = slot_of(tasks[t]);
    if (job >= places_.size()) places_.resize(job + std::size_t{1});
    places_[job] = {.pipeline = p, .task = t, .firing = firing.number, .slot = slot};
  }
}

const Firings::Made& Firings::made_earlier(JobIndex job, std::size_t task) const {
  const TaskPlace& place = places_[job];
  const auto& series = pipelines_[place.pipeline].series;
  const auto& made = std::ranges::find(series, task, &Series::task)->made;
  return *(std::ranges::lower_bound(made, place.firing, {}, &Made::firing) - 1);
}

std::optional<FiringId> Firings::complete(JobIndex job, UnitId unit, Nanos now,
                                          std::shared_ptr<const std::vector<Tensor>> data) {
  const TaskPlace& place = places_[job];
  PipelineState& state = pipelines_[place.pipeline];
  if (state.moves_data || !state.series.empty()) {
    const Made made{.unit = unit, .at = now, .firing = place.firing, .data = std::move(data)};
    if (state.moves_data) firings_[place.slot].made[place.task] = made;
    keep(state, place.task, made);
  }
  return end_task(job, TaskEnd::kCompleted, now);
}

/// For later firings, if one may read what this task makes.
void Firings::keep(PipelineState& state, std::size_t task, const Made& made) {
  const auto series = std::ranges::find(state.series, task, &Series::task);
  if (series == state.series.end()) return;
  const auto behind = std::ranges::upper_bound(series->made, made.firing, {}, &Made::firing);
  series->made.insert(behind, made);
  if (series->image) ++state.kept[made.firing];
  forget_read(state, *series);
}

std::optional<FiringId> Firings::end_task(JobIndex job, TaskEnd how, Nanos now) {
  const TaskPlace& place = places_[job];
  Firing& firing = firings_[place.slot];
  PipelineState& state = pipelines_[place.pipeline];
  if (how == TaskEnd::kCompleted || how == TaskEnd::kFailed) tallies_[place.pipeline].ran = true;
  if (how != TaskEnd::kCompleted) {
    firing.complete = false;
    firing.only_no_predecessor = firing.only_no_predecessor && how == TaskEnd::kNoPredecessor;
  }
  if (state.pipeline->tasks[place.task].image_input && --firing.images_remaining == 0 &&
      (state.kept.empty() || !state.kept.contains(firing.number))) {
    --buffers_used_;
  }
  if (--firing.tasks_remaining > 0) return std::nullopt;
  firing.made.clear();
  end_firing(firing, now);
  return firing.id;
}

void Firings::end_firing(const Firing& firing, Nanos now) {
  PipelineState& state = pipelines_[firing.pipeline];
  PipelineTally& tally = tallies_[firing.pipeline];
  if (firing.complete) {
    const Nanos latency = now - firing.fired_at;
    ++tally.completed;
    tally.latency.add(latency);
    const auto& deadline = state.pipeline->deadline;
    if (deadline && latency > *deadline) ++tally.deadline_misses;
  } else {
    ++tally.dropped;
    if (firing.only_no_predecessor) ++tally.no_predecessor;
  }
  if (!state.series.empty()) {
    state.over[firing.number - state.first_live] = true;
    advance(state);
  }
  if (state.pipeline->frames) fire_anew(firing.pipeline);
}

void Firings::advance(PipelineState& state) {
  while (!state.over.empty() && state.over.front()) {
    state.over.pop_front();
    ++state.first_live;
  }
  for (Series& each : state.series) forget_read(state, each);
}

/// Of what was made before all firings that are not over, they and those to come read the newest.
void Firings::forget_read(PipelineState& state, Series& series) {
  auto& made = series.made;
  while (made.size() > 1 && made[1].firing < state.first_live) {
    const std::uint64_t firing = made.front().firing;
    made.pop_front();
    if (!series.image || --state.kept[firing] > 0) continue;
    state.kept.erase(firing);
    --buffers_used_;
  }
}

/// A closed loop's place in flight is free: it fires once more, when what happens now is settled,
/// if a frame is left.
void Firings::fire_anew(std::uint32_t p) {
  PipelineState& state = pipelines_[p];
  if (tallies_[p].fired + state.to_fire >= *state.pipeline->frames) return;
  ++state.to_fire;
  refires_.push_back(p);
}

/// Whether a firing of the pipeline has, or needs no, image buffer.
bool Firings::finds_buffer(const PipelineState& state) const {
  return state.image_tasks == 0 || !scenario_.mix.image_buffers ||
         buffers_used_ < *scenario_.mix.image_buffers;
}

void Firings::count_unfinished(std::vector<PipelineTally>& tallies, Nanos end) const {
  for (const Firing& firing : firings_) {
    if (firing.tasks_remaining == 0) continue;
    PipelineTally& tally = tallies[firing.pipeline];
    ++tally.unfinished;
    const Pipeline& pipeline = *pipelines_[firing.pipeline].pipeline;
    const Nanos age = end - firing.fired_at;
    if (pipeline.deadline && age > *pipeline.deadline) ++tally.deadline_misses;
    const Nanos deadline = pipeline.deadline.value_or(Nanos::zero());
    const Nanos allowed = pipeline.rate_hz ? std::max(pipeline.period(), deadline) : Nanos::max();
    if (age > allowed) ++tally.queued;
  }
}

}  // namespace pirt
