// A result of ros2_benchmark: one node on one machine, at its highest rate and at fixed ones.
#include <fmt/core.h>

#include "characterize/published/published.h"
#include "workloads/base/error.h"
#include "workloads/base/text/json.h"
#include "workloads/base/text/text.h"

namespace pirt {
namespace {

constexpr const char* kBasic = "BasicPerformanceMetrics.";

}  // namespace

Publication read_ros2_benchmark(const std::string& file, const Json& root) {
  const Json& metadata = root.at("metadata");
  const auto said = [&metadata](const char* key) {
    return metadata.value("BenchmarkMetadata." + std::string(key), "");
  };
  std::string node = metadata.at("BenchmarkMetadata.NAME").get<std::string>();
  if (const auto end = node.rfind(" Benchmark"); end != std::string::npos) node.resize(end);
  const std::string host = said("DEVICE_HOSTNAME");
  const std::string machine = host.empty() ? file : host;
  for (const std::string& text : {machine, node}) {
    if (name_of(text).empty()) {
      throw JsonError("'" + text + "' has no letter or digit to be called by");
    }
  }
  PublishedBoard board{.name = name_of(machine),
                       .said = fmt::format("{} {}", host, said("DEVICE_ARCH")),
                       .units = {},
                       .figures = {},
                       .facts = {}};
  add_unit(board, {.name = "board", .device = board.said, .is_cpu = false});
  PublishedFigure figure{.workload = "ros2_benchmark." + name_of(node, '_'),
                         .unit = "board",
                         .samples = {},
                         .notes = {}};
  std::vector<std::string> rates;
  for (const auto& [key, test] : root.items()) {
    if (!key.ends_with("fps") || !test.is_object()) continue;
    rates.push_back(key);
    for (const char* which : {"FIRST", "LAST"}) {
      const std::string latency = fmt::format("{}{}_SENT_RECEIVED_LATENCY", kBasic, which);
      figure.samples.push_back(published_time(test.at(latency).get<double>(), 1e6, latency));
    }
  }
  if (figure.samples.empty()) {
    throw_bad_input("'" + file +
                    "' of ros2_benchmark has no test at a fixed rate, and at the highest rate "
                    "messages wait: no time of a call is in it");
  }
  figure.notes.push_back("first and last frame at " + join(rates, " and ") +
                         ", from message to message");
  if (root.contains("custom") && root.at("custom").contains("data_resolution")) {
    figure.notes.push_back("input " + root.at("custom").at("data_resolution").get<std::string>());
  }
  add_figure(board, figure);
  const std::string rate_key = std::string(kBasic) + "MEAN_FRAME_RATE";
  if (root.contains(rate_key)) {
    board.facts["published.highest_rate_hz"] = fmt::format("{}", root.at(rate_key).get<double>());
  }
  if (const auto at = said("TEST_DATETIME"); !at.empty()) board.facts["published.tested"] = at;
  if (const auto os = said("DEVICE_OS"); !os.empty()) board.facts["os"] = os;
  return {.format = "ros2_benchmark",
          .boards = {std::move(board)},
          .left_out = {"latencies at the highest rate: messages waited"}};
}

}  // namespace pirt
