#include "characterize/duet/readers.h"

#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <map>
#include <string_view>

#include "characterize/published/google_benchmark.h"
#include "characterize/statistics/rank_tests.h"
#include "workloads/base/error.h"
#include "workloads/base/text/json.h"
#include "workloads/base/text/printable.h"
#include "workloads/base/text/text.h"
#include "workloads/model/phase.h"

namespace pirt {
namespace {

constexpr std::size_t kMostFigures = 1000;
constexpr std::size_t kLongestName = 200;
constexpr std::size_t kLongestFilter = 60'000;  // characters; an argument has 128 KiB

/// Figures by name as they come; a name that comes again has the median of them.
class Figures {
 public:
  void add(const std::string& name, double value, const Measure& measure) {
    if (name.empty() || name.size() > kLongestName) {
      throw_bad_input(
          fmt::format("a name of {} characters, not of 1 to {}", name.size(), kLongestName));
    }
    for (const std::string& text : {name, measure.unit}) {
      if (const auto found = find_unprintable(text)) {
        throw_bad_input(fmt::format("'{}' has {}", printable(text), found->what));
      }
    }
    if (!std::isfinite(value)) throw_bad_input("'" + name + "' is no finite figure");
    const auto [known, is_new] = measures_.try_emplace(name, measure);
    if (!is_new && (known->second.unit != measure.unit ||
                    known->second.higher_is_better != measure.higher_is_better)) {
      throw_bad_input("'" + name + "' comes again in another unit or direction");
    }
    values_[name].push_back(value);
    if (values_.size() > kMostFigures) {
      throw_bad_input(fmt::format("more than {} figures; let it print fewer", kMostFigures));
    }
  }

  [[nodiscard]] Sample sample() const {
    Sample sample;
    for (const auto& [name, values] : values_) {
      sample.seconds[name] = median_of(values);
      const Measure& measure = measures_.at(name);
      if (measure.unit != "s" || measure.higher_is_better) sample.measures[name] = measure;
    }
    if (sample.seconds.empty()) throw_bad_input("it printed no figure");
    return sample;
  }

