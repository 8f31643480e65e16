// Is the gate of two programs right on this machine? Whole decisions on a program against itself,
// as it is and with extra work injected: how often the answer was wrong, with the bound that so
// many decisions allow. Exits with 1 if that contradicts what the gate promises.
//
// Usage: self_test PIRT [--decisions N] [--trial NAME]... [--ledger FILE]
//   N        whole decisions of each trial; default 20
//   NAME     only this trial, e.g. same or 'execute +10 %'
//   FILE     keeps the decisions: the same command goes on with it
#include "reports/gate/self_test.h"

#include <fmt/format.h>

#include <cstdlib>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "characterize/duet/duet.h"
#include "characterize/duet/lanes.h"
#include "characterize/worker/injection.h"
#include "characterize/worker/measure.h"
#include "reports/gate/duet_gate.h"
#include "workloads/base/error.h"

namespace {

using namespace pirt;  // NOLINT: a program

struct Options {
  std::string program;
  int decisions = 20;
  std::vector<const Trial*> trials;
  std::string ledger;
};

Options parse(const std::vector<std::string>& words) {
  Options options;
  for (std::size_t i = 0; i < words.size(); ++i) {
    const bool has_value = i + 1 < words.size();
    if (words[i] == "--decisions" && has_value) {
      options.decisions = std::atoi(words[++i].c_str());
    } else if (words[i] == "--trial" && has_value) {
      options.trials.push_back(&find_trial(words[++i]));
    } else if (words[i] == "--ledger" && has_value) {
      options.ledger = words[++i];
    } else if (options.program.empty() && !words[i].starts_with('-')) {
      options.program = words[i];
    } else {
      throw_bad_input("'" + words[i] + "' is not understood");
    }
  }
  if (options.program.empty() || options.decisions < 1) {
    throw_bad_input("usage: self_test PIRT [--decisions N] [--trial NAME]... [--ledger FILE]");
  }
  if (options.trials.empty()) {
    for (const Trial& trial : self_test_trials()) options.trials.push_back(&trial);
  }
  return options;
}

DuetPrograms programs_of(const Options& options) {
  DuetPrograms programs;
  programs.platform_argument = "host";
  programs.platform = load_platform(programs.platform_argument);
  programs.baseline = programs.candidate = std::filesystem::canonical(options.program);
  programs.seed = 1;
  programs.work = std::chrono::milliseconds(50);
  programs.limit = std::chrono::seconds(60);
  return programs;
}

/// Two cells of the platform's first measured unit that take little, and the scheduler where it is
/// what is slowed down.
std::vector<DuetCell> cells_of(const DuetPrograms& programs, const Trial& trial) {
  if (trial.injected.starts_with("scheduler")) return {{std::string(kSchedulerCell), ""}};
  for (const UnitModel& unit : programs.platform.units) {
    if (unit.measured()) return {{"sobel", unit.name}, {"conv1", unit.name}};
  }
  throw_bad_input(fmt::format("platform '{}' has no unit to measure", programs.platform.name));
}

/// What was found that is not so.
std::string detail_of(const Trial& trial, const DuetPrograms& programs, const GateResult& result) {
  std::string detail;
  for (const GateRow& row : result.rows) {
    const bool quiet = row.verdict == GateVerdict::kSame || row.verdict == GateVerdict::kFaster;
    const bool injected = row.workload == programs.injected.workload;
    if (quiet && (trial.injected.empty() || !injected)) continue;
    detail +=
        fmt::format("{}{} {} {} {:+.1f} % {}", detail.empty() ? "" : "; ", row.workload, row.phase,
                    to_string(row.verdict), 100 * (row.ratio.value_or(1) - 1), row.reason);
  }
  return detail;
}

TrialAnswer decide(const Trial& trial, DuetPrograms programs, std::string& detail) {
  const auto cells = cells_of(programs, trial);
  if (!trial.injected.empty()) programs.injection = parse_injection(std::string(trial.injected));
  programs.injected = cells.front();
  DuetComparison comparison(cells, programs.seed);
  Ledger nowhere;
  const auto end =
      run_duet(comparison, nowhere, program_samples(programs), one_at_a_time(cells.size()), {});
  const GateResult result = judge_duet(comparison, end);
  const TrialAnswer answer = answer_of(trial, result, programs.injected);
  if (answer != TrialAnswer::kRight) detail = detail_of(trial, programs, result);
  return answer;
}

/// Trials in turns, so that a noisy hour meets all of them.
void decide_all(const Options& options, SelfTest& test, Ledger& ledger) {
  DuetPrograms programs = programs_of(options);
  const MachineClock clock;
  for (int round = 0; round < options.decisions; ++round) {
    for (const Trial* trial : options.trials) {
      const TrialCount count = test.count(*trial);
      if (count.decisions() > round) continue;
      fmt::print(stderr, "decision {} of {}: {}\n", round + 1, options.decisions, trial->name);
      programs.seed = 1 + static_cast<std::uint64_t>(count.decisions());
      const Nanos begin = clock.now();
      std::string detail;
      const auto answer = decide(*trial, programs, detail);
      const auto event = SelfTest::event_of(*trial, answer, to_s(clock.now() - begin), detail);
      ledger.append(event);
      test.apply(event);
      if (answer == TrialAnswer::kRight) continue;
      fmt::print(stderr, "{}, decision {}: {}: {}\n", trial->name, round + 1, to_string(answer),
                 detail);
    }
  }
}

}  // namespace

int main(int argc, char** argv) {
  try {
    const Options options = parse({argv + 1, argv + argc});
    const DuetPrograms programs = programs_of(options);
    SelfTest test;
    Ledger ledger;
    if (!options.ledger.empty()) {
      ledger = Ledger(options.ledger,
                      ledger_key(programs, cells_of(programs, self_test_trials().front())),
                      [&](const Ledger::Event& event) { test.apply(event); });
    }
    decide_all(options, test, ledger);
    fmt::print("{}", render(self_test_document(test), Format::kText));
    return breaks_promise(test) ? kExitCheckFailed : 0;
  } catch (const std::exception& error) {
    fmt::print(stderr, "self_test: {}\n", error.what());
    return kExitBadInput;
  }
}
