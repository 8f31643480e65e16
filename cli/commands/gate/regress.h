// What the ways of `pirt regress` share: its options and how its answer goes out.
#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "characterize/duet/duet.h"
#include "cli/options/output.h"
#include "cli/options/own.h"
#include "reports/gate/gate_report.h"

namespace pirt::cli {

struct RegressOptions {
  std::vector<std::string> files;  ///< Two stored profiles.
  std::string baseline_program, candidate_program;
  std::string baseline_command, candidate_command, setup_command;
  std::string as;  ///< "CANDIDATE=BASELINE", two workloads.
  OwnFiles own;
  std::string reads = "time";
  int warm_up = 1;

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

  std::string anchor;
  bool strict = false;
  bool all = false;
  Output markdown, junit, json;
};

/// Prints or writes @p report as the options say. @return The exit code.
int emit_report(const GateReport& report, const RegressOptions& options);

/// What a process may take until it hangs: --sample-limit, and so much less than --max-time that
/// one that hangs is found.
[[nodiscard]] Nanos process_limit(const RegressOptions& options);

int regress_programs(const RegressOptions& options);
int regress_commands(const RegressOptions& options);

/// A comparison of two that run, from its ledger on, until it is decided or the time is up.
struct LiveComparison {
  DuetComparison& comparison;
  Ledger::Event key;
  TakeSample take;
  DuetRounds rounds;
  const std::atomic<bool>* stop = nullptr;
  std::function<void(const DuetStep&)> on_step = {};  ///< Before each step; may be empty.
  std::function<void(const Ledger&)> on_ledger = {};  ///< Once it is read; may be empty.
};
/// Measures, prints the answer and keeps the ledger as long as there is something to go on with.
/// @return The exit code.
int finish_comparison(const RegressOptions& options, const LiveComparison& live,
                      const std::string& baseline, const std::string& candidate);

}  // namespace pirt::cli
