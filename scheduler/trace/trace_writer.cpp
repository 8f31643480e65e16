#include "scheduler/trace/trace_writer.h"

#include <fmt/core.h>

#include <algorithm>
#include <iterator>

#include "workloads/base/text/json.h"

namespace pirt {
namespace {

/// Chrome counts in microseconds; with three decimals nothing of a nanosecond is lost.
std::string us(Nanos time) {
  return fmt::format("{}.{:03}", time.count() / 1000, time.count() % 1000);
}

Json header_of(const Scenario& run, const DispatcherSetup& setup, const std::string& time) {
  auto header = to_json(setup);
  header["platform"] = run.platform.name;
  header["mix"] = run.mix.name;
  header["seed"] = run.seed;
  header["time"] = time;
  return header;
}

/// Process 0 is the run; units follow.
std::size_t process(UnitId unit) { return unit + std::size_t{1}; }

}  // namespace

TraceWriter::TraceWriter(const std::filesystem::path& path, const Scenario& run,
                         const DispatcherSetup& setup, const std::string& time)
    : LoadObserver(run.platform),
      run_(run),
      file_(path, header_of(run, setup, time)),
      free_lanes_(run.platform.units.size()),
      lanes_(run.platform.units.size(), 0) {
  for (const auto& unit : run.platform.units) {
    power_.keys.push_back(json_text(unit.name));
    depth_.keys.push_back(json_text(unit.name));
  }
  for (const auto& [name, link] : run.platform.links) {
    power_.keys.push_back(json_text("link " + name));
  }
  depth_.keys.push_back(json_text("in no queue"));
  name_tracks(setup.mode->name);
  settled(Nanos::zero(), std::vector<int>(depth_.keys.size(), 0));
}

void TraceWriter::name_tracks(std::string_view mode) {
  const auto name = [&](std::size_t pid, const std::string& text) {
    file_.event(fmt::format(R"({{"name":"process_name","ph":"M","pid":{},"args":{{"name":{}}}}})",
                            pid, json_text(text)));
    file_.event(fmt::format(
        R"({{"name":"process_sort_index","ph":"M","pid":{},"args":{{"sort_index":{}}}}})", pid,
        pid));
  };
  name(0, "mix " + run_.mix.name + ", mode " + std::string(mode));
  for (UnitId unit = 0; unit < run_.platform.units.size(); ++unit) {
    name(process(unit), run_.platform.units[unit].name);
  }
}

void TraceWriter::submitted(TaskId task, std::size_t pipeline, std::size_t position,
                            std::uint64_t firing) {
  const auto found = tasks_.find(task);
  if (found == tasks_.end()) return;  // It has ended as it was submitted.
  found->second.pipeline = pipeline;
  found->second.position = position;
  found->second.firing = firing;
}

void TraceWriter::on_input(const DispatcherInput& input, const Answer& answer) {
  file_.log(log_line(input, answer));
  if (!answer.taken) return;
  for (std::size_t i = 0; i < answer.submitted.size(); ++i) {
    const TaskId id = answer.submitted[i];
    const Task& task = input.tasks[i];
    for (const TaskId before : task.after) {
      const auto found = tasks_.find(before);
      if (found != tasks_.end()) found->second.successors.push_back(id);
    }
    for (const std::uint32_t before : task.after_own) {
      tasks_.at(answer.submitted[before]).successors.push_back(id);
    }
    tasks_[id] = {};
  }
  for (const Ended& each : answer.ended) {
    const auto found = tasks_.find(each.task);
    if (found != tasks_.end()) found->second.over = true;
  }
  // The slot is free before the next task starts on it.
  if (input.kind == DispatcherInput::Kind::kComplete)
    end_slice(input.task, input.outcome, input.now);
  for (const Start& each : answer.started) start(each, input.now);
  for (const Ended& each : answer.ended) {
    file_.event(fmt::format(
        R"({{"name":"{}","ph":"i","s":"p","pid":0,"tid":0,"ts":{},"args":{{"task":{}}}}})",
        to_string(each.how), us(input.now), each.task));
    // A task that is cancelled while it runs keeps its slice until it completes.
    const auto found = tasks_.find(each.task);
    if (found != tasks_.end() && !found->second.running) tasks_.erase(found);
  }
}

std::size_t TraceWriter::take_lane(UnitId unit) {
  auto& free = free_lanes_[unit];
  if (!free.empty()) return free.extract(free.begin()).value();
  const std::size_t lane = lanes_[unit]++;
  file_.event(fmt::format(
      R"({{"name":"thread_name","ph":"M","pid":{},"tid":{},"args":{{"name":"slot {}"}}}})",
      process(unit), lane, lane + 1));
  return lane;
}

void TraceWriter::start(const Start& start, Nanos now) {
  TaskTrack& track = tasks_[start.task];
  track.slot = {start.unit, take_lane(start.unit)};
  track.started_at = now;
  track.ready_at = start.ready_at;
  track.running = true;
  for (const FlowStart& flow : track.flows) {
    const auto id = ++flows_;
    file_.event(fmt::format(
        R"({{"name":"after","cat":"dependency","ph":"s","id":{},"pid":{},"tid":{},"ts":{}}})", id,
        process(flow.slot.unit), flow.slot.lane, us(flow.at)));
    file_.event(fmt::format(
        R"({{"name":"after","cat":"dependency","ph":"f","bp":"e","id":{},"pid":{},"tid":{},"ts":{}}})",
        id, process(start.unit), track.slot.lane, us(now)));
  }
}

void TraceWriter::end_slice(TaskId task, Outcome outcome, Nanos now) {
  const auto found = tasks_.find(task);
  if (found == tasks_.end()) return;
  // A task that is given back has another slice to come, and only then those behind it.
  found->second.running = false;
  const bool returned = outcome == Outcome::kReturned && !found->second.over;
  TaskTrack track = returned ? found->second : std::move(found->second);
  if (returned) {
    track.successors.clear();
  } else {
    tasks_.erase(found);
  }
  const Pipeline& pipeline = run_.mix.pipelines[track.pipeline];
  const MixTask& definition = pipeline.tasks[track.position];
  file_.event(fmt::format(
      R"({{"name":{},"cat":{},"ph":"X","pid":{},"tid":{},"ts":{},"dur":{},"args":{{"task":{},"firing":{},"waited_us":{},"outcome":"{}"}}}})",
      json_text(pipeline.name + "." + definition.name), json_text(definition.workload),
      process(track.slot.unit), track.slot.lane, us(track.started_at), us(now - track.started_at),
      task, track.firing, us(track.started_at - track.ready_at), word(outcome)));
  free_lanes_[track.slot.unit].insert(track.slot.lane);
  // Within the slice, which ends before `now`.
  const FlowStart flow{track.slot, std::max(track.started_at, now - Nanos(1))};
  for (const TaskId each : track.successors) {
    const auto successor = tasks_.find(each);
    if (successor != tasks_.end()) successor->second.flows.push_back(flow);
  }
}

void TraceWriter::preparing(TaskId task, Nanos now, Nanos takes) {
  const auto found = tasks_.find(task);
  if (found == tasks_.end()) return;
  const TaskTrack& track = found->second;
  const MixTask& definition = run_.mix.pipelines[track.pipeline].tasks[track.position];
  file_.event(fmt::format(
      R"({{"name":"prepare","cat":{},"ph":"X","pid":{},"tid":{},"ts":{},"dur":{},"args":{{"task":{}}}}})",
      json_text(definition.workload), process(track.slot.unit), track.slot.lane, us(now), us(takes),
      task));
}

/// Several things may happen at one moment; what they come to counts.
void TraceWriter::settled(Nanos now, std::span<const int> waiting) {
  if (now > settled_at_) write_counters();
  settled_at_ = now;
  power_.values.clear();
  for (const auto& load : loads_) power_.values.push_back(load.power_w());
  depth_.values.assign(waiting.begin(), waiting.end());
}

void TraceWriter::write_counters() {
  write(power_, settled_at_);
  write(depth_, settled_at_);
}

void TraceWriter::write(Counter& counter, Nanos at) {
  const auto& values = counter.values;
  if (values == counter.written) return;
  counter.written = values;
  std::string line = fmt::format(R"({{"name":"{}","ph":"C","pid":0,"tid":0,"ts":{},"args":{{)",
                                 counter.name, us(at));
  for (std::size_t i = 0; i < values.size(); ++i) {
    fmt::format_to(std::back_inserter(line), "{}{}:{}", i == 0 ? "" : ",", counter.keys[i],
                   values[i]);
  }
  file_.event(line + "}}");
}

void TraceWriter::finish(const Tally& tally) {
  write_counters();
  // The run ends here, and with it what idle units draw.
  std::ranges::fill(power_.values, 0);
  write(power_, std::max(tally.end, settled_at_));
  if (run_.mix.open_loop()) {
    file_.event(fmt::format(
        R"({{"name":"duration: counts and energy are of this moment","ph":"i","s":"g","pid":0,"tid":0,"ts":{}}})",
        us(tally.end)));
  }
  file_.finish();
}

}  // namespace pirt
