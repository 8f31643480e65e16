#include "scheduler/services/transfers.h"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <iterator>

#include "workloads/base/error.h"
#include "workloads/base/text/numbers.h"
#include "workloads/catalog/specs.h"

namespace pirt {
namespace {

std::int64_t total_bytes(const std::vector<TensorSpec>& specs) {
  std::int64_t sum = 0;
  for (const auto& spec : specs) sum += spec.size_bytes();
  return sum;
}

Nanos at_or_none(const std::vector<Nanos>& by_unit, UnitId unit) {
  return by_unit.empty() ? Nanos::zero() : by_unit[unit];
}

/// By unit: over its link, at the mean of its latency.
std::vector<Nanos> link_times(const Platform& platform, std::int64_t size_bytes) {
  std::vector<Nanos> times(platform.units.size(), Nanos::zero());
  for (UnitId unit = 0; unit < times.size(); ++unit) {
    const Link* const link = link_of(platform, unit);
    if (link != nullptr) times[unit] = sending_time(*link, size_bytes) + link->latency.mean();
  }
  return times;
}

}  // namespace

Nanos GraphEdge::transfer(UnitId source, UnitId target) const {
  if (source == target) return Nanos::zero();
  return delay + at_or_none(leave, source) + at_or_none(enter, target);
}

const Link* link_of(const Platform& platform, UnitId unit) {
  const auto link = platform.links.find(platform.units[unit].link);
  return link == platform.links.end() ? nullptr : &link->second;
}

std::size_t servers_of_link(const Platform& platform, UnitId unit) {
  const auto link = platform.links.find(platform.units[unit].link);
  return platform.units.size() +
         static_cast<std::size_t>(std::distance(platform.links.begin(), link));
}

Nanos sending_time(const Link& link, std::int64_t size_bytes) {
  const double ns = static_cast<double>(size_bytes) * 8e3 / link.mbit_s;
  // Neither number is out of its range, but together they may be.
  if (ns > kLongestMs * 1e6) {
    throw_bad_input(fmt::format(
        "sending {} bytes over link {} at {} Mbit/s takes more than {} ms; give fewer bytes in the "
        "mix or a faster link in the platform file",
        size_bytes, link.name, link.mbit_s, kLongestMs));
  }
  return Nanos(std::llround(ns));
}

CallBytes call_bytes(const MixTask& task) {
  if (!task.service.empty()) return {};
  const WorkloadSpec workload = find_spec(task.workload);
  CallBytes bytes{
      .in = total_bytes(workload.inputs), .out = total_bytes(workload.outputs), .moves = true};
  for (const PortInput& port : task.inputs) bytes.in -= workload.inputs[port.input].size_bytes();
  for (const std::size_t output : task.handed_on)
    bytes.out -= workload.outputs[output].size_bytes();
  if (task.bytes) {
    bytes.in = task.bytes->in;
    bytes.out = task.bytes->out;
  }
  if (task.input_bytes) bytes.in = *task.input_bytes;
  return bytes;
}

GraphEdge state_edge(const Platform& platform, std::int64_t size_bytes) {
  const std::vector<Nanos> times = link_times(platform, size_bytes);
  return {.leave = times, .enter = times, .size_bytes = size_bytes};
}

std::vector<GraphEdge> edges_into(const Platform& platform, const Pipeline& pipeline,
                                  std::size_t task) {
  std::vector<GraphEdge> edges;
  const MixTask& target = pipeline.tasks[task];
  for (std::size_t i = 0; i < target.after.size(); ++i) {
    const MixEdge& given = target.edges[i];
    GraphEdge edge{.from = target.after[i],
                   .to = task,
                   .delay = given.transfer,
                   .size_bytes = given.bytes.value_or(0)};
    if (given.bytes && !platform.links.empty()) {
      const bool leaves = given.by_port || !pipeline.tasks[edge.from].service.empty();
      const bool enters = given.by_port || !target.service.empty();
      if (leaves) edge.leave = link_times(platform, *given.bytes);
      if (enters) edge.enter = link_times(platform, *given.bytes);
    }
    edges.push_back(std::move(edge));
  }
  return edges;
}

std::vector<GraphEdge> earlier_edges_into(const Platform& platform, const Pipeline& pipeline,
                                          std::size_t task) {
  std::vector<GraphEdge> edges;
  for (const PortInput& port : pipeline.tasks[task].inputs) {
    if (!port.earlier) continue;
    auto known = std::ranges::find(edges, port.task, &GraphEdge::from);
    if (known == edges.end()) {
      edges.push_back({.from = port.task, .to = task, .earlier = true});
      known = edges.end() - 1;
    }
    const WorkloadSpec maker = find_spec(pipeline.tasks[port.task].workload);
    known->size_bytes += maker.outputs[port.output].size_bytes();
  }
  for (GraphEdge& each : edges) {
    each.leave = each.enter = link_times(platform, each.size_bytes);
  }
  return edges;
}

}  // namespace pirt
