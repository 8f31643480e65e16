// What a robot runs: pipelines of tasks with rates, dependencies and deadlines. Read from YAML,
// checked completely, and never changed.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "workloads/base/time.h"

namespace pirt {

/// What travels from one task to the next.
struct MixEdge {
  std::optional<std::int64_t> bytes;  ///< Over the links of the units.
  Nanos transfer{0};                  ///< Delay between any two different units.
};

struct MixTask {
  std::string name;      ///< Unique in its pipeline.
  std::string workload;  ///< Of the catalog, or "pipeline/task" if the task has its own service.
  /// Time of a call by unit or role, each above 0, for tasks that are in no catalog; otherwise
  /// empty.
  std::map<std::string, Nanos> service;
  std::string service_location;  ///< "file:line: path" of it, for messages.
  bool image_input = false;
  std::vector<std::size_t> after;  ///< Positions in Pipeline::tasks, all before this one.
  std::vector<MixEdge> edges;      ///< From each of `after`.
  std::optional<std::int64_t>
      input_bytes;                    ///< Given with the edges; absent = the workload's inputs.
  std::vector<std::string> eligible;  ///< Units or roles that may serve it; empty = all.
};

struct Pipeline {
  std::string name;
  std::optional<double> rate_hz;  ///< Open loop: fires at 0, 1/rate, 2/rate, ...
  std::optional<std::int64_t>
      frames;  ///< Closed loop: fires so often, a new one at each end. One of the two is given.
  std::optional<Nanos> deadline;  ///< Of a firing's last task, from the firing on.
  std::optional<Nanos>
      expires;  ///< A task not started so long after its firing is given up, with its successors.
  bool real_time = true;       ///< False: may take longer than 30 s.
  std::vector<MixTask> tasks;  ///< Predecessors first, otherwise in file order.

  [[nodiscard]] bool has_image_input() const;
};

struct Mix {
  std::string name;
  std::string description;
  std::optional<std::int64_t> image_buffers;  ///< Absent = no limit.
  std::vector<Pipeline> pipelines;            ///< In file order; ties in time break by it.

  [[nodiscard]] bool open_loop() const;   ///< Some pipeline has a rate.
  [[nodiscard]] bool fires_once() const;  ///< Every pipeline is one frame of a closed loop.
};

/// A shipped name, or a file if @p name contains '/' or ends in ".yaml".
/// @throws Error{kBadInput} with file:line; unknown shipped names come with the nearest ones; a
/// cycle is printed with its names.
[[nodiscard]] Mix load_mix(const std::string& name);
/// @param file  Name for messages.
[[nodiscard]] Mix parse_mix(const std::string& file, const std::string& text);
[[nodiscard]] std::vector<std::string> shipped_mixes();

}  // namespace pirt
