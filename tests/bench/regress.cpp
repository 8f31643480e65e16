// How often the regression gate is right, on this machine.
//
// Usage:
//   regress tables DATABASE...       all ordered pairs of the databases' runs (tests/bench/aa makes
//                                    some): alarms and inconclusive answers without a change, how
//                                    often +25 % in one cell is found, in four cells a pair, one
//                                    after another, and where it is not; and in all of fc6 to fc8
//                                    at once, which move together as they would with the machine
//   regress load PIRT LEDGER [N]     N (60) whole decisions of a program against itself while
//                                    another program keeps one core busy
//   regress gate PIRT                how long a whole gate over Table I takes, without a change
// Two programs on a quiet machine: self_test, beside this program.
#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <span>
#include <string>
#include <string_view>
#include <thread>
#include <vector>

#include "characterize/profile/store/reader.h"
#include "characterize/worker/injection.h"
#include "characterize/worker/measure.h"
#include "characterize/worker/process.h"
#include "reports/gate/gate_report.h"
#include "reports/gate/self_test.h"
#include "workloads/base/error.h"
#include "workloads/base/math/random.h"

namespace {

using namespace pirt;  // NOLINT: a program

struct Answers {
  std::int64_t pass = 0, alarm = 0, inconclusive = 0;
  void add(int code) { ++(code == 0 ? pass : code == kExitCheckFailed ? alarm : inconclusive); }
  [[nodiscard]] std::int64_t all() const { return pass + alarm + inconclusive; }
};

double percent(std::int64_t part, std::int64_t all) {
  return all == 0 ? 0 : 100.0 * static_cast<double>(part) / static_cast<double>(all);
}

using Cells = std::vector<const PhaseRow*>;  ///< One row stands for its cell.

bool contains(const Cells& cells, std::string_view workload, std::string_view unit) {
  return std::ranges::any_of(cells, [&](const PhaseRow* cell) {
    return cell->workload == workload && cell->unit == unit;
  });
}

Cells cells_of(const Profile& profile, std::string_view prefix = {}) {
  Cells cells;
  for (const PhaseRow& row : profile.phases) {
    if (row.phase == Phase::kExecute && row.workload.starts_with(prefix)) cells.push_back(&row);
  }
  return cells;
}

/// @p profile with `execute` and `call` of @p cells 25 % slower.
Profile slower(Profile profile, const Cells& cells) {
  for (PhaseRow& row : profile.phases) {
    if (!contains(cells, row.workload, row.unit)) continue;
    if (row.phase != Phase::kExecute && row.phase != Phase::kCall) continue;
    for (Nanos& value : row.values) value = scaled(value, 1.25);
    for (auto* figure : {&row.median, &row.ci_low, &row.ci_high}) {
      if (*figure) *figure = scaled(**figure, 1.25);
    }
  }
  return profile;
}

/// @p profile with one in 25 calls of every cell ten times as long.
Profile with_tails(Profile profile, std::uint64_t seed) {
  Random random(seed);
  for (PhaseRow& row : profile.phases) {
    if (row.phase != Phase::kCall) continue;
    for (Nanos& value : row.values) {
      if (random.below(25) == 0) value = scaled(value, 10);
    }
  }
  return profile;
}

/// Rows of a result: undecided ones among those that are judged, tails that were found among those
/// that can be.
struct Rows {
  std::int64_t undecided = 0, judged = 0, tails = 0, eligible = 0;
  void add(const GateResult& result) {
    for (const GateRow& row : result.rows) {
      if (row.verdict == GateVerdict::kNotJudged) continue;
      ++judged;
      undecided += row.verdict == GateVerdict::kUndecided ? 1 : 0;
    }
  }
  void add_tails(const GateResult& result) {
    for (const GateRow& row : result.rows) {
      if (row.phase != "call tail" || row.verdict == GateVerdict::kNotJudged) continue;
      ++eligible;
      tails += row.verdict == GateVerdict::kSlower ? 1 : 0;
    }
  }
};

/// How many cells are slowed down for each pair of runs.
constexpr int kInjections = 4;

/// Cells in random order, each as often as the others.
class Deck {
 public:
  explicit Deck(const Profile& profile) : cells_(cells_of(profile)) {}
  const PhaseRow& deal() {
    if (next_ == 0) next_ = cells_.size();
    std::swap(cells_[random_.below(next_)], cells_[next_ - 1]);
    return *cells_[--next_];
  }

