#include "scheduler/services/call_plan.h"

#include <algorithm>
#include <iterator>
#include <limits>

namespace pirt {
namespace {

void add_link(const Platform& platform, UnitId unit, std::int64_t size_bytes,
              std::vector<CallStep>& steps) {
  const Link* const link = link_of(platform, unit);
  if (link == nullptr) return;
  const Nanos sending = sending_time(*link, size_bytes);
  const Distribution& latency = link->latency;
  steps.push_back({.servers = static_cast<std::uint32_t>(servers_of_link(platform, unit)),
                   .time = Distribution::constant(sending),
                   .usual = sending,
                   .scaled = sending,
                   .watts = link->active_w,
                   .energy_scale = 1});
  steps.push_back({.time = latency, .usual = usual_worst_of(latency), .scaled = latency.mean()});
}

/// How many times as long a call takes at most beside all that share the unit's memory.
double beside_all(const Platform& platform, UnitId unit, const CallConditions& conditions) {
  const auto others = platform.neighbours(platform.units[unit]).size();
  return 1 + static_cast<double>(others) * (conditions.slowest_beside() - 1);
}

void add_stages(const Platform& platform, const Service& service, UnitId unit,
                std::vector<CallStep>& steps) {
  const ServiceStage* sliced = nullptr;  // The longest on the unit itself.
  for (const ServiceStage& stage : service.stages) {
    if (service.slices.size() <= 1 || stage.on != unit) continue;
    if (sliced == nullptr || stage.mean() > sliced->mean()) sliced = &stage;
  }
  for (const ServiceStage& stage : service.stages) {
    CallStep& step = steps.emplace_back();
    step.time = stage.time;
    step.usual = stage.usual();
    step.scaled = stage.mean();
    step.scale = stage.scale;
    if (stage.on) {
      step.servers = *stage.on;
      step.watts = platform.units[*stage.on].active_w;
      step.energy_scale = service.metered_j ? 0 : stage.energy_scale;
    }
    if (service.conditions && stage.on == unit && stage.name == to_string(Phase::kExecute)) {
      step.conditions = &*service.conditions;
      step.beside = beside_all(platform, unit, *step.conditions);
    }
    if (&stage == sliced) step.slices = &service.slices;
  }
}

/// A call's own joules are drawn while its unit works on it, or, where that never does, while any
/// server does, or, of one that has none, while it lasts: a second of it has as much of them as any
/// other.
void spread_own(double own_j, UnitId unit, std::span<CallStep> stages) {
  const auto served = [stages](const auto& by) {
    return std::ranges::any_of(
        stages, [&](const CallStep& step) { return by(step) && step.scaled > Nanos::zero(); });
  };
  const auto by_unit = [unit](const CallStep& step) { return step.servers == unit; };
  const auto by_any = [](const CallStep& step) { return step.servers != CallStep::kDelay; };
  const bool own = served(by_unit);
  const bool any = served(by_any);
  const auto counts = [&](const CallStep& step) {
    return own ? by_unit(step) : !any || by_any(step);
  };
  Nanos all{0};
  for (const CallStep& step : stages) all += counts(step) ? step.scaled : Nanos::zero();
  for (CallStep& step : stages) {
    if (!counts(step)) continue;
    step.own_j = all > Nanos::zero() ? own_j * (to_s(step.scaled) / to_s(all)) : 0;
  }
  if (all == Nanos::zero() && !stages.empty()) stages.front().own_j = own_j;
}

/// Whether some call of the unit can be suspended for another.
bool lets_in(const ServiceTable& services, UnitId unit) {
  return std::ranges::any_of(services.entries, [unit](const std::vector<ServiceEntry>& row) {
    return row[unit].service && row[unit].service->slices.size() > 1;
  });
}

bool takes_time(const GraphEdge& edge) {
  const auto any = [](const std::vector<Nanos>& times) {
    return std::ranges::any_of(times, [](Nanos time) { return time > Nanos::zero(); });
  };
  return edge.delay > Nanos::zero() || any(edge.leave) || any(edge.enter);
}

/// Empty if none takes time.
std::vector<GraphEdge> data_edges(const Platform& platform, const Pipeline& pipeline,
                                  std::size_t task) {
  std::vector<GraphEdge> edges = edges_into(platform, pipeline, task);
  std::ranges::move(earlier_edges_into(platform, pipeline, task), std::back_inserter(edges));
  if (std::ranges::none_of(edges, takes_time)) edges.clear();
  return edges;
}

/// Joules of the links of both ends; nothing where the data does not move.
double moving_j(const Platform& platform, UnitId from, UnitId to, std::int64_t size_bytes) {
  double energy_j = 0;
  for (const UnitId end : {from, to}) {
    const Link* link = from == to ? nullptr : link_of(platform, end);
    if (link != nullptr) energy_j += link->active_w * to_s(sending_time(*link, size_bytes));
  }
  return energy_j;
}

/// First, the wait for data on its way, at its longest: from any unit that may have it.
void add_wait(const Scenario& scenario, std::size_t pipeline, const TaskPlan& task, UnitId unit,
              CallPlan& call) {
  if (task.edges.empty() && !task.state) return;
  const Platform& platform = scenario.platform;
  Nanos longest{0};
  const auto add = [&](UnitMask sources, const GraphEdge& edge) {
    double most_j = 0;
    for (UnitId from = 0; from < platform.units.size(); ++from) {
      if (!contains(sources, from)) continue;
      longest = std::max(longest, edge.transfer(from, unit));
      most_j = std::max(most_j, moving_j(platform, from, unit, edge.size_bytes));
    }
    call.data_j += most_j;
  };
  for (const GraphEdge& edge : task.edges) {
    add(scenario.classes[pipeline][edge.from].eligible, edge);
  }
  if (task.state) add(~UnitMask{0}, task.state_edge);
  CallStep& wait = *call.steps.emplace(call.steps.begin());
  wait.usual = longest;
  wait.for_data = true;
}

bool is_worst(Taken taken) { return taken == Taken::kUsualWorst || taken == Taken::kWorst; }

}  // namespace

Nanos CallStep::before_scale(Taken taken) const {
  const bool certain = taken == Taken::kLeast || taken == Taken::kMean;
  if (prepares && certain) return Nanos::zero();
  if (taken == Taken::kMean) return time.mean();
  if (is_worst(taken)) {
    if (taken == Taken::kUsualWorst || conditions == nullptr) return usual;
    return pirt::scaled(std::max(usual, conditions->usual_worst), beside);
  }
  Nanos least = time.low;
  Nanos most = std::max(time.high, usual);
  if (conditions != nullptr) {
    // A cold call that was measured apart may have been the faster one.
    for (const auto* cold : {&conditions->cold_cache, &conditions->cold_memory}) {
      if (!*cold) continue;
      least = std::min(least, (*cold)->low);
      most = std::max(most, (*cold)->high);
    }
    most = pirt::scaled(most, beside);
  }
  return taken == Taken::kLeast ? least : most;
}

Nanos CallStep::takes(Taken taken) const {
  if (taken == Taken::kMean && !prepares) return scaled;
  return scale == 1 ? before_scale(taken) : pirt::scaled(before_scale(taken), scale);
}

Nanos CallPlan::takes(Taken taken) const {
  Nanos sum = is_worst(taken) ? handover + leave : Nanos::zero();
  for (const CallStep& step : steps) sum += step.takes(taken);
  return sum;
}

Nanos CallPlan::prepares() const {
  Nanos sum{0};
  for (const CallStep& step : steps) sum += step.prepares ? step.scaled : Nanos::zero();
  return sum;
}

Nanos CallPlan::on(std::uint32_t servers, Taken taken) const {
  Nanos sum{0};
  for (const CallStep& step : steps) {
    if (step.servers == servers) sum += step.takes(taken);
  }
  return sum;
}

Nanos CallPlan::bottleneck(UnitId unit) const {
  Nanos own{0};
  Nanos any{0};
  for (const CallStep& step : steps) {
    const Nanos takes = step.takes(Taken::kMean);
    any = std::max(any, takes);
    if (step.servers == unit) own = std::max(own, takes);
  }
  return own > Nanos::zero() ? own : any;
}

Nanos CallPlan::longest_slice() const {
  Nanos longest{0};
  Nanos since = handover + leave;  // It could be suspended.
  for (const CallStep& step : steps) {
    const Nanos takes = step.prepares ? Nanos::zero() : step.takes(Taken::kUsualWorst);
    if (step.slices == nullptr) {
      since += takes;
      continue;
    }
    for (std::size_t part = 0; part < step.slices->size(); ++part) {
      since += pirt::scaled(takes, (*step.slices)[part]);
      longest = std::max(longest, since);
      if (part + 1 < step.slices->size()) since = leave;
    }
  }
  return std::max(longest, since);
}

std::optional<double> CallPlan::energy_j(Taken taken) const {
  if (!energy_known) return std::nullopt;
  double energy_j = own_j();
  for (const CallStep& step : steps) {
    if (step.servers == CallStep::kDelay) continue;
    energy_j += step.watts * to_s(step.before_scale(taken)) * step.energy_scale;
  }
  return energy_j;
}

double CallPlan::own_j() const {
  double sum = 0;
  for (const CallStep& step : steps) sum += step.own_j;
  return sum;
}

double CallPlan::window_j() const {
  double energy_j = 0;
  double highest_w = 0;
  for (const CallStep& step : steps) {
    // What lengthens a call lets it draw for longer, but for its own joules.
    energy_j += step.watts * to_s(step.before_scale(Taken::kHighest)) * step.energy_scale;
    highest_w = std::max(highest_w, step.watts * step.energy_scale / step.scale);
  }
  return own_j() + data_j + std::min(energy_j, highest_w * to_s(kPowerWindow));
}

CallPlan plan_call(const Platform& platform, const ServiceTable& services, WorkloadId workload,
                   UnitId unit, const CallBytes& bytes) {
  const Service& service = *services.find(workload, unit);
  CallPlan call;
  call.energy_known = service.energy_known;
  if (!services.units.empty()) {
    call.handover = services.units[unit].longest_handover;
    const Nanos leave = services.units[unit].longest_leave;
    if (leave > Nanos::zero() && lets_in(services, unit)) call.leave = leave;
  }
  if (bytes.moves) add_link(platform, unit, bytes.in, call.steps);
  if (service.prepare) {
    CallStep& load = call.steps.emplace_back();
    load.servers = unit;
    load.time = Distribution::constant(*service.prepare);
    load.usual = load.scaled = *service.prepare;
    load.watts = platform.units[unit].active_w;
    load.energy_scale = service.metered_j ? 0.0 : 1.0;
    load.prepares = true;
    load.context =
        context_of(*platform.units[unit].contexts, workload, services.workloads[workload]);
  }
  const std::size_t first = call.steps.size();
  add_stages(platform, service, unit, call.steps);
  spread_own(service.fixed_j(), unit, std::span(call.steps).subspan(first));
  if (bytes.moves) add_link(platform, unit, bytes.out, call.steps);
  return call;
}

std::int64_t calls_in_service(int servers, Nanos total, Nanos occupied) {
  constexpr auto kNoLimit = std::numeric_limits<std::int64_t>::max();
  if (occupied <= Nanos::zero()) return kNoLimit;
  // Wide, since servers x total may not fit.
  __extension__ using Wide = __int128;
  const Wide jobs = (Wide{servers} * total.count() + occupied.count() - 1) / occupied.count();
  return static_cast<std::int64_t>(std::min<Wide>(jobs, kNoLimit));
}

std::vector<TaskPlan> plan_tasks(const Scenario& scenario, std::size_t pipeline) {
  const Platform& platform = scenario.platform;
  std::vector<TaskPlan> plans;
  const auto& tasks = scenario.mix.pipelines[pipeline].tasks;
  for (std::size_t t = 0; t < tasks.size(); ++t) {
    const TaskClass& kind = scenario.classes[pipeline][t];
    TaskPlan& plan = plans.emplace_back();
    plan.workload = kind.workload;
    plan.edges = data_edges(platform, scenario.mix.pipelines[pipeline], t);
    if (tasks[t].state && !platform.links.empty()) {
      plan.state = tasks[t].state;
      plan.state_edge = state_edge(platform, scenario.mix.states[*plan.state].size_bytes);
    }
    for (UnitId unit = 0; unit < platform.units.size(); ++unit) {
      CallPlan& call = plan.calls.emplace_back();
      if (!contains(kind.eligible, unit)) continue;
      call = plan_call(platform, scenario.services, kind.workload, unit, call_bytes(tasks[t]));
      add_wait(scenario, pipeline, plan, unit, call);
    }
  }
  return plans;
}

CostTable call_costs(const Scenario& scenario) {
  const Platform& platform = scenario.platform;
  const ServiceTable& services = scenario.services;
  std::vector<CallBytes> bytes(services.workloads.size());
  for (std::size_t p = 0; p < scenario.classes.size(); ++p) {
    for (std::size_t t = 0; t < scenario.classes[p].size(); ++t) {
      CallBytes& most = bytes[scenario.classes[p][t].workload];
      const CallBytes its = call_bytes(scenario.mix.pipelines[p].tasks[t]);
      if (its.in + its.out >= most.in + most.out) most = its;
    }
  }
  CostTable costs;
  for (WorkloadId workload = 0; workload < services.workloads.size(); ++workload) {
    auto& row = costs.emplace_back(platform.units.size());
    for (UnitId unit = 0; unit < row.size(); ++unit) {
      const Service* service = services.find(workload, unit);
      if (service == nullptr) continue;
      const CallPlan call = plan_call(platform, services, workload, unit, bytes[workload]);
      row[unit] = {.total = call.takes(Taken::kMean),
                   .occupied = call.bottleneck(unit),
                   .energy_j = call.energy_j(Taken::kMean),
                   .energy_provenance = service->energy_provenance};
    }
  }
  return costs;
}

}  // namespace pirt
