// pirt sample: one fresh process of a cell, for `pirt regress` of another version too. Not in the
// help; what it prints is stable (characterize/duet/sample.h).
#include "characterize/duet/sample.h"

#include <cmath>
#include <memory>
#include <vector>

#include "characterize/machine/build_info.h"
#include "cli/commands.h"
#include "cli/commands/measure/planning_time.h"
#include "cli/options/duration.h"
#include "cli/options/files.h"
#include "cli/options/output.h"
#include "cli/options/own.h"
#include "cli/options/shipped.h"
#include "cli/options/values.h"
#include "workloads/base/error.h"
#include "workloads/base/system/affinity.h"
#include "workloads/base/text/json.h"
#include "workloads/base/time.h"

namespace pirt::cli {
namespace {

struct SampleFlags {
  std::string workload, unit;
  OwnFiles own;
  std::string platform = "host";
  std::uint64_t seed = 1;
  std::string work = "50ms";
  bool verify = false, setup = false;
  std::string inject;
};

Sample sample_scheduler(const SampleRequest& request) {
  // Moving between cores makes processes differ by 15 % instead of 2 %.
  bind_to_cores(std::vector{usable_cores().front()}, std::string(kSchedulerCell));
  const MachineClock clock;
  const ExtraWork extra(clock);
  const double more = request.injection.scheduler - 1;
  std::function<void(Nanos)> slow_down;
  if (more > 0) {
    slow_down = [&](Nanos shortest) {
      const auto time = more * static_cast<double>(shortest.count());
      ExtraWork::run(extra.steps_for(Nanos(std::llround(time))));
    };
  }
  Sample sample;
  sample.version = build_info().version;
  sample.device = "host";
  sample.seconds = time_planning(clock, request.work, slow_down);
  return sample;
}

int sample(const SampleFlags& options) {
  load(options.own.all());
  SampleRequest request;
  request.cell = {options.workload, options.unit};
  request.seed = options.seed;
  request.work = parse_duration(options.work);
  if (options.verify) request.kind = SampleKind::kVerified;
  if (options.setup) request.kind = SampleKind::kSetup;
  if (!options.inject.empty()) request.injection = parse_injection(options.inject);
  const bool scheduler = options.workload == kSchedulerCell;
  if (!scheduler && options.unit.empty()) throw_bad_input("--unit is required");
  const Sample result =
      scheduler ? sample_scheduler(request) : take_sample(load_platform(options.platform), request);
  emit_text(json_text(to_json(result), 2) + "\n", {});
  return 0;
}

}  // namespace

void add_sample(CLI::App& app, Action& action) {
  auto options = std::make_shared<SampleFlags>();
  Command command(app, "sample", "Time one workload on one unit in this process, as JSON");
  command.hide();  // not in the help
  add_text(command, "--workload", &options->workload, "WORKLOAD", "A workload, or scheduler")
      .offers(offer_workloads())
      .required();
  add_text(command, "--unit", &options->unit, "UNIT", "Unit of the platform").offers(offer_units());
  add_input(command, "--platform", &options->platform,
            "A name of `pirt list platforms`, or a YAML file", FileUse::kReadIfFile)
      .offers(offer_platforms())
      .shows_default();
  add_workloads(command, options->own);
  add_seed(command, options->seed, "Seed of inputs and weights");
  add_value(command, "--work", &options->work, "DURATION", no_duration,
            "How long calls are repeated")
      .shows_default();
  const Option verify = command.add_flag("--verify", options->verify, "Compare with the reference");
  command.add_flag("--setup", options->setup, "Set up only, without calls").excludes(verify);
  add_text(command, "--inject", &options->inject, "STEP=FACTOR",
           "Extra work, e.g. execute=1.1: to see whether a gate notices");
  command.footer("Example: pirt sample --workload sobel --unit cpu");
  command.runs(action, [options] { return sample(*options); });
}

}  // namespace pirt::cli
