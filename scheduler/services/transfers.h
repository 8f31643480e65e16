// What it takes to move data to, from and between the units of a platform.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "characterize/platform/platform.h"
#include "scheduler/mix/mix.h"
#include "scheduler/mix/task.h"

namespace pirt {

/// The link that data to and from the unit travels over; null if there is none.
[[nodiscard]] const Link* link_of(const Platform& platform, UnitId unit);
/// Where the link of a unit that has one stands among a run's servers: units in order, then links.
[[nodiscard]] std::size_t servers_of_link(const Platform& platform, UnitId unit);
/// How long the link is busy with it; its latency follows.
/// @throws Error{kBadInput} if it is longer than a time in a file may be.
[[nodiscard]] Nanos sending_time(const Link& link, std::int64_t size_bytes);

/// What each call of a task moves over the link of its unit, wherever its predecessors ran: of the
/// workload's inputs and outputs those that travel by no port. Nothing for a task with a service of
/// its own: there, data travels along the edges.
struct CallBytes {
  std::int64_t in = 0;
  std::int64_t out = 0;
  bool moves = false;  ///< It moves something, be it nothing but a message.
};
[[nodiscard]] CallBytes call_bytes(const MixTask& task);

/// Data that one task makes for another. On the same unit it costs nothing to hand on.
struct GraphEdge {
  std::size_t from = 0;
  std::size_t to = 0;
  Nanos delay{0};              ///< Between any two different units.
  std::vector<Nanos> leave{};  ///< By unit: what it adds that the data leaves it; empty = nothing.
  std::vector<Nanos> enter{};  ///< By unit: what it adds that the data goes to it; empty = nothing.
  std::int64_t size_bytes = 0;  ///< What it moves over links.
  bool earlier = false;         ///< Of an earlier firing.

  [[nodiscard]] Nanos transfer(UnitId source, UnitId target) const;
};

/// The edges into a task, as its data moves: `transfer_ms` between different units, and bytes over
/// the links of both, at the mean of their latency. A catalog workload moves data that has no port
/// at each call, so that its unit's link is not counted again here.
/// @return  By MixTask::after; from and to are positions in the pipeline.
[[nodiscard]] std::vector<GraphEdge> edges_into(const Platform& platform, const Pipeline& pipeline,
                                                std::size_t task);

/// The same for what a task takes from earlier firings.
/// @return  One for each task that it takes from.
[[nodiscard]] std::vector<GraphEdge> earlier_edges_into(const Platform& platform,
                                                        const Pipeline& pipeline, std::size_t task);
/// A state of that size, which moves from unit to unit: over the links of both, one after the
/// other.
[[nodiscard]] GraphEdge state_edge(const Platform& platform, std::int64_t size_bytes);

}  // namespace pirt
