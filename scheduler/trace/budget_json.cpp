// The plan of mode budget in a trace.
#include <algorithm>

#include "scheduler/record/fields.h"
#include "scheduler/trace/log_json.h"
#include "workloads/base/error.h"

namespace pirt {

// By members in order, so that one that is added does not compile until it is written here.

template <typename Fields, Of<BudgetPlan::Task> Given>
void walk(Fields& fields, Given& task) {
  auto& [pipeline, first, pinned, units, capacity, share, worst, context, prepare, window_j, behind,
         slice, ready, tolerates, state, at_once] = task;
  fields.field("pipeline", pipeline);
  fields.field("first", first);
  fields.field("pinned", pinned);
  fields.field("units", units);
  fields.field("capacity", capacity);
  fields.field("share", share);
  fields.field("worst_ns", worst);
  fields.field("context", context);
  fields.field("prepare_ns", prepare);
  fields.field("window_j", window_j);
  fields.field("behind_ns", behind);
  fields.list("slice_ns", slice);
  fields.field("state", state);
  fields.list("at_once", at_once);
  // Nobody asks when it is ready if nobody counts on it.
  auto its_ready = tolerates ? std::optional<Nanos>(ready) : std::nullopt;
  fields.field("ready_ns", its_ready);
  if constexpr (!std::is_const_v<Given>) ready = its_ready.value_or(Nanos::zero());
  fields.field("tolerates_ns", tolerates);
}

template <typename Fields, Of<BudgetPlan::Arrivals> Given>
void walk(Fields& fields, Given& arrivals) {
  auto& [rate_hz, offset, jitter, deadline, real_time] = arrivals;
  fields.field("offset_ns", offset);
  fields.field("jitter_ns", jitter);
  fields.field("real_time", real_time);
  fields.field("rate_hz", rate_hz);
  fields.field("deadline_ns", deadline);
}

template <typename Fields, Of<BudgetPlan> Given>
void walk(Fields& fields, Given& plan) {
  auto& [tasks, pipelines, window_j] = plan;
  fields.field("tasks", tasks);
  fields.field("pipelines", pipelines);
  fields.field("window_j", window_j);
}

namespace {

void require(bool condition) {
  if (!condition) throw_bad_input("the plan of mode budget does not fit the units");
}

}  // namespace

Json to_json(const BudgetPlan& plan) {
  return plan.tasks.empty() ? Json() : RecordWriter::json_of(plan);
}

BudgetPlan budget_plan_from_json(const Json& json, std::size_t units) {
  BudgetPlan plan;
  if (json.is_null()) return plan;
  RecordReader::read(json, plan);
  for (const BudgetPlan::Arrivals& each : plan.pipelines) require(each.rate_hz.value_or(1) > 0);
  for (const BudgetPlan::Task& task : plan.tasks) {
    require(task.pipeline < plan.pipelines.size() && !task.units.empty());
    require(std::ranges::all_of(task.units, [units](UnitId unit) { return unit < units; }));
    require(task.capacity.size() == units && task.share.size() == units &&
            task.worst.size() == units && task.context.size() == units &&
            task.prepare.size() == units && task.window_j.size() == units &&
            (task.slice.empty() || task.slice.size() == units) &&
            (task.at_once.empty() || task.at_once.size() == units));
  }
  return plan;
}

}  // namespace pirt
