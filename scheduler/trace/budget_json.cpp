#include "scheduler/trace/budget_json.h"

#include <algorithm>

#include "workloads/base/error.h"

namespace pirt {
namespace {

std::vector<std::int64_t> in_nanos(const std::vector<Nanos>& times) {
  std::vector<std::int64_t> counts;
  for (const Nanos each : times) counts.push_back(each.count());
  return counts;
}

std::vector<Nanos> times_from_json(const Json& json) {
  std::vector<Nanos> times;
  for (const auto& each : json) times.emplace_back(each.get<std::int64_t>());
  return times;
}

void require(bool condition) {
  if (!condition) throw_bad_input("the plan of mode budget does not fit the units");
}

/// Absent where there is no such key.
std::optional<Nanos> nanos(const Json& json, const char* key) {
  if (!json.contains(key)) return std::nullopt;
  return Nanos(json.at(key).get<std::int64_t>());
}

BudgetPlan::Task task_from_json(const Json& json) {
  return {.pipeline = json.at("pipeline").get<std::uint32_t>(),
          .first = json.at("first").get<bool>(),
          .pinned = json.at("pinned").get<bool>(),
          .units = json.at("units").get<std::vector<UnitId>>(),
          .capacity = json.at("capacity").get<std::vector<int>>(),
          .share = json.at("share").get<std::vector<double>>(),
          .worst = times_from_json(json.at("worst_ns")),
          .context = json.at("context").get<std::vector<std::uint32_t>>(),
          .prepare = times_from_json(json.at("prepare_ns")),
          .window_j = json.at("window_j").get<std::vector<double>>(),
          .behind = Nanos(json.at("behind_ns").get<std::int64_t>()),
          .slice = times_from_json(json.value("slice_ns", Json())),
          .ready = nanos(json, "ready_ns").value_or(Nanos::zero()),
          .tolerates = nanos(json, "tolerates_ns"),
          .state = json.contains("state") ? std::optional(json.at("state").get<std::size_t>())
                                          : std::nullopt};
}

BudgetPlan::Arrivals arrivals_from_json(const Json& json) {
  BudgetPlan::Arrivals arrivals;
  if (json.contains("rate_hz")) arrivals.rate_hz = json.at("rate_hz").get<double>();
  arrivals.offset = Nanos(json.at("offset_ns").get<std::int64_t>());
  arrivals.jitter = Nanos(json.at("jitter_ns").get<std::int64_t>());
  arrivals.deadline = nanos(json, "deadline_ns");
  arrivals.real_time = json.at("real_time").get<bool>();
  require(arrivals.rate_hz.value_or(1) > 0);
  return arrivals;
}

}  // namespace

// By members in order, so that one that is added does not compile until it is written here.
Json to_json(const BudgetPlan& plan) {
  const auto& [tasks, pipelines, window_j] = plan;
  if (tasks.empty()) return {};
  Json json = {{"tasks", Json::array()}, {"pipelines", Json::array()}};
  for (const auto& [pipeline, first, pinned, units, capacity, share, worst, context, prepare,
                    call_window_j, behind, slice, ready, tolerates, state] : tasks) {
    json["tasks"].push_back({{"pipeline", pipeline},
                             {"first", first},
                             {"pinned", pinned},
                             {"units", units},
                             {"capacity", capacity},
                             {"share", share},
                             {"worst_ns", in_nanos(worst)},
                             {"context", context},
                             {"prepare_ns", in_nanos(prepare)},
                             {"window_j", call_window_j},
                             {"behind_ns", behind.count()}});
    if (!slice.empty()) json["tasks"].back()["slice_ns"] = in_nanos(slice);
    if (state) json["tasks"].back()["state"] = *state;
    if (!tolerates) continue;
    json["tasks"].back()["ready_ns"] = ready.count();
    json["tasks"].back()["tolerates_ns"] = tolerates->count();
  }
  for (const auto& [rate_hz, offset, jitter, deadline, real_time] : pipelines) {
    Json each = {
        {"offset_ns", offset.count()}, {"jitter_ns", jitter.count()}, {"real_time", real_time}};
    if (rate_hz) each["rate_hz"] = *rate_hz;
    if (deadline) each["deadline_ns"] = deadline->count();
    json["pipelines"].push_back(std::move(each));
  }
  if (window_j) json["window_j"] = *window_j;
  return json;
}

BudgetPlan budget_plan_from_json(const Json& json, std::size_t units) {
  BudgetPlan plan;
  if (json.is_null()) return plan;
  for (const auto& each : json.at("tasks")) plan.tasks.push_back(task_from_json(each));
  for (const auto& each : json.at("pipelines")) plan.pipelines.push_back(arrivals_from_json(each));
  if (json.contains("window_j")) plan.window_j = json.at("window_j").get<double>();
  for (const BudgetPlan::Task& task : plan.tasks) {
    require(task.pipeline < plan.pipelines.size() && !task.units.empty());
    require(std::ranges::all_of(task.units, [units](UnitId unit) { return unit < units; }));
    require(task.capacity.size() == units && task.share.size() == units &&
            task.worst.size() == units && task.context.size() == units &&
            task.prepare.size() == units && task.window_j.size() == units &&
            (task.slice.empty() || task.slice.size() == units));
  }
  return plan;
}

}  // namespace pirt
