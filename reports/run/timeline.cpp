#include "reports/run/timeline.h"

#include <fmt/core.h>

#include <algorithm>
#include <map>
#include <tuple>

#include "reports/document/figures.h"
#include "scheduler/trace/log_json.h"
#include "scheduler/trace/trace_document.h"
#include "workloads/base/error.h"
#include "workloads/base/text/json.h"
#include "workloads/base/text/text.h"

namespace pirt {
namespace {

/// "localization.blur" -> pipeline and task.
void split_name(const std::string& name, Slice& slice) {
  const auto dot = name.find('.');
  slice.pipeline = name.substr(0, dot);
  slice.task = dot == std::string::npos ? name : name.substr(dot + 1);
}

/// Chrome's microseconds. A trace of virtual time begins at 0, and its numbers are finite.
double ms_of(const Json& event, const char* key) {
  const double us = event.at(key).get<double>();
  if (!(us >= 0 && us < 1e15)) throw_bad_input(fmt::format("{} of a slice is {} us", key, us));
  return us / 1e3;
}

Slice slice_of(const Json& event, std::size_t units) {
  Slice slice;
  const auto process = event.at("pid").get<std::size_t>();  // 0 is the run
  if (process < 1 || process > units) {
    throw_bad_input(fmt::format("a slice is of process {}, which is no unit", process));
  }
  slice.unit = process - 1;
  slice.slot = event.at("tid").get<std::int64_t>();
  split_name(event.at("name").get<std::string>(), slice);
  slice.workload = event.at("cat").get<std::string>();
  slice.start_ms = ms_of(event, "ts");
  slice.end_ms = slice.start_ms + ms_of(event, "dur");
  const Json& arguments = event.at("args");
  slice.firing = arguments.at("firing").get<std::int64_t>();
  slice.waited_ms = ms_of(arguments, "waited_us");
  return slice;
}

Timeline timeline_of(const Json& json) {
  const Json& part = json.at("pirt");
  check_trace_version(part);
  Timeline timeline;
  timeline.mode = part.at("mode").get<std::string>();
  timeline.platform = part.at("platform").get<std::string>();
  timeline.mix = part.at("mix").get<std::string>();
  timeline.seed = part.at("seed").get<std::uint64_t>();
  timeline.time = part.value("time", timeline.time);
  timeline.complete = !part.value("inputs", Json(0)).is_null();
  timeline.units = part.at("units").get<std::vector<std::string>>();
  for (const Json& event : json.at("traceEvents")) {
    if (event.at("ph") == "X") timeline.slices.push_back(slice_of(event, timeline.units.size()));
  }
  std::ranges::stable_sort(timeline.slices, {}, &Slice::start_ms);
  return timeline;
}

constexpr const char* kInTheMiddle =
    "The trace ends in the middle: its run did not come to its end. ";

/// Where the chart ends: with the first task that it has no more room for; and before a few last
/// ones (of the cloud) that would make everything else too small to see.
double window_end(const std::vector<Slice>& all, const std::vector<Slice>& shown) {
  if (shown.empty()) return 0;
  std::vector<double> ends;
  for (const Slice& slice : shown) ends.push_back(slice.end_ms);
  std::ranges::sort(ends);
  const double most = all.size() > shown.size() ? all[shown.size()].start_ms : ends.back();
  const double nearly_all = ends[(ends.size() - 1) * 95 / 100];
  return most > 2 * nearly_all ? nearly_all * 1.05 : most;
}

/// Lanes of units that ever have two tasks at a time say which slot they are.
class Lanes {
 public:
  explicit Lanes(const Timeline& timeline) : units_(timeline.units), most_(units_.size(), 0) {
    for (const Slice& slice : timeline.slices) {
      most_[slice.unit] = std::max(most_[slice.unit], slice.slot);
    }
  }
  [[nodiscard]] std::string name(const Slice& slice) const {
    const std::string& unit = units_[slice.unit];
    return most_[slice.unit] == 0 ? unit : fmt::format("{}, slot {}", unit, slice.slot + 1);
  }

