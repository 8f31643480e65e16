// How far virtual time is off: mixes full-robot and table1-robot on platform host, live and
// predicted from a profile that is measured in the same minutes, and pairs of workloads as fast as
// they go.
//
// Usage: fidelity PIRT [ROUNDS [SECONDS]]   PIRT: the program, e.g. build/pirt; default: 5 rounds
// of
//        20 s a run, 20 to 30 minutes in all. Nothing else should run meanwhile.
//
// Each round measures a profile (--quick --interference), runs every mix in every mode live, pairs
// of workloads side by side, and two that alternate with others on one unit (what caches lose by
// that: scheduler/README.md), and predicts each with --draw samples. Figures are medians over the
// rounds. Exit code 1: a goal is missed.
#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <map>
#include <set>
#include <string>
#include <vector>

#include "characterize/profile/store/reader.h"
#include "scheduler/mix/mix.h"
#include "scheduler/record/run_record.h"
#include "workloads/base/error.h"
#include "workloads/base/text/text.h"

namespace {

constexpr double kP50Share = 0.05, kP50Ms = 0.020;
constexpr double kP95Share = 0.15, kP95Ms = 0.050;
constexpr double kMissesOf500 = 3;
constexpr double kMakespanMedian = 0.05, kMakespanWorst = 0.15;
constexpr double kLongestCallMs = 5;
constexpr std::size_t kPairs = 10;
const std::vector<std::string> kMixes = {"full-robot", "table1-robot"};
const std::vector<std::string> kModes = {"latency", "throughput", "advanced"};
/// For pairs, beside the workloads of the mixes.
const std::vector<std::string> kShort = {
    "gaussian_blur",    "sobel",        "convolution", "undistort",
    "background_model", "optical_flow", "pool1",       "fc8"};

double median(std::vector<double> values) {
  std::ranges::sort(values);
  const std::size_t half = values.size() / 2;
  return values.size() % 2 == 1 ? values[half] : (values[half - 1] + values[half]) / 2;
}

/// One figure in all rounds.
struct Figure {
  std::vector<double> live, predicted;

  void add(const std::optional<double>& there, const std::optional<double>& here) {
    if (!there || !here) return;
    live.push_back(*there);
    predicted.push_back(*here);
  }
  [[nodiscard]] double off() const { return median(predicted) - median(live); }
  [[nodiscard]] double share() const { return std::abs(off()) / median(live); }
};

struct Pipeline {
  std::int64_t fired = 0;  ///< In a round.
  Figure p50_ms, p95_ms, misses;
};

class Rounds {
 public:
  Rounds(std::string program, std::filesystem::path folder, int seconds)
      : program_(std::move(program)), folder_(std::move(folder)), seconds_(seconds) {}

  void run(int round) {
    database_ = folder_ / fmt::format("round-{}.db", round);
    std::set<std::string> names(kShort.begin(), kShort.end());
    for (const auto& mix : kMixes) {
      for (const auto& pipeline : pirt::load_mix(mix).pipelines) {
        for (const auto& task : pipeline.tasks) names.insert(task.workload);
      }
    }
    pirt_do(fmt::format("characterize --quick --interference --seed {} --filter '^({})$' --db {}",
                        round, pirt::join(std::vector(names.begin(), names.end()), "|"),
                        database_.string()));
    for (const auto& mix : kMixes) {
      for (const auto& mode : kModes) {
        const auto both =
            live_and_predicted(mix, mode, fmt::format("--duration {}s", seconds_), round);
        for (const auto& there : both.first.pipelines) take(mix + ", " + mode, there, both.second);
      }
    }
    for (const auto& [a, b] : pairs()) {
      const auto both = live_and_predicted(pair_mix(a, b), "throughput", "", round);
      makespans_[a + " and " + b].add(both.first.makespan_s, both.second.makespan_s);
    }
    for (const std::size_t others : {0U, 2U, 4U, 6U}) {
      const auto both =
          live_and_predicted(alternating_mix(others), "latency", "--in-flight 1", round);
      alternating_[fmt::format("{} and {}, {} others between", kShort[0], kShort[1], others)].add(
          both.first.makespan_s, both.second.makespan_s);
    }
  }

