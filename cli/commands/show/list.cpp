// pirt list: what this build and this machine have.
#include <fmt/core.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <map>
#include <memory>

#include "characterize/energy/meter.h"
#include "characterize/platform/platform.h"
#include "characterize/worker/job_runner.h"
#include "cli/commands.h"
#include "cli/options/files.h"
#include "cli/options/output.h"
#include "cli/options/own.h"
#include "cli/options/shipped.h"
#include "cli/options/sysfs.h"
#include "cli/options/values.h"
#include "reports/document/document.h"
#include "scheduler/mix/mix.h"
#include "scheduler/policies/policy.h"
#include "workloads/backends/backend_list.h"
#include "workloads/backends/registry.h"
#include "workloads/base/error.h"
#include "workloads/base/text/json.h"
#include "workloads/base/text/text.h"
#include "workloads/catalog/catalog.h"
#include "workloads/catalog/own_list.h"
#include "workloads/model/device_choice.h"

namespace pirt::cli {
namespace {

struct ListFlags {
  std::string what;
  std::optional<std::string> platform;  ///< Of units; absent = host.
  OwnFiles own;                         ///< Of workloads.
  Output json;
};

/// One listing in both forms.
struct Listing {
  Document document;
  Json json;
};

std::string count(std::optional<std::int64_t> value) {
  return value ? fmt::format("{}", *value) : "-";
}

std::string shapes(const std::vector<TensorSpec>& specs) {
  std::vector<std::string> parts;
  for (const auto& spec : specs) parts.push_back(spec.describe());
  return parts.empty() ? "-" : join(parts, ", ");
}

/// Of a list the first extent is what it can hold: `capacity`.
Json tensors(const std::vector<TensorSpec>& specs) {
  auto rows = Json::array();
  for (const auto& spec : specs) {
    Json row = {{"name", spec.name}, {"element", to_string(spec.element)}, {"shape", spec.shape}};
    if (spec.varies) row["capacity"] = spec.shape.front();
    rows.push_back(std::move(row));
  }
  return rows;
}

/// A chain of layers has many.
std::string parameters_text(const std::vector<TensorSpec>& specs) {
  constexpr std::size_t kShown = 2;
  return specs.size() <= kShown ? shapes(specs) : fmt::format("{} tensors", specs.size());
}

std::string state_text(const Workload& workload) {
  if (!workload.state) return "-";
  return workload.state->name + ": " + shapes(workload.state->tensors);
}

Listing list_workloads() {
  Table table{
      .title = "Workloads",
      .columns = {{"workload", Align::kLeft},
                  {"operations"},
                  {"bytes"},
                  {"kernel", Align::kLeft},
                  {"description", Align::kLeft}},
      .footnotes = {"Operations a call: 2 a multiply-add, bias and activation excluded; - where "
                    "they depend on the data."}};
  Table ports{.title = "Tensors",
              .columns = {{"workload", Align::kLeft},
                          {"inputs", Align::kLeft},
                          {"parameters", Align::kLeft},
                          {"outputs", Align::kLeft},
                          {"state", Align::kLeft}},
              .footnotes = {"<=500: a list, whose length varies from call to call."}};
  Json rows = Json::array();
  std::vector<const Workload*> all;
  for (const Workload& workload : catalog()) all.push_back(&workload);
  const auto own = own_workloads();
  all.insert(all.end(), own.begin(), own.end());
  for (const Workload* each : all) {
    const Workload& workload = *each;
    ports.rows.push_back({workload.name, shapes(workload.inputs),
                          parameters_text(workload.parameters), shapes(workload.outputs),
                          state_text(workload)});
    table.rows.push_back({workload.name, count(workload.ops), count(workload.bytes()),
                          workload.kernel, workload.description});
    Json row = {{"name", workload.name},
                {"description", workload.description},
                {"kernel", workload.kernel},
                {"tags", workload.tags},
                {"bytes", workload.bytes()},
                {"inputs", tensors(workload.inputs)},
                {"parameters", tensors(workload.parameters)},
                {"outputs", tensors(workload.outputs)},
                {"frames", workload.frames}};
    if (workload.state) {
      row["state"] = {{"name", workload.state->name},
                      {"tensors", tensors(workload.state->tensors)}};
    }
    if (workload.ops) row["ops"] = *workload.ops;
    if (workload.at_size) row["sized"] = true;
    rows.push_back(std::move(row));
  }
  table.footnotes.push_back(fmt::format(
      "Batches @batch{} to @batch{}, of AlexNet's workloads: so many images a call, the weights "
      "read once",
      kSmallestBatch, kLargestBatch));
  std::vector<std::string> sized;
  for (const Workload* each : all) {
    if (each->at_size) sized.push_back(each->name);
  }
  table.footnotes.push_back("Sizes @WIDTHxHEIGHT, as in sobel@1280x720, of " + join(sized, ", "));
  Json others = Json::array();
  for (const Variant& variant : variants()) {
    const auto workloads = workloads_in_variant(variant.name);
    table.footnotes.push_back(fmt::format("Variant @{}, of {} workloads: {}", variant.name,
                                          workloads.size(), variant.description));
    Json names = Json::array();
    for (const Workload* workload : workloads) names.push_back(workload->name);
    others.push_back({{"name", variant.name},
                      {"description", variant.description},
                      {"workloads", std::move(names)}});
  }
  return {{.title = "pirt workloads", .parts = {table, ports}},
          {{"workloads", rows}, {"variants", others}}};
}

/// Workloads that a backend has no kernels for, and why.
struct Unsupported {
  std::vector<std::string> workloads;
  std::string reason;
};

/// Those with the same reason together, in the catalog's order of the first of each.
std::vector<Unsupported> unsupported(const Backend& backend) {
  std::vector<Unsupported> all;
  for (const auto& workload : catalog()) {
    const auto support = backend.supports(workload);
    if (support.ok) continue;
    auto same = std::ranges::find(all, support.reason, &Unsupported::reason);
    if (same == all.end())
      same = all.insert(all.end(), {.workloads = {}, .reason = support.reason});
    same->workloads.push_back(workload.name);
  }
  return all;
}

/// One that cannot even be asked is not there; the others are listed all the same.
const Probe& probe_of(const Backend& backend) {
  static std::map<std::string_view, Probe> known;
  const auto [at, is_new] = known.try_emplace(backend.name());
  if (!is_new) return at->second;
  try {
    return at->second = probe_backend("/proc/self/exe", backend);
  } catch (const Error& error) {
    return at->second = {.available = false, .reason = error.what(), .devices = {}};
  }
}

Listing list_backends() {
  Table table{.title = "Backends",
              .columns = {{"backend", Align::kLeft},
                          {"available", Align::kLeft},
                          {"workloads"},
                          {"phases", Align::kLeft},
                          {"description", Align::kLeft}}};
  Json rows = Json::array();
  for (const auto& backend : backends()) {
    const Probe& probe = probe_of(*backend);
    const auto missing = unsupported(*backend);
    std::vector<std::string> phases;
    for (const Phase phase : backend->phases()) phases.emplace_back(to_string(phase));
    std::vector<std::string> devices;
    std::vector<std::string> shown;
    const bool several = probe.devices.size() > 1;  // of which a platform file chooses one
    for (std::size_t i = 0; i < probe.devices.size(); ++i) {
      devices.push_back(probe.devices[i].name);
      shown.push_back(several ? numbered(probe.devices, i) : devices.back());
    }
    std::size_t supported = catalog().size();
    Json reasons = Json::array();
    for (const Unsupported& group : missing) {
      supported -= group.workloads.size();
      for (const std::string& name : group.workloads) reasons.push_back(name + ": " + group.reason);
    }
    table.rows.push_back({std::string(backend->name()), probe.available ? "yes" : "no",
                          fmt::format("{} of {}", supported, catalog().size()), join(phases, " "),
                          std::string(backend->description())});
    if (!probe.available) {
      table.footnotes.push_back(fmt::format("{}: {}", backend->name(), probe.reason));
    } else if (!devices.empty()) {
      table.footnotes.push_back(fmt::format("{}: {}", backend->name(), join(shown, "; ")));
    }
    Json options = Json::array();
    for (const OptionSpec& option : options_of(backend->name())) {
      table.footnotes.push_back(fmt::format("{} has option {} (default {}{}{}, {} to {}): {}",
                                            backend->name(), option.name, option.standard,
                                            option.unit.empty() ? "" : " ", option.unit, option.low,
                                            option.high, option.description));
      options.push_back({{"name", option.name},
                         {"unit", option.unit},
                         {"description", option.description},
                         {"low", option.low},
                         {"high", option.high},
                         {"default", option.standard}});
    }
    for (const Unsupported& group : missing) {
      if (!probe.available && group.reason.ends_with(probe.reason)) continue;  // said already
      table.footnotes.push_back(fmt::format("{} does not support {}: {}", backend->name(),
                                            join(group.workloads, ", "), group.reason));
    }
    Json row = {{"name", backend->name()},
                {"description", backend->description()},
                {"available", probe.available},
                {"phases", phases},
                {"devices", devices},
                {"unsupported", reasons},
                {"options", options}};
    if (!probe.available) row["reason"] = probe.reason;
    rows.push_back(std::move(row));
  }
  return {{.title = "pirt backends", .parts = {table}}, {{"backends", rows}}};
}

std::string core_list(const std::vector<int>& cores) {
  return cores.empty() ? "-" : fmt::format("{}", fmt::join(cores, ","));
}

/// The device that a unit of the platform would compute on, or why it cannot; the unit's watts
/// become that device's.
std::string unit_status(UnitModel& unit, bool& available) {
  available = true;
  if (!unit.measured()) return "modelled by the platform file";
  const Probe& probe = probe_of(find_backend(unit.backend));
  available = probe.available;
  if (!probe.available) return "unavailable: " + probe.reason;
  if (probe.devices.empty()) return std::string(find_backend(unit.backend).description());
  try {
    const DeviceInfo& device = probe.devices[choose_device(probe.devices, unit.device).index];
    unit = on_device(std::move(unit), device.is_cpu);
    return device.name +
           (device.is_cpu && unit.role != Role::kCpu ? " (computes on the host's cores)" : "");
  } catch (const Error& error) {
    available = false;
    return std::string("unavailable: ") + error.what();
  }
}

Listing list_units(const std::string& platform_name) {
  const auto platform = load_platform(platform_name);
  Table table{.title = "Units of platform " + platform.name,
              .columns = {{"unit", Align::kLeft},
                          {"role", Align::kLeft},
                          {"backend", Align::kLeft},
                          {"cores", Align::kLeft},
                          {"servers"},
                          {"active W"},
                          {"idle W"},
                          {"device", Align::kLeft}}};
  if (!platform.assumptions.empty()) table.footnotes.push_back(platform.assumptions);
  Json rows = Json::array();
  for (UnitModel unit : platform.units) {
    bool available = true;
    const auto status = unit_status(unit, available);
    const bool known = !unit.measured() || platform.states_power(unit);
    const auto watts = [known](double power_w) { return known ? fmt::format("{}", power_w) : "-"; };
    table.rows.push_back(
        {unit.name, std::string(to_string(unit.role)), unit.measured() ? unit.backend : "-",
         core_list(unit.cores) + (unit.shares_cores ? " (shared)" : ""),
         fmt::format("{}", unit.servers), watts(unit.active_w), watts(unit.idle_w), status});
    rows.push_back({{"name", unit.name},
                    {"role", to_string(unit.role)},
                    {"backend", unit.backend},
                    {"cores", unit.cores},
                    {"servers", unit.servers},
                    {"active_w", known ? Json(unit.active_w) : Json()},
                    {"idle_w", known ? Json(unit.idle_w) : Json()},
                    {"available", available},
                    {"device", status}});
  }
  return {{.title = "pirt units", .parts = {table}},
          {{"platform", platform.name}, {"units", rows}}};
}

Listing list_meters() {
  const auto found = discover_meters(sysfs_root());
  Table table{.title = "Energy meters of this machine",
              .columns = {{"meter", Align::kLeft},
                          {"covers", Align::kLeft},
                          {"driver", Align::kLeft},
                          {"reads", Align::kLeft},
                          {"part of", Align::kLeft},
                          {"status", Align::kLeft}}};
  auto rows = Json::array();
  for (const auto& meter : found.meters) {
    const MeterInfo& info = meter->info();
    const bool counts = info.kind == MeterKind::kCounter;
    table.rows.push_back({info.name, info.covers, info.driver, counts ? "energy" : "power",
                          info.under.empty() ? "-" : info.under,
                          info.problem.empty() ? "readable" : "not readable (below)"});
    if (!info.problem.empty()) table.footnotes.push_back(info.name + ": " + info.problem);
    Json row = {{"name", info.name},     {"covers", info.covers},
                {"driver", info.driver}, {"reads", counts ? "energy" : "power"},
                {"path", info.path},     {"readable", info.problem.empty()}};
    if (!info.under.empty()) row["part_of"] = info.under;
    if (!info.problem.empty()) row["reason"] = info.problem;
    rows.push_back(std::move(row));
  }
  for (const auto& missing : found.missing)
    table.footnotes.push_back("Not there or not known: " + missing);
  return {{.title = "pirt meters", .parts = {table}},
          {{"meters", rows}, {"missing", found.missing}}};
}

Listing list_named(const std::string& what, const std::vector<std::string>& names,
                   const std::function<std::string(const std::string&)>& describe) {
  Table table{.title = what, .columns = {{"name", Align::kLeft}, {"description", Align::kLeft}}};
  Json rows = Json::array();
  for (const auto& name : names) {
    const auto description = describe(name);
    table.rows.push_back({name, description});
    rows.push_back({{"name", name}, {"description", description}});
  }
  return {{.title = "pirt " + what, .parts = {table}}, {{what, rows}}};
}

/// Those that need a device which is not here say so, and those of which no unit is here.
Listing list_platforms() {
  Table table{
      .title = "platforms",
      .columns = {
          {"name", Align::kLeft}, {"available", Align::kLeft}, {"description", Align::kLeft}}};
  Json rows = Json::array();
  for (const std::string& name : shipped_platforms()) {
    const Platform platform = load_platform(name);
    std::string reason;
    bool some = false, needed = false;
    for (UnitModel unit : platform.units) {
      if (!unit.measured()) continue;
      bool available = true;
      const std::string status = unit_status(unit, available);
      some |= available;
      if (available || (unit.device.empty() && !reason.empty())) continue;
      needed |= !unit.device.empty();
      reason = fmt::format("{}: {}", unit.name, status);
    }
    if (some && !needed) reason.clear();
    table.rows.push_back({name, reason.empty() ? "yes" : "no", platform.description});
    Json row = {
        {"name", name}, {"description", platform.description}, {"available", reason.empty()}};
    if (!reason.empty()) {
      table.footnotes.push_back(fmt::format("{}, {}", name, reason));
      row["reason"] = reason;
    }
    rows.push_back(std::move(row));
  }
  return {{.title = "pirt platforms", .parts = {table}}, {{"platforms", rows}}};
}

Listing list_modes() {
  std::vector<std::string> names;
  for (const auto& policy : policies()) names.emplace_back(policy.name);
  return list_named("modes", names, [](const std::string& name) {
    return std::string(find_policy(name).description);
  });
}

std::vector<std::string> what_is_listed() {
  return {"workloads", "backends", "units", "platforms", "mixes", "modes", "meters"};
}

Listing list(const ListFlags& options) {
  if (options.platform && options.what != "units") {
    throw_bad_input("--platform says whose units are listed, and " + options.what +
                    " are none; leave it out");
  }
  if (!options.own.files.empty() && options.what != "workloads") {
    throw_bad_input("--workloads brings workloads, and " + options.what +
                    " are none; leave it out");
  }
  learn(options.own.all());
  if (options.what == "workloads") return list_workloads();
  if (options.what == "backends") return list_backends();
  if (options.what == "units") return list_units(options.platform.value_or("host"));
  if (options.what == "modes") return list_modes();
  if (options.what == "meters") return list_meters();
  if (options.what == "platforms") return list_platforms();
  if (options.what == "mixes") {
    return list_named("mixes", shipped_mixes(),
                      [](const std::string& name) { return load_mix(name).description; });
  }
  throw_bad_input("cannot list '" + options.what + "'" +
                  suggestion(options.what, what_is_listed()));
}

}  // namespace

void add_list(CLI::App& app, Action& action) {
  auto options = std::make_shared<ListFlags>();
  Command command(app, "list",
                  "Show the workloads, backends, units, platforms, mixes, modes or energy meters");
  add_text(command, "what", &options->what, "WHAT", join(what_is_listed(), " | "))
      .offers(what_is_listed())
      .required();
  add_input(command, "--platform", &options->platform,
            "Platform whose units are listed (default: host)", FileUse::kReadIfFile)
      .offers(offer_platforms());
  add_workloads(command, options->own);
  add_json(command, options->json);
  command.footer("Example: pirt list workloads");
  command.runs(action, [options] {
    auto listing = list(*options);
    listing.json["schema_version"] = 1;
    emit(render(listing.document, Format::kText), listing.json, options->json);
    return 0;
  });
}

}  // namespace pirt::cli
