#include "workloads/backends/fpga/simulation.h"

#include <fmt/core.h>

#include <algorithm>

#include "workloads/base/error.h"

namespace pirt::fpga {
namespace {

std::int64_t elements_of(std::span<const Lane> lanes) {
  return lanes.empty() ? 0 : std::ssize(lanes[0].memory) / lanes[0].bytes;
}

/// Beyond that a core has stopped: none takes as many cycles for what goes in or out, however it is
/// starved.
void refuse_to_wait(std::int64_t cycle, const Task& task) {
  if (cycle > 1'000'000 + 200 * (elements_of(task.in) + elements_of(task.out))) {
    throw_environment(
        fmt::format("a core of backend fpga gave no answer in {} cycles for {} elements", cycle,
                    elements_of(task.in)));
  }
}

/// The streams of a task's lanes: readers, then writers.
class Streams {
 public:
  explicit Streams(const Task& task) : task_(task) {
    for (const Lane& lane : task.in) streams_.push_back(Stream::reading(lane.memory));
    for (const Lane& lane : task.out) streams_.push_back(Stream::writing(lane.memory));
  }

  [[nodiscard]] std::span<Stream> all() { return streams_; }
  [[nodiscard]] bool is_done() const { return std::ranges::all_of(streams_, &Stream::is_done); }

  [[nodiscard]] Driven driven() const {
    Driven driven{.in_valid = true, .in_data = 0, .out_ready = true};
    int shift = 0;
    for (std::size_t i = 0; i < task_.in.size(); ++i) {
      const int bytes = task_.in[i].bytes;
      driven.in_valid = driven.in_valid && streams_[i].queued() >= static_cast<std::size_t>(bytes);
      if (driven.in_valid) driven.in_data |= streams_[i].peek(bytes) << shift;
      shift += 8 * bytes;
    }
    for (std::size_t i = 0; i < task_.out.size(); ++i) {
      driven.out_ready =
          driven.out_ready && streams_[task_.in.size() + i].has_room(task_.out[i].bytes);
    }
    return driven;
  }

  void move(const Driven& driven, const Shown& shown) {
    if (driven.in_valid && shown.in_ready) {
      for (std::size_t i = 0; i < task_.in.size(); ++i) streams_[i].take(task_.in[i].bytes);
    }
    if (!shown.out_valid || !driven.out_ready) return;
    std::uint64_t value = shown.out_data;
    for (std::size_t i = 0; i < task_.out.size(); ++i) {
      const int bytes = task_.out[i].bytes;
      streams_[task_.in.size() + i].give(value, bytes);
      value = bytes == 8 ? 0 : value >> (8 * bytes);
    }
  }

 private:
  const Task& task_;
  std::vector<Stream> streams_;
};

}  // namespace

std::int64_t cycles_alone(Core& core, const Task& task) {
  core.start(task.width, task.height, task.parameters);
  constexpr Driven kAlways{.in_valid = true, .in_data = 0, .out_ready = true};
  std::int64_t given = 0, first = -1;
  for (std::int64_t cycle = 0;; ++cycle) {
    refuse_to_wait(cycle, task);
    const Shown shown = core.show(kAlways);
    if (shown.in_ready && first < 0) first = cycle;
    if (shown.out_valid && ++given == elements_of(task.out)) return cycle - first + 1;
    core.clock();
  }
}

std::int64_t cycles_with_memory(Core& core, const Task& task, std::int64_t core_hz,
                                const SdramTiming& timing) {
  core.start(task.width, task.height, task.parameters);
  Streams streams(task);
  Sdram sdram(timing, streams.all());
  // Both clocks start together; the memory's goes on by its share of a cycle of the core's.
  std::int64_t owed = 0;
  for (std::int64_t cycle = 0;; ++cycle) {
    refuse_to_wait(cycle, task);
    if (streams.is_done()) return cycle;
    for (owed += timing.clock_hz; owed >= core_hz; owed -= core_hz) sdram.clock();
    const Driven driven = streams.driven();
    const Shown shown = core.show(driven);
    core.clock();
    streams.move(driven, shown);
  }
}

double transfer_s(std::size_t size_bytes, bool into_memory, const SdramTiming& timing) {
  std::vector<std::byte> memory(size_bytes);
  std::vector<Stream> stream;
  stream.push_back(into_memory ? Stream::writing(memory) : Stream::reading(memory));
  Sdram sdram(timing, stream);
  std::int64_t cycle = 0, given = 0;
  for (; !stream[0].is_done(); ++cycle) {
    // The other side is always fast enough.
    if (into_memory) {
      for (; given < std::ssize(memory) && stream[0].has_room(1); ++given) stream[0].give(0, 1);
    } else {
      stream[0].take(static_cast<int>(std::min<std::size_t>(8, stream[0].queued())));
    }
    sdram.clock();
  }
  return static_cast<double>(cycle) / static_cast<double>(timing.clock_hz);
}

}  // namespace pirt::fpga
