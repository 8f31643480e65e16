#include "characterize/tune/search.h"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <map>
#include <optional>
#include <span>
#include <utility>

#include "characterize/statistics/rank_tests.h"

namespace pirt {
namespace {

using opencl::ParameterInfo;
using opencl::Tuning;

/// The user stopped it; caught in search_tuning().
struct Stopped {};
/// The time is over; likewise.
struct TimeUp {};

TuneSample measure_once(const TuneSearch& search, const TuneStep& step, const Tuning& tuning,
                        const std::string& workload, const std::string& what) {
  if (search.time_up()) throw TimeUp{};
  const auto& parameter = *step.parameter;
  search.progress(step, fmt::format("{}={}, {}, {}", parameter.name, tuning[parameter.parameter],
                                    workload, what));
  auto sample = search.measure(tuning, workload);
  if (!sample) throw Stopped{};
  return *std::move(sample);
}

/// What a step may gain, by what the search starts with and the candidates at both ends.
class FirstLook {
 public:
  explicit FirstLook(const TuneSearch& search) : search_(search) {}

  /// Log of the start's time over the best candidate's; 0 where none is faster.
  [[nodiscard]] double gain(const TuneStep& step) {
    const auto parameter = step.parameter->parameter;
    const auto candidates = step.parameter->range(search_.start.is_cpu()).candidates;
    double best = 0;
    for (const int value : {candidates.front(), candidates.back()}) {
      Tuning tuning = search_.start;
      tuning.set(parameter, value);
      if (tuning == search_.start) continue;
      const auto theirs = seconds_of_start(step);
      if (!theirs) return 0;
      if (const auto ours = seconds(step, tuning)) best = std::max(best, std::log(*theirs / *ours));
    }
    return best;
  }

 private:
  [[nodiscard]] std::optional<double> seconds(const TuneStep& step, const Tuning& tuning) {
    const auto sample = measure_once(search_, step, tuning, step.workloads.front(), "first look");
    if (sample.status != TuneSample::Status::kGood) return std::nullopt;
    return to_s(sample.time);
  }

  [[nodiscard]] std::optional<double> seconds_of_start(const TuneStep& step) {
    const auto known = start_.find(step.workloads.front());
    if (known != start_.end()) return known->second;
    return start_[step.workloads.front()] = seconds(step, search_.start);
  }

  const TuneSearch& search_;
  std::map<std::string, std::optional<double>> start_;  ///< By workload.
};

std::vector<const TuneStep*> in_order(const TuneSearch& search) {
  std::vector<const TuneStep*> order;
  for (const TuneStep& step : search.steps) order.push_back(&step);
  if (order.size() < 2) return order;
  FirstLook look(search);
  std::map<const TuneStep*, double> gains;
  for (const TuneStep* step : order) {
    gains[step] = step->parameter->kernels.empty() ? -1 : look.gain(*step);
  }
  std::ranges::stable_sort(order, std::ranges::greater{},
                           [&](const TuneStep* step) { return gains.at(step); });
  return order;
}

/// One parameter's search.
class StepSearch {
 public:
  StepSearch(const TuneSearch& search, const Tuning& base, const TuneStep& step, Random& random)
      : search_(search), base_(base), step_(step), random_(random), workloads_(step.workloads) {
    const auto& range = step.parameter->range(base.is_cpu());
    finding_.parameter = step.parameter;
    finding_.standard = finding_.best = finding_.fastest = range.standard;
    race_.assign(range.candidates.begin(), range.candidates.end());
  }

  TuneFinding run() {
    for (int round = 0; round < search_.rules.rounds; ++round) {
      measure_round(fmt::format("round {}", round + 1));
      if (workloads_.empty()) return finding_;
      drop_the_slow();
    }
    finding_.verdict = TuneVerdict::kDefaultBest;
    finding_.fastest = fastest();
    judge();
    if (finding_.fastest == finding_.standard || finding_.speed_up < 1 + search_.rules.least_gain) {
      return finding_;
    }
    confirm();
    return finding_;
  }

