// A benchmark.yaml of RobotPerf: results of one benchmark on many boards. Its latencies go from
// message to message; `value` is the longest, the mean stands in the note.
#include <fmt/core.h>

#include <algorithm>
#include <optional>

#include "characterize/published/published.h"
#include "workloads/base/error.h"
#include "workloads/base/text/numbers.h"
#include "workloads/base/text/yaml.h"

namespace pirt {
namespace {

constexpr double kMost = 1e9;

struct Result {
  std::string hardware, metric, unit, kind, note;
  double value = 0;
};

Result read_result(const YamlNode& node) {
  const YamlNode entry = node.at("result");
  const auto optional = [&entry](const char* key) {
    return entry.has(key) ? entry.at(key).paragraph() : "";
  };
  return {.hardware = entry.at("hardware").paragraph(),
          .metric = entry.at("metric").text(),
          .unit = optional("metric_unit"),
          .kind = optional("type"),
          .note = optional("note"),
          .value = entry.at("value").number(0, kMost)};
}

/// 5.41 of "mean 5.41 ms, rms 5.85 ms" and of "mean_benchmark 5.41, rms_benchmark 5.85".
std::optional<std::string> number_after(const std::string& note, const std::string& word) {
  const auto begin = note.find(word);
  if (begin == std::string::npos) return std::nullopt;
  const auto space = note.find(' ', begin);
  if (space == std::string::npos) return std::nullopt;
  const auto end = note.find_first_not_of("0123456789.eE-", space + 1);
  return note.substr(space + 1, end == std::string::npos ? end : end - space - 1);
}

/// What is read off power and throughput: no time of a call, and kept beside the rows.
void add_fact(PublishedBoard& board, const Result& result) {
  std::string& fact = board.facts["published." + name_of(result.metric, '_')];
  fact += fmt::format("{}{} {}", fact.empty() ? "" : ", ", result.value, result.unit);
}

/// Why a latency is not the time of a call; empty if it is.
std::string why_not(const Result& result, const std::optional<std::string>& mean) {
  if (result.unit != "ms") return "not in ms";
  if (result.note.find("swept") != std::string::npos) {
    return "the rate was swept, so that messages waited";
  }
  if (!mean || !milliseconds(*mean, kNanosecondMs, kLongestMs).value) {
    return "the longest alone is given, and no mean";
  }
  return "";
}

}  // namespace

Publication read_robotperf(const std::string& file, const std::string& text) {
  const YamlNode root = parse_yaml(file, text);
  if (!root.is_map() || !root.has("results") || !root.has("name")) {
    throw_bad_input("'" + file +
                    "' is none of what can be imported: times of yours (CSV: workload, unit, ms), "
                    "JSON of Google Benchmark, of nvbench or of ros2_benchmark, a history of "
                    "StarPU, a benchmark.yaml of RobotPerf (name, results), a table of ncnn (CSV: "
                    "soc, unit, threads, network, avg_ms)");
  }
  const std::string benchmark = "robotperf." + name_of(root.at("name").text(), '_');
  Publication publication{.format = "RobotPerf", .boards = {}, .left_out = {}};
  std::map<std::string, int> left_out;
  for (const YamlNode& node : root.at("results").items()) {
    const Result result = read_result(node);
    const std::string name = name_of(result.hardware);
    if (name.empty()) node.fail("its hardware has no letter or digit");
    auto board = std::ranges::find(publication.boards, name, &PublishedBoard::name);
    if (board == publication.boards.end()) {
      board = publication.boards.insert(
          board, {.name = name, .said = result.hardware, .units = {}, .figures = {}, .facts = {}});
      add_unit(*board, {.name = "board", .device = result.hardware, .is_cpu = false});
    }
    if (result.metric != "latency") {
      add_fact(*board, result);
      continue;
    }
    const auto mean = number_after(result.note, "mean");
    if (const std::string why = why_not(result, mean); !why.empty()) {
      ++left_out[result.hardware + ": " + why];
      continue;
    }
    PublishedFigure figure{
        .workload = benchmark + (result.kind.empty() ? "" : "." + name_of(result.kind, '_')),
        .unit = "board",
        .samples = {*milliseconds(*mean, kNanosecondMs, kLongestMs).value},
        .notes = {"means of published runs, from message to message"}};
    const auto lost = number_after(result.note, "lost ");
    const auto lost_messages = number_after(result.note, "messages ");
    const auto& share = lost_messages ? lost_messages : lost;
    if (share && decimal_number(*share, 1e-9, 100).value) {
      figure.notes.push_back("some of them lost messages");
    }
    add_figure(*board, figure);
  }
  for (const auto& [what, count] : left_out) {
    publication.left_out.push_back(fmt::format("{} ({} latencies)", what, count));
  }
  return publication;
}

}  // namespace pirt
