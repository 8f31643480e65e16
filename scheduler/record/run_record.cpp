// One list of fields a record, walked by the writer and the reader alike, so that the two cannot
// drift apart.
#include "scheduler/record/run_record.h"

#include <algorithm>
#include <concepts>
#include <type_traits>

#include "workloads/base/error.h"
#include "workloads/base/text/json.h"
#include "workloads/base/text/text.h"

namespace pirt {
namespace {

class Writer {
 public:
  template <typename T>
  void field(const char* key, const T& value) {
    if constexpr (requires { value.has_value(); }) {
      if (value) json[key] = *value;
    } else {
      json[key] = value;
    }
  }
  Json json = Json::object();
};

class Reader {
 public:
  explicit Reader(const Json& json) : json_(json) {}
  template <typename T>
  void field(const char* key, T& value) {
    if constexpr (requires { value.has_value(); }) {
      if (json_.contains(key)) value = json_.at(key).get<typename T::value_type>();
    } else {
      value = json_.at(key).get<T>();
    }
  }

 private:
  const Json& json_;
};

/// It, or a constant one: what is read into, and written from.
template <typename Given, typename Record>
concept Of = std::same_as<std::remove_const_t<Given>, Record>;

template <typename Visitor, Of<UnitResult> Unit>
void visit(Visitor& visitor, Unit& unit) {
  visitor.field("role", unit.role);
  visitor.field("backend", unit.backend);
  visitor.field("device", unit.device);
  visitor.field("device_is_cpu", unit.device_is_cpu);
  visitor.field("own_clock", unit.own_clock);
  visitor.field("round_trip_ms", unit.round_trip_ms);
  visitor.field("link_mbit_s", unit.link_mbit_s);
  visitor.field("late_replies", unit.late_replies);
  visitor.field("provenance", unit.provenance);
  visitor.field("energy_provenance", unit.energy_provenance);
  visitor.field("mixture", unit.mixture);
  visitor.field("energy_mixture", unit.energy_mixture);
  visitor.field("prepares", unit.prepares);
  visitor.field("prepare_s", unit.prepare_s);
  visitor.field("completed", unit.completed);
  visitor.field("mean_latency_ms", unit.mean_latency_ms);
  visitor.field("p99_latency_ms", unit.p99_latency_ms);
  visitor.field("busy_s", unit.busy_s);
  visitor.field("utilization", unit.utilization);
  visitor.field("energy_j", unit.energy_j);
}

template <typename Visitor, Of<PipelineResult> Pipeline>
void visit(Visitor& visitor, Pipeline& pipeline) {
  visitor.field("fired", pipeline.fired);
  visitor.field("completed", pipeline.completed);
  visitor.field("dropped", pipeline.dropped);
  visitor.field("unfinished", pipeline.unfinished);
  visitor.field("never_ran", pipeline.never_ran);
  visitor.field("no_predecessor", pipeline.no_predecessor);
  visitor.field("queued", pipeline.queued);
  visitor.field("real_time", pipeline.real_time);
  visitor.field("rate_hz", pipeline.rate_hz);
  visitor.field("p50_ms", pipeline.p50_ms);
  visitor.field("p95_ms", pipeline.p95_ms);
  visitor.field("p99_ms", pipeline.p99_ms);
  visitor.field("deadline_ms", pipeline.deadline_ms);
  visitor.field("deadline_misses", pipeline.deadline_misses);
  visitor.field("response_bound_ms", pipeline.response_bound_ms);
  visitor.field("guaranteed", pipeline.guaranteed);
  visitor.field("not_analysed", pipeline.not_analysed);
}

template <typename Visitor, Of<DoubtedFigure> Figure>
void visit(Visitor& visitor, Figure& figure) {
  visitor.field("workload", figure.workload);
  visitor.field("unit", figure.unit);
  visitor.field("doubts", figure.doubts);
  visitor.field("low", figure.low);
  visitor.field("high", figure.high);
  visitor.field("taken", figure.taken);
  visitor.field("wild", figure.wild);
}

template <typename Visitor, Of<CallResult> Call>
void visit(Visitor& visitor, Call& call) {
  visitor.field("workload", call.workload);
  visitor.field("unit", call.unit);
  visitor.field("completed", call.completed);
  visitor.field("p50_ms", call.p50_ms);
  visitor.field("p95_ms", call.p95_ms);
  visitor.field("upload_ms", call.upload_ms);
  visitor.field("launch_ms", call.launch_ms);
  visitor.field("execute_ms", call.execute_ms);
  visitor.field("download_ms", call.download_ms);
}

template <typename Visitor, Of<PlanRow> Planned>
void visit(Visitor& visitor, Planned& planned) {
  visitor.field("pipeline", planned.pipeline);
  visitor.field("task", planned.task);
  visitor.field("unit", planned.unit);
  visitor.field("start_ms", planned.start_ms);
  visitor.field("finish_ms", planned.finish_ms);
}

template <typename Visitor, Of<TriedPlan> Tried>
void visit(Visitor& visitor, Tried& tried) {
  visitor.field("plan", tried.name);
  visitor.field("late", tried.late);
  visitor.field("rate_per_ms", tried.rate_per_ms);
  visitor.field("latency_ms", tried.latency_ms);
  visitor.field("energy_mj", tried.energy_mj);
  visitor.field("taken", tried.taken);
}

template <typename Visitor, Of<RunBounds> Bounds>
void visit(Visitor& visitor, Bounds& bounds) {
  visitor.field("throughput_per_ms", bounds.throughput_per_ms);
  visitor.field("energy_j", bounds.energy_j);
  visitor.field("makespan_s", bounds.makespan_s);
  visitor.field("critical_path_ms", bounds.critical_path_ms);
}

template <typename Visitor, Of<RunRecord> Record>
void visit(Visitor& visitor, Record& record) {
  visitor.field("mode", record.mode);
  visitor.field("basic", record.basic);
  visitor.field("overflow", record.overflow);
  visitor.field("platform", record.platform);
  visitor.field("assumptions", record.assumptions);
  visitor.field("profile", record.profile);
  visitor.field("draw", record.draw);
  visitor.field("mix", record.mix);
  visitor.field("time", record.time);
  visitor.field("set_up_s", record.set_up_s);
  visitor.field("first_call_ms", record.first_call_ms);
  visitor.field("seed", record.seed);
  visitor.field("duration_s", record.duration_s);
  visitor.field("in_flight", record.in_flight);
  visitor.field("objective", record.objective);
  visitor.field("min_rate_per_ms", record.min_rate_per_ms);
  visitor.field("power_cap_w", record.power_cap_w);
  visitor.field("over_cap", record.over_cap);
  visitor.field("power_highest_w", record.power_highest_w);
  visitor.field("slices_left", record.suspensions);
  visitor.field("planned_makespan_s", record.planned_makespan_s);
  visitor.field("makespan_s", record.makespan_s);
  visitor.field("drain_s", record.drain_s);
  visitor.field("submitted", record.submitted);
  visitor.field("completed", record.completed);
  visitor.field("dropped", record.dropped);
  visitor.field("expired", record.expired);
  visitor.field("failed", record.failed);
  visitor.field("queued", record.queued);
  visitor.field("no_predecessor", record.no_predecessor);
  visitor.field("returned", record.returned);
  visitor.field("stalled", record.stalled);
  visitor.field("offloaded", record.offloaded);
  visitor.field("throughput_per_ms", record.throughput_per_ms);
  visitor.field("mean_latency_ms", record.mean_latency_ms);
  visitor.field("p99_latency_ms", record.p99_latency_ms);
  visitor.field("energy_j", record.energy_j);
  visitor.field("average_power_w", record.average_power_w);
  visitor.field("weights", record.weights);
  visitor.field("weights_from", record.weights_from);
  visitor.field("figures", record.figures);
  visitor.field("warnings", record.warnings);
}

template <typename Record>
Json json_of(const Record& record) {
  Writer writer;
  visit(writer, record);
  return std::move(writer.json);
}

template <typename Record>
void read(const Json& json, Record& record) {
  Reader reader(json);
  visit(reader, record);
}

/// Lists that may be absent: an empty one is not written.
template <typename Element>
void write_list(Writer& writer, const char* key, const std::vector<Element>& list) {
  if (list.empty()) return;
  Json values = Json::array();
  for (const auto& element : list) values.push_back(json_of(element));
  writer.field(key, values);
}

template <typename Element>
void read_list(const Json& json, const char* key, std::vector<Element>& list) {
  if (!json.contains(key)) return;
  for (const auto& value : json.at(key)) read(value, list.emplace_back());
}

void check_version(const Json& json, const std::string& source) {
  const bool has_version = json.is_object() && json.contains("schema_version") &&
                           json["schema_version"].is_number_integer();
  if (!has_version || !json.contains("mode")) {
    throw_bad_input(source + ": not the result of a run; `pirt schedule --json FILE` writes one");
  }
  const auto version = json["schema_version"].get<std::int64_t>();
  if (version != RunRecord::kSchemaVersion) {
    throw_bad_input(source + ": schema_version " + std::to_string(version) + ", this pirt reads " +
                    std::to_string(RunRecord::kSchemaVersion) + "; write it again with this one");
  }
}

}  // namespace

std::optional<double> gap(std::optional<double> reached, std::optional<double> bound) {
  if (!reached || !bound || *bound <= 0) return std::nullopt;
  return *reached / *bound - 1;
}

const UnitResult* RunRecord::find_unit(const std::string& name) const {
  const auto found = std::ranges::find(units, name, &UnitResult::unit);
  return found == units.end() ? nullptr : &*found;
}

const PipelineResult* RunRecord::find_pipeline(const std::string& name) const {
  const auto found = std::ranges::find(pipelines, name, &PipelineResult::pipeline);
  return found == pipelines.end() ? nullptr : &*found;
}

Json to_json(const RunRecord& record) {
  Writer writer;
  writer.field("schema_version", RunRecord::kSchemaVersion);
  visit(writer, record);
  Json units = Json::object();
  for (const auto& unit : record.units) units[unit.unit] = json_of(unit);
  Json pipelines = Json::object();
  for (const auto& pipeline : record.pipelines) pipelines[pipeline.pipeline] = json_of(pipeline);
  writer.field("units", units);
  writer.field("pipelines", pipelines);
  write_list(writer, "calls", record.calls);
  write_list(writer, "doubted", record.doubted);
  write_list(writer, "plan", record.plan);
  write_list(writer, "tried", record.tried);
  if (record.bounds) {
    writer.field("bounds", json_of(*record.bounds));
    Writer gaps;  // derived: not read back
    gaps.field("throughput", gap(record.throughput_per_ms, record.bounds->throughput_per_ms));
    gaps.field("energy", gap(record.energy_j, record.bounds->energy_j));
    gaps.field("makespan", gap(record.makespan_s, record.bounds->makespan_s));
    writer.field("gaps", gaps.json);
  }
  for (const auto& [figure, interval] : record.intervals) {
    writer.json["intervals"][figure] = {interval.low, interval.high};
  }
  return std::move(writer.json);
}

RunRecord run_record_from_json(const Json& json, const std::string& source) {
  check_version(json, source);
  try {
    RunRecord record;
    read(json, record);
    if (record.time != "virtual" && !record.is_live()) {
      throw_bad_input(source + ": time '" + record.time + "'; a run is in virtual time or live");
    }
    for (const auto& [name, value] : json.at("units").items()) {
      read(value, record.units.emplace_back());
      record.units.back().unit = name;
    }
    for (const auto& [name, value] : json.at("pipelines").items()) {
      read(value, record.pipelines.emplace_back());
      record.pipelines.back().pipeline = name;
    }
    read_list(json, "calls", record.calls);
    read_list(json, "doubted", record.doubted);
    read_list(json, "plan", record.plan);
    read_list(json, "tried", record.tried);
    if (json.contains("intervals")) {
      for (const auto& [figure, ends] : json.at("intervals").items()) {
        record.intervals[figure] = {ends.at(0).get<double>(), ends.at(1).get<double>()};
      }
    }
    if (json.contains("bounds")) read(json.at("bounds"), record.bounds.emplace());
    return record;
  } catch (const JsonError& error) {
    throw_bad_input(source + ": not a complete result of a run: " + error.reason() +
                    "; write it again with this pirt");
  }
}

RunRecord load_run_record(const std::filesystem::path& path) {
  const std::string text = read_text(path);
  try {
    return run_record_from_json(parse_json(text), path.string());
  } catch (const JsonError& error) {  // Syntax, or a number that no double holds.
    throw_bad_input(path.string() + ": not JSON, or cut off: " + error.reason() +
                    "; `pirt schedule --json FILE` writes the result of a run");
  }
}

}  // namespace pirt
