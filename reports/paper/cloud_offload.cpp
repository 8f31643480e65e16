#include "reports/paper/cloud_offload.h"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>

#include "characterize/platform/elsewhere.h"
#include "reports/document/figures.h"
#include "reports/paper/paper_figures.h"
#include "scheduler/services/call_plan.h"
#include "scheduler/services/services.h"
#include "scheduler/services/transfers.h"
#include "workloads/base/error.h"
#include "workloads/base/text/text.h"
#include "workloads/catalog/specs.h"

namespace pirt {
namespace {

std::int64_t bytes_of(const std::vector<TensorSpec>& specs) {
  std::int64_t sum = 0;
  for (const TensorSpec& each : specs) sum += each.size_bytes();
  return sum;
}

/// One workload with all that its units cost.
struct Row {
  const Platform& platform;
  const Profile& profile;
  const ServiceTable& services;
  WorkloadId workload;

  [[nodiscard]] const std::string& name() const { return services.workloads[workload]; }
  [[nodiscard]] CallThere call(UnitId unit) const {
    const Service& service = *services.find(workload, unit);
    const CallPlan its = plan(unit, {});
    return {.unit = platform.units[unit].name,
            .time = its.takes(Taken::kMean),
            .energy_j = its.energy_j(Taken::kMean),
            .time_from = service.time_provenance,
            .energy_from = service.energy_provenance};
  }
  [[nodiscard]] CallPlan plan(UnitId unit, const CallBytes& bytes) const {
    return plan_call(platform, services, workload, unit, bytes);
  }
};

bool is_cloud(const UnitModel& unit) { return unit.role == Role::kCloud; }

/// What the call moves over its unit's link: all that it reads and writes.
void add_link(const Link& link, const CallPlan& call, OffloadChoice& choice) {
  choice.fixed = choice.cloud.time + 2 * link.latency.mean();
  choice.cloud.time = call.takes(Taken::kMean);
  if (choice.cloud_worst) {
    *choice.cloud_worst += choice.cloud.time - choice.fixed + 2 * link.latency.high;
  }
  choice.radio_w = link.active_w;
  choice.fixed_j = choice.cloud.energy_j.value_or(0);
  choice.cloud.energy_j = call.energy_j(Taken::kMean);
  choice.cloud.time_from = sum_of(choice.cloud.time_from, Provenance::kModelled);
  choice.cloud.energy_from = sum_of(choice.cloud.energy_from, Provenance::kModelled);
}

/// The slowest that is known of the cloud's call, without its link.
std::optional<Nanos> worst_of(const Row& row, UnitId unit) {
  const UnitModel& model = row.platform.units[unit];
  if (is_elsewhere(model)) {
    const PhaseRow* const call = row.profile.find(row.name(), model.name, Phase::kCall);
    return call != nullptr && is_used(*call) && model.link.empty() ? call->p99 : std::nullopt;
  }
  Nanos sum{0};
  for (const ServiceStage& stage : row.services.find(row.workload, unit)->stages) {
    sum += stage.time.high;
  }
  return sum;
}

OffloadChoice cloud_choice(const Row& row, UnitId unit) {
  const UnitModel& model = row.platform.units[unit];
  const WorkloadSpec spec = find_spec(row.name());
  OffloadChoice choice;
  choice.workload = row.name();
  choice.cloud = row.call(unit);
  choice.bytes = bytes_of(spec.inputs) + bytes_of(spec.outputs);
  choice.cloud_worst = worst_of(row, unit);
  choice.fixed = choice.cloud.time;
  if (const Link* const link = link_of(row.platform, unit)) {
    const CallBytes bytes{bytes_of(spec.inputs), bytes_of(spec.outputs), true};
    add_link(*link, row.plan(unit, bytes), choice);
  } else if (is_elsewhere(model)) {
    choice.fixed = Nanos::zero();
    for (const ServiceStage& stage : row.services.find(row.workload, unit)->stages) {
      const bool moves =
          stage.name == to_string(Phase::kUpload) || stage.name == to_string(Phase::kDownload);
      if (!moves) choice.fixed += stage.mean();
    }
    choice.radio_w = model.active_w;
    choice.fixed_j = row.services.find(row.workload, unit)->fixed_j();
  }
  return choice;
}

/// @return  Why there is none; empty if it was added.
std::string add_choice(const Row& row, OffloadChoices& result) {
  std::optional<OffloadChoice> choice;
  std::string why = "no cloud serves it";
  for (UnitId unit = 0; unit < row.platform.units.size(); ++unit) {
    if (!is_cloud(row.platform.units[unit])) continue;
    if (row.services.find(row.workload, unit) == nullptr) {
      why = "in the cloud " + row.services.entries[row.workload][unit].reason;
      continue;
    }
    OffloadChoice there = cloud_choice(row, unit);
    if (!choice || there.cloud.time < choice->cloud.time) choice = std::move(there);
  }
  if (!choice) return why;
  bool here = false;
  for (UnitId unit = 0; unit < row.platform.units.size(); ++unit) {
    if (is_cloud(row.platform.units[unit]) || row.services.find(row.workload, unit) == nullptr) {
      continue;
    }
    CallThere call = row.call(unit);
    if (call.energy_j && (!choice->frugal || *call.energy_j < *choice->frugal->energy_j)) {
      choice->frugal = call;
    }
    if (!here || call.time < choice->fastest.time) choice->fastest = std::move(call);
    here = true;
  }
  if (!here) return "nothing is known of it on a unit of the robot's";
  result.choices.push_back(*std::move(choice));
  return "";
}

std::optional<double> mbit_s(std::optional<double> seconds, std::int64_t bytes) {
  if (!seconds || *seconds <= 0) return std::nullopt;
  return static_cast<double>(bytes) * 8e-6 / *seconds;
}

std::string millis(double seconds) { return figure(1e3 * seconds); }

std::string joules(const CallThere& call) {
  return call.energy_j ? marked(millis(*call.energy_j), call.energy_from) : "-";
}

std::vector<std::string> row_of(const OffloadChoice& choice) {
  const Origin computed = sum_of(choice.fastest.time_from, choice.cloud.time_from);
  const auto from = [&](std::optional<double> bandwidth) {
    return bandwidth ? marked(figure(*bandwidth), weakest(computed, Provenance::kModelled))
                     : "none";
  };
  const auto frugal = choice.cloud_is_frugal();
  return {choice.workload,
          choice.fastest.unit,
          marked(figure_ms(choice.fastest.time), choice.fastest.time_from),
          marked(figure_ms(choice.cloud.time), choice.cloud.time_from),
          choice.cloud_worst ? marked(figure_ms(*choice.cloud_worst), choice.cloud.time_from) : "-",
          choice.cloud_is_faster() ? "cloud" : "local",
          from(choice.break_even_time()),
          choice.frugal ? choice.frugal->unit : "-",
          choice.frugal ? joules(*choice.frugal) : "-",
          joules(choice.cloud),
          frugal ? *frugal ? "cloud" : "local" : "-",
          choice.radio_w && frugal ? from(choice.break_even_energy()) : "-",
          figure(static_cast<double>(choice.bytes) * 1e-3)};
}

/// Table IV, as it is printed: of the TX1, its GPU is better than its CPU in both.
std::vector<std::string> printed_row() {
  const auto said = [](const std::string& text) { return marked(text, Provenance::kPublished); };
  const paper::Inference& gpu = paper::kTable4[1];
  const paper::Inference& cloud = paper::kTable4[2];
  return {"alexnet, the paper",
          "GPU (TX1)",
          said(millis(gpu.low_s)),
          said(fmt::format("{} to {}", millis(cloud.low_s), millis(cloud.high_s))),
          said(millis(cloud.high_s)),
          gpu.low_s < cloud.low_s ? "local" : "cloud",
          "-",
          "GPU (TX1)",
          said(millis(gpu.energy_j)),
          said(millis(cloud.energy_j)),
          gpu.energy_j < cloud.energy_j ? "local" : "cloud",
          "-",
          "-"};
}

Json json_of(const CallThere& call) {
  Json json = {{"unit", call.unit},
               {"ms", to_ms(call.time)},
               {"time_provenance", to_string(call.time_from)}};
  if (call.energy_j) {
    json["energy_j"] = *call.energy_j;
    json["energy_provenance"] = to_string(call.energy_from);
  }
  return json;
}

/// How the radio's joules were found.
std::string radio_model(const Platform& platform) {
  std::vector<std::string> said;
  for (const UnitModel& unit : platform.units) {
    if (!is_cloud(unit)) continue;
    const auto link = platform.links.find(unit.link);
    if (link != platform.links.end()) {
      said.push_back(fmt::format("{} W of link {} x bytes / {} Mbit/s", link->second.active_w,
                                 link->first, link->second.mbit_s));
    } else if (is_elsewhere(unit)) {
      said.push_back(
          fmt::format("active_w {} W of {} x upload and download", unit.active_w, unit.name));
    } else {
      said.push_back("what the platform states a call of " + unit.name);
    }
  }
  return "The robot's joules in the cloud are its radio's: " + join(said, ", ") +
         "; waiting costs nothing beyond idle power, which is drawn either way.";
}

}  // namespace

std::optional<bool> OffloadChoice::cloud_is_frugal() const {
  if (!frugal || !cloud.energy_j) return std::nullopt;
  return *cloud.energy_j < *frugal->energy_j;
}

std::optional<double> OffloadChoice::break_even_time() const {
  if (!radio_w) return std::nullopt;  // Its time follows from no bytes.
  return mbit_s(to_s(fastest.time - fixed), bytes);
}

std::optional<double> OffloadChoice::break_even_energy() const {
  if (!radio_w || *radio_w <= 0 || !frugal || !cloud.energy_j) return std::nullopt;
  return mbit_s((*frugal->energy_j - fixed_j) / *radio_w, bytes);
}

OffloadChoices offload_choices(const Profile& profile, const Platform& platform) {
  if (std::ranges::none_of(platform.units, is_cloud)) {
    throw_bad_input("platform " + platform.name +
                    " has no unit of role cloud, and `pirt report offload` compares with one; "
                    "characterize platform host-cloud, or give one with --platform");
  }
  std::vector<std::string> workloads = profile.workloads();
  std::erase_if(workloads, [](const std::string& each) { return !try_find_spec(each); });
  const ServiceTable services = resolve_services(platform, &profile, workloads, {});
  OffloadChoices result;
  for (WorkloadId workload = 0; workload < workloads.size(); ++workload) {
    const std::string why = add_choice({platform, profile, services, workload}, result);
    if (!why.empty()) result.left_out.push_back(workloads[workload] + ": " + why);
  }
  return result;
}

Table offload_table(const OffloadChoices& choices, const Platform& platform) {
  Table table{.title = "Local or cloud, a call (the paper's Table IV for every workload)",
              .columns = {{"workload", Align::kLeft},
                          {"fastest here", Align::kLeft},
                          {"ms"},
                          {"cloud ms"},
                          {"at worst ms"},
                          {"by time", Align::kLeft},
                          {"from Mbit/s"},
                          {"least here", Align::kLeft},
                          {"mJ"},
                          {"cloud mJ"},
                          {"by energy", Align::kLeft},
                          {"from Mbit/s"},
                          {"KB moved"}}};
  bool printed = false;
  for (const OffloadChoice& each : choices.choices) {
    table.rows.push_back(row_of(each));
    if (each.workload != paper::kInference) continue;
    table.rows.push_back(printed_row());
    printed = true;
  }
  if (!printed) table.rows.push_back(printed_row());
  table.footnotes = {
      "Medians, set-up excluded. At worst: p99 of what was measured, the upper end of what is "
      "modelled.",
      "from Mbit/s: where the cloud becomes better than the best unit here, with what its call "
      "takes besides moving inputs and outputs as it is; none: it never does.",
      radio_model(platform)};
  if (!platform.assumptions.empty()) {
    std::string assumed = platform.assumptions;
    std::ranges::replace(assumed, '\n', ' ');
    while (assumed.ends_with(' ')) assumed.pop_back();
    table.footnotes.push_back(assumed);
  }
  if (!choices.left_out.empty()) {
    table.footnotes.push_back("Left out: " + join(choices.left_out, "; ") + ".");
  }
  table.footnotes.emplace_back(provenance_legend());
  return table;
}

Json offload_json(const OffloadChoices& choices) {
  Json rows = Json::array();
  for (const OffloadChoice& each : choices.choices) {
    Json row = {{"workload", each.workload},
                {"fastest", json_of(each.fastest)},
                {"cloud", json_of(each.cloud)},
                {"bytes", each.bytes},
                {"by_time", each.cloud_is_faster() ? "cloud" : "local"}};
    if (each.frugal) row["frugal"] = json_of(*each.frugal);
    if (each.cloud_worst) row["cloud"]["worst_ms"] = to_ms(*each.cloud_worst);
    if (const auto frugal = each.cloud_is_frugal()) row["by_energy"] = *frugal ? "cloud" : "local";
    if (const auto from = each.break_even_time()) row["break_even_time_mbit_s"] = *from;
    if (const auto from = each.break_even_energy()) row["break_even_energy_mbit_s"] = *from;
    rows.push_back(std::move(row));
  }
  return {{"offload", std::move(rows)}, {"left_out", choices.left_out}};
}

}  // namespace pirt
