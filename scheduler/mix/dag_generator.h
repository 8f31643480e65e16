// Random task graphs as mixes, by the parameters of the static planners' papers.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace pirt {

// The highest that generate_dag takes.
inline constexpr int kMostDagTasks = 10'000;
inline constexpr double kHighestDagShape = 100;
inline constexpr double kHighestDagCcr = 1000;
inline constexpr double kHighestDagHeterogeneity = 2;
inline constexpr double kLongestDagMeanMs = 1e6;

/// @source Topcuoglu, Hariri, Wu: Performance-Effective and Low-Complexity Task Scheduling for
/// Heterogeneous Computing, IEEE TPDS 13(3), 2002, section 5.
struct DagParameters {
  int tasks = 40;      ///< 1 to 10,000.
  double shape = 1;    ///< alpha, above 0: sqrt(tasks) / alpha levels of sqrt(tasks) * alpha.
  int out_degree = 3;  ///< At most so many edges leave a task; at least 1.
  double ccr = 0.5;    ///< Mean transfer over mean service; 0 = transfers take no time.
  double heterogeneity =
      0.5;              ///< beta, 0 to 2: a task's services differ by up to beta times its mean.
  double mean_ms = 10;  ///< Mean service of the whole graph, above 0.
  std::vector<std::string> units = {"cpu", "gpu",
                                    "dsp"};  ///< Units or roles; at least one, each once.
  std::uint64_t seed = 1;
};

/// A mix of one firing of one pipeline, as YAML: the same parameters give the same bytes.
///
/// Levels and their widths are drawn around their means; a task's mean service is uniform in
/// (0, 2 x mean_ms), its service on each unit uniform in mean x (1 -+ beta / 2), an edge's transfer
/// uniform in (0, 2 x ccr x mean_ms). Edges go to the next level, and a quarter of them anywhere
/// below. Every task but those of the first level has a predecessor in the level above, whose tasks
/// have more edges than out_degree where it is too narrow otherwise.
/// @throws Error{kBadInput} naming the parameter that is out of its range.
[[nodiscard]] std::string generate_dag(const DagParameters& parameters);

}  // namespace pirt