 private:
  const std::vector<std::string>& units_;
  std::vector<std::int64_t> most_;
};

}  // namespace

Timeline load_timeline(const std::filesystem::path& path) {
  return parse_timeline(read_text(path, kAnySize), path.string());
}

Timeline parse_timeline(const std::string& text, const std::string& source) {
  try {
    Timeline timeline = timeline_of(parse_trace(text));
    timeline.source = source;
    return timeline;
  } catch (const JsonError& error) {
    throw_bad_input(not_a_trace(source, error));
  } catch (const Error& error) {
    throw_bad_input(source + ": " + error.what());
  }
}

std::optional<Timeline> planned_timeline(const RunRecord& run) {
  if (run.plan.empty()) return std::nullopt;
  Timeline timeline{.source = "the plan of mode " + run.mode,
                    .platform = run.platform,
                    .mix = run.mix,
                    .mode = run.mode,
                    .seed = run.seed};
  for (const auto& unit : run.units) timeline.units.push_back(unit.unit);
  for (const PlanRow& row : run.plan) {
    const auto unit = std::ranges::find(timeline.units, row.unit);
    if (unit == timeline.units.end()) continue;
    Slice slice;
    slice.unit = static_cast<std::size_t>(unit - timeline.units.begin());
    slice.pipeline = row.pipeline;
    slice.task = row.task;
    slice.start_ms = row.start_ms;
    slice.end_ms = row.finish_ms;
    timeline.slices.push_back(std::move(slice));
  }
  std::ranges::stable_sort(timeline.slices, {}, &Slice::start_ms);
  return timeline;
}

Chart timeline_chart(const Timeline& timeline) {
  Chart chart{.kind = ChartKind::kTimeline, .x = {"ms"}};
  chart.table = {.title = fmt::format("What ran where and when: mode {}, mix {} on {}",
                                      timeline.mode, timeline.mix, timeline.platform),
                 .columns = {{"unit", Align::kLeft},
                             {"pipeline", Align::kLeft},
                             {"task", Align::kLeft},
                             {"workload", Align::kLeft},
                             {"firing"},
                             {"start ms"},
                             {"end ms"},
                             {"waited ms"}},
                 .footnotes = {(timeline.time == "live" ? "Live. " : "Virtual time. ") +
                               std::string(timeline.complete ? "" : kInTheMiddle) +
                               std::string("waited: from the end of its predecessors to its "
                                           "start.")},
                 .origin = timeline.source};
  auto shown = timeline.slices;
  if (shown.size() > kMostSlices) shown.resize(kMostSlices);
  const double until = window_end(timeline.slices, shown);
  std::erase_if(shown, [&](const Slice& slice) { return slice.start_ms > until; });
  chart.summary = fmt::format("{} of {} tasks, from 0 to {} ms.", shown.size(),
                              timeline.slices.size(), figure(until));
  std::ranges::stable_sort(shown, {}, [](const Slice& slice) {
    return std::tuple(slice.unit, slice.slot, slice.start_ms);
  });
  const Lanes lanes(timeline);
  for (const Slice& slice : shown) {
    chart.table.rows.push_back(
        {lanes.name(slice), slice.pipeline, slice.task,
         slice.workload.empty() ? "-" : slice.workload, fmt::format("{}", slice.firing),
         fmt::format("{:.3f}", slice.start_ms), fmt::format("{:.3f}", slice.end_ms),
         fmt::format("{:.3f}", slice.waited_ms)});
    chart.marks.push_back({.group = lanes.name(slice),
                           .series = slice.pipeline,
                           .low = slice.start_ms,
                           .high = std::max(slice.start_ms, std::min(slice.end_ms, until)),
                           .provenance = Provenance::kModelled,
                           .word = slice.task});
  }
  return chart;
}

}  // namespace pirt