 private:
  Cells cells_;
  std::size_t next_ = 0;  ///< So many of this round are left.
  Random random_{1};
};

/// What a gate would exit with that judged only `execute` and `call` of @p cells of @p candidate,
/// after these were made 25 % slower. Rows of cells that it does not find are printed.
int exit_code_on_slower(const Profile& base, const Profile& candidate, const Cells& cells,
                        const std::string& pair) {
  const Profile changed = slower(candidate, cells);
  GateResult result = judge(diff_profiles(base, changed));
  std::erase_if(result.rows, [&](const GateRow& row) {
    return !contains(cells, row.workload, row.unit) ||
           (row.phase != "execute" && row.phase != "call");
  });
  const int code = exit_code_of(result);
  if (code == kExitCheckFailed) return code;
  fmt::print("+25 % not found, {}:", pair);
  for (const GateRow& row : result.rows) {
    fmt::print(" {} {} {} {} {:+.1f} % {};", row.workload, row.unit, row.phase,
               to_string(row.verdict), 100 * (row.ratio.value_or(1) - 1), row.reason);
  }
  fmt::print("\n");
  return code;
}

int tables(std::span<const std::string> paths) {
  const std::string platform = load_profile(paths.front()).platform();
  std::vector<Profile> runs;
  for (const std::string& path : paths) {
    const ProfileReader reader(path);
    for (const std::int64_t id : reader.finished_runs(platform)) {
      runs.push_back(reader.read(platform, {id, id}));
      reader.read_samples(runs.back());
    }
  }
  fmt::print("{} runs of platform {}\n", runs.size(), platform);
  if (runs.size() < 2) throw_bad_input("two runs are needed; tests/bench/aa makes some");
  Answers same;
  Answers one_slowed, family_slowed;
  Rows rows;
  Deck deck(runs.front());
  for (std::size_t a = 0; a < runs.size(); ++a) {
    for (std::size_t b = 0; b < runs.size(); ++b) {
      if (a == b) continue;
      const GateResult result = judge(diff_profiles(runs[a], runs[b]));
      same.add(exit_code_of(result));
      rows.add(result);
      const Profile tails = with_tails(runs[b], a * runs.size() + b);
      rows.add_tails(judge(diff_profiles(runs[a], tails)));
      for (const GateRow& row : result.rows) {
        const bool loud = row.verdict == GateVerdict::kSlower ||
                          row.verdict == GateVerdict::kInconclusive ||
                          row.verdict == GateVerdict::kNotComparable;
        if (!loud) continue;
        fmt::print("run {} against {}: {} {} {} {}: {:+.1f} % {}\n", b + 1, a + 1, row.workload,
                   row.unit, row.phase, to_string(row.verdict), 100 * (row.ratio.value_or(1) - 1),
                   row.reason);
      }
      const std::string pair = fmt::format("run {} against {}", b + 1, a + 1);
      for (int i = 0; i < kInjections; ++i) {
        const PhaseRow& cell = deck.deal();
        if (runs[b].find(cell.workload, cell.unit, Phase::kExecute) == nullptr) continue;
        one_slowed.add(exit_code_on_slower(runs[a], runs[b], {&cell}, pair));
      }
      const Cells family = cells_of(runs[b], "fc");
      if (!family.empty()) {
        family_slowed.add(exit_code_on_slower(runs[a], runs[b], family, pair));
      }
    }
  }
  fmt::print(
      "without a change: {} ordered pairs: {} alarm ({:.1f} %, goal: at most 1 %), {} "
      "inconclusive ({:.1f} %, goal: at most 20 %)\n",
      same.all(), same.alarm, percent(same.alarm, same.all()), same.inconclusive,
      percent(same.inconclusive, same.all()));
  fmt::print(
      "rows: {} of {} undecided ({:.1f} %); tails of 4 % x 10: {} of {} found ({:.1f} %, goal: "
      "at least 90 %)\n",
      rows.undecided, rows.judged, percent(rows.undecided, rows.judged), rows.tails, rows.eligible,
      percent(rows.tails, rows.eligible));
  fmt::print("+25 % in one cell: {} of {} found ({:.1f} %, goal: at least 95 %), {} inconclusive\n",
             one_slowed.alarm, one_slowed.all(), percent(one_slowed.alarm, one_slowed.all()),
             one_slowed.inconclusive);
  fmt::print("+25 % in all of fc6 to fc8: {} of {} found ({:.1f} %), {} inconclusive\n",
             family_slowed.alarm, family_slowed.all(),
             percent(family_slowed.alarm, family_slowed.all()), family_slowed.inconclusive);
  return 0;
}

/// Runs a program to its end, its output on ours. @return The exit code.
int run_pirt(const std::string& program, const std::vector<std::string>& arguments) {
  ProcessRequest request;
  request.program = program;
  request.arguments = arguments;
  request.limit = std::chrono::hours(24);
  const ProcessResult result = run_process(request);
  fmt::print("{}{}", result.output, result.diagnostics);
  return result.end == ProcessResult::End::kExited ? result.code : -1;
}

int load(const std::string& program, const std::string& ledger, const std::string& decisions) {
  std::atomic<bool> stop = false;
  std::thread busy([&stop] {
    while (!stop) ExtraWork::run(1'000'000);
  });
  const auto self_test = std::filesystem::canonical("/proc/self/exe").parent_path() / "self_test";
  const int code = run_pirt(self_test.string(), {program, "--trial", "same", "--decisions",
                                                 decisions, "--ledger", ledger});
  stop = true;
  busy.join();
  return code;
}

int gate(const std::string& program) {
  const MachineClock clock;
  const Nanos begin = clock.now();
  const std::string ledger = fmt::format("/tmp/pirt-gate-{}.ledger", ::getpid());
  const int code =
      run_pirt(program, {"regress", "--baseline-program", program, "--candidate-program", program,
                         "--ledger", ledger, "--max-time", "1h", "--filter",
                         "^(gaussian_blur|convolution|sobel|undistort|feature_detect|optical_flow|"
                         "conv[1-5]|fc[678])$"});
  fmt::print("a whole gate over Table I: {:.0f} s, exit code {} (goal: under 600 s, 0)\n",
             to_s(clock.now() - begin), code);
  std::remove(ledger.c_str());
  return code;
}

}  // namespace

int main(int argc, char** argv) {
  const std::vector<std::string> words(argv + 1, argv + argc);
  try {
    if (words.size() >= 2 && words[0] == "tables") return tables(std::span(words).subspan(1));
    if ((words.size() == 3 || words.size() == 4) && words[0] == "load") {
      return load(words[1], words[2], words.size() == 4 ? words[3] : "60");
    }
    if (words.size() == 2 && words[0] == "gate") return gate(words[1]);
    fmt::print(stderr, "usage: regress tables DATABASE... | load PIRT LEDGER [N] | gate PIRT\n");
    return kExitBadInput;
  } catch (const Error& error) {
    fmt::print(stderr, "regress: {}\n", error.what());
    return exit_code(error.code());
  }
}
