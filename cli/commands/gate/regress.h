// What the ways of `pirt regress` share: its options and how its answer goes out.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "cli/options/output.h"
#include "reports/gate/gate_report.h"

namespace pirt::cli {

struct RegressOptions {
  std::vector<std::string> files;  ///< Two stored profiles.
  std::string baseline_program, candidate_program;

  std::string filter;
  std::string platform;
  std::vector<std::string> units;
  std::string mix = "full-robot";
  std::uint64_t seed = 1;
  std::string work = "50ms";
  bool cold = false;
  bool one_at_a_time = false;
  std::string max_time = "9min";
  std::string sample_limit = "60s";
  std::optional<std::string> ledger;

  bool all = false;
  Output markdown, junit, json;
};

/// Prints or writes @p report as the options say. @return The exit code.
int emit_report(const GateReport& report, const RegressOptions& options);

int regress_programs(const RegressOptions& options);

}  // namespace pirt::cli