  /// @return  Whether all goals are met.
  bool print() const {
    bool met = true;
    const auto line = [&met](const std::string& what, const std::string& figure, double live,
                             double predicted, const std::string& off, bool good) {
      fmt::print("{:<44} {:<8} {:>10.4g} {:>10.4g} {:>9} {}\n", what, figure, live, predicted, off,
                 good ? "" : "MISSED");
      met = met && good;
    };
    fmt::print("{:<44} {:<8} {:>10} {:>10} {:>9}\n", "what", "figure", "live", "virtual", "off");
    const auto relative = [](const Figure& figure) {
      return fmt::format("{:+.1f} %", 100 * figure.off() / median(figure.live));
    };
    for (const auto& each : pipelines_) {
      const auto& name = each.first;  // no bindings: a lambda takes them
      const auto& pipeline = each.second;
      const auto rounds = static_cast<std::int64_t>(pipeline.p50_ms.live.size());
      if (rounds == 0) continue;
      const auto check = [&](const Figure& figure, const char* word, std::int64_t least,
                             double share, double ms) {
        if (pipeline.fired * rounds < least) return;
        line(name, word, median(figure.live), median(figure.predicted), relative(figure),
             figure.share() <= share || std::abs(figure.off()) <= ms);
      };
      check(pipeline.p50_ms, "p50 ms", 50, kP50Share, kP50Ms);
      check(pipeline.p95_ms, "p95 ms", 200, kP95Share, kP95Ms);
      if (pipeline.misses.live.empty() || pipeline.fired * rounds < 500) continue;
      const double of_500 = pipeline.misses.off() * 500 / static_cast<double>(pipeline.fired);
      line(name, "misses", median(pipeline.misses.live), median(pipeline.misses.predicted),
           fmt::format("{:+.1f}/500", of_500), std::abs(of_500) <= kMissesOf500);
    }
    for (const auto& [name, figure] : alternating_) {
      line(name, "makespan", median(figure.live), median(figure.predicted), relative(figure),
           figure.share() <= kMakespanWorst);
    }
    std::vector<double> off;
    for (const auto& [name, figure] : makespans_) {
      off.push_back(figure.share());
      line(name, "makespan", median(figure.live), median(figure.predicted), relative(figure), true);
    }
    if (off.empty()) return met;
    const double middle = median(off);
    const double worst = std::ranges::max(off);
    fmt::print("makespans: off by {:.1f} % in the median (goal 5), {:.1f} % at worst (goal 15)\n",
               100 * middle, 100 * worst);
    return met && middle <= kMakespanMedian && worst <= kMakespanWorst;
  }

 private:
  void pirt_do(const std::string& arguments) const {
    const std::string command =
        program_ + " " + arguments + " >/dev/null 2>>" + (folder_ / "log").string();
    if (std::system(command.c_str()) != 0) {
      pirt::throw_environment("failed: " + command);
    }
  }

  [[nodiscard]] std::pair<pirt::RunRecord, pirt::RunRecord> live_and_predicted(
      const std::string& mix, const std::string& mode, const std::string& more, int round) const {
    std::vector<pirt::RunRecord> records;
    for (const char* time : {"--live", "--draw samples"}) {
      const auto file = folder_ / "record.json";
      pirt_do(
          fmt::format("schedule --mode {} --mix {} --profile {} --seed {} {} {} "
                      "--json {}",
                      mode, mix, database_.string(), round, more, time, file.string()));
      records.push_back(pirt::load_run_record(file));
    }
    return {std::move(records[0]), std::move(records[1])};
  }

