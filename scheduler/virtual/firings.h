// The firings of a mix's pipelines: when they come, who gets an image buffer, where and when data
// was made, and what a firing comes to. Pure: it reads no clock and
// calls nobody, so that virtual time and the live driver share it.
#pragma once

#include <algorithm>
#include <cstdint>
#include <deque>
#include <map>
#include <memory>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "scheduler/mix/task.h"
#include "scheduler/record/tally.h"
#include "scheduler/services/recall.h"
#include "scheduler/services/scenario.h"
#include "workloads/model/tensor.h"

namespace pirt {

/// Where the driver keeps what it knows of a live task: the slot of its id.
using JobIndex = std::uint32_t;

class Firings {
 public:
  /// @param scenario   Must outlive it.
  /// @param keep_made  Whether made() is asked for data that takes no time to move, too.
  explicit Firings(const Scenario& scenario, bool keep_made = false);

  /// Nothing fires from then on.
  [[nodiscard]] Nanos end() const { return end_; }
  void stop(Nanos now) { end_ = std::min(end_, now); }

  // When: pipelines with a rate are asked for their next time after each firing; closed loops fire
  // so often at the begin, and then whenever next_loop says so.

  /// Absent if it comes no more, or the pipeline is a closed loop.
  [[nodiscard]] std::optional<Nanos> due(std::uint32_t pipeline) const;
  [[nodiscard]] std::int64_t at_begin(std::uint32_t pipeline) const {
    return pipelines_[pipeline].to_fire;
  }
  /// A closed loop that fires now: one whose firing has ended, then those that were short of a
  /// buffer, in the order in which they were; kNoLoop if none more does. (Not optional: of that the
  /// compiler writes two halves to memory and reads them as one, which at each event costs as much
  /// as all else here.)
  [[nodiscard]] std::uint32_t next_loop(Nanos now) {
    return refires_.empty() && starving_.empty() ? kNoLoop : take_loop(now);
  }
  static constexpr std::uint32_t kNoLoop = UINT32_MAX;

  /// The pipeline fires: what a dispatcher is given, true until the next call. Absent if it finds
  /// no image buffer: the firing is dropped, and counted.
  [[nodiscard]] std::optional<std::span<const Task>> fire(std::uint32_t pipeline, Nanos now);
  /// The dispatcher has them.
  void submitted(std::uint32_t pipeline, FiringId firing, std::span<const TaskId> tasks, Nanos now);
  /// What all submissions of the pipeline have in common but for times.
  [[nodiscard]] std::span<const Task> tasks(std::uint32_t pipeline) const {
    return pipelines_[pipeline].tasks;
  }

  /// Where a live task stands.
  struct TaskPlace {
    std::uint32_t pipeline = 0;
    std::uint32_t task = 0;    ///< Position in the pipeline.
    std::uint64_t firing = 0;  ///< Number in the pipeline, from 0.
    std::uint32_t slot = 0;    ///< Of the firing's id.
    friend bool operator==(const TaskPlace&, const TaskPlace&) = default;
  };
  [[nodiscard]] static JobIndex job_of(TaskId id) { return slot_of(id); }
  [[nodiscard]] const TaskPlace& place(JobIndex job) const { return places_[job]; }

  /// Where and when a task's data was made, and the data, where something is really computed. It is
  /// kept as long as somebody may read it.
  struct Made {
    UnitId unit = 0;
    Nanos at{0};
    std::uint64_t firing = 0;
    std::shared_ptr<const std::vector<Tensor>> data = nullptr;
  };
  /// By another task of the same firing, which completed.
  [[nodiscard]] const Made& made(JobIndex job, std::size_t task) const {
    return firings_[places_[job].slot].made[task];
  }
  /// By the nearest earlier firing that completed the task, for a task that may start.
  [[nodiscard]] const Made& made_earlier(JobIndex job, std::size_t task) const;

  /// The task completed, or ended otherwise; its job is free. What is returned names the firing
  /// that is over with it, which the dispatcher may forget.
  [[nodiscard]] std::optional<FiringId> complete(
      JobIndex job, UnitId unit, Nanos now, std::shared_ptr<const std::vector<Tensor>> data = {});
  [[nodiscard]] std::optional<FiringId> end_task(JobIndex job, TaskEnd how, Nanos now);

  /// By pipeline, of all that has happened.
  [[nodiscard]] const std::vector<PipelineTally>& tallies() const { return tallies_; }
  [[nodiscard]] std::int64_t refused_tasks() const { return refused_tasks_; }
  /// Adds what is not over at @p end.
  void count_unfinished(std::vector<PipelineTally>& tallies, Nanos end) const;

 private:
  struct Firing {
    FiringId id = kNoTask;
    std::uint32_t pipeline = 0;
    std::uint32_t tasks_remaining = 0;  ///< 0: over.
    std::uint32_t images_remaining = 0;
    bool complete = true;
    bool only_no_predecessor = true;  ///< Of the tasks that it lost.
    std::uint64_t number = 0;
    Nanos fired_at{0};
    std::vector<Made> made = {};  ///< By task; empty unless data of the pipeline moves.
  };
  /// What later firings may read of one task: completed firings, rising.
  struct Series {
    std::size_t task = 0;
    bool image = false;
    std::deque<Made> made = {};
  };
  struct PipelineState {
    const Pipeline* pipeline = nullptr;
    std::uint64_t jitter_seed = 0;
    std::vector<Task> tasks = {};  ///< As submitted last; but for times always the same.
    std::vector<std::vector<std::uint32_t>> after = {};  ///< By task: what these refer to,
    std::vector<std::vector<SeriesId>> reads = {};       ///< likewise.
    std::vector<std::optional<RecallLead>> leads = {};  ///< By task; absent = it is not taken back.
    std::uint32_t image_tasks = 0;
    bool moves_data = false;
    std::int64_t to_fire = 0;  ///< Of a closed loop: at the begin, or in refires_ or starving_.
    std::vector<Series> series = {};
    std::deque<bool> over = {};  ///< Of firings from first_live on.
    std::uint64_t first_live = 0;
    std::map<std::uint64_t, int> kept = {};  ///< By firing: series that keep its image.
  };

  void plan(std::uint32_t pipeline);
  void keep(PipelineState& state, std::size_t task, const Made& made);
  [[nodiscard]] std::uint32_t take_loop(Nanos now);
  void end_firing(const Firing& firing, Nanos now);
  void advance(PipelineState& state);
  void forget_read(PipelineState& state, Series& series);
  void fire_anew(std::uint32_t pipeline);
  [[nodiscard]] bool finds_buffer(const PipelineState& state) const;

  const Scenario& scenario_;
  bool keep_made_;
  Nanos end_ = Nanos::max();
  std::vector<PipelineState> pipelines_;  ///< As many as they will be: tasks point into them.
  std::vector<PipelineTally> tallies_;
  std::vector<Firing> firings_;         ///< By slot of their ids,
  std::vector<TaskPlace> places_;       ///< and by job.
  std::deque<std::uint32_t> refires_;   ///< Closed loops that fire now.
  std::deque<std::uint32_t> starving_;  ///< Closed loops that fire when a buffer is free.
  SeriesId series_count_ = 0;
  std::int64_t buffers_used_ = 0;  ///< Their images are in use, or kept for a later firing.
  std::int64_t refused_tasks_ = 0;
};

}  // namespace pirt