 private:
  /// Logarithms of seconds by round, of one candidate.
  using Times = std::map<std::string, std::vector<double>>;

  void measure_round(const std::string& what) {
    for (const std::string& workload : std::vector(workloads_)) {
      for (const int value : order_of(workload)) {
        if (std::ranges::find(race_, value) != race_.end()) measure(value, workload, what);
        if (std::ranges::find(workloads_, workload) == workloads_.end()) break;
      }
    }
  }

  /// Random, but the default goes first where a workload is new: if that cannot be measured, no
  /// candidate is to blame.
  [[nodiscard]] std::vector<int> order_of(const std::string& workload) {
    std::vector<int> order = race_;
    for (std::size_t i = order.size(); i > 1; --i) {
      std::swap(order[i - 1], order[random_.below(i)]);
    }
    if (!times_[finding_.standard].contains(workload)) {
      const auto standard = std::ranges::find(order, finding_.standard);
      std::rotate(order.begin(), standard, standard + 1);
    }
    return order;
  }

  void measure(int value, const std::string& workload, const std::string& what) {
    Tuning tuning = base_;
    tuning.set(step_.parameter->parameter, value);
    const TuneSample sample = measure_once(search_, step_, tuning, workload, what);
    if (sample.status == TuneSample::Status::kGood) {
      times_[value][workload].push_back(std::log(to_s(sample.time)));
    } else if (value == finding_.standard) {
      leave_out(workload, sample.reason);
    } else {
      finding_.rejected.push_back(
          {value, sample.status == TuneSample::Status::kWrong, workload + ": " + sample.reason});
      std::erase(race_, value);
    }
  }

  /// Without the default's time there is nothing to compare with.
  void leave_out(const std::string& workload, const std::string& reason) {
    std::erase(workloads_, workload);
    finding_.reason +=
        fmt::format("{}{}: {}", finding_.reason.empty() ? "" : "; ", workload, reason);
  }

  /// Log of the default's time over the candidate's by round: the mean over @p workloads.
  [[nodiscard]] std::vector<double> gains(int value, std::span<const std::string> workloads) const {
    std::vector<double> by_round;
    for (const std::string& workload : workloads) {
      const auto& ours = times_.at(value).at(workload);
      const auto& theirs = times_.at(finding_.standard).at(workload);
      by_round.resize(ours.size());
      for (std::size_t i = 0; i < ours.size(); ++i) {
        by_round[i] += (theirs.at(i) - ours[i]) / static_cast<double>(workloads.size());
      }
    }
    return by_round;
  }

  [[nodiscard]] double gain(int value) const { return median_of(gains(value, workloads_)); }

  [[nodiscard]] int fastest() const {
    return *std::ranges::max_element(race_, {}, [this](int value) { return gain(value); });
  }

  void drop_the_slow() {
    const double slowest = gain(fastest()) - std::log1p(search_.rules.out_of_race);
    std::erase_if(race_,
                  [&](int value) { return value != finding_.standard && gain(value) < slowest; });
  }

  /// Fills in how the fastest compares, from the rounds in times_.
  void judge() {
    const auto all = gains(finding_.fastest, workloads_);
    finding_.speed_up = std::exp(median_of(all));
    finding_.rounds = static_cast<int>(all.size());
    finding_.rounds_faster =
        static_cast<int>(std::ranges::count_if(all, [](double gain) { return gain > 0; }));
    finding_.p_value = sign_test_p(all, 0);
    finding_.gains.clear();
    for (const std::string& workload : workloads_) {
      finding_.gains.push_back(
          {workload, std::exp(median_of(gains(finding_.fastest, std::span(&workload, 1))))});
    }
  }