  void take(const std::string& run, const pirt::PipelineResult& there,
            const pirt::RunRecord& predicted) {
    const auto here =
        std::ranges::find(predicted.pipelines, there.pipeline, &pirt::PipelineResult::pipeline);
    if (here == predicted.pipelines.end()) return;
    Pipeline& pipeline = pipelines_[run + ": " + there.pipeline];
    pipeline.fired = there.fired;
    pipeline.p50_ms.add(there.p50_ms, here->p50_ms);
    pipeline.p95_ms.add(there.p95_ms, here->p95_ms);
    if (there.deadline_misses && here->deadline_misses) {
      pipeline.misses.add(static_cast<double>(*there.deadline_misses),
                          static_cast<double>(*here->deadline_misses));
    }
  }

  /// Neighbours in the profile's order, of those whose calls are short wherever they run.
  [[nodiscard]] std::vector<std::pair<std::string, std::string>> pairs() const {
    const pirt::Profile profile = pirt::load_profile(database_);
    std::vector<std::string> names;
    for (const auto& name : profile.workloads()) {
      bool is_short = true;
      int units = 0;
      for (const auto& unit : profile.units()) {
        const auto* call = profile.find(name, unit, pirt::Phase::kCall);
        if (call == nullptr || !call->median) continue;
        ++units;
        is_short = is_short && pirt::to_ms(*call->median) < kLongestCallMs;
      }
      if (is_short && units == 2) names.push_back(name);
    }
    std::vector<std::pair<std::string, std::string>> found;
    for (std::size_t apart = 1; apart < names.size(); ++apart) {
      for (std::size_t i = 0; i + apart < names.size() && found.size() < kPairs; ++i) {
        found.emplace_back(names[i], names[i + apart]);
      }
    }
    return found;
  }

  [[nodiscard]] std::string pair_mix(const std::string& a, const std::string& b) const {
    const auto file = folder_ / "pair.yaml";
    std::ofstream out(file);
    out << "mix: pair\npipelines:\n";
    for (const auto& name : {a, b}) {
      out << fmt::format(
          "  {0}: {{closed_loop: {{frames: 500}}, tasks: [{{name: {0}, workload: {0}}}]}}\n", name);
    }
    return file.string();
  }

  /// The first two of kShort and as many others in a chain on one unit, again and again.
  [[nodiscard]] std::string alternating_mix(std::size_t others) const {
    const auto file = folder_ / "alternating.yaml";
    std::ofstream out(file);
    out << "mix: alternating\npipelines:\n  p:\n    closed_loop: {frames: 200}\n    tasks:\n";
    for (std::size_t i = 0; i < others + 2; ++i) {
      out << fmt::format("      - {{name: {0}, workload: {0}, eligible: [cpu]{1}}}\n", kShort[i],
                         i == 0 ? "" : fmt::format(", after: [{}]", kShort[i - 1]));
    }
    return file.string();
  }

  std::string program_;
  std::filesystem::path folder_;
  std::filesystem::path database_;
  int seconds_;
  std::map<std::string, Pipeline> pipelines_;
  std::map<std::string, Figure> makespans_, alternating_;
};

}  // namespace

int main(int argc, char** argv) {
  if (argc < 2) {
    fmt::print(stderr, "usage: fidelity PIRT [ROUNDS [SECONDS]]\n");
    return 2;
  }
  const int rounds = argc > 2 ? std::atoi(argv[2]) : 5;
  const int seconds = argc > 3 ? std::atoi(argv[3]) : 20;
  std::string name = (std::filesystem::temp_directory_path() / "pirt-fidelity-XXXXXX").string();
  if (::mkdtemp(name.data()) == nullptr) return 4;
  try {
    const auto start = std::chrono::steady_clock::now();
    Rounds all(argv[1], name, seconds);
    for (int round = 1; round <= rounds; ++round) {
      all.run(round);
      fmt::print(stderr, "round {} of {}: {:.0f} s gone\n", round, rounds,
                 std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count());
    }
    const bool met = all.print();
    std::filesystem::remove_all(name);
    return met ? 0 : 1;
  } catch (const std::exception& error) {
    fmt::print(stderr, "{}; the log is in {}\n", error.what(), name);
    return 4;
  }
}
