// The paper's claims one by one: confirmed, refuted, or not testable here, with our figure, where
// it comes from, and what the paper prints; and where the paper contradicts itself.
//
// A claim about a unit that this machine does not have is not testable, and neither is one that
// compares units where there are no two real ones, or that rests on joules which are nothing but
// time times assumed watts. An OpenCL device that computes on the host's cores is no GPU. Apart,
// and in no count, stand figures that the model was fitted to, which show nothing, and what holds
// by construction.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "characterize/platform/platform.h"
#include "characterize/profile/profile.h"
#include "reports/document/document.h"
#include "reports/paper/paper_report.h"
#include "reports/paper/section5.h"
#include "scheduler/mix/mix.h"
#include "scheduler/schedule.h"
#include "workloads/base/text/json.h"

namespace pirt {

enum class Finding : std::uint8_t {
  kConfirmed,
  kRefuted,
  kNotTestable,
  kFitted,          ///< Ours was made to be the paper's: shows nothing.
  kByConstruction,  ///< Arithmetic on what the paper says: could not be otherwise.
};
/// "confirmed", "refuted", "not testable here", "fitted", "by construction".
[[nodiscard]] std::string_view to_string(Finding finding);

struct Claim {
  std::string where;  ///< "Observation 2", "Table I".
  std::string claim;
  std::string paper;       ///< What it prints, in short; "-" if nothing.
  std::string here = "-";  ///< Our figure, with its mark.
  std::string from = "-";  ///< Where ours comes from: "measured", "virtual time, modelled".
  Finding finding = Finding::kNotTestable;
  std::string why = {};  ///< What was compared, or what is missing.
};

/// What the claims are held against; null or empty = not there.
struct Evidence {
  const Profile* profile = nullptr;
  const Platform* platform = nullptr;             ///< Of the profile.
  const Mix* mix = nullptr;                       ///< Of the modes.
  const ModeRuns* modes = nullptr;                ///< All modes on that platform and mix.
  const ModeRuns* table5 = nullptr;               ///< The paper's three on its closed loop there.
  const std::vector<PaperCell>* cells = nullptr;  ///< Table V on the fitted platform.
  const Section5* section5 = nullptr;             ///< Section V on the platform fitted to it.
};

/// In the paper's order. Observation One runs the mix a few times, in virtual time.
[[nodiscard]] std::vector<Claim> scorecard(const Evidence& evidence);

void append(std::vector<Claim>& to, std::vector<Claim> more);

/// A claim that was looked at, with what was found; one that was not, and why.
[[nodiscard]] Claim decided(Claim claim, bool holds, const std::string& here, std::string_view from,
                            const std::string& why = "");
[[nodiscard]] Claim not_testable(Claim claim, const std::string& why);
/// One whose figure ours was fitted to.
/// @param within  How near it came is within the fit's limit.
[[nodiscard]] Claim fitted_to(Claim claim, bool within, const std::string& here,
                              const std::string& why);

/// The role that a unit really has: one that only stands in for an accelerator has none.
[[nodiscard]] std::optional<Role> real_role(const Evidence& evidence, const std::string& unit);
/// Those of the profile that have one.
[[nodiscard]] std::vector<std::string> real_units(const Evidence& evidence);
inline constexpr const char* kNoTwoRealUnits =
    "needs two real units; an OpenCL device on the host's cores is none";
/// Whether the joules of a run on the machine of the profile are a meter's, or made of watts that
/// the platform says a source of.
[[nodiscard]] bool watts_are_known(const Evidence& evidence, const RunRecord& run);
inline constexpr const char* kAssumedWatts = "joules are time times assumed watts";

// The parts of it.
[[nodiscard]] std::vector<Claim> operation_claims();
[[nodiscard]] std::vector<Claim> observation_claims(const Evidence& evidence);
[[nodiscard]] std::vector<Claim> scheduling_claims(const Evidence& evidence);
[[nodiscard]] std::vector<Claim> section5_claims(const Evidence& evidence);

/// So much short of a rate or a bound is still there: a run that ends between two firings.
inline constexpr double kAlmost = 0.01;

/// Null if the mode is not among them.
[[nodiscard]] const RunRecord* find_mode(const std::vector<RunRecord>& runs,
                                         const std::string& mode);

[[nodiscard]] Table scorecard_table(const std::vector<Claim>& claims);

/// Where the paper contradicts itself; nothing of it is ours.
[[nodiscard]] Table contradictions_table();

[[nodiscard]] Json scorecard_json(const std::vector<Claim>& claims);

}  // namespace pirt
