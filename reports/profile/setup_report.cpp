#include "reports/profile/setup_report.h"

#include <fmt/core.h>

#include <algorithm>

#include "reports/document/figures.h"
#include "workloads/base/text/json.h"

namespace pirt {
namespace {

/// A workload on two units, the one that the profile names first as `a`.
struct Pair {
  std::string workload, a, b;
};

template <typename T>
void add_once(std::vector<T>& items, const T& item) {
  if (std::ranges::find(items, item) == items.end()) items.push_back(item);
}

std::vector<Pair> pairs_of(const OffloadingCosts& costs) {
  std::vector<std::string> workloads;
  for (const auto& cost : costs.costs) add_once(workloads, cost.workload);
  std::vector<Pair> pairs;
  for (const auto& workload : workloads) {
    std::vector<std::string> units;
    for (const auto& cost : costs.costs) {
      if (cost.workload == workload) add_once(units, cost.unit);
    }
    for (std::size_t a = 0; a < units.size(); ++a) {
      for (std::size_t b = a + 1; b < units.size(); ++b) {
        pairs.push_back({workload, units[a], units[b]});
      }
    }
  }
  return pairs;
}

struct Found {
  Crossover by_medians;
  std::optional<CrossoverRange> range;
};

std::optional<Found> crossover_of(const OffloadingCosts& costs, const Pair& pair, State state) {
  const auto* a = costs.find(pair.workload, pair.a, state);
  const auto* b = costs.find(pair.workload, pair.b, state);
  if (a == nullptr || b == nullptr) return std::nullopt;
  return Found{crossover(a->calls(), b->calls()), crossover_range(*a, *b)};
}

std::string text_of(const Crossover& found) {
  switch (found.kind) {
    case Crossover::Kind::kNever:
      return "never";
    case Crossover::Kind::kFromFirst:
      return "from the first";
    case Crossover::Kind::kFrom:
      return fmt::format("from {} calls", found.calls);
    case Crossover::Kind::kUpTo:
      return found.calls == 1 ? "for one call only" : fmt::format("up to {} calls", found.calls);
  }
  return "-";
}

/// "from 74 calls (55 to 102)", "from 74 calls (from 9 calls, or never)", "never (or from 9
/// calls)".
std::string text_of(const std::optional<Found>& found) {
  if (!found) return "-";
  const Crossover& middle = found->by_medians;
  std::string text = text_of(middle);
  if (!found->range) return text;
  const auto& [soonest, latest] = *found->range;
  if (soonest == middle && latest == middle) return text;
  if (soonest.kind == middle.kind && latest.kind == middle.kind) {
    return fmt::format("{} ({} to {})", text, std::min(soonest.calls, latest.calls),
                       std::max(soonest.calls, latest.calls));
  }
  if (latest == middle) return fmt::format("{} (or {})", text, text_of(soonest));
  if (soonest == middle) return fmt::format("{} (or {})", text, text_of(latest));
  return fmt::format("{} ({}, or {})", text, text_of(soonest), text_of(latest));
}

Json json_of(const Crossover& found) {
  switch (found.kind) {
    case Crossover::Kind::kNever:
      return {{"wins", "never"}};
    case Crossover::Kind::kFromFirst:
      return {{"wins", "always"}};
    case Crossover::Kind::kFrom:
      return {{"wins", "from"}, {"calls", found.calls}};
    case Crossover::Kind::kUpTo:
      return {{"wins", "up_to"}, {"calls", found.calls}};
  }
  return {};
}

Json json_of(const Found& found) {
  Json json = json_of(found.by_medians);
  if (found.range) {
    json["soonest"] = json_of(found.range->soonest);
    json["latest"] = json_of(found.range->latest);
  }
  return json;
}

/// Share of the first call's time that is not the call.
double set_up_share(const OffloadingCost& cost) {
  const double total = to_ms(cost.calls().first);
  return total > 0 ? to_ms(cost.set_up()) / total : 0;
}

std::vector<std::string> missing_notes(const OffloadingCosts& costs) {
  std::vector<std::string> notes;
  for (const auto& missing : costs.missing) {
    notes.push_back(fmt::format("Left out: {} on {}, {}: {}", missing.workload, missing.unit,
                                to_string(missing.state), missing.reason));
  }
  return notes;
}

}  // namespace

Table offloading_table(const OffloadingCosts& costs) {
  Table table{.title = "Offloading time by phase, ms (the paper's Fig. 7)",
              .columns = {{"workload", Align::kLeft},
                          {"unit", Align::kLeft},
                          {"set-up", Align::kLeft},
                          {"device_init"},
                          {"prepare"},
                          {"upload"},
                          {"launch"},
                          {"execute"},
                          {"download"},
                          {"first call"},
                          {"set-up part"},
                          {"each further"}}};
  for (const auto& cost : costs.costs) {
    const auto shown = [&cost](std::optional<Nanos> time) {
      return time ? marked(figure_ms(time), cost.provenance) + cost.doubt : "-";
    };
    table.rows.push_back({cost.workload, cost.unit, std::string(to_string(cost.state)),
                          shown(cost.device_init), shown(cost.set_up() - cost.device_init),
                          shown(cost.upload), shown(cost.launch), shown(cost.execute),
                          shown(cost.download), shown(cost.calls().first),
                          fmt::format("{:.1f}%", 100 * set_up_share(cost)), shown(cost.call)});
  }
  table.footnotes = {
      "prepare: without the call that it ends with. first call: from a process that has nothing to "
      "the end of its first call. Medians of each phase: they need not add up exactly.",
      "cold: fresh process, empty kernel cache; warm: fresh process, filled cache. - a phase that "
      "the unit does not have."};
  for (auto& note : missing_notes(costs)) table.footnotes.push_back(std::move(note));
  table.footnotes.emplace_back(provenance_legend());
  return table;
}

Table crossover_table(const OffloadingCosts& costs) {
  Table table{.title =
                  "Crossover: for how many calls the second unit beats the first, set-up "
                  "included",
              .columns = {{"workload", Align::kLeft},
                          {"first", Align::kLeft},
                          {"second", Align::kLeft},
                          {"cold", Align::kLeft},
                          {"warm", Align::kLeft},
                          {"set up already", Align::kLeft}}};
  for (const Pair& pair : pairs_of(costs)) {
    const auto* a = costs.find(pair.workload, pair.a, State::kWarm);
    const auto* b = costs.find(pair.workload, pair.b, State::kWarm);
    if (a == nullptr) a = costs.find(pair.workload, pair.a, State::kCold);
    if (b == nullptr) b = costs.find(pair.workload, pair.b, State::kCold);
    const auto faster = is_faster_call(*a, *b);
    const std::string steady = !faster ? "equal" : *faster ? "yes" : "no";
    table.rows.push_back({pair.workload, pair.a, pair.b,
                          text_of(crossover_of(costs, pair, State::kCold)),
                          text_of(crossover_of(costs, pair, State::kWarm)), steady});
  }
  table.footnotes = {
      "From medians; in brackets what the ends of their 95 % intervals allow, first those that "
      "favour the second unit (no brackets: nothing else, or fewer than 3 set-ups). set up "
      "already: whether one call is faster when both units are ready (the runtime's set-up at "
      "start); equal: the intervals overlap."};
  return table;
}

Chart offloading_chart(const OffloadingCosts& costs) {
  Chart chart{.kind = ChartKind::kStacks,
              .summary =
                  "From nothing to the end of the first call: what is set up, moved and "
                  "computed.",
              .x = {"ms to the end of the first call"},
              .parts = {"device_init", "prepare", "upload", "launch", "execute", "download"},
              .table = offloading_table(costs)};
  for (const auto& cost : costs.costs) {
    const auto ms = [](std::optional<Nanos> time) { return time ? to_ms(*time) : 0.0; };
    chart.marks.push_back(
        {.group = fmt::format("{}, {}, {}", cost.workload, cost.unit, to_string(cost.state)),
         .series = cost.unit,
         .values = {ms(cost.device_init), ms(cost.set_up() - cost.device_init), ms(cost.upload),
                    ms(cost.launch), ms(cost.execute), ms(cost.download)},
         .provenance = cost.provenance,
         .doubt = cost.doubt});
  }
  return chart;
}

Chart crossover_chart(const OffloadingCosts& costs) {
  Chart chart{.kind = ChartKind::kDots, .x = {"calls", true}, .series = {"cold", "warm"}};
  chart.table = {
      .title = "From how many calls on another unit is faster, set-up included",
      .columns = {{"workload", Align::kLeft},
                  {"first", Align::kLeft},
                  {"second", Align::kLeft},
                  {"set-up", Align::kLeft},
                  {"the second is faster", Align::kLeft}},
      .footnotes = {"From medians; in brackets what the ends of their 95 % intervals allow, "
                    "first those that favour the second unit (no brackets: nothing else, "
                    "or fewer than 3 set-ups)."}};
  int paid_back = 0;
  for (const Pair& pair : pairs_of(costs)) {
    for (const State state : {State::kCold, State::kWarm}) {
      const auto found = crossover_of(costs, pair, state);
      if (!found) continue;
      chart.table.rows.push_back(
          {pair.workload, pair.a, pair.b, std::string(to_string(state)), text_of(found)});
      Mark mark{.group = fmt::format("{}: {} for {}", pair.workload, pair.b, pair.a),
                .series = std::string(to_string(state)),
                .provenance = weakest(costs.find(pair.workload, pair.a, state)->provenance,
                                      costs.find(pair.workload, pair.b, state)->provenance)};
      const Crossover& middle = found->by_medians;
      if (middle.kind == Crossover::Kind::kFrom) {
        ++paid_back;
        mark.x = static_cast<double>(middle.calls);
        if (found->range && found->range->soonest.kind == middle.kind &&
            found->range->latest.kind == middle.kind) {
          mark.low = static_cast<double>(found->range->soonest.calls);
          mark.high = static_cast<double>(found->range->latest.calls);
        }
      } else {
        mark.word = text_of(middle);
        mark.at_far_edge = middle.kind == Crossover::Kind::kNever;
      }
      chart.marks.push_back(std::move(mark));
    }
  }
  chart.summary = fmt::format(
      "In {} of {} cases the second unit's longer set-up is paid back by some number "
      "of calls.",
      paid_back, chart.marks.size());
  return chart;
}

Json setup_json(const OffloadingCosts& costs) {
  Json json = {
      {"offloading", Json::array()}, {"crossovers", Json::array()}, {"missing", Json::array()}};
  for (const auto& cost : costs.costs) {
    Json entry = {{"workload", cost.workload},
                  {"unit", cost.unit},
                  {"state", to_string(cost.state)},
                  {"provenance", to_string(cost.provenance)},
                  {"mixture", cost.provenance.mixture},
                  {"device_init_ms", to_ms(cost.device_init)},
                  {"prepare_ms", to_ms(cost.set_up() - cost.device_init)}};
    const auto add = [&entry](const char* key, std::optional<Nanos> time) {
      if (time) entry[key] = to_ms(*time);
    };
    add("upload_ms", cost.upload);
    add("launch_ms", cost.launch);
    add("execute_ms", cost.execute);
    add("download_ms", cost.download);
    add("call_ms", cost.call);
    add("first_call_ms", cost.calls().first);
    json["offloading"].push_back(std::move(entry));
  }
  for (const Pair& pair : pairs_of(costs)) {
    Json entry = {{"workload", pair.workload}, {"first", pair.a}, {"second", pair.b}};
    for (const State state : {State::kCold, State::kWarm}) {
      const auto found = crossover_of(costs, pair, state);
      if (found) entry[std::string(to_string(state))] = json_of(*found);
    }
    json["crossovers"].push_back(std::move(entry));
  }
  for (const auto& missing : costs.missing) {
    json["missing"].push_back({{"workload", missing.workload},
                               {"unit", missing.unit},
                               {"state", to_string(missing.state)},
                               {"reason", missing.reason}});
  }
  return json;
}

}  // namespace pirt
