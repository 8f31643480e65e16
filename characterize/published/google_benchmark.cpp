// JSON of Google Benchmark: what functions of the user's took on the host.
// Source of the keys: google/benchmark v1.7.1, src/json_reporter.cc; of `skipped`: v1.8.0.
#include "characterize/published/google_benchmark.h"

#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <map>

#include "characterize/published/published.h"

namespace pirt {
namespace {

double nanoseconds_of(const std::string& unit) {
  static const std::map<std::string, double> units = {
      {"ns", 1}, {"us", 1e3}, {"ms", 1e6}, {"s", 1e9}};
  const auto found = units.find(unit);
  if (found == units.end()) throw JsonError("time_unit '" + unit + "' is none of ns, us, ms, s");
  return found->second;
}

/// Of versions that do not say `run_type`.
bool is_named_as_aggregate(const std::string& name) {
  constexpr std::array kEnds = {"_BigO", "_RMS", "_mean", "_median", "_stddev", "_cv"};
  return std::ranges::any_of(kEnds, [&name](const char* end) { return name.ends_with(end); });
}

/// With null for NaN and Infinity, which Google Benchmark writes of counters that have no figure
/// and JSON does not know.
std::string without_nan(std::string_view text) {
  constexpr std::array<std::string_view, 4> kNone = {"-NaN", "NaN", "-Infinity", "Infinity"};
  std::string json;
  bool quoted = false;
  while (!text.empty()) {
    const auto none = std::ranges::find_if(
        kNone, [&](std::string_view each) { return !quoted && text.starts_with(each); });
    const std::size_t taken = none != kNone.end()                            ? none->size()
                              : quoted && text[0] == '\\' && text.size() > 1 ? 2
                                                                             : 1;
    if (taken == 1 && text[0] == '"') quoted = !quoted;
    json += none != kNone.end() ? std::string_view("null") : text.substr(0, taken);
    text.remove_prefix(taken);
  }
  return json;
}

BenchmarkEntry entry_of(const Json& benchmark) {
  using Kind = BenchmarkEntry::Kind;
  const std::string name = benchmark.at("name");
  BenchmarkEntry entry{.name = benchmark.value("run_name", name),
                       .threads = benchmark.value("threads", std::int64_t{1})};
  if (benchmark.value("error_occurred", false)) {
    entry.kind = Kind::kError;
    entry.said = benchmark.value("error_message", "an error");
  } else if (benchmark.value("skipped", false)) {
    entry.kind = Kind::kSkipped;
  } else if (benchmark.value("run_type", is_named_as_aggregate(name) ? "" : "iteration") !=
             "iteration") {
    entry.kind = Kind::kAggregate;
  } else {
    entry.real_ns = benchmark.at("real_time").get<double>() *
                    nanoseconds_of(benchmark.value("time_unit", "ns"));
  }
  return entry;
}

/// Why it is no time of a call; empty if it is.
std::string why_not_a_call(const BenchmarkEntry& entry) {
  switch (entry.kind) {
    case BenchmarkEntry::Kind::kAggregate:
      return "aggregates of repetitions";
    case BenchmarkEntry::Kind::kError:
      return "benchmarks that failed";
    case BenchmarkEntry::Kind::kSkipped:
      return "benchmarks that were skipped";
    case BenchmarkEntry::Kind::kTime:
      break;
  }
  if (entry.threads > 1) return "benchmarks of several threads, whose time is not one of a call";
  return entry.real_ns < 1 ? "times below a nanosecond" : "";
}

}  // namespace

std::optional<Json> find_benchmarks(std::string_view text) {
  const auto begin = text.starts_with('{') ? 0 : text.find("\n{");
  if (begin == std::string_view::npos) return std::nullopt;
  text.remove_prefix(begin);
  auto root = try_parse_json(without_nan(text));
  // It ends with a brace at the begin of a line; what a program prints behind it is left out.
  const auto last = text.rfind("\n}");
  if (!root && last != std::string_view::npos) {
    root = try_parse_json(without_nan(text.substr(0, last + 2)));
  }
  if (root && !(root->contains("benchmarks") && root->at("benchmarks").is_array())) root.reset();
  return root;
}

std::vector<BenchmarkEntry> benchmark_entries(const Json& root) {
  std::vector<BenchmarkEntry> entries;
  for (const Json& benchmark : root.at("benchmarks")) entries.push_back(entry_of(benchmark));
  return entries;
}

Publication read_google_benchmark(const std::string& file, const Json& root) {
  const Json& context = root.at("context");
  const std::string host = context.value("host_name", "");
  PublishedBoard board{.name = name_of(host).empty() ? board_of(file) : name_of(host),
                       .said = host.empty() ? file : host,
                       .provenance = Provenance::kMeasured};
  if (const auto date = context.value("date", ""); !date.empty()) board.facts["tested"] = date;
  add_unit(board, {.name = "cpu", .device = "the host's cores", .is_cpu = true});
  std::map<std::string, int> left_out;
  std::map<std::string, std::string> known;
  for (const BenchmarkEntry& entry : benchmark_entries(root)) {
    if (const std::string why = why_not_a_call(entry); !why.empty()) {
      ++left_out[why];
      continue;
    }
    add_figure(board, {.workload = foreign_name("gbench", entry.name, known),
                       .unit = "cpu",
                       .samples = {published_time(entry.real_ns, 1, entry.name + ": real_time")},
                       .notes = {"means of the wall time of repetitions"}});
  }
  Publication publication{.format = "Google Benchmark", .boards = {std::move(board)}};
  for (const auto& [why, count] : left_out) {
    publication.left_out.push_back(fmt::format("{} ({})", why, count));
  }
  return publication;
}

}  // namespace pirt
