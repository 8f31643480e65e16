#include "scheduler/what_if.h"

#include <fmt/format.h>

#include <algorithm>

#include "scheduler/planner/budget_plan.h"
#include "scheduler/record/keeping_up.h"
#include "scheduler/schedule.h"
#include "scheduler/services/devices.h"
#include "workloads/base/error.h"
#include "workloads/base/text/text.h"

namespace pirt {
namespace {

constexpr double kStep = 0.05;
constexpr int kMostSteps = 60;
constexpr int kHalvings = 7;  ///< 5 % / 2^7 is below a two-thousandth.
constexpr const char* kAll = "all";

/// The busiest unit of those that served the pipeline's workloads, or that could have.
const UnitResult* unit_of(const RunRecord& run, const Pipeline& pipeline) {
  const UnitResult* busiest = nullptr;
  for (const UnitResult& unit : run.units) {
    const bool served = std::ranges::any_of(run.calls, [&](const CallResult& call) {
      return call.unit == unit.unit &&
             std::ranges::any_of(pipeline.tasks, [&](const MixTask& task) {
               return task.workload == call.workload;
             });
    });
    if (!served) continue;
    if (busiest == nullptr || unit.utilization.value_or(0) > busiest->utilization.value_or(0)) {
      busiest = &unit;
    }
  }
  return busiest;
}

std::string what_of(const PipelineResult& result) {
  const Shortfall shortfall = shortfall_of(result);
  std::vector<std::string> parts;
  const auto add = [&](std::int64_t firings, const char* what) {
    if (firings > 0) parts.push_back(fmt::format("{} of {} {}", firings, result.fired, what));
  };
  add(shortfall.late, "late");
  add(shortfall.dropped, "dropped");
  add(shortfall.queued, "unfinished for more than a period");
  return join(parts, ", ");
}

std::string resource_of(const RunRecord& run, const Mix& mix, const UnitResult* unit,
                        const PipelineResult& result, const Pipeline& pipeline,
                        std::optional<double> power_cap_w) {
  constexpr double kFull = 0.9;
  const double busy = unit == nullptr ? 0 : unit->utilization.value_or(0);
  if (busy >= kFull) return fmt::format("time of the unit ({:.0f} % busy)", 100 * busy);
  if (power_cap_w && run.average_power_w.value_or(0) >= 0.85 * *power_cap_w) {
    return fmt::format("power ({:.3g} of {:.3g} W)", *run.average_power_w, *power_cap_w);
  }
  if (shortfall_of(result).dropped > 0 && mix.image_buffers && pipeline.has_image_input()) {
    return fmt::format("image buffers ({})", *mix.image_buffers);
  }
  return fmt::format("its turn: calls before it are not interrupted ({:.0f} % busy)", 100 * busy);
}

/// A mix with the parameter at a value; a cap of power is no mix's.
Mix changed(const Mix& mix, const WhatIfChange& change, double value) {
  Mix other = mix;
  if (change.kind != WhatIfChange::Kind::kRate) return other;
  const bool all = change.pipeline == kAll;
  for (Pipeline& pipeline : other.pipelines) {
    if (!pipeline.rate_hz || (!all && pipeline.name != change.pipeline)) continue;
    pipeline.rate_hz = all ? *pipeline.rate_hz * value : value;
    pipeline.jitter = std::min(pipeline.jitter, pipeline.period());
  }
  return other;
}

class Search {
 public:
  Search(const Platform& platform, const Profile* profile, const Mix& mix,
         const WhatIfChange& change, const ScheduleOptions& options)
      : platform_(platform), profile_(profile), mix_(mix), change_(change), options_(options) {}

  /// @param values  The given one, then so far as is tried.
  WhatIfRow run(const std::string& mode, const std::vector<double>& values) {
    redraw_.reset();
    warnings_.reset();
    WhatIfRow row = found(mode, values);
    row.warnings = warnings_.value_or(std::vector<std::string>{});
    if (!uncertain_ || !row.not_run.empty()) return row;
    redraw_ = Redraw{.kind = Redraw::Kind::kLongest};
    row.holds_if_long = found(mode, values).holds;
    redraw_ = Redraw{.kind = Redraw::Kind::kShortest};
    row.holds_if_short = found(mode, values).holds;
    return row;
  }

 private:
  WhatIfRow found(const std::string& mode, const std::vector<double>& values) {
    WhatIfRow row{.mode = mode};
    const auto holds_at = [&](double value) {
      if (auto breakage = breakage_at(mode, value)) {
        row.breaks = value;
        row.breakage = std::move(breakage);
        return false;
      }
      row.holds = value;
      return true;
    };
    try {
      for (const double value : values) {
        if (!holds_at(value)) break;
      }
      for (int i = 0; i < kHalvings && row.holds && row.breaks; ++i) {
        holds_at((*row.holds + *row.breaks) / 2);
      }
    } catch (const Error& error) {
      row.not_run = error.what();
    }
    return row;
  }

