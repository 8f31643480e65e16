// Everything that `pirt report` says, as one document: the model behind text, Markdown and HTML.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "characterize/platform/platform.h"
#include "characterize/profile/profile.h"
#include "reports/document/document.h"
#include "reports/paper/paper_report.h"
#include "reports/run/timeline.h"
#include "scheduler/mix/mix.h"
#include "scheduler/schedule.h"
#include "workloads/base/text/json.h"

namespace pirt {

/// A profile, and what virtual time makes of it.
struct Machine {
  Profile profile;  ///< With samples, for their distributions.
  std::optional<Platform> platform;
  ModeRuns modes;   ///< All modes on the mix of the report.
  ModeRuns table5;  ///< table5_of() it, for the paper's claims; otherwise empty.
};

/// Modes of a profile's machine on a mix, in virtual time. What cannot run is skipped, with the
/// reason:
/// @p why where there is no platform.
/// @param strict  ScheduleOptions::strict.
[[nodiscard]] ModeRuns runs_of(const Profile& profile, const std::optional<Platform>& platform,
                               const Mix& mix, const std::vector<std::string>& modes,
                               const std::string& why = "", bool strict = false);

/// @param platform  Absent = `why` says so in place of each mode.
/// @param mix       Of `modes`. A profile that lacks some of its workloads makes a report all the
/// same: the modes are skipped, with the reason.
[[nodiscard]] Machine machine_of(Profile profile, std::optional<Platform> platform, const Mix& mix,
                                 const std::string& why = "", bool strict = false);

/// The paper's three modes on its closed loop of convolutions.
[[nodiscard]] ModeRuns table5_of(const Machine& machine, bool strict);

struct ReportInputs {
  std::vector<Machine> machines;    ///< Empty: nothing was measured, there are modes or runs alone.
  ModeRuns modelled = {};           ///< Without a machine: of a platform that its file describes.
  Mix mix;                          ///< Of their modes.
  std::vector<RunRecord> runs;      ///< Given; where there are none, the paper's modes are shown.
  std::vector<Timeline> timelines;  ///< Given, or made for the report.
  bool facts = true;                ///< With every fact that was recorded of the run: 70 lines.
};

/// Answers first: which unit, which mode; then what that follows from. The paper's claims are
/// paper_document()'s.
[[nodiscard]] Document full_report(const ReportInputs& inputs);

/// The figures of the first machine as profile_json() has them, with "modes" (given, or the
/// paper's), "setup", "pareto", "live" if there are live runs; of the others under "others".
[[nodiscard]] Json full_report_json(const ReportInputs& inputs);

/// On a screen: the preferable unit of each workload, and the paper's modes beside each other.
[[nodiscard]] Document brief_document(const Profile& profile, const ModeRuns& modes,
                                      const Mix& mix);
/// "preferable" as in profile_json(), with all that comparison_json() has.
[[nodiscard]] Json brief_json(const Profile& profile, const ModeRuns& modes);

/// Where runs and profiles do not belong together: other platforms. Empty = they do.
[[nodiscard]] std::vector<std::string> mismatches(const ReportInputs& inputs);

/// Tables I, III, IV, V, the observations and Section V. @param machine  Null = what needs no
/// measurement.
/// @param others  Profiles of other boards, which with the machine's make Table III anew.
[[nodiscard]] Document paper_document(const Machine* machine, const std::vector<Profile>& others,
                                      const Mix& mix, const PaperRuns& paper);
[[nodiscard]] Json paper_document_json(const Machine* machine, const std::vector<Profile>& others,
                                       const Mix& mix, const PaperRuns& paper);

}  // namespace pirt
