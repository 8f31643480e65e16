// JSON of Google Benchmark: what functions of the user's took on the host.
// Source of the keys: google/benchmark v1.7.1, src/json_reporter.cc.
#include <fmt/core.h>

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

/// Why it is no time of a call; empty if it is.
std::string why_not_a_call(const Json& benchmark) {
  if (benchmark.value("run_type", "iteration") != "iteration") return "aggregates of repetitions";
  if (benchmark.value("error_occurred", false)) return "benchmarks that failed";
  if (benchmark.value("skipped", false)) return "benchmarks that were skipped";
  if (benchmark.value("threads", 1) > 1) {
    return "benchmarks of several threads, whose time is not one of a call";
  }
  return "";
}

}  // namespace

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
  for (const Json& benchmark : root.at("benchmarks")) {
    if (const std::string why = why_not_a_call(benchmark); !why.empty()) {
      ++left_out[why];
      continue;
    }
    const std::string name = benchmark.value("run_name", benchmark.at("name").get<std::string>());
    const double unit_ns = nanoseconds_of(benchmark.value("time_unit", "ns"));
    add_figure(board, {.workload = foreign_name("gbench", name, known),
                       .unit = "cpu",
                       .samples = {published_time(benchmark.at("real_time").get<double>(), unit_ns,
                                                  name + ": real_time")},
                       .notes = {"means of the wall time of repetitions"}});
  }
  Publication publication{.format = "Google Benchmark", .boards = {std::move(board)}};
  for (const auto& [why, count] : left_out) {
    publication.left_out.push_back(fmt::format("{} ({})", why, count));
  }
  return publication;
}

}  // namespace pirt
