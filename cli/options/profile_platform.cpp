#include "cli/options/profile_platform.h"

#include <fmt/core.h>

#include <algorithm>
#include <set>
#include <utility>

#include "characterize/profile/size_estimate.h"
#include "characterize/profile/store/reader.h"
#include "characterize/published/published.h"
#include "cli/options/output.h"
#include "cli/options/own.h"
#include "reports/document/figures.h"
#include "scheduler/services/devices.h"
#include "scheduler/services/eligibility.h"
#include "workloads/base/error.h"
#include "workloads/base/text/shell.h"
#include "workloads/catalog/catalog.h"
#include "workloads/catalog/specs.h"
#include "workloads/own/definition.h"

namespace pirt::cli {

Platform platform_of(const Profile& profile, const std::vector<YamlOverride>& overrides) {
  const std::string& name = profile.platform();
  const auto shipped = shipped_platforms();
  if (std::ranges::find(shipped, name) == shipped.end()) {
    if (const auto imported = published_platform(profile)) {
      return parse_platform(profile.path, *imported, overrides, 1);
    }
    throw_bad_input("profile '" + profile.path + "' was taken on platform " + name +
                    ", which is not shipped; give its file with --platform FILE.yaml");
  }
  return load_platform(name, overrides);
}

ProfiledPlatform read_platform(const std::optional<std::string>& platform,
                               const std::optional<std::string>& profile,
                               const std::vector<YamlOverride>& overrides,
                               const std::vector<std::string>& own, const std::string& mix) {
  ProfiledPlatform read;
  if (platform) read.platform = load_platform(*platform, overrides);
  if (profile) read.profile = ProfileReader(*profile).read(read.platform.name);
  if (!platform) read.platform = platform_of(read.profile.value(), overrides);
  read.platform = on_devices(std::move(read.platform), read.profile ? &*read.profile : nullptr);
  if (read.profile) {
    hold_against(*read.profile, own, mix, &read.platform);
  } else {
    learn(own);
  }
  return read;
}

namespace {

/// What to do about the gap, the other way than --estimate.
/// @param workloads  That have it as well.
std::string how_to_measure(const ProfiledPlatform& read, const std::string& unit,
                           const std::vector<std::string>& workloads) {
  const UnitModel* model = read.platform.find_unit(unit);
  const std::string& path = read.profile->path;
  if (model == nullptr || !model->measured()) {
    return "pirt import TABLE.csv --db " + path_in_shell(path);
  }
  return measure_command(read.platform, unit, workloads, path);
}

/// Where nobody gives the times of a size, and who has the workload says that it has none.
void refuse_other_sizes(const Mix& mix, const std::set<std::string>& served) {
  for (const std::string& name : workloads_of(mix)) {
    if (!is_foreign(name) || served.contains(name) || try_find_spec(name)) continue;
    if (!try_find_spec(own::plain_name(name))) continue;
    try {
      static_cast<void>(find_workload(name));
    } catch (const Error& error) {
      throw_bad_input("mix " + mix.name + ": " + error.what());
    }
  }
}

}  // namespace

void add_estimate_option(Command& command, bool& estimate) {
  command.add_flag("--estimate", estimate,
                   "Model the times of workloads at a size that is not measured (sobel@1280x720) "
                   "from four or more other sizes on the same unit, if it is between them");
}

void fill_sizes(ProfiledPlatform& read, const Mix& mix, bool estimate) {
  std::set<std::string> served;
  for (const auto& [workload, model] : read.platform.workloads) served.insert(workload);
  std::vector<SizeGap> gaps, missing;
  if (read.profile) {
    for (const std::string& workload : read.profile->workloads()) served.insert(workload);
    gaps = size_gaps(*read.profile, workloads_of(mix));
  }
  for (SizeGap& gap : gaps) {
    if (!estimate || !gap.why_not.empty()) {
      missing.push_back(std::move(gap));
      continue;
    }
    served.insert(gap.workload);
    const PhaseRow call = add_estimate(*read.profile, gap);
    warn(fmt::format("{} on {} is modelled: {} (95 %: {} to {}), through {} other sizes",
                     gap.workload, gap.unit, duration_text(*call.median),
                     duration_text(*call.ci_low), duration_text(*call.ci_high), gap.others.size()));
  }
  refuse_other_sizes(mix, served);
  std::vector<std::string> unserved;  // Measured at once: each round of this takes minutes.
  for (const SizeGap& gap : missing) {
    const bool is_new = std::ranges::find(unserved, gap.workload) == unserved.end();
    if (is_new && !served.contains(gap.workload)) unserved.push_back(gap.workload);
  }
  for (const SizeGap& gap : missing) {
    const bool is_served = served.contains(gap.workload);
    const std::string text = fmt::format(
        "{} on {} has no row, and none of another size is taken for it{}: {}{}", gap.workload,
        gap.unit, estimate ? ", nor can they make an estimate, since " + gap.why_not : "",
        how_to_measure(read, gap.unit, is_served ? std::vector{gap.workload} : unserved),
        gap.why_not.empty() ? ", or --estimate" : "");
    if (!is_served) throw_bad_input("mix " + mix.name + ": " + text);
    warn(text);
  }
}

}  // namespace pirt::cli