  std::optional<Breakage> breakage_at(const std::string& mode, double value) {
    const Mix mix = changed(mix_, change_, value);
    const bool budgets = find_policy(mode).budgets;
    ScheduleOptions options = budgets ? options_ : options_.without_budget();
    options.mode = mode;
    options.redraw = redraw_;
    options.watch_power = true;
    std::optional<double> cap_w = options_.power_cap_w;
    if (change_.kind == WhatIfChange::Kind::kPowerCap) cap_w = value;
    if (budgets) options.power_cap_w = cap_w;
    if (cap_w && above_idle_j(platform_, *cap_w) < 0) {
      return Breakage{.resource = "power", .what = infeasible_cap(platform_, *cap_w)};
    }
    const RunRecord run = run_virtual(platform_, profile_, mix, options);
    if (cap_w && !run.energy_j) {
      throw_bad_input(
          "--power-cap: nobody knows what a unit draws that served something; give it with --set "
          "UNIT.active_w=W");
    }
    uncertain_ = run.uncertain;
    if (!warnings_) warnings_ = run.warnings;
    return breakage_of(run, mix, cap_w);
  }

  const Platform& platform_;
  const Profile* profile_;
  const Mix& mix_;
  const WhatIfChange& change_;
  const ScheduleOptions& options_;
  std::optional<Redraw> redraw_;
  bool uncertain_ = false;
  std::optional<std::vector<std::string>> warnings_;  ///< Of the first run.
};

std::vector<double> values_of(const WhatIfChange& change, double given) {
  std::vector<double> values;
  const bool down = change.kind == WhatIfChange::Kind::kPowerCap;
  for (int i = 0; i <= kMostSteps; ++i) {
    const double factor = down ? 1 - kStep * i : 1 + kStep * i;
    if (factor <= kStep / 2) break;
    values.push_back(given * factor);
  }
  return values;
}

}  // namespace

std::optional<Breakage> breakage_of(const RunRecord& run, const Mix& mix,
                                    std::optional<double> power_cap_w) {
  double worst = 0;
  std::size_t position = 0;
  for (std::size_t p = 0; p < mix.pipelines.size(); ++p) {
    const PipelineResult& result = run.pipelines[p];
    if (result.fired == 0) continue;
    const double each =
        static_cast<double>(shortfall_of(result).firings()) / static_cast<double>(result.fired);
    if (each <= worst) continue;
    worst = each;
    position = p;
  }
  if (worst > 0) {
    const Pipeline& pipeline = mix.pipelines[position];
    const PipelineResult& result = run.pipelines[position];
    const UnitResult* unit = unit_of(run, pipeline);
    return Breakage{.pipeline = pipeline.name,
                    .unit = unit == nullptr ? "" : unit->unit,
                    .resource = resource_of(run, mix, unit, result, pipeline, power_cap_w),
                    .what = what_of(result)};
  }
  if (run.stalled > 0) {
    return Breakage{
        .resource = power_cap_w ? "power" : "a unit that may begin them",
        .what = fmt::format("{} of {} tasks are never begun", run.stalled, run.submitted)};
  }
  if (!power_cap_w || run.power_highest_w.value_or(0) <= *power_cap_w * (1 + 1e-9)) {
    return std::nullopt;
  }
  const auto hungriest = std::ranges::max_element(
      run.units, {}, [](const UnitResult& unit) { return unit.energy_j.value_or(0); });
  return Breakage{.unit = hungriest->unit,
                  .resource = "power",
                  .what = fmt::format("the fullest second draws {:.3g} W", *run.power_highest_w)};
}

WhatIfChange parse_raise(const std::string& text, const Mix& mix) {
  constexpr std::string_view kRate = ".rate_hz";
  std::vector<std::string> known = {std::string(kAll) + std::string(kRate)};
  for (const Pipeline& pipeline : mix.pipelines) {
    if (pipeline.rate_hz) known.push_back(pipeline.name + std::string(kRate));
  }
  if (std::ranges::find(known, text) == known.end()) {
    throw_bad_input("--raise '" + text + "' names no rate of mix " + mix.name +
                    suggestion(text, known));
  }
  return {.kind = WhatIfChange::Kind::kRate,
          .pipeline = text.substr(0, text.size() - kRate.size())};
}

WhatIf what_if(const Platform& platform, const Profile* profile, const Mix& mix,
               const std::vector<std::string>& modes, const WhatIfChange& change,
               const ScheduleOptions& options) {
  WhatIf result;
  if (change.kind == WhatIfChange::Kind::kPowerCap) {
    if (!options.power_cap_w) {
      throw_bad_input("--lower power-cap begins at a cap; give it with --power-cap 11W");
    }
    result.parameter = "power cap";
    result.unit = "W";
    result.given = *options.power_cap_w;
  } else if (change.pipeline == kAll) {
    if (!mix.open_loop()) {
      throw_bad_input("mix " + mix.name + " has closed loops only, and no rate to raise");
    }
    result.parameter = "all rates, times";
    result.given = 1;
  } else {
    const auto pipeline = std::ranges::find(mix.pipelines, change.pipeline, &Pipeline::name);
    result.parameter = change.pipeline + ".rate_hz";
    result.unit = "Hz";
    result.given = *pipeline->rate_hz;
  }
  const auto values = values_of(change, result.given);
  result.last_tried = values.back();
  const Platform opened = on_devices(platform, profile, options.without);
  Search search(opened, profile, mix, change, options);
  for (const auto& mode : modes) result.rows.push_back(search.run(mode, values));
  return result;
}

}  // namespace pirt
