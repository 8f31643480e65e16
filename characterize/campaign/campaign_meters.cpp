#include "characterize/campaign/campaign_meters.h"

#include <fmt/core.h>

#include <algorithm>

#include "characterize/energy/choice.h"

namespace pirt {
namespace {

constexpr int kWindowsARepeat = 3;  // idle, calls, idle
// Of a counter that steps: what finds how long one lasts, and where each window begins and ends.
constexpr int kStepsARepeat = 9 + 2 * kWindowsARepeat;
constexpr Nanos kBoard = std::chrono::seconds(2);  // opening and preparing one with such a counter

MeterRequest request_for(const std::vector<const Meter*>& meters,
                         const std::filesystem::path& sysfs) {
  MeterRequest request;
  request.meters = names_of(meters);
  request.source = source_of(meters);
  request.domain = domain_of(meters);
  request.sysfs = std::filesystem::absolute(sysfs).string();
  request.step = step_of(meters, MachineClock());
  request.window = metering_window(meters, request.window, request.step);
  return request;
}

}  // namespace

void plan_meters(const CampaignOptions& options, CampaignPlan& plan) {
  const MeterDiscovery found = discover_meters(options.sysfs);
  for (std::size_t i = 0; i < plan.units.size(); ++i) {
    const UnitRecord& unit = plan.units[i];
    const auto pci = plan.facts.find("unit." + unit.unit + ".pci");
    const UnitModel& model = options.platform.unit(unit.unit);
    const MeterUser user{
        .unit = model,
        .device_is_cpu = unit.device_is_cpu,
        .simulated = plan.provenances[i] != Provenance::kMeasured,
        .pci = pci == plan.facts.end() ? "" : pci->second,
        .has_model = options.platform.states_power(on_device(model, unit.device_is_cpu))};
    const MeterChoice choice = choose_meters(found, user, options.sysfs);
    if (!choice.remark.empty()) plan.remarks.push_back(choice.remark);
    const std::string fact = "meter." + unit.unit;
    if (choice.meters.empty()) {
      plan.facts[fact + "_unknown"] = choice.remark.empty() ? "none" : choice.remark;
      continue;
    }
    const MeterRequest request = request_for(choice.meters, options.sysfs);
    plan.facts[fact] = request.source + " (" + request.domain + ")";
    plan.meters[unit.unit] = request;
  }
}

Nanos metering_time(const CampaignPlan& plan, const std::string& unit) {
  const auto found = plan.meters.find(unit);
  if (found == plan.meters.end()) return Nanos(0);
  const MeterRequest& meter = found->second;
  const Nanos repeat = kWindowsARepeat * meter.window + kStepsARepeat * meter.step;
  return kMeteredRepeats * repeat + (meter.step.count() > 0 ? kBoard : Nanos(0));
}

Nanos metering_time(const CampaignPlan& plan) {
  Nanos time{0};
  for (const PlannedCell& cell : plan.cells) time += metering_time(plan, cell.unit);
  return time;
}

Environment idle_facts(const CampaignPlan& plan) {
  Environment facts;
  std::map<std::string, std::string> known;  // units that share a meter share its reading
  for (const auto& [unit, request] : plan.meters) {
    if (!known.contains(request.meters)) known[request.meters] = idle_power_text(request);
    const bool is_figure = !known[request.meters].empty();
    facts["meter." + unit + (is_figure ? ".idle_w" : ".idle_w_unknown")] =
        is_figure ? known[request.meters] : "the meter shows none";
  }
  return facts;
}

Environment awake_facts(const CampaignPlan& plan,
                        const std::map<std::string, std::vector<double>>& idle_w) {
  Environment facts;
  for (const auto& [unit, request] : plan.meters) {
    const auto known = idle_w.find(unit);
    if (request.domain != kCoversGpu || known == idle_w.end()) continue;
    std::vector<double> sorted = known->second;
    std::ranges::sort(sorted);
    facts["meter." + unit + ".awake_w"] = fmt::format("{:.4g}", sorted[sorted.size() / 2]);
  }
  return facts;
}

}  // namespace pirt
