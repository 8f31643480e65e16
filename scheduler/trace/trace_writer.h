// Writes a run as it goes: tracks, counters and flows for Perfetto, and the dispatcher's log for
// `pirt replay`.
//
// Tracks: a process a unit, in it a thread a slot, in that a slice a task, from start to
// completion. Slices of a slot never overlap, but that of a task whose context the unit had to load
// has a slice `prepare` in it. Flows lead from a task to those that waited for it.
// Counters: power, by unit and link, and queue depth, by unit and for tasks that are in no unit's
// queue.
//
// Power is what servers and links draw and what units draw idle; joules that a call costs as a
// whole (call_j, a meter's, those of operations and bytes) are drawn evenly while it is served.
#pragma once

#include <filesystem>
#include <set>
#include <span>
#include <string>
#include <unordered_map>
#include <utility>
#include <vector>

#include "scheduler/record/tally.h"
#include "scheduler/services/scenario.h"
#include "scheduler/trace/log_json.h"
#include "scheduler/trace/server_load.h"
#include "scheduler/trace/trace_file.h"

namespace pirt {

class TraceWriter final : public DispatcherObserver, public LoadObserver {
 public:
  /// @param run   For names; its references must outlive the writer.
  /// @param time  "virtual" or "live", as in the run's record.
  /// @throws Error{kBadInput} if nothing can be written there.
  TraceWriter(const std::filesystem::path& path, const Scenario& run, const DispatcherSetup& setup,
              const std::string& time = "virtual");

  void on_input(const DispatcherInput& input, const Answer& answer) override;
  void submitted(TaskId task, std::size_t pipeline, std::size_t position,
                 std::uint64_t firing) override;
  void preparing(TaskId task, Nanos now, Nanos takes) override;
  void settled(Nanos now, std::span<const int> waiting) override;

  /// What has been written survives the process, once the dispatcher has had an input.
  /// @throws Error{kBadInput} if something could not be written.
  void flush() { file_.flush(); }
  /// The trace is complete after this. It runs to the last completion; where counts and energy are
  /// of an earlier moment, the duration, that is marked.
  /// @throws Error{kBadInput} if it cannot be written.
  void finish(const Tally& tally);

 private:
  struct Slot {
    UnitId unit = 0;
    std::size_t lane = 0;
  };
  /// Where in a slice a flow begins.
  struct FlowStart {
    Slot slot;
    Nanos at{0};
  };
  struct TaskTrack {
    std::size_t pipeline = 0, position = 0;
    std::uint64_t firing = 0;
    std::vector<TaskId> successors;
    std::vector<FlowStart> flows;  ///< Of its predecessors that are complete.
    Slot slot;
    Nanos started_at{0}, ready_at{0};
    bool running = false;
    bool over = false;  ///< For the dispatcher; it may still run.
  };

  struct Counter {
    const char* name;
    std::vector<std::string> keys = {};
    std::vector<double> values = {};   ///< At settled_at_.
    std::vector<double> written = {};  ///< The last ones.
  };

  void name_tracks(std::string_view mode);
  void start(const Start& start, Nanos now);
  void end_slice(TaskId task, Outcome outcome, Nanos now);
  std::size_t take_lane(UnitId unit);
  void write(Counter& counter, Nanos at);
  void write_counters();

  const Scenario& run_;
  TraceFile file_;
  std::unordered_map<TaskId, TaskTrack> tasks_;
  std::vector<std::set<std::size_t>> free_lanes_;  ///< By unit.
  std::vector<std::size_t> lanes_;                 ///< By unit: how many there are.
  Counter power_{.name = "power W"}, depth_{.name = "queue depth"};
  Nanos settled_at_{0};
  std::uint64_t flows_ = 0;
};

}  // namespace pirt
