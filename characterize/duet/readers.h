// What a program's process says of itself, read as the figures of a comparison: pirt's own samples,
// and what other programs print.
#pragma once

#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "characterize/duet/sample.h"
#include "characterize/worker/process.h"

namespace pirt {

struct OutputReader {
  std::string_view name;  ///< What --reads is given.
  std::string_view help;
  /// @param process  That exited with 0.
  /// @throws Error{kBadInput} for an output that is none of the kind, with the place.
  Sample (*read)(const ProcessResult& process);
  /// What the command is given besides, to say what is read here.
  /// @param only  The figures that are wanted; empty = all.
  std::vector<std::string> (*arguments)(const std::vector<std::string>& only);
  std::string_view first = {};  ///< What its first processes are given besides; may be empty.
};

/// `pirt`: what `pirt sample` answers.
/// `time`: nothing that it prints; `wall` and `cpu` in s, `memory` in bytes (its peak, where that
/// is above this process' own). `gbench`: JSON of Google Benchmark on stdout: the real time of each
/// benchmark, the median where it has repetitions. Aggregates, complexities (BigO, RMS) and what
/// was skipped are left out; `error_occurred` is an error. `lines`: `NAME VALUE UNIT
/// [lower|higher]` a line, the better direction last (default lower, and none of rates, such as
/// MB/s, Mbps or fps, which have to say it); the median of a name that comes again. Empty lines and
/// those that begin with # are left out, any other is an error.
[[nodiscard]] std::span<const OutputReader> output_readers();
/// As `pirt`, of two workloads on one unit: opening the unit is neither one's, inputs are each
/// one's own. The first processes verify.
[[nodiscard]] const OutputReader& workload_reader();
/// @throws Error{kBadInput} with the nearest names.
[[nodiscard]] const OutputReader& find_reader(const std::string& name);

}  // namespace pirt
