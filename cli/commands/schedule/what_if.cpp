// pirt what-if: raises a rate, or lowers a cap of power, until a mode keeps no longer what the mix
// wants.
#include "scheduler/what_if.h"

#include <algorithm>
#include <memory>

#include "characterize/profile/store/reader.h"
#include "cli/commands.h"
#include "cli/options/duration.h"
#include "cli/options/files.h"
#include "cli/options/output.h"
#include "cli/options/own.h"
#include "cli/options/profile_platform.h"
#include "cli/options/shipped.h"
#include "cli/options/values.h"
#include "reports/document/document.h"
#include "reports/run/what_if_report.h"
#include "scheduler/planner/budget_plan.h"
#include "scheduler/policies/policy.h"
#include "scheduler/schedule.h"
#include "workloads/base/error.h"

namespace pirt::cli {
namespace {

struct WhatIfFlags {
  std::string mix = "full-robot";
  std::optional<std::string> profile, platform;
  OwnFiles own;
  std::vector<std::string> settings, without;
  std::vector<std::string> modes;
  std::optional<std::string> raise, lower, power_cap, duration;
  std::string draw = "median";
  std::uint64_t seed = 1;
  bool strict = false;
  bool estimate = false;
  Output markdown, json;
};

WhatIfChange change_of(const WhatIfFlags& options, const Mix& mix) {
  if (options.lower) {
    if (*options.lower != "power-cap") {
      throw_bad_input("--lower '" + *options.lower + "': what can be lowered is power-cap");
    }
    return {.kind = WhatIfChange::Kind::kPowerCap, .pipeline = ""};
  }
  return parse_raise(options.raise.value_or("all.rate_hz"), mix);
}

int find_what_breaks(const WhatIfFlags& options) {
  if (!options.profile && !options.platform) {
    throw_bad_input("give --profile FILE, or --platform with a modelled one (pirt list platforms)");
  }
  auto read = read_platform(options.platform, options.profile, parse_overrides(options.settings),
                            options.own.all(options.mix), options.mix);
  const Mix mix = load_mix(options.mix);  // The profile says what workloads of its own it has.
  const WhatIfChange change = change_of(options, mix);
  ScheduleOptions schedule;
  schedule.draw = find_draw(options.draw);
  if (read.profile && schedule.draw == Draw::kSamples) {
    ProfileReader(*options.profile).read_samples(*read.profile);
  }
  fill_sizes(read, mix, options.estimate);
  schedule.without = options.without;
  schedule.seed = options.seed;
  schedule.strict = options.strict;
  if (options.duration) schedule.duration = parse_duration(*options.duration);
  if (options.power_cap) schedule.power_cap_w = parse_watts(*options.power_cap);
  std::vector<std::string> modes = options.modes;
  if (modes.empty()) {
    modes = paper_modes();
    modes.emplace_back("budget");
  }
  for (const auto& mode : modes) static_cast<void>(find_policy(mode));
  const WhatIf found =
      what_if(read.platform, read.profile ? &*read.profile : nullptr, mix, modes, change, schedule);
  const auto ran = [](const WhatIfRow& row) { return row.not_run.empty(); };
  if (std::ranges::none_of(found.rows, ran)) throw_bad_input(found.rows.front().not_run);
  const Document document = what_if_document(found, read.platform, mix);
  if (options.markdown) emit_text(render(document, Format::kMarkdown), options.markdown);
  emit(options.markdown.to_stdout() ? "" : render(document, Format::kText),
       what_if_json(found, read.platform, mix), options.json);
  const auto fits = [](const WhatIfRow& row) { return row.holds.has_value(); };
  return std::ranges::any_of(found.rows, fits) ? 0 : kExitCheckFailed;
}

}  // namespace

void add_what_if(CLI::App& app, Action& action) {
  auto options = std::make_shared<WhatIfFlags>();
  Command command(app, "what-if",
                  "Find what breaks first when a rate rises or the power shrinks, mode by mode");
  add_workloads(command, options->own);
  add_input(command, "--mix", &options->mix, "A name of `pirt list mixes`, or a YAML file",
            FileUse::kReadIfFile)
      .offers(offer_mixes())
      .shows_default();
  add_input(command, "--profile", &options->profile, "Profile database of pirt characterize");
  add_input(command, "--platform", &options->platform,
            "A name of `pirt list platforms`, or a YAML file (default: the profile's)",
            FileUse::kReadIfFile)
      .offers(offer_platforms());
  add_settings(command, options->settings);
  add_list_of(command, "--without", options->without, "UNIT,...",
              "Units that serve nothing, as if they were away from the beginning")
      .offers(offer_units());
  add_list_of(command, "--modes", options->modes, "MODE,...",
              "The modes of the table (default: the paper's and budget)")
      .offers(offer_modes());
  add_text(command, "--raise", &options->raise, "PIPELINE.rate_hz",
           "Whose rate rises, up to four times what it is (default: all.rate_hz, all together)");
  const Option lower = add_text(command, "--lower", &options->lower, "power-cap",
                                "Instead: lower the cap of power from --power-cap on");
  add_value(command, "--power-cap", &options->power_cap, "WATTS", no_watts,
            "Draw no more in any second, e.g. 11W");
  add_value(command, "--duration", &options->duration, "DURATION", no_duration,
            "Virtual time of each run (default: 60s)");
  add_choice(command, "--draw", &options->draw, "HOW", draw_names(),
             "What a call on a profiled unit takes")
      .shows_default();
  add_strict(command, options->strict);
  add_estimate_option(command, options->estimate);
  add_seed(command, options->seed, "Seed of drawn durations and of jitter");
  add_output(command, "--markdown", options->markdown, "Write the table as Markdown, - for stdout");
  add_json(command, options->json);
  command.option("--estimate").needs(command.option("--profile"));
  lower.excludes(command.option("--raise"));
  command.footer(
      "Exit code 0: some mode keeps what the mix wants as it is; 1: none does.\n"
      "Example: pirt what-if --mix section5 --platform snapdragon820-section5 --power-cap 11W");
  command.runs(action, [options] { return find_what_breaks(*options); });
}

}  // namespace pirt::cli
