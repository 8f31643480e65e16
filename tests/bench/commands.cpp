// How often the gate of two commands is right: whole decisions of `pirt regress --baseline-command`
// on five small programs, each against itself, with more work, and beside a busy loop, with what
// ten runs of each and a t-test say of the same.
//
// Usage:
//   commands run PIRT LEDGER [DECISIONS]   that many decisions of each program without a change
//   (60),
//                                          a fifth of it with each slowdown; LEDGER keeps them, and
//                                          the same command goes on; prints the table
//   commands program NAME [WORK]           is one of the programs, with WORK times its work
#include <fmt/core.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <map>
#include <numeric>
#include <string>
#include <thread>
#include <vector>

#include "characterize/duet/ledger.h"
#include "characterize/statistics/proportions.h"
#include "characterize/worker/injection.h"
#include "characterize/worker/measure.h"
#include "characterize/worker/process.h"
#include "workloads/base/error.h"
#include "workloads/base/math/random.h"

namespace {

using namespace pirt;  // NOLINT: a program

std::filesystem::path own_path() { return std::filesystem::canonical("/proc/self/exe"); }

struct Program {
  std::string name, reads;
};
/// The last is Google Benchmark's (tests/examples/benchmark.cpp).
const std::array<Program, 5> kPrograms = {{{"sort", "lines"},
                                           {"chase", "lines"},
                                           {"text", "time"},
                                           {"matrix", "time"},
                                           {"bench", "gbench"}}};

std::size_t scaled_count(double count, double work) {
  return static_cast<std::size_t>(count * work);
}

double run_sort(double work) {
  Random random(1);
  std::vector<std::uint64_t> values(scaled_count(600'000, work));
  for (auto& value : values) value = random.next();
  std::ranges::sort(values);
  return static_cast<double>(values.front());
}

double run_chase(double work) {
  std::vector<std::uint32_t> next(1U << 18U);  // so that filling it takes next to nothing
  std::iota(next.begin(), next.end(), 0U);
  Random random(1);
  for (std::size_t i = next.size() - 1; i > 0; --i) std::swap(next[i], next[random.below(i)]);
  std::uint32_t at = 0;
  for (std::size_t i = 0; i < scaled_count(20'000'000, work); ++i) at = next[at];
  return at;
}

double run_text(double work) {
  std::map<std::string, int> words;
  for (std::size_t i = 0; i < scaled_count(600'000, work); ++i) {
    ++words["word " + std::to_string(i * 7919 % 5003)];
  }
  return static_cast<double>(words.size());
}

double run_matrix(double work) {
  constexpr std::size_t kSize = 200;
  std::vector<double> a(kSize * kSize, 1.5), b(kSize * kSize, 0.5), c(kSize * kSize);
  for (std::size_t round = 0; round < scaled_count(100, work); ++round) {
    for (std::size_t i = 0; i < kSize; ++i) {
      for (std::size_t k = 0; k < kSize; ++k) {
        for (std::size_t j = 0; j < kSize; ++j)
          c[i * kSize + j] += a[i * kSize + k] * b[k * kSize + j];
      }
    }
  }
  return c[7];
}

int program(const std::string& name, double work) {
  const MachineClock clock;
  const Nanos begin = clock.now();
  const double sum = name == "sort"    ? run_sort(work)
                     : name == "chase" ? run_chase(work)
                     : name == "text"  ? run_text(work)
                                       : run_matrix(work);
  fmt::print("# {}\n{} {} ms\n", sum, name, to_ms(clock.now() - begin));
  return 0;
}

std::vector<std::string> command(const Program& of, double work) {
  if (of.reads == "gbench") {
    const auto path = own_path().parent_path().parent_path() / "examples" / "benchmark";
    return {path.string(), fmt::format("--work={}", work)};
  }
  return {own_path().string(), "program", of.name, fmt::format("{}", work)};
}

std::string in_one(const std::vector<std::string>& words) {
  std::string text;
  for (const auto& word : words) text += "'" + word + "' ";
  return text;
}

struct Trial {
  std::string name;
  double work = 1;
  bool busy = false;
  double share = 1;  ///< Of the decisions.
};
const std::array<Trial, 4> kTrials = {{{"same", 1, false, 1},
                                       {"+5 %", 1.05, false, 0.2},
                                       {"+10 %, busy", 1.10, true, 0.2},
                                       {"+5 %, busy", 1.05, true, 0.1}}};

/// Keeps a core busy for as long as it lives.
class BusyLoop {
 public:
  explicit BusyLoop(bool wanted) {
    if (!wanted) return;
    thread_ = std::thread([this] {
      while (!stop_) ExtraWork::run(1'000'000);
    });
  }
  ~BusyLoop() {
    stop_ = true;
    if (thread_.joinable()) thread_.join();
  }
  BusyLoop(const BusyLoop&) = delete;
  BusyLoop& operator=(const BusyLoop&) = delete;

 private:
  std::atomic<bool> stop_ = false;
  std::thread thread_;
};

ProcessResult started(const std::vector<std::string>& words) {
  ProcessRequest request;
  request.program = words.front();
  request.arguments.assign(words.begin() + 1, words.end());
  request.limit = std::chrono::hours(1);
  return run_process(request);
}

/// Ten runs of one and then of the other: whether Welch's t says at 5 % that the second takes
/// longer.
bool t_test_alarms(const Program& of, double work) {
  std::array<std::vector<double>, 2> times;
  for (const std::size_t side : {0U, 1U}) {
    for (int i = 0; i < 10; ++i) {
      times[side].push_back(to_s(started(command(of, side == 0 ? 1 : work)).wall));
    }
  }
  std::array<double, 2> means{}, variances{};
  for (std::size_t side = 0; side < 2; ++side) {
    means[side] = std::accumulate(times[side].begin(), times[side].end(), 0.0) / 10;
    for (const double time : times[side]) variances[side] += std::pow(time - means[side], 2) / 9;
  }
  return (means[1] - means[0]) / std::sqrt((variances[0] + variances[1]) / 10) > 1.734;  // 18 free
}

Ledger::Event decide(const std::string& pirt, const Program& of, const Trial& trial, int number) {
  const BusyLoop busy(trial.busy);
  const MachineClock clock;
  const Nanos begin = clock.now();
  const auto ledger = std::filesystem::temp_directory_path() / fmt::format("pirt-{}", ::getpid());
  const auto outcome =
      started({pirt, "regress", "--baseline-command", in_one(command(of, 1)), "--candidate-command",
               in_one(command(of, trial.work)), "--reads", of.reads, "--seed",
               std::to_string(number + 1), "--ledger", ledger.string()});
  std::filesystem::remove(ledger);
  const Nanos middle = clock.now();
  const bool t_test = t_test_alarms(of, trial.work);
  return {{"program", of.name},   {"trial", trial.name},
          {"code", outcome.code}, {"elapsed_s", to_s(middle - begin)},
          {"t_test", t_test},     {"t_test_s", to_s(clock.now() - middle)}};
}

struct Count {
  std::int64_t all = 0, alarms = 0, open = 0, t_alarms = 0;
  double elapsed_s = 0, t_elapsed_s = 0;
};

int run(const std::string& pirt, const std::string& path, int decisions) {
  std::map<std::pair<std::string, std::string>, Count> counts;
  const auto add = [&counts](const Ledger::Event& event) {
    Count& count =
        counts[{event.at("program").get<std::string>(), event.at("trial").get<std::string>()}];
    const int code = event.at("code").get<int>();
    ++count.all;
    count.alarms += code == 1 ? 1 : 0;
    count.open += code == 3 ? 1 : 0;
    count.t_alarms += event.at("t_test").get<bool>() ? 1 : 0;
    count.elapsed_s += event.at("elapsed_s").get<double>();
    count.t_elapsed_s += event.at("t_test_s").get<double>();
  };
  Ledger ledger(path, {{"commands", 1}}, add);
  for (int number = 0; number < decisions; ++number) {
    for (const Program& of : kPrograms) {
      for (const Trial& trial : kTrials) {
        const auto done = counts[{of.name, trial.name}].all;
        if (done > number || number >= trial.share * decisions) continue;
        const auto event = decide(pirt, of, trial, number);
        ledger.append(event);
        add(event);
      }
    }
  }
  fmt::print("{:>12} {:>12} {:>10} {:>8} {:>13} {:>9} {:>9} | {:>8} {:>9}\n", "trial", "program",
             "decisions", "alarms", "inconclusive", "at most %", "s each", "t-test", "s each");
  for (const Trial& trial : kTrials) {
    Count sum;
    const auto print = [&trial](const std::string& name, const Count& count) {
      if (count.all == 0) return;
      const auto all = static_cast<double>(count.all);
      // Of an injected slowdown an answer that is none is a miss.
      const auto wrong = trial.work > 1 ? count.all - count.alarms : count.alarms;
      fmt::print("{:>12} {:>12} {:>10} {:>8} {:>13} {:>9.2g} {:>9.1f} | {:>8} {:>9.1f}\n",
                 trial.name, name, count.all, count.alarms, count.open,
                 100 * rate_upper_bound(wrong, count.all), count.elapsed_s / all, count.t_alarms,
                 count.t_elapsed_s / all);
    };
    for (const Program& of : kPrograms) {
      const Count& count = counts[{of.name, trial.name}];
      print(of.name, count);
      sum.all += count.all;
      sum.alarms += count.alarms;
      sum.open += count.open;
      sum.t_alarms += count.t_alarms;
      sum.elapsed_s += count.elapsed_s;
      sum.t_elapsed_s += count.t_elapsed_s;
    }
    print("all", sum);
  }
  fmt::print("at most: of wrong answers, with 95 % confidence\n");
  return 0;
}

}  // namespace

int main(int argc, char** argv) {
  const std::vector<std::string> words(argv + 1, argv + argc);
  try {
    if (words.size() >= 2 && words[0] == "program") {
      return program(words[1], words.size() > 2 ? std::atof(words[2].c_str()) : 1);
    }
    if (words.size() >= 3 && words[0] == "run") {
      return run(words[1], words[2], words.size() > 3 ? std::atoi(words[3].c_str()) : 60);
    }
    fmt::print(stderr, "usage: commands run PIRT LEDGER [DECISIONS] | program NAME [WORK]\n");
    return kExitBadInput;
  } catch (const Error& error) {
    fmt::print(stderr, "commands: {}\n", error.what());
    return exit_code(error.code());
  }
}
