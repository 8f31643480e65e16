#include "scheduler/schedule.h"

#include <algorithm>
#include <memory>
#include <utility>

#include "scheduler/dispatcher.h"
#include "scheduler/eligibility.h"
#include "scheduler/policies/unit_order.h"
#include "scheduler/policy.h"
#include "scheduler/services.h"
#include "scheduler/summary.h"
#include "scheduler/virtual_time.h"
#include "scheduler/weights.h"
#include "workloads/base/error.h"
#include "workloads/base/text.h"

namespace pirt {
namespace {

/// The platform's defaults for the mode; those of its basic scheduler where the platform has none
/// for advanced.
struct Defaults {
  const ModeDefaults* mode = nullptr;  ///< Null if there are none.
  std::string name;
};

Defaults defaults_of(const Platform& platform, const ScheduleOptions& options) {
  for (const auto& [name, defaults] : platform.modes) {
    const auto known = policy_names();
    if (std::ranges::find(known, name) == known.end()) {
      throw_bad_input("platform " + platform.name + ": modes: unknown mode '" + name + "'" +
                      suggestion(name, known));
    }
  }
  const bool advanced = find_policy(options.mode).has_basic();
  for (const auto& name : {options.mode, advanced ? options.basic : options.mode}) {
    const auto found = platform.modes.find(name);
    if (found != platform.modes.end()) return {&found->second, name};
  }
  return {};
}

WeightTable choose_weights(const Platform& platform, const ServiceTable& services,
                           const ScheduleOptions& options, const Defaults& defaults) {
  if (!options.weights.empty())
    return given_weights(options.weights, platform, services, "--weights");
  if (defaults.mode != nullptr && !defaults.mode->weights.empty()) {
    return given_weights(defaults.mode->weights, platform, services,
                         "platform " + platform.name + ": modes." + defaults.name + ".weights");
  }
  const WeightRule rule = find_policy(options.mode).rule;
  return derive_weights(rule == WeightRule::kOfBasic ? find_basic_policy(options.basic).rule : rule,
                        platform, services);
}

/// By pipeline; 0 for open loops.
std::vector<int> choose_in_flight(const Platform& platform, const Mix& mix,
                                  const ServiceTable& services,
                                  const std::vector<std::vector<TaskClass>>& classes,
                                  const ScheduleOptions& options, const Defaults& defaults) {
  std::vector<int> in_flight;
  for (std::size_t p = 0; p < mix.pipelines.size(); ++p) {
    int frames = 0;
    if (mix.pipelines[p].frames) {
      if (options.in_flight) {
        frames = *options.in_flight;
      } else if (defaults.mode != nullptr && defaults.mode->in_flight) {
        frames = *defaults.mode->in_flight;
      } else {
        // What keeps the units busy with the pipeline's most spread-out workload.
        for (const auto& kind : classes[p]) {
          frames = std::max(frames, in_flight_for(kind.workload, platform, services));
        }
      }
    }
    in_flight.push_back(frames);
  }
  return in_flight;
}

void check_options(const Platform& platform, const Mix& mix, const ScheduleOptions& options) {
  static_cast<void>(find_policy(options.mode));
  static_cast<void>(find_basic_policy(options.basic));
  if (platform.units.size() > kMaxUnits) {
    throw_bad_input("platform " + platform.name + " has " + std::to_string(platform.units.size()) +
                    " units; at most " + std::to_string(kMaxUnits) + " can be scheduled");
  }
  if (options.in_flight && *options.in_flight < 1) {
    throw_bad_input("--in-flight is " + std::to_string(*options.in_flight) + "; it is at least 1");
  }
  if (options.duration && *options.duration <= Nanos::zero())
    throw_bad_input("--duration must be above 0");
  if (options.duration && !mix.open_loop()) {
    throw_bad_input("--duration is for pipelines with a rate; mix " + mix.name +
                    " has closed loops only");
  }
}

/// What a reader of the result has to know about how the algorithms apply to this platform.
void add_warnings(const Platform& platform, const Mix& mix,
                  const std::vector<std::vector<TaskClass>>& classes,
                  const ScheduleOptions& options, std::vector<std::string>& warnings) {
  std::vector<std::string> roles;
  for (const auto& unit : platform.units) roles.push_back(unit.role);
  const bool advanced = find_policy(options.mode).has_basic();
  const bool fills = (advanced ? options.basic : options.mode) != "latency";
  if (fills && units_by_role(roles, kThroughputOrder) == units_by_role(roles, kEnergyOrder)) {
    warnings.push_back("platform " + platform.name +
                       " has no unit of role dsp: throughput and energy modes fill the same order");
  }
  if (!advanced) return;
  UnitMask cloud = 0;
  for (UnitId unit = 0; unit < roles.size(); ++unit)
    cloud |= roles[unit] == "cloud" ? unit_bit(unit) : 0;
  for (std::size_t p = 0; p < mix.pipelines.size(); ++p) {
    const auto stays = [&](const TaskClass& kind) {
      return !kind.real_time && (kind.eligible & cloud) == 0;
    };
    if (std::ranges::none_of(classes[p], stays)) continue;
    warnings.push_back("pipeline " + mix.pipelines[p].name +
                       " is not real-time, but no unit of role cloud may serve all of it; " +
                       options.basic + " takes the rest");
  }
}

}  // namespace

RunRecord run_virtual(const Platform& platform, const Profile* profile, const Mix& mix,
                      const ScheduleOptions& options) {
  check_options(platform, mix, options);
  const Defaults defaults = defaults_of(platform, options);
  ServiceOptions service_options;
  service_options.allow_invalid = options.allow_invalid;
  if (defaults.mode != nullptr) service_options.stage_scale = defaults.mode->stage_scale;
  const ServiceTable services =
      resolve_services(platform, profile, workloads_of(mix), service_options);
  const PolicyInfo& mode = find_policy(options.mode);
  check_every_workload_served(platform, profile, mix, services, mode.has_basic());
  const auto classes = task_classes(platform, mix, services);

  PolicySetup setup;
  setup.weights = choose_weights(platform, services, options, defaults);
  setup.literal_overflow = options.literal_overflow;
  setup.basic = options.basic;
  for (const auto& unit : platform.units) setup.roles.push_back(unit.role);
  auto policy = mode.make(setup);
  check_every_task_placeable(platform, mix, classes, *policy, options.mode);

  const VirtualSetup run{
      .platform = platform,
      .services = services,
      .mix = mix,
      .classes = classes,
      .in_flight = choose_in_flight(platform, mix, services, classes, options, defaults),
      .duration = options.duration.value_or(kDefaultDuration),
      .seed = options.seed};
  std::vector<std::optional<int>> slots;
  for (const auto& unit : platform.units) slots.push_back(unit.slots);
  Dispatcher dispatcher(std::move(slots), std::move(policy));
  const Tally tally = VirtualTime(run, dispatcher).run();

  RunRecord record = summarize(run, profile, setup.weights, dispatcher.counts(), tally);
  record.mode = options.mode;
  if (mode.has_basic()) record.basic = options.basic;
  if (record.basic.value_or(options.mode) != "latency") {
    record.overflow = options.literal_overflow ? "literal" : "hold";
  }
  record.warnings = services.warnings;
  add_warnings(platform, mix, classes, options, record.warnings);
  return record;
}

}  // namespace pirt
