#include "characterize/duet/comparison.h"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>

#include "workloads/base/error.h"
#include "workloads/base/math/random.h"
#include "workloads/base/text/json.h"
#include "workloads/base/time.h"
#include "workloads/model/phase.h"

namespace pirt {
namespace {

using Event = DuetComparison::Event;
using Seconds = std::map<std::string, double>;

/// Of a confirmation. Ten canaries before the first answer, of which eight would do.
constexpr std::size_t kBlocksACanary = 2;
/// Parts of a call that are less than this share of it can only be seen in the call.
constexpr double kLeastShare = 0.10;

constexpr std::size_t index_of(Side side) { return static_cast<std::size_t>(side); }

std::string order_text(const std::vector<Side>& order) {
  std::string text;
  for (const Side side : order) text += side == Side::kBaseline ? 'A' : 'B';
  return text;
}

Side side_of(const Event& body) {
  return body.at("side") == "candidate" ? Side::kCandidate : Side::kBaseline;
}

Event cell_json(const DuetCell& cell) { return {{"workload", cell.workload}, {"unit", cell.unit}}; }

/// Mean log ratio of the inner two to the outer two.
double inner_to_outer(const std::array<double, 4>& s) {
  return (std::log(s[1]) + std::log(s[2]) - std::log(s[0]) - std::log(s[3])) / 2;
}

/// Of @p phase, if it is above 0.
std::optional<double> time_of(const Seconds& seconds, const std::string& phase) {
  const auto found = seconds.find(phase);
  return found != seconds.end() && found->second > 0 ? std::optional(found->second) : std::nullopt;
}

/// The time of @p phase in all four, if all four have it.
std::optional<std::array<double, 4>> times_of(const std::vector<Seconds>& seconds,
                                              const std::string& phase) {
  std::array<double, 4> times{};
  for (std::size_t i = 0; i < times.size(); ++i) {
    const auto time = time_of(seconds[i], phase);
    if (!time) return std::nullopt;
    times[i] = *time;
  }
  return times;
}

Measure measure_of(const Sample& sample, const std::string& figure) {
  const auto found = sample.measures.find(figure);
  return found == sample.measures.end() ? Measure{"s"} : found->second;
}

/// "ms, lower is better".
std::string measure_text(const Sample& sample, const std::string& figure) {
  const Measure measure = measure_of(sample, figure);
  return measure.unit + (measure.higher_is_better ? ", higher is better" : ", lower is better");
}

/// The first figure that both have, in another unit or direction; empty if there is none.
std::string differing_figure(const Sample& a, const Sample& b) {
  for (const auto& [name, unused] : a.seconds) {
    if (b.seconds.contains(name) && measure_text(a, name) != measure_text(b, name)) return name;
  }
  return "";
}

/// Adds the runs of a block, in their @p order, that had no such figure.
void add_without(const std::string& order, const std::vector<Seconds>& seconds,
                 const std::string& phase, const Measure& measure, RunsWithout& without) {
  for (std::size_t i = 0; i < seconds.size(); ++i) {
    const bool is_there = seconds[i].contains(phase);
    if (is_there && time_of(seconds[i], phase)) continue;
    // Of what less is better a 0 is the best there is: the other side lacks it.
    const bool is_best = is_there && !measure.higher_is_better;
    const bool is_base = (order[i] == 'A') != is_best;
    ++without[index_of(is_base ? Side::kBaseline : Side::kCandidate)];
  }
}

bool is_part_of_call(const std::string& phase) {
  return phase == "upload" || phase == "launch" || phase == "download";
}

bool is_setup(const std::string& phase) {
  const auto known = phase_from_string(phase);
  return known && pirt::is_setup(*known);
}

}  // namespace

std::string_view to_string(Side side) { return side == Side::kBaseline ? "baseline" : "candidate"; }

bool DuetCellState::ended() const {
  return !failures[0].empty() || !failures[1].empty() || !not_comparable.empty();
}

bool DuetCellState::decided() const {
  if (ended()) return true;
  if (blocks == 0) return false;
  return std::ranges::all_of(series, [](const auto& each) {
    return each.second.rule.verdict() != DuetVerdict::kUndecided;
  });
}

bool DuetCellState::calls_decided() const {
  return blocks > 0 && cell.workload != kCommandCell &&
         std::ranges::all_of(series, [](const auto& each) {
           return is_setup(each.first) || each.second.rule.verdict() != DuetVerdict::kUndecided;
         });
}

std::vector<std::string> DuetCellState::undecided() const {
  std::vector<std::string> names;
  for (const auto& [name, each] : series) {
    if (each.rule.verdict() == DuetVerdict::kUndecided) names.push_back(name);
  }
  return names;
}

bool DuetCellState::wants_canary() const {
  return std::ranges::any_of(series, [this](const auto& each) {
    const DuetRule& rule = each.second.rule;
    return rule.verdict() == DuetVerdict::kUndecided && rule.confirming() &&
           rule.confirmation().size() >= kBlocksACanary * canaries;
  });
}

DuetComparison::DuetComparison(std::vector<DuetCell> cells, std::uint64_t seed, Nanos limit)
    : seed_(seed), limit_(limit) {
  for (DuetCell& cell : cells) {
    cells_.emplace_back();
    cells_.back().cell = std::move(cell);
  }
}

/// How often it was measured.
std::size_t DuetComparison::turn_of(const DuetCellState& state) const {
  return state.blocks + state.canaries + (state.checks[0] ? 1 : 0) + (state.checks[1] ? 1 : 0);
}

std::optional<DuetStep> DuetComparison::next(std::span<const std::size_t> among) const {
  std::optional<std::size_t> chosen;
  std::pair<std::size_t, std::uint64_t> least;
  for (const std::size_t c : among) {
    if (cells_[c].decided()) continue;
    const std::size_t turn = turn_of(cells_[c]);
    const std::pair rank{turn, hash_u64(hash_u64(seed_, turn), c)};
    if (chosen && least <= rank) continue;
    chosen = c;
    least = rank;
  }
  if (!chosen) return std::nullopt;
  const DuetCellState& state = cells_[*chosen];
  DuetStep step;
  step.cell = *chosen;
  for (const Side side : {Side::kBaseline, Side::kCandidate}) {
    if (state.checks[index_of(side)]) continue;
    step.order = {side};
    step.sample = SampleKind::kVerified;
    return step;
  }
  step.sample = state.calls_decided() ? SampleKind::kSetup : SampleKind::kTimed;
  if (state.wants_canary()) {
    step.kind = DuetStep::Kind::kCanary;
    step.order.assign(4, Side::kBaseline);
    return step;
  }
  step.kind = DuetStep::Kind::kBlock;
  // Two blocks after each other have both orders, in one way or the other.
  const std::uint64_t pair = state.blocks / 2;
  const std::uint64_t coin =
      ((hash_u64(derive_seed(seed_, to_string(state.cell)), pair) >> 63U) + state.blocks) % 2;
  const Side outer = coin == 0 ? Side::kBaseline : Side::kCandidate;
  const Side inner = coin == 0 ? Side::kCandidate : Side::kBaseline;
  step.order = {outer, inner, inner, outer};
  return step;
}

Event DuetComparison::event_of(const DuetStep& step, const std::vector<Sample>& samples) const {
  Event body = cell_json(cells_[step.cell].cell);
  if (step.kind == DuetStep::Kind::kCheck) {
    body["side"] = to_string(step.order.front());
    body["sample"] = to_json(samples.front());
    return {{"check", body}};
  }
  body["order"] = order_text(step.order);
  Event seconds = Event::array();
  for (const Sample& sample : samples) seconds.push_back(sample.seconds);
  body["seconds"] = seconds;
  return {{"block", body}};
}

Event DuetComparison::failure_of(const DuetStep& step, Side side, const std::string& error,
                                 bool timed_out) const {
  Event body = cell_json(cells_[step.cell].cell);
  body["side"] = to_string(side);
  body["error"] = error;
  if (timed_out) body["limit_s"] = to_s(limit_);
  return {{"failure", body}};
}

DuetCellState& DuetComparison::cell_of(const Event& event) {
  const DuetCell cell{event.at("workload"), event.at("unit")};
  const auto found = std::ranges::find(cells_, cell, &DuetCellState::cell);
  if (found == cells_.end()) throw_bad_input("no such cell: " + to_string(cell));
  return *found;
}

void DuetComparison::apply(const Event& event) {
  try {
    if (event.contains("check")) {
      const Event& body = event["check"];
      check(cell_of(body), body);
    } else if (event.contains("block")) {
      const Event& body = event["block"];
      block(cell_of(body), body);
    } else if (event.contains("failure")) {
      const Event& body = event["failure"];
      DuetCellState& state = cell_of(body);
      if (body.value("limit_s", to_s(limit_)) < to_s(limit_)) return;
      state.failures[index_of(side_of(body))] = body.at("error");
    } else {
      throw_bad_input("an unknown event");
    }
  } catch (const JsonError&) {
    throw_bad_input("an event that lacks something");
  }
}

void DuetComparison::check(DuetCellState& state, const Event& event) {
  const Side side = side_of(event);
  const Sample sample = sample_from_json(json_text(event.at("sample")));
  ++processes_;
  if (sample.right == false) state.failures[index_of(side)] = "wrong output, " + sample.detail;
  state.checks[index_of(side)] = sample;
  if (!state.checks[0] || !state.checks[1]) return;
  const auto compare = [&](const std::string& what, const std::string& a, const std::string& b) {
    if (a != b) state.not_comparable = fmt::format("{}: {} against {}", what, a, b);
  };
  compare("device", state.checks[0]->device, state.checks[1]->device);
  compare("input data", state.checks[0]->inputs, state.checks[1]->inputs);
  const std::string figure = differing_figure(*state.checks[0], *state.checks[1]);
  compare("figure " + figure, measure_text(*state.checks[0], figure),
          measure_text(*state.checks[1], figure));
}

std::string DuetComparison::unlike_first(const DuetStep& step, Side side,
                                         const Sample& sample) const {
  const auto& first = cells_[step.cell].checks[index_of(side)];
  if (!first) return "";
  const std::string name = differing_figure(sample, *first);
  if (name.empty()) return "";
  return fmt::format("figure {}: {}, and {} before", name, measure_text(sample, name),
                     measure_text(*first, name));
}

void DuetComparison::block(DuetCellState& state, const Event& event) {
  const std::string order = event.at("order");
  const auto seconds = event.at("seconds").get<std::vector<Seconds>>();
  if (seconds.size() != 4) throw_bad_input("a block without four processes");
  const bool canary = order == "AAAA";
  if (!canary && order != "ABBA" && order != "BAAB") throw_bad_input("no such order: " + order);
  processes_ += 4;
  if (state.series.empty()) start_series(state, order, seconds);
  const std::size_t table = series_count();
  for (auto& [phase, series] : state.series) {
    const auto times = times_of(seconds, phase);
    if (!times) {
      if (canary || series.rule.verdict() != DuetVerdict::kUndecided) continue;
      add_without(order, seconds, phase, series.measure, series.runs_without);
      if (++series.without == kMostWithout) series.rule.give_up();
      continue;
    }
    const double ratio =
        series.measure.higher_is_better ? -inner_to_outer(*times) : inner_to_outer(*times);
    if (canary) {
      series.rule.add_canary(ratio);
      continue;
    }
    series.rule.add_block(order == "ABBA" ? ratio : -ratio, table);
    for (std::size_t i = 0; i < times->size(); ++i) {
      (order[i] == 'A' ? series.base_s : series.candidate_s).push_back((*times)[i]);
    }
  }
  ++(canary ? state.canaries : state.blocks);
}

/// Of the figures that every process has, of commands the first of each, too; of phases, parts of a
/// call only if they are more than a trifle of it.
void DuetComparison::start_series(DuetCellState& state, const std::string& order,
                                  const std::vector<Seconds>& seconds) {
  if (!state.checks[0] || !state.checks[1]) throw_bad_input("a block before the first processes");
  const Seconds& of_base = state.checks[0]->seconds;
  const Seconds& of_candidate = state.checks[1]->seconds;
  std::set<std::string> phases;
  const auto add_phases = [&phases](const Seconds& of) {
    for (const auto& [phase, time] : of) {
      if (time > 0) phases.insert(phase);
    }
  };
  add_phases(of_base);
  add_phases(of_candidate);
  std::ranges::for_each(seconds, add_phases);
  const bool has_phases = state.cell.workload != kCommandCell;
  const auto call = has_phases ? times_of(seconds, "call") : std::nullopt;
  for (const std::string& phase : phases) {
    const auto times = times_of(seconds, phase);
    const bool base_has = time_of(of_base, phase).has_value();
    const bool candidate_has = time_of(of_candidate, phase).has_value();
    if (!times || !(has_phases || (base_has && candidate_has))) {
      // Of what only one has the checks tell; parts of a call are seen in it, and a phase that took
      // no time by the clock is none that is missing.
      const bool no_time = has_phases && std::ranges::any_of(seconds, [&](const Seconds& of) {
                             const auto its = of.find(phase);
                             return its != of.end() && its->second <= 0;
                           });
      if (base_has == candidate_has && !no_time && !(has_phases && is_part_of_call(phase))) {
        RunsWithout& without = state.passing[phase];
        const Sample& knows = *state.checks[of_base.contains(phase) ? 0 : 1];
        const Measure measure = measure_of(knows, phase);
        add_without(order, seconds, phase, measure, without);
        add_without("AB", {of_base, of_candidate}, phase, measure, without);
      }
      continue;
    }
    const bool trifle =
        call && is_part_of_call(phase) &&
        *std::ranges::max_element(*times) < kLeastShare * *std::ranges::min_element(*call);
    if (trifle) continue;
    const bool setup = has_phases && is_setup(phase);
    DuetSeries series;
    if (setup) series.rule = DuetRule(setup_thresholds());
    series.measure = measure_of(*state.checks[0], phase);
    state.series.emplace(phase, std::move(series));
  }
  if (state.series.empty()) state.not_comparable = "the programs have no phase in common";
}

std::size_t DuetComparison::series_count() const {
  std::size_t count = 0;
  for (const DuetCellState& state : cells_) count += state.series.size();
  return count;
}

std::size_t DuetComparison::decided() const {
  return static_cast<std::size_t>(std::ranges::count_if(cells_, &DuetCellState::decided));
}

}  // namespace pirt