  /// Fresh rounds of the fastest and the default alone.
  void confirm() {
    finding_.verdict = TuneVerdict::kNotConfirmed;
    race_ = {finding_.standard, finding_.fastest};
    times_.clear();
    for (int round = 0; round < search_.rules.confirming_rounds; ++round) {
      measure_round(fmt::format("confirming round {}", round + 1));
      const bool rejected = race_.size() < 2;
      if (rejected || workloads_.empty()) {
        finding_.fastest = finding_.standard;
        finding_.speed_up = 1;
        finding_.gains.clear();
        finding_.rounds = finding_.rounds_faster = 0;
        finding_.p_value = 1;
        if (workloads_.empty()) finding_.verdict = TuneVerdict::kNotMeasured;
        return;
      }
    }
    judge();
    const auto lower =
        median_lower_bound(gains(finding_.fastest, workloads_), search_.rules.confidence);
    if (finding_.speed_up >= 1 + search_.rules.least_gain && lower && *lower > 0) {
      finding_.verdict = TuneVerdict::kReplaced;
      finding_.best = finding_.fastest;
    }
  }

  const TuneSearch& search_;
  const Tuning& base_;
  const TuneStep& step_;
  Random& random_;
  std::vector<std::string> workloads_;  ///< Those that the default can be measured on.
  std::vector<int> race_;               ///< Candidates that are still measured.
  std::map<int, Times> times_;
  TuneFinding finding_;
};

/// Steps to take, each with how often it was taken.
class Agenda {
 public:
  explicit Agenda(const std::vector<const TuneStep*>& steps) {
    for (const TuneStep* step : steps) entries_.push_back({step});
  }

  /// Null when all is done.
  [[nodiscard]] const TuneStep* next() {
    const auto it = std::ranges::find(entries_, true, &Entry::due);
    if (it == entries_.end()) return nullptr;
    it->due = false;
    ++it->taken;
    return it->step;
  }

  /// Another value of @p changed may change what is best for others of the same kernels.
  void look_again_beside(const ParameterInfo& changed) {
    for (Entry& entry : entries_) {
      const ParameterInfo& other = *entry.step->parameter;
      if (&other == &changed || changed.kernels.empty()) continue;
      if (other.kernels == changed.kernels && entry.taken == 1) entry.due = true;
    }
  }

 private:
  struct Entry {
    const TuneStep* step;
    int taken = 0;
    bool due = true;
  };
  std::vector<Entry> entries_;
};

void keep(TuneFinding finding, std::vector<TuneFinding>& findings) {
  const auto it = std::ranges::find(findings, finding.parameter, &TuneFinding::parameter);
  if (it == findings.end()) {
    findings.push_back(std::move(finding));
  } else {
    *it = std::move(finding);
  }
}

}  // namespace

TuneOutcome search_tuning(const TuneSearch& search) {
  TuneOutcome outcome{.tuning = search.start, .findings = {}, .not_reached = {}};
  Random random(search.seed);
  try {
    Agenda agenda(in_order(search));
    while (const TuneStep* step = agenda.next()) {
      TuneFinding finding = StepSearch(search, outcome.tuning, *step, random).run();
      const auto parameter = step->parameter->parameter;
      const bool changed = outcome.tuning[parameter] != finding.best;
      if (finding.verdict != TuneVerdict::kNotMeasured && changed) {
        outcome.tuning.set(parameter, finding.best);
        agenda.look_again_beside(*step->parameter);
      }
      keep(std::move(finding), outcome.findings);
    }
  } catch (const Stopped&) {
    outcome.stopped = true;
  } catch (const TimeUp&) {
  }
  for (const TuneStep& step : search.steps) {
    const auto& found = outcome.findings;
    if (std::ranges::find(found, step.parameter, &TuneFinding::parameter) == found.end()) {
      outcome.not_reached.emplace_back(step.parameter->name);
    }
  }
  return outcome;
}

}  // namespace pirt
