#include "reports/run/answer.h"

#include <fmt/core.h>

#include <algorithm>
#include <iterator>

#include "reports/document/figures.h"
#include "reports/run/run_report.h"
#include "scheduler/record/interval.h"
#include "scheduler/record/keeping_up.h"
#include "workloads/base/text/text.h"

namespace pirt {
namespace {

constexpr std::size_t kModesATable = 5;

using Runs = std::vector<const RunRecord*>;

std::vector<std::string> modes_of(const Runs& runs) {
  std::vector<std::string> names;
  for (const RunRecord* run : runs) names.push_back(run->mode);
  return names;
}

/// "a", "a or b", "a, b or c".
std::string any_of(const std::vector<std::string>& names) {
  if (names.size() < 2) return join(names, "");
  const std::vector<std::string> first(names.begin(), names.end() - 1);
  return join(first, ", ") + " or " + names.back();
}

bool has_deadlines(std::span<const RunRecord> runs) {
  return std::ranges::any_of(runs,
                             [](const RunRecord& run) { return p99_of_deadline(run).has_value(); });
}

/// The best, and then those of @p among that cannot be told apart from it.
template <typename Alike>
Runs with_equals(const RunRecord* best, std::span<const RunRecord* const> among,
                 const Alike& alike) {
  Runs found = {best};
  for (const RunRecord* run : among) {
    if (run != best && alike(*run, *best)) found.push_back(run);
  }
  return found;
}

/// "31 late, 2 dropped"; empty if nothing is amiss.
std::string shortfall_text(const Shortfall& shortfall) {
  std::vector<std::string> parts;
  const auto add = [&](std::int64_t firings, const char* what) {
    if (firings > 0) parts.push_back(fmt::format("{} {}", firings, what));
  };
  add(shortfall.late, "late");
  add(shortfall.dropped, "dropped");
  add(shortfall.queued, "queued");
  return join(parts, ", ");
}

std::string pipeline_cell(const RunRecord& run, const std::string& name) {
  const PipelineResult* pipeline = run.find_pipeline(name);
  if (pipeline == nullptr) return "-";
  const std::string text =
      shown_figure_of(run, "pipelines." + name + ".p99_ms", pipeline->p99_ms, marks_of(run).time);
  const Shortfall shortfall = shortfall_of(*pipeline);
  return shortfall.firings() == 0 ? text
                                  : std::string(kMiss) + text + ", " + shortfall_text(shortfall);
}

/// "camera, p99 of 40 ms", "mapping, p99 ms".
std::string pipeline_name(const PipelineResult& pipeline) {
  if (!pipeline.deadline_ms) return pipeline.pipeline + ", p99 ms";
  return fmt::format("{}, p99 of {} ms", pipeline.pipeline, figure(*pipeline.deadline_ms));
}

std::string energy_text(const RunRecord& run) {
  return shown_figure_of(run, "energy_j", run.energy_j, marks_of(run).energy) + " J";
}

}  // namespace

std::optional<double> tail_of(const RunRecord& run, std::span<const RunRecord> runs) {
  if (has_deadlines(runs)) return p99_of_deadline(run);
  std::optional<double> worst;
  for (const PipelineResult& pipeline : run.pipelines) {
    if (!pipeline.p99_ms) continue;
    double least = *pipeline.p99_ms;
    for (const RunRecord& each : runs) {
      const PipelineResult* other = each.find_pipeline(pipeline.pipeline);
      if (other != nullptr) least = std::min(least, other->p99_ms.value_or(least));
    }
    if (least > 0) worst = std::max(worst.value_or(0), *pipeline.p99_ms / least);
  }
  return worst;
}

std::string tail_name(std::span<const RunRecord> runs) {
  return has_deadlines(runs) ? "p99 / deadline" : "p99 from firing to completion";
}

bool same_tail(const RunRecord& a, const RunRecord& b) {
  if (p99_of_deadline(a) && p99_of_deadline(b)) return cannot_tell(a, b, "p99_of_deadline");
  return std::ranges::all_of(a.pipelines, [&](const PipelineResult& pipeline) {
    return cannot_tell(a, b, "pipelines." + pipeline.pipeline + ".p99_ms");
  });
}

Runs best_by(std::span<const RunRecord* const> among, const std::string& figure, bool greatest) {
  const RunRecord* best = nullptr;
  double reached = 0;
  for (const RunRecord* run : among) {
    const RunFigures figures = figures_of(*run);
    const auto found = figures.find(figure);
    if (found == figures.end()) continue;
    if (best != nullptr && !(greatest ? found->second > reached : found->second < reached))
      continue;
    best = run;
    reached = found->second;
  }
  if (best == nullptr) return {};
  return with_equals(best, among, [&](const RunRecord& a, const RunRecord& b) {
    return cannot_tell(a, b, figure);
  });
}

Runs best_by_tail(std::span<const RunRecord* const> among, std::span<const RunRecord> runs) {
  if (has_deadlines(runs)) return best_by(among, "p99_of_deadline");
  const RunRecord* best = nullptr;
  for (const RunRecord* run : among) {
    const auto tail = tail_of(*run, runs);
    if (tail && (best == nullptr || *tail < *tail_of(*best, runs))) best = run;
  }
  if (best == nullptr) return {};
  return with_equals(best, among, same_tail);
}

bool comparable(const RunRecord& a, const RunRecord& b) {
  return ran_the_same(a, b) && a.time == b.time;
}

std::vector<std::string> ModeAnswer::lines() const {
  std::vector<std::string> all = {sentence};
  if (!doubts.empty()) all.push_back(doubts);
  return all;
}

ModeAnswer answer_of(const ModeRuns& modes) {
  ModeAnswer answer;
  if (modes.runs.empty()) {
    answer.sentence = "No mode could run: " + join(reason_lines(modes.skipped), "; ");
    return answer;
  }
  for (const RunRecord& run : modes.runs) {
    if (comparable(run, modes.runs.front())) continue;
    answer.sentence = fmt::format(
        "NOT COMPARABLE, so that no mode is named: {} ran {} on {} in {} time, {} ran {} on {} in "
        "{} time, or what was set of them, profile, draw, duration or seed differ.",
        modes.runs.front().mode, modes.runs.front().mix, modes.runs.front().platform,
        modes.runs.front().time, run.mode, run.mix, run.platform, run.time);
    return answer;
  }
  answer.doubts = doubts_text(modes.runs.front());
  Runs all, kept;
  for (const RunRecord& run : modes.runs) {
    all.push_back(&run);
    if (keeps_up(run)) kept.push_back(&run);
  }
  const auto known = [](const RunRecord* run) { return run->energy_j.has_value(); };
  const std::string of = kept.size() == all.size()
                             ? fmt::format("all {} modes keep up", all.size())
                             : fmt::format("of {} modes {} keep{} up", all.size(), kept.size(),
                                           kept.size() == 1 ? "s" : "");
  Runs best;
  if (kept.empty()) {
    Runs begun;  // Who never begins a task loses none of it either.
    std::ranges::copy_if(all, std::back_inserter(begun),
                         [](const RunRecord* run) { return run->stalled == 0; });
    if (begun.empty()) begun = all;
    best = best_by(best_by(begun, "real_time_losses"), "real_time_queued");
    answer.modes = modes_of(best);
    const auto lost = real_time_losses(*best.front()), queued = real_time_queued(*best.front());
    const std::string firings = fmt::format(
        "{} real-time firing{} late or dropped{}{}", lost, lost == 1 ? "" : "s",
        queued == 0 ? "" : fmt::format(" and {} queued", queued),
        best.front()->stalled == 0 ? ""
                                   : fmt::format(", {} tasks never begun", best.front()->stalled));
    if (all.size() == 1) {
      answer.sentence = fmt::format("{} does not keep up: {}.", best.front()->mode, firings);
      return answer;
    }
    answer.sentence = fmt::format("No mode keeps up. Take {}: with {}, it loses the fewest{}.",
                                  any_of(answer.modes), firings,
                                  best.size() > 1 ? "; these cannot be told apart" : "");
    return answer;
  }
  const bool by_energy = std::ranges::all_of(kept, known);
  best = by_energy ? best_by(kept, "energy_j") : best_by_tail(kept, modes.runs);
  if (best.empty()) best = kept;  // nothing completed
  answer.modes = modes_of(best);
  const RunRecord& first = *best.front();
  const auto tail = tail_of(first, modes.runs);
  const std::string why = by_energy ? fmt::format("needs the least energy, {} in {} s",
                                                  energy_text(first), figure(first.makespan_s))
                                    : "has the least " + tail_name(modes.runs) +
                                          (has_deadlines(modes.runs) ? ", " + figure(tail) : "");
  if (all.size() == 1) {  // Who has one to choose of chooses none.
    answer.sentence =
        first.mode + " keeps up" +
        (by_energy ? fmt::format(", with {} in {} s", energy_text(first), figure(first.makespan_s))
                   : "") +
        ".";
    return answer;
  }
  answer.sentence = best.size() == 1
                        ? fmt::format("Take {}: {}, and it {}.", first.mode, of, why)
                        : fmt::format("Take {}: {}, and these cannot be told apart; {} {}.",
                                      any_of(answer.modes), of, first.mode, why);
  return answer;
}

std::vector<Table> answer_tables(std::span<const RunRecord> runs) {
  std::vector<Table> tables;
  for (std::size_t begin = 0; begin < runs.size(); begin += kModesATable) {
    const auto some = runs.subspan(begin, std::min(kModesATable, runs.size() - begin));
    Table table{.title = "Modes", .columns = {{"", Align::kLeft}}};
    if (runs.size() > kModesATable) {
      table.title += fmt::format(", {} to {} of {}", begin + 1, begin + some.size(), runs.size());
    }
    for (const RunRecord& run : some) table.columns.push_back({column_name(run, runs)});
    const auto row = [&](const std::string& what, const auto& cell) {
      std::vector<std::string> cells = {what};
      for (const RunRecord& run : some) cells.push_back(cell(run));
      table.rows.push_back(std::move(cells));
    };
    row("keeps up", [](const RunRecord& run) {
      return keeps_up(run) ? std::string("yes") : std::string(kMiss) + "no";
    });
    row("energy, J", [](const RunRecord& run) {
      return shown_figure_of(run, "energy_j", run.energy_j, marks_of(run).energy);
    });
    row("tasks/ms", [](const RunRecord& run) {
      return shown_figure_of(run, "throughput_per_ms", run.throughput_per_ms, marks_of(run).time);
    });
    if (has_deadlines(runs)) {
      row("p99 / deadline", [](const RunRecord& run) {
        return shown_figure_of(run, "p99_of_deadline", p99_of_deadline(run), marks_of(run).time);
      });
    }
    for (const PipelineResult& pipeline : runs.front().pipelines) {
      row(pipeline_name(pipeline),
          [&](const RunRecord& run) { return pipeline_cell(run, pipeline.pipeline); });
    }
    tables.push_back(std::move(table));
  }
  if (tables.empty()) return tables;
  tables.back().footnotes = {
      "p99 from a pipeline's firing to its completion, of its deadline; p99 / deadline: the "
      "largest "
      "of real-time pipelines. ✗: late, dropped, or queued for more than a period.",
      std::string(provenance_legend())};
  return tables;
}

}  // namespace pirt
