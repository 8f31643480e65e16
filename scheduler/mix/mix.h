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
  /// The bytes are those of ports: the data stays where it was made until somebody elsewhere takes
  /// it, and no call moves it besides.
  bool by_port = false;
};

/// What a call moves to where it is computed, and back.
struct MixBytes {
  std::int64_t in = 0, out = 0;
};

/// Data that a task takes from another.
struct PortInput {
  std::size_t input = 0;   ///< Position in its workload's inputs.
  std::size_t task = 0;    ///< Who makes it: position in Pipeline::tasks.
  std::size_t output = 0;  ///< Position in that one's workload's outputs.
  /// `@-1`: not of the same firing, but of the nearest earlier one that completed that task. No
  /// edge, since nothing of the same firing is waited for.
  bool earlier = false;
  friend bool operator==(const PortInput&, const PortInput&) = default;
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
      input_bytes;  ///< Given with the edges; absent = the workload's inputs.
  /// Of a foreign workload, whose tensors nobody here knows; absent = nothing.
  std::optional<MixBytes> bytes;
  std::vector<PortInput> inputs;       ///< Each input at most once; the others come from outside.
  std::vector<std::size_t> handed_on;  ///< Its outputs that others take, each once, rising.
  bool read_later = false;             ///< Some task of a later firing takes one of them.
  std::optional<std::size_t> state;    ///< Position in Mix::states of what it holds.
  std::vector<std::string> eligible;   ///< Units or roles that may serve it; empty = all.
};

struct Pipeline {
  std::string name;
  std::optional<double> rate_hz;  ///< Open loop: fires at offset, offset + 1/rate, ...
  std::optional<std::int64_t>
      frames;  ///< Closed loop: fires so often, a new one at each end. One of the two is given.
  Nanos offset{0};  ///< Of the first firing, with a rate.
  Nanos jitter{0};  ///< With a rate: each firing comes by up to so much later, drawn by the seed.
  std::optional<Nanos> deadline;  ///< Of a firing's last task, from the firing on.
  std::optional<Nanos>
      expires;  ///< A task not started so long after its firing is given up, with its successors.
  bool real_time = true;       ///< False: may take longer than 30 s.
  std::vector<MixTask> tasks;  ///< Predecessors first, otherwise in file order.

  [[nodiscard]] bool has_image_input() const;
  [[nodiscard]] Nanos period() const { return from_s(1 / *rate_hz); }  ///< Only with a rate.
  /// Positions of the tasks of the same firing that have to end before it begins: `after`, and the
  /// last one before it that holds its state.
  [[nodiscard]] std::vector<std::size_t> waits_for(std::size_t task) const;
  /// Whether a later firing takes an image of this one, which keeps its buffer until then.
  [[nodiscard]] bool keeps_image() const;
};

/// What tasks hold while they run, one at a time.
struct MixState {
  std::string name;  ///< "pipeline/state of the workload", or what the tasks call it.
  std::int64_t size_bytes = 0;
  std::string workload;  ///< Of the first task that holds it: makes it.
};

struct Mix {
  std::string name;
  std::string argument;  ///< What load_mix was given: the name, or a file. For messages.
  std::string description;
  std::optional<std::int64_t> image_buffers;  ///< Absent = no limit.
  std::vector<Pipeline> pipelines;            ///< In file order; ties in time break by it.
  std::vector<MixState> states;

  [[nodiscard]] bool open_loop() const;      ///< Some pipeline has a rate.
  [[nodiscard]] bool fires_once() const;     ///< Every pipeline is one frame of a closed loop.
  [[nodiscard]] bool reads_earlier() const;  ///< Some task takes data of an earlier firing.
};

/// From a pipeline's first nominal time to that of a firing, before it is rounded: by its number
/// and not from the last one, so that rounding does not add up.
[[nodiscard]] inline double nominal_ns(double rate_hz, std::int64_t number) {
  return static_cast<double>(number) * 1e9 / rate_hz;
}

/// A shipped name, or a file if @p name contains '/' or ends in ".yaml".
/// @throws Error{kBadInput} with file:line; unknown shipped names come with the nearest ones; a
/// cycle is printed with its names.
[[nodiscard]] Mix load_mix(const std::string& name);
/// @param file  Name for messages.
[[nodiscard]] Mix parse_mix(const std::string& file, const std::string& text);
/// What the tasks of a mix, named as for load_mix, have for `workload`: before any of them is
/// known.
/// @throws Error{kBadInput} with file:line where it has no tasks to look through.
[[nodiscard]] std::vector<std::string> named_workloads(const std::string& name);
[[nodiscard]] std::vector<std::string> shipped_mixes();

}  // namespace pirt
