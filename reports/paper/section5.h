// What the paper's Section V reports of a robot without and with the runtime, and what platform
// snapdragon820-section5 makes of it.
//
// Only the CPU's times are fitted, to the run without the runtime; the rest is a prediction (see
// the platform's file).
#pragma once

#include <string>
#include <vector>

namespace pirt {

/// One run of the robot's three pipelines.
struct Section5Row {
  std::string mode;  ///< "paper" or a mode's name.
  std::string mix;   ///< "section5-cpu-only", "section5" or "section5-placed".
  double localization_fps = 0;
  double recognitions_per_s = 0;
  double planning_p50_ms = 0;
  double planning_p99_ms = 0;
  double power_w = 0;
};

struct Section5 {
  /// As printed: planning "within 6 ms" stands in both columns with the runtime, and 0, not known,
  /// without. @source Pi-RT, Section V-A.
  Section5Row paper_without, paper_with;
  Section5Row fitted;                    ///< Mix section5-cpu-only, mode cpu-only.
  std::vector<Section5Row> predictions;  ///< Mix section5, all modes that can run it.
  std::vector<Section5Row> placed;       ///< Mix section5-placed, likewise.
  std::vector<std::string> not_run;      ///< "section5, mode energy: why".
};

/// Runs all of them in virtual time for 60 s.
[[nodiscard]] Section5 run_section5();

}  // namespace pirt
