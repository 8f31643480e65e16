// What a fake unit does: durations by phase, jitter, failures. Read from YAML; an unknown key is an
// error. Which workloads there are is known above (characterize/platform/platform_file.cpp).
//
//   device: fake gpu                       name that it reports
//   device_init_ms: 1.0
//   prepare_ms: {cold: 10, warm: 2}        or one number for both
//   stages: {sobel: [{name: upload, ms: 0.1}, {name: execute, ms: {uniform: [1, 2]}}]}
//                                          a stage may have bound_ms as well: what it takes at
//                                          least
//   accounts: {execute: counted, upload: measured, prepare: {unknown: no model of loading}}
//                                          how the time of a phase is known; others: modelled.
//                                          measured: it sleeps as long, by the machine's clock
//   deterministic: true                    says that its figures repeat exactly
//   machine_ms: 20                         that each execute takes of the machine's time, as slow
//                                          emulators do; no part of any figure
//   samples_ms: {sobel: [1.0, 1.1]}        execute times, one a call, over again; replaces the
//                                          execute stage
//   process_factors: [1, 1.1]              of calls, in time: the first for a process that has
//                                          an empty kernel cache, the second for the next, ...
//   clock: wall                            holds the unit for its times in real time; default
//                                          simulated: nothing sleeps
//   seed: 1                                of the uniform draws
//   unsupported: [fc6]
//   wrong_output: [conv1]                  first element of every output off by one
//   wrong_output_after: {conv1: 30}        right for that many calls, wrong from then on
//   nan_output: [conv2]                    NaN (floating point) or all bits set (integers)
//   peaks_g_s: {f32: 100}                  1e9 operations or bytes a second; others: unavailable
//   cache_kb: 512                          what the device says of its cache
//   fail_open: some message                open() throws
//   fail_prepare: [conv3]                  prepare() throws
//   fail_execute: [conv4]                  execute() throws
//   crash: [conv5]                         execute() aborts the process
//   hang: [fc8]                            execute() never returns
//   reference_folder: /tmp/x               where <workload>.reference may lie; otherwise the
//                                          reference is computed
//
// A workload without stages takes 0.1 ms upload, 0.01 ms launch, 1 ms execute, 0.1 ms download. One
// with stages lacks the phases that are not among them.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <set>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "workloads/base/time.h"
#include "workloads/model/backend.h"
#include "workloads/model/peak.h"
#include "workloads/model/phase.h"

namespace pirt {
class YamlNode;
}

namespace pirt::fake {

struct ScriptedStage {
  Phase phase = Phase::kExecute;  ///< kUpload, kLaunch, kExecute or kDownload.
  Nanos low{0};
  Nanos high{0};  ///< Equal to low, or the upper end of a uniform draw (inclusive).
  std::optional<Nanos> bound = {};  ///< What it takes at least, as the device says.
};

struct Script {
  std::string device = "fake device";
  Nanos device_init = from_ms(1);
  Nanos prepare_cold = from_ms(10);
  Nanos prepare_warm = from_ms(2);
  std::map<std::string, std::vector<ScriptedStage>> stages;
  std::map<std::string, std::vector<Nanos>> samples;
  std::vector<double> process_factors;
  std::map<Phase, Accounting> accounts;  ///< Of those that are not modelled.
  bool deterministic = false;
  Nanos machine{0};  ///< Of the machine's time, in each execute.
  bool wall_clock = false;
  std::uint64_t seed = 1;
  std::set<std::string> unsupported, wrong_output, nan_output;
  std::set<std::string> fail_prepare, fail_execute, crash, hang;
  std::map<std::string, std::int64_t> wrong_output_after;
  std::map<PeakKind, double> peaks;  ///< Operations or bytes a second.
  std::optional<std::int64_t> cache_bytes;
  std::optional<std::string> fail_open;
  std::string reference_folder;

  [[nodiscard]] std::span<const ScriptedStage> stages_of(const std::string& workload) const;
};

/// @throws Error{kBadInput} at the node: an unknown key (with the nearest ones) or one given twice,
/// a wrong type, a number outside its range (times: 0, or a nanosecond to eleven days).
[[nodiscard]] Script read_script(const YamlNode& node);
/// Whether what a script has under @p key names workloads: the items of a list, the keys of a map.
[[nodiscard]] bool names_workloads(std::string_view key);

/// @param text  Empty = no key given.
/// @throws Error{kBadInput} "fake script:LINE: ..." for broken syntax and what read_script refuses.
[[nodiscard]] Script parse_script(const std::string& text);

}  // namespace pirt::fake