 private:
  std::map<std::string, std::vector<double>> values_;
  std::map<std::string, Measure> measures_;
};

std::vector<std::string> no_arguments(const std::vector<std::string>&) { return {}; }

Sample read_pirt(const ProcessResult& process) {
  Sample sample = sample_from_json(process.output);
  for (const auto& [phase, seconds] : sample.seconds) {
    if (seconds < 0) throw_bad_input("'" + phase + "' is below 0, no time");
  }
  return sample;
}

Sample read_workload(const ProcessResult& process) {
  Sample sample = read_pirt(process);
  sample.seconds.erase(std::string(to_string(Phase::kDeviceInit)));
  sample.inputs.clear();  // Each generates its own.
  return sample;
}

Sample read_time(const ProcessResult& process) {
  Figures figures;
  figures.add("wall", to_s(process.wall), {"s"});
  figures.add("cpu", to_s(process.cpu), {"s"});
  // Of a smaller program nobody knows: pirt's own would be the same figure on both sides.
  const bool is_its_own = 10 * process.peak_bytes > 11 * process.inherited_bytes;
  figures.add("memory", is_its_own ? static_cast<double>(process.peak_bytes) : 0, {"bytes"});
  return figures.sample();
}

Sample read_gbench(const ProcessResult& process) {
  const auto benchmarks = find_benchmarks(process.output);
  if (!benchmarks) {
    throw_bad_input(fmt::format("stdout is no JSON of Google Benchmark but '{}'",
                                one_line(process.output, 60)));
  }
  Figures figures;
  try {
    for (const BenchmarkEntry& entry : benchmark_entries(*benchmarks)) {
      if (entry.kind == BenchmarkEntry::Kind::kError) {
        throw_bad_input(fmt::format("benchmark {}: {}", entry.name, entry.said));
      }
      if (entry.kind == BenchmarkEntry::Kind::kTime) {
        figures.add(entry.name, 1e-9 * entry.real_ns, {"s"});
      }
    }
  } catch (const JsonError& error) {
    throw_bad_input("a benchmark's entry: " + error.reason());
  }
  return figures.sample();
}

/// A regular expression that finds exactly these names.
std::vector<std::string> gbench_arguments(const std::vector<std::string>& only) {
  std::vector<std::string> arguments = {"--benchmark_format=json"};
  std::string filter;
  for (const std::string& name : only) {
    filter += filter.empty() ? "^(" : "|";
    for (const char c : name) {
      if (std::string_view(R"(\^$.|?*+()[]{})").find(c) != std::string_view::npos) filter += '\\';
      filter += c;
    }
  }
  if (!filter.empty() && filter.size() < kLongestFilter) {
    arguments.push_back("--benchmark_filter=" + filter + ")$");
  }
  return arguments;
}

/// Whether most figures in it are better the more they are: "MB/s", "fps", "GFLOPS".
bool is_rate(std::string unit) {
  constexpr std::array<std::string_view, 16> kRates = {"hz",  "khz",  "mhz",  "ghz",  "fps",  "qps",
                                                       "ips", "bps",  "kbps", "mbps", "gbps", "rps",
                                                       "tps", "iops", "ops",  "rpm"};
  constexpr std::array<std::string_view, 9> kTimes = {"s",   "sec",    "sec.", "second", "seconds",
                                                      "min", "minute", "h",    "hour"};
  std::ranges::transform(unit, unit.begin(), [](char c) {
    return c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c;
  });
  const auto slash = unit.rfind('/');
  const bool is_of_time = slash != std::string::npos &&
                          std::ranges::find(kTimes, unit.substr(slash + 1)) != kTimes.end();
  return is_of_time || unit.ends_with("flops") || std::ranges::find(kRates, unit) != kRates.end();
}

Sample read_lines(const ProcessResult& process) {
  Figures figures;
  int number = 0;
  for (const std::string& line : split(process.output, '\n')) {
    ++number;
    const auto words = words_in(line);
    if (words.empty() || words[0].starts_with('#')) continue;
    const auto fail = [&](const std::string& why) {
      throw_bad_input(fmt::format("line {} '{}': {}; a line is NAME VALUE UNIT [lower|higher]",
                                  number, one_line(line, 60), why));
    };
    if (words.size() < 3 || words.size() > 4) fail(fmt::format("{} words", words.size()));
    double value = 0;
    const std::string& text = words[1];
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
    if (error != std::errc() || end != text.data() + text.size()) {
      fail("'" + text + "' is no number");
    }
    if (words.size() == 3 && is_rate(words[2])) {
      fail("more is better of most rates: say lower or higher");
    }
    const std::string direction = words.size() == 4 ? words[3] : "lower";
    if (direction != "lower" && direction != "higher") fail("'" + direction + "' is no direction");
    try {
      figures.add(words[0], value, {words[2], direction == "higher"});
    } catch (const Error& problem) {
      fail(problem.what());
    }
  }
  return figures.sample();
}

constexpr std::array<OutputReader, 4> kReaders = {
    {{"time", "wall and processor time and peak memory of the process", read_time, no_arguments},
     {"gbench", "JSON of Google Benchmark", read_gbench, gbench_arguments},
     {"lines", "lines NAME VALUE UNIT [lower|higher]", read_lines, no_arguments},
     {"pirt", "what pirt sample answers", read_pirt, no_arguments}}};
constexpr OutputReader kWorkloadReader = {"workload", "what pirt sample answers of a workload",
                                          read_workload, no_arguments, "--verify"};

}  // namespace

std::span<const OutputReader> output_readers() { return kReaders; }

const OutputReader& workload_reader() { return kWorkloadReader; }

const OutputReader& find_reader(const std::string& name) {
  std::vector<std::string> names;
  for (const OutputReader& reader : kReaders) {
    if (reader.name == name) return reader;
    names.emplace_back(reader.name);
  }
  throw_bad_input("nothing reads '" + name + "'" + suggestion(name, names) + "; --reads " +
                  join(names, ", "));
}

}  // namespace pirt
