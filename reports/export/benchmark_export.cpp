// The JSON of Google Benchmark. Declared in profile_export.h.
//
// Source of the keys: google/benchmark v1.7.1, src/json_reporter.cc, and what its tools/gbench
// reads.
#include <fmt/core.h>

#include <optional>
#include <utility>

#include "reports/export/profile_export.h"
#include "workloads/base/text/json.h"
#include "workloads/base/text/text.h"

namespace pirt {
namespace {

std::string fact(const RunInfo& run, const std::string& key) {
  const auto found = run.environment.find(key);
  return found == run.environment.end() ? std::string("unknown") : found->second;
}

/// Of the newest run; `pirt_*` is what Google Benchmark has no key for.
Json context(const Profile& profile) {
  const RunInfo& run = profile.runs.front();
  Json json = {{"date", run.started}, {"executable", "pirt"}};
  if (const auto cores = run.figure("cores_online")) {
    json["num_cpus"] = static_cast<std::int64_t>(*cores);
  }
  json["caches"] = Json::array();
  json["load_avg"] = Json::array();
  if (const auto load = run.figure("load_1m")) json["load_avg"].push_back(*load);
  json["library_build_type"] = fact(run, "build_type") == "Debug" ? "debug" : "release";
  json["json_schema_version"] = 1;
  json["pirt_version"] = fact(run, "pirt_version");
  json["pirt_platform"] = run.platform;
  json["pirt_cpu_model"] = fact(run, "cpu_model");
  json["pirt_cpu_time"] = "not measured: repeats real_time";
  for (const UnitRecord& unit : run.units) {
    json["pirt_units"][unit.unit] = unit.backend + " on " + unit.device;
  }
  return json;
}

Json entry(const PhaseRow& row, const std::string& suffix, const std::string& type, Nanos value) {
  const std::string name = benchmark_name(row);
  std::string label(to_string(row.provenance));
  if (row.provenance.mixture) label += "; mixture";
  if (!row.notes.empty()) label += "; " + join(row.notes, "; ");
  Json json = {{"name", name + suffix},
               {"run_name", name},
               {"run_type", type},
               {"repetitions", row.samples},
               {"threads", 1},
               {"iterations", 1},
               {"real_time", value.count()},
               {"cpu_time", value.count()},
               {"time_unit", "ns"},
               {"label", label},
               {"provenance", to_string(row.provenance)},
               {"mixture", row.provenance.mixture},
               {"run_id", row.run_id}};
  if (!row.doubts.empty()) json["doubts"] = row.doubts;
  return json;
}

void add_row(const PhaseRow& row, Json& benchmarks) {
  std::int64_t index = 0;
  for (const Nanos sample : row.values) {
    Json json = entry(row, "", "iteration", sample);
    json["repetition_index"] = index++;
    benchmarks.push_back(std::move(json));
  }
  const std::pair<const char*, std::optional<Nanos>> aggregates[] = {
      {"median", row.median}, {"mad", row.mad}, {"p95", row.p95}, {"p99", row.p99}};
  for (const auto& [name, value] : aggregates) {
    if (!value) continue;
    Json json = entry(row, std::string("_") + name, "aggregate", *value);
    json["aggregate_name"] = name;
    json["aggregate_unit"] = "time";
    json["iterations"] = row.samples;
    benchmarks.push_back(std::move(json));
  }
}

}  // namespace

std::string benchmark_name(const PhaseRow& row) {
  const std::string state =
      row.state == State::kSteady ? std::string() : fmt::format("_{}", to_string(row.state));
  return fmt::format("{}/{}/{}{}/real_time", row.workload, row.unit, to_string(row.phase), state);
}

BenchmarkExport export_google_benchmark(const Profile& profile) {
  BenchmarkExport result;
  Json benchmarks = Json::array();
  for (const PhaseRow& row : profile.phases) {
    if (is_used(row) && !row.values.empty()) {
      add_row(row, benchmarks);
    } else {
      result.left_out.push_back(benchmark_name(row) + ": " + join(held_against(row), ", "));
    }
  }
  result.json = {{"context", context(profile)}, {"benchmarks", std::move(benchmarks)}};
  result.json["context"]["pirt_left_out"] = result.left_out;
  return result;
}

}  // namespace pirt
