// JSON of nvbench: what kernels of the user's took on an NVIDIA GPU.
// Source of the tags and forms: NVIDIA/nvbench, nvbench/detail/measure_cold.cu and
// nvbench/json_printer.cu.
//
// A row is the mean time on the host's clock from a kernel's launch to its end, after the L2 was
// flushed: the nearest thing to a call, without what is moved. The GPU's own time of it and
// launches in a row are less than a call.
#include <fmt/core.h>

#include <map>

#include "characterize/published/published.h"
#include "workloads/base/text/numbers.h"

namespace pirt {
namespace {

/// Null if the state has no such summary.
const Json* summary_value(const Json& state, std::string_view tag) {
  for (const Json& summary : state.at("summaries")) {
    if (summary.value("tag", "") != tag) continue;
    for (const Json& datum : summary.at("data")) {
      if (datum.value("name", "") == "value") return &datum.at("value");
    }
  }
  return nullptr;
}

/// nvbench writes numbers as texts; older ones did not.
double seconds_of(const Json& value, const std::string& workload) {
  if (!value.is_string()) return value.get<double>();
  const auto read = decimal_number(value.get<std::string>(), 0, 1e9);
  if (!read.value) throw JsonError(workload + ": its time " + read.problem);
  return *read.value;
}

std::string calls_of(const Json& state) {
  const Json* const count = summary_value(state, "nv/cold/sample_size");
  if (count == nullptr) return "an unknown number of";
  return count->is_string() ? count->get<std::string>()
                            : fmt::format("{}", count->get<std::int64_t>());
}

/// "copy_Elements_65536" of benchmark copy at Elements = 65536.
std::string name_of_state(const std::string& benchmark, const Json& state) {
  std::string said = benchmark;
  for (const Json& axis : state.at("axis_values")) {
    const Json& value = axis.at("value");
    said += "_" + axis.at("name").get<std::string>() + "_" +
            (value.is_string() ? value.get<std::string>() : json_text(value));
  }
  return said;
}

}  // namespace

Publication read_nvbench(const std::string& file, const Json& root) {
  PublishedBoard board{.name = board_of(file), .said = file, .provenance = Provenance::kMeasured};
  std::map<std::int64_t, std::string> units;  // by nvbench's number of the device
  for (const Json& device : root.at("devices")) {
    const std::string name =
        fmt::format("gpu{}", units.empty() ? "" : std::to_string(units.size()));
    units.emplace(device.at("id").get<std::int64_t>(), name);
    add_unit(board,
             {.name = name, .device = device.at("name").get<std::string>(), .is_cpu = false});
  }
  Publication publication{.format = "nvbench", .boards = {}};
  std::map<std::string, std::string> known;
  for (const Json& benchmark : root.at("benchmarks")) {
    const std::string name = benchmark.at("name").get<std::string>();
    for (const Json& state : benchmark.at("states")) {
      const std::string workload = foreign_name("nvbench", name_of_state(name, state), known);
      const Json* const seconds = summary_value(state, "nv/cold/time/cpu/mean");
      if (state.value("is_skipped", false) || seconds == nullptr) {
        publication.left_out.push_back(workload + ": no time on the host's clock");
        continue;
      }
      const auto unit = units.find(state.at("device").get<std::int64_t>());
      if (unit == units.end()) throw JsonError(workload + ": its device is not under 'devices'");
      add_figure(board, {.workload = workload,
                         .unit = unit->second,
                         .samples = {published_time(seconds_of(*seconds, workload), 1e9, workload)},
                         .notes = {fmt::format("mean of {} calls from launch to end, L2 flushed "
                                               "before, without transfers",
                                               calls_of(state))}});
    }
  }
  publication.left_out.push_back(
      "the GPU's own times and launches in a row: less than a call takes");
  publication.boards.push_back(std::move(board));
  return publication;
}

}  // namespace pirt
