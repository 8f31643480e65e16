#include "scheduler/record/run_record.h"

#include <algorithm>

#include "scheduler/record/fields.h"
#include "workloads/base/error.h"
#include "workloads/base/text/text.h"

namespace pirt {

template <typename Fields, Of<UnitResult> Unit>
void walk(Fields& fields, Unit& unit) {
  fields.field("role", unit.role);
  fields.field("backend", unit.backend);
  fields.field("device", unit.device);
  fields.field("device_is_cpu", unit.device_is_cpu);
  fields.field("own_clock", unit.own_clock);
  fields.field("round_trip_ms", unit.round_trip_ms);
  fields.field("link_mbit_s", unit.link_mbit_s);
  fields.field("late_replies", unit.late_replies);
  fields.field("provenance", unit.provenance);
  fields.field("energy_provenance", unit.energy_provenance);
  fields.field("mixture", unit.mixture);
  fields.field("energy_mixture", unit.energy_mixture);
  fields.field("prepares", unit.prepares);
  fields.field("prepare_s", unit.prepare_s);
  fields.field("completed", unit.completed);
  fields.field("mean_latency_ms", unit.mean_latency_ms);
  fields.field("p99_latency_ms", unit.p99_latency_ms);
  fields.field("busy_s", unit.busy_s);
  fields.field("utilization", unit.utilization);
  fields.field("energy_j", unit.energy_j);
}

template <typename Fields, Of<PipelineResult> Pipeline>
void walk(Fields& fields, Pipeline& pipeline) {
  fields.field("fired", pipeline.fired);
  fields.field("completed", pipeline.completed);
  fields.field("dropped", pipeline.dropped);
  fields.field("unfinished", pipeline.unfinished);
  fields.field("never_ran", pipeline.never_ran);
  fields.field("no_predecessor", pipeline.no_predecessor);
  fields.field("queued", pipeline.queued);
  fields.field("real_time", pipeline.real_time);
  fields.field("rate_hz", pipeline.rate_hz);
  fields.field("p50_ms", pipeline.p50_ms);
  fields.field("p95_ms", pipeline.p95_ms);
  fields.field("p99_ms", pipeline.p99_ms);
  fields.field("deadline_ms", pipeline.deadline_ms);
  fields.field("deadline_misses", pipeline.deadline_misses);
  fields.field("response_bound_ms", pipeline.response_bound_ms);
  fields.field("guaranteed", pipeline.guaranteed);
  fields.field("not_analysed", pipeline.not_analysed);
}

template <typename Fields, Of<DoubtedFigure> Figure>
void walk(Fields& fields, Figure& figure) {
  fields.field("workload", figure.workload);
  fields.field("unit", figure.unit);
  fields.field("doubts", figure.doubts);
  fields.field("low", figure.low);
  fields.field("high", figure.high);
  fields.field("taken", figure.taken);
  fields.field("wild", figure.wild);
}

template <typename Fields, Of<CallResult> Call>
void walk(Fields& fields, Call& call) {
  fields.field("workload", call.workload);
  fields.field("unit", call.unit);
  fields.field("completed", call.completed);
  fields.field("p50_ms", call.p50_ms);
  fields.field("p95_ms", call.p95_ms);
  fields.field("upload_ms", call.upload_ms);
  fields.field("launch_ms", call.launch_ms);
  fields.field("execute_ms", call.execute_ms);
  fields.field("download_ms", call.download_ms);
}

template <typename Fields, Of<PlanRow> Planned>
void walk(Fields& fields, Planned& planned) {
  fields.field("pipeline", planned.pipeline);
  fields.field("task", planned.task);
  fields.field("unit", planned.unit);
  fields.field("start_ms", planned.start_ms);
  fields.field("finish_ms", planned.finish_ms);
}

template <typename Fields, Of<TriedPlan> Tried>
void walk(Fields& fields, Tried& tried) {
  fields.field("plan", tried.name);
  fields.field("late", tried.late);
  fields.field("rate_per_ms", tried.rate_per_ms);
  fields.field("latency_ms", tried.latency_ms);
  fields.field("energy_mj", tried.energy_mj);
  fields.field("taken", tried.taken);
}

template <typename Fields, Of<RunBounds> Bounds>
void walk(Fields& fields, Bounds& bounds) {
  fields.field("throughput_per_ms", bounds.throughput_per_ms);
  fields.field("energy_j", bounds.energy_j);
  fields.field("makespan_s", bounds.makespan_s);
  fields.field("critical_path_ms", bounds.critical_path_ms);
}

template <typename Fields, Of<RunRecord> Record>
void walk(Fields& fields, Record& record) {
  fields.field("mode", record.mode);
  fields.field("basic", record.basic);
  fields.field("overflow", record.overflow);
  fields.field("platform", record.platform);
  fields.field("platform_file", record.platform_file);
  fields.field("platform_hash", record.platform_hash);
  fields.list("settings", record.settings);
  fields.field("assumptions", record.assumptions);
  fields.field("profile", record.profile);
  fields.field("profile_file", record.profile_file);
  fields.field("profile_hash", record.profile_hash);
  fields.field("draw", record.draw);
  fields.field("mix", record.mix);
  fields.field("mix_file", record.mix_file);
  fields.field("time", record.time);
  fields.field("set_up_s", record.set_up_s);
  fields.field("first_call_ms", record.first_call_ms);
  fields.field("seed", record.seed);
  fields.field("duration_s", record.duration_s);
  fields.field("in_flight", record.in_flight);
  fields.list("besides", record.besides);
  fields.field("slices", record.slices);
  fields.field("objective", record.objective);
  fields.field("min_rate_per_ms", record.min_rate_per_ms);
  fields.field("power_cap_w", record.power_cap_w);
  fields.field("over_cap", record.over_cap);
  fields.field("power_highest_w", record.power_highest_w);
  fields.field("slices_left", record.suspensions);
  fields.field("planned_makespan_s", record.planned_makespan_s);
  fields.field("makespan_s", record.makespan_s);
  fields.field("drain_s", record.drain_s);
  fields.field("submitted", record.submitted);
  fields.field("completed", record.completed);
  fields.field("dropped", record.dropped);
  fields.field("expired", record.expired);
  fields.field("failed", record.failed);
  fields.field("queued", record.queued);
  fields.field("no_predecessor", record.no_predecessor);
  fields.field("returned", record.returned);
  fields.field("stalled", record.stalled);
  fields.field("offloaded", record.offloaded);
  fields.field("throughput_per_ms", record.throughput_per_ms);
  fields.field("mean_latency_ms", record.mean_latency_ms);
  fields.field("p99_latency_ms", record.p99_latency_ms);
  fields.field("energy_j", record.energy_j);
  fields.field("average_power_w", record.average_power_w);
  fields.field("weights", record.weights);
  fields.field("weights_from", record.weights_from);
  fields.field("figures", record.figures);
  fields.field("warnings", record.warnings);
  fields.by_name("units", record.units, &UnitResult::unit);
  fields.by_name("pipelines", record.pipelines, &PipelineResult::pipeline);
  fields.list("calls", record.calls);
  fields.list("doubted", record.doubted);
  fields.list("plan", record.plan);
  fields.list("tried", record.tried);
  fields.field("bounds", record.bounds);
}

namespace {

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
  RecordWriter fields;
  fields.field("schema_version", RunRecord::kSchemaVersion);
  walk(fields, record);
  Json& json = fields.json;
  if (record.bounds) {
    Json& gaps = json["gaps"] = Json::object();  // derived: not read back
    gaps.put("throughput", gap(record.throughput_per_ms, record.bounds->throughput_per_ms));
    gaps.put("energy", gap(record.energy_j, record.bounds->energy_j));
    gaps.put("makespan", gap(record.makespan_s, record.bounds->makespan_s));
  }
  for (const auto& [figure, interval] : record.intervals) {
    json["intervals"][figure] = {interval.low, interval.high};
  }
  return std::move(json);
}

RunRecord run_record_from_json(const Json& json, const std::string& source) {
  check_version(json, source);
  try {
    RunRecord record;
    RecordReader::read(json, record);
    if (record.time != "virtual" && !record.is_live()) {
      throw_bad_input(source + ": time '" + record.time + "'; a run is in virtual time or live");
    }
    if (json.contains("intervals")) {
      for (const auto& [figure, ends] : json.at("intervals").items()) {
        record.intervals[figure] = {ends.at(0).get<double>(), ends.at(1).get<double>()};
      }
    }
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
